//! Figures 4, 6 and 8: which pixels share a group.

use std::sync::{Arc, OnceLock};

use krylux::analysis::segment::{evidence, feature_view, segment};
use krylux::analysis::separate::SeparateBy;
use krylux::analysis::{
    Blurred, Coordinates, MASKED, SegmentOptions, Segmentation, WithoutDirect, adjusted_rand_index,
};
use krylux::finding::{Finding, Grade};
use krylux::image::{Blur, Resolution};
use krylux::lab::Lab;
use krylux::scene::{Scene, builtin};
use krylux::transport::{Assembled, MatrixOperator, Part};
use krylux::verbs::Segment;

use crate::common::load;

/// Light paths per pixel.
const SAMPLES: u32 = 256;

/// A scene traced, with its author's regions.
struct Traced {
    traced: Arc<Assembled>,
    truth: Vec<u8>,
}

/// The two folds at this size, traced once for all tests.
fn folds(side: usize) -> &'static Traced {
    static FOLDS: [OnceLock<Traced>; 2] = [const { OnceLock::new() }; 2];
    let cell = match side {
        48 => &FOLDS[0],
        64 => &FOLDS[1],
        _ => unreachable!("the figures have one of these sizes"),
    };
    cell.get_or_init(|| Traced::new(load("zigzag"), side))
}

impl Traced {
    fn new(scene: Scene, side: usize) -> Self {
        let mut lab = Lab::builder_of_scene(scene).size(side, side).samples(SAMPLES).open().unwrap();
        Self { truth: lab.labels().unwrap(), traced: lab.assembled().unwrap().unwrap() }
    }

    fn part(&self, part: Part) -> MatrixOperator<'_> {
        MatrixOperator::new(&self.traced.matrix, part, 0)
    }

    fn segmentation(&self, photos: usize, eigenvectors: usize, groups: &[usize]) -> Segmentation {
        let options =
            SegmentOptions { photos, eigenvectors, groups: groups.into(), ..SegmentOptions::default() };
        segment(&mut self.part(Part::Global), &options).unwrap()
    }

    fn agreement(&self, labels: &[u8]) -> f64 {
        adjusted_rand_index(labels, &self.truth).unwrap()
    }
}

fn labels(found: &Segmentation, groups: usize) -> &[u8] {
    &found.labels.iter().find(|(of, _)| *of == groups).unwrap().1
}

/// The share of pixels that are in their group's most frequent region.
fn purity(labels: &[u8], truth: &[u8]) -> f64 {
    let pairs = || labels.iter().zip(truth).filter(|(label, _)| **label != MASKED);
    let best = |group: u8| {
        let count = |region: u8| pairs().filter(|pair| *pair == (&group, &region)).count();
        (0..=MASKED).map(count).max().unwrap()
    };
    (0..MASKED).map(best).sum::<usize>() as f64 / pairs().count() as f64
}

/// How much of what there is to know about a pixel's group its row tells, within the regions, and how much its column tells: mutual
/// information over entropy. Cuts across a region are told by the row.
fn told_by_row_and_column(labels: &[u8], truth: &[u8], side: usize) -> [f64; 2] {
    let entropy = |of: &[u8]| -> f64 {
        let share = |label: u8| of.iter().filter(|&&other| other == label).count() as f64 / of.len() as f64;
        (0..MASKED).map(share).filter(|share| *share > 0.0).map(|share| -share * share.ln()).sum()
    };
    let within = |wanted: &dyn Fn(usize) -> bool| -> Vec<u8> {
        (0..labels.len()).filter(|&at| labels[at] != MASKED && wanted(at)).map(|at| labels[at]).collect()
    };
    let lines: [&dyn Fn(usize) -> usize; 2] = [&|at| at / side, &|at| at % side];
    lines.map(|line| {
        let (mut all, mut left) = (0.0, 0.0);
        for region in 0..=1 {
            let of_region = within(&|at| truth[at] == region);
            all += of_region.len() as f64 * entropy(&of_region);
            for index in 0..side {
                let of_line = within(&|at| truth[at] == region && line(at) == index);
                left += of_line.len() as f64 * entropy(&of_line);
            }
        }
        1.0 - left / all
    })
}

#[test]
fn figure_4_two_folds_are_told_apart_by_few_photos_and_then_cut_across() {
    let folds = folds(64);
    let found = folds.segmentation(50, 10, &[2, 6, 10]);
    let two = purity(labels(&found, 2), &folds.truth);
    let fewest = (4..=50).find(|&photos| {
        let found = folds.segmentation(photos, 10, &[2]);
        purity(labels(&found, 2), &folds.truth) >= 0.99
    });
    let told = [6, 10].map(|groups| told_by_row_and_column(labels(&found, groups), &folds.truth, 64));
    let pure = [6, 10].map(|groups| purity(labels(&found, groups), &folds.truth));
    println!(
        "fig4: purity {two:.4} at 50 photos, fewest {fewest:?}; told by row and column {told:.3?}, purity {pure:.4?}"
    );
    println!("fig4: {}", found.regions.sentence());
    assert!(two >= 0.99, "{two}");
    assert!(fewest.is_some_and(|photos| photos <= 12), "{fewest:?}");
    // More groups part the folds across, and never join them: a group of both folds would have half of its pixels in each.
    assert!(pure.iter().all(|pure| *pure >= 0.99), "{pure:?}");
    assert!(told.iter().all(|[row, column]| *row > 0.5 && *row > 2.0 * column), "{told:?}");
    assert_eq!((found.regions.count, found.regions.clear), (2, true), "{:?}", found.regions);
}

/// The cut's value, and that of as many straight bands of equally many rows.
fn cut_and_straight_cut(scene: &Traced, labels: &[u8], groups: usize, side: usize) -> [f64; 2] {
    let bands = groups / 2;
    let straight: Vec<u8> = (0..side * side)
        .map(|at| match (labels[at], scene.truth[at]) {
            (MASKED, _) | (_, MASKED) => MASKED,
            (_, region) => region * bands as u8 + (at / side * bands / side) as u8,
        })
        .collect();
    [labels, &straight].map(|labels| evidence(&mut scene.part(Part::Global), labels).unwrap().cut())
}

#[test]
fn bent_sheets_are_cut_into_horizontal_bands_and_sharp_folds_at_their_creases_which_is_cheaper() {
    let side = 64;
    let bent = Traced::new(load("two-sheets"), side);
    let found = bent.segmentation(50, 10, &[6, 10]);
    for groups in [6, 10] {
        let labels = labels(&found, groups);
        let [row, column] = told_by_row_and_column(labels, &bent.truth, side);
        let [cut, straight] = cut_and_straight_cut(&bent, labels, groups, side);
        println!(
            "fig4: bent sheets, {groups} groups told by row {row:.3} and column {column:.3}; cut {cut:.3}, of straight bands {straight:.3}"
        );
        assert!(row > 0.8 && column < 0.1, "{row} {column}");
        assert!(cut <= straight, "{cut} {straight}");
    }
    // The zigzag's halves have eigenvalues above the continuous part of an infinite fold's spectrum, 0.79, and finer bands have none.
    let folds = folds(side);
    let found = folds.segmentation(50, 10, &[4, 10]);
    let [row, column] = told_by_row_and_column(labels(&found, 4), &folds.truth, side);
    let [cut, straight] = cut_and_straight_cut(folds, labels(&found, 10), 10, side);
    println!(
        "fig4: folds, 4 groups told by row {row:.3} and column {column:.3}; cut of 10 {cut:.3}, of straight bands {straight:.3}"
    );
    println!("fig4: folds, eigenvalues {:.4?}", found.eigenvalues);
    assert!(row > 0.8 && column < 0.1, "{row} {column}");
    assert!(cut < 0.9 * straight, "{cut} {straight}");
    assert!(found.eigenvalues[3] > 0.79 && found.eigenvalues[4] < 0.79, "{:?}", found.eigenvalues);
}

#[test]
fn pixels_of_one_fold_have_close_features_and_those_of_the_other_distant_ones() {
    let folds = folds(48);
    let found = folds.segmentation(30, 10, &[2]);
    // Two pixels of the left fold, near the top, on either side of its valley; and the mirror image of the first.
    let view = feature_view(&found, Resolution::new(48, 48), &[(6, 10), (18, 10), (41, 10)]).unwrap();
    let [same, other] = [view.distances[0][1], view.distances[0][2]];
    println!("fig5: distance in one fold {same:.3}, to the other {other:.3}");
    assert!(other > 3.0 * same, "{same} {other}");
    assert!(feature_view(&found, Resolution::new(48, 48), &[(48, 0)]).is_err());
}

#[test]
fn figure_6_patches_of_a_sheet_behind_another_share_a_group() {
    let sheets = Traced::new(builtin::sheet_behind_sheet().to_scene(), 64);
    let found = sheets.segmentation(50, 10, &[2]);
    let two = labels(&found, 2);
    // The visible parts of the rear sheet, at the left and right of the front sheet.
    let patch = |is_left: bool| -> Vec<u8> {
        let seen = |&pixel: &usize| sheets.truth[pixel] == 1 && (pixel % 64 < 32) == is_left;
        (0..64 * 64).filter(seen).map(|pixel| two[pixel]).collect()
    };
    let ones = |patch: &[u8]| patch.iter().filter(|&&label| label == 1).count() as f64 / patch.len() as f64;
    let [left, right] = [patch(true), patch(false)];
    let front: Vec<u8> =
        (0..64 * 64).filter(|&pixel| sheets.truth[pixel] == 0).map(|pixel| two[pixel]).collect();
    let shares = [ones(&left), ones(&right), ones(&front)];
    println!("fig6: shares in group 2 {shares:.4?}; {}", found.regions.sentence());
    assert!(left.len() > 800 && right.len() > 800, "{} {}", left.len(), right.len());
    assert!((shares[0] - shares[1]).abs() < 0.01, "both patches are in one group: {shares:?}");
    assert!((shares[0] - shares[2]).abs() > 0.98, "and the front sheet in the other: {shares:?}");
}

#[test]
fn plain_coordinates_are_the_entries_of_the_eigenvectors_with_equal_weights() {
    let folds = folds(48);
    let asked = |coordinates| SegmentOptions {
        photos: 20,
        groups: vec![2],
        coordinates,
        ..SegmentOptions::default()
    };
    let found = segment(&mut folds.part(Part::Global), &asked(Coordinates::Plain)).unwrap();
    let scaled = segment(&mut folds.part(Part::Global), &asked(Coordinates::Commute)).unwrap();
    assert_eq!(found.eigenvectors, scaled.eigenvectors);
    for pixel in (0..48 * 48).filter(|&pixel| !found.mask[pixel]) {
        let entries: Vec<f64> = found.eigenvectors[1..].iter().map(|vector| vector[pixel]).collect();
        assert_eq!(found.feature(pixel), entries);
        assert_eq!(found.weights[pixel], 1.0);
    }
    // Dim pixels weigh as much as bright ones here, so that more of those at the rims are in the other group.
    let agreement = folds.agreement(labels(&found, 2));
    assert!((0.9..folds.agreement(labels(&scaled, 2))).contains(&agreement), "{agreement}");
    assert!(found.findings().iter().all(|finding| finding.grade == Grade::Ok), "{:?}", found.findings());
    // A single pixel is no region, however bright it is.
    let mut single = found;
    single
        .degree
        .iter_mut()
        .enumerate()
        .for_each(|(pixel, degree)| *degree = if pixel == 0 { 1e3 } else { 1.0 });
    let of_two = single.labels.iter_mut().find(|(groups, _)| *groups == 2).map(|(_, labels)| labels).unwrap();
    of_two.iter_mut().enumerate().for_each(|(pixel, label)| *label = u8::from(pixel == 0));
    let graded = |found: &Finding| (found.name == "smallest group").then_some(found.grade);
    assert_eq!(single.findings().iter().find_map(graded), Some(Grade::Fails));
}

#[test]
fn plain_groups_of_a_few_pixels_are_not_passed_off_as_regions() {
    let carton = Traced::new(builtin::nine_cells(false).to_scene(), 64);
    let asked = |coordinates| SegmentOptions {
        photos: 50,
        eigenvectors: 20,
        groups: vec![9],
        coordinates,
        ..SegmentOptions::default()
    };
    for (coordinates, grade) in [(Coordinates::Plain, Grade::Fails), (Coordinates::Commute, Grade::Ok)] {
        let found = segment(&mut carton.part(Part::Global), &asked(coordinates)).unwrap();
        let agreement = carton.agreement(labels(&found, 9));
        println!("{coordinates:?}: adjusted Rand index {agreement:.4}");
        assert_eq!(
            found.findings().iter().map(|finding| finding.grade).max(),
            Some(grade),
            "{:?}",
            found.findings()
        );
        assert_eq!(agreement > 0.9, grade == Grade::Ok, "{agreement}");
    }
}

#[test]
fn figure_8_cells_of_a_carton_are_groups_and_eggs_change_them() {
    let empty = Traced::new(builtin::nine_cells(false).to_scene(), 64);
    let found = empty.segmentation(100, 20, &[9]);
    let nine = labels(&found, 9);
    let agreement = empty.agreement(nine);
    let lit = evidence(&mut empty.part(Part::Global), nine).unwrap();
    println!(
        "fig8: without eggs adjusted Rand index {agreement:.4}; cut {:.4}; {}",
        lit.cut(),
        found.regions.sentence()
    );
    assert!(agreement >= 0.95, "{agreement}");
    assert_eq!(found.regions.count, 9, "{:?}", found.regions);
    assert_eq!((lit.groups, lit.photos.len()), (9, 9));
    // The light that stays in a cell: pixels on the rims see two cells.
    assert!(lit.kept().iter().all(|kept| *kept > 0.97), "{:?}", lit.kept());
    assert!(lit.exchange[0].iter().skip(1).all(|share| *share < 0.02), "{:?}", lit.exchange[0]);

    let eggs = Traced::new(builtin::nine_cells(true).to_scene(), 64);
    let with_eggs = eggs.segmentation(100, 20, &[9]);
    let cells = eggs.agreement(labels(&with_eggs, 9));
    let change = adjusted_rand_index(nine, labels(&with_eggs, 9)).unwrap();
    println!(
        "fig8: with eggs {cells:.4} against the cells, {change:.4} against the groups before; {}",
        with_eggs.regions.sentence()
    );
    // An egg's upper half sees the other eggs and the rims in place of its own cell: the groups differ.
    assert!(change < 0.7 && cells < 0.7, "{change} {cells}");
}

#[test]
fn direct_light_may_be_measured_in_place_of_being_known_and_both_sides_be_blurred() {
    let folds = folds(48);
    let resolution = Resolution::new(48, 48);
    let mut white = vec![0.0; 48 * 48];
    krylux::operator::Operator::apply(&mut folds.part(Part::Direct), &vec![1.0; 48 * 48], &mut white)
        .unwrap();
    let options = SegmentOptions { photos: 20, groups: vec![2], ..SegmentOptions::default() };
    let methods =
        [(SeparateBy::Checkerboards { square: 4, shifts: 4 }, 16), (SeparateBy::Random { photos: 16 }, 17)];
    for (method, photos) in methods {
        let direct = method.measure(&mut folds.part(Part::Full), resolution, 3).unwrap();
        assert_eq!(direct.photos, photos, "{method:?}");
        let missed: f64 = direct.direct.iter().zip(&white).map(|(a, b)| (a - b).powi(2)).sum();
        let relative = (missed / white.iter().map(|d| d * d).sum::<f64>()).sqrt();
        let mut full = folds.part(Part::Full);
        let mut global = WithoutDirect::new(&mut full, &direct.direct).unwrap();
        let sharp = folds.agreement(labels(&segment(&mut global, &options).unwrap(), 2));
        let mut blurred = Blurred::new(&mut global, Blur::new(resolution, 1.0).unwrap()).unwrap();
        let soft = folds.agreement(labels(&segment(&mut blurred, &options).unwrap(), 2));
        println!(
            "direct by {method:?}: off by {relative:.4}; adjusted Rand index {sharp:.4}, blurred {soft:.4}"
        );
        // Some of the indirect light returns to its own pixel or nearly so, and counts as direct.
        assert!(relative < 0.15, "{method:?}: {relative}");
        assert!(sharp >= 0.97 && soft >= 0.97, "{method:?}: {sharp} {soft}");
    }
}

#[test]
fn the_regions_of_cartons_are_counted_and_grouped_without_being_told_their_number() {
    // Another size and seed than those by which the number of starting patterns was chosen.
    for (scene, regions) in [("carton", 12), ("nine-cells", 9), ("zigzag", 2)] {
        let mut lab = Lab::builder_of_scene(load(scene)).size(96, 96).samples(128).seed(5).open().unwrap();
        let found = lab.ask(&Segment::default()).unwrap().segmentation;
        let truth = lab.truth().unwrap().unwrap();
        let (groups, score) = truth.scores(&found).unwrap()[0];
        println!("{scene}: {}; {groups} groups, adjusted Rand index {score:.4}", found.regions.sentence());
        assert_eq!((found.photos, found.regions.count, groups), (50, regions, regions), "{scene}");
        assert!(!found.regions.at_least && score >= 0.97, "{scene}: {score}");
    }
}
