//! Figures 6, 8 and 9: a sheet behind another one, an egg carton, and the photos of its segmentation.
//!
//! In figure 6, two regions exchange no light, though one hides part of the other from the camera. The patches of the rear sheet do not
//! touch in the photo, and are one group. They exchange light behind the front sheet, and by reflection from its back side.
//!
//! Figure 8 shows ten groups of a carton with eggs. Section 8.2 also divides the empty one, blurs patterns and photos, and takes 50 photos;
//! the caption has one hundred, and twenty eigenvectors. Here: 50 photos and twenty eigenvectors, from one starting pattern.

use super::bench::{Bench, Set, Stage};
use super::check::Check;
use super::figure::{Figure, Panel, Plot, Reproduced, Strip, counted};
use super::groups::{asked, bands, components, labels, panels, purity, random_labels};
use super::vectors::{largest_outside, product};
use crate::analysis::segment::{evidence, segment};
use crate::analysis::{
    Blurred, Capture, Coordinates, MASKED, SegmentOptions, Segmentation, adjusted_rand_index,
};
use crate::error::{Error, Result};
use crate::image::Blur;
use crate::krylov::Start;
use crate::operator::{Operator, Product, Recorded};
use crate::transport::Part;

const SHEET_GROUPS: [usize; 3] = [2, 6, 10];
const PURE: f64 = 0.99;
/// The smallest size of a patch, as a fraction of the photo.
const PATCH: f64 = 0.01;
const REAR_SHEET: u8 = 1;

pub(super) fn fig6(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::SheetBehindSheet, side)?;
    let options = asked(PHOTOS, &SHEET_GROUPS, stage.resolution);
    let found = segment(&mut bench.photos(&stage, Part::Global)?, &options)?;
    let two = &found.labels[0].1;
    let random = random_labels(&stage.truth, 2);
    let shares = patch_shares(two, &stage);
    let of_random = patch_shares(&random, &stage);
    let lined = bench.stage(Set::LinedSheet, side)?;
    let mut exchanged = |of: &Stage| -> Result<f64> {
        let light = product(&mut bench.truth(of, Part::Global)?, &vec![1.0; of.pixels()])?;
        Ok(light
            .iter()
            .zip(&of.truth)
            .filter(|(_, region)| **region == REAR_SHEET)
            .map(|(light, _)| light)
            .sum())
    };
    let [by_all, without_back] = [exchanged(&stage)?, exchanged(&lined)?];
    let large = |labels: &[u8], group: u8| {
        let least = (PATCH * stage.pixels() as f64) as usize;
        components(labels, group, stage.resolution).iter().filter(|patch| patch.len() >= least).count() as f64
    };
    let mut checks = vec![
        Check::of("purity of two groups: the front sheet and the sheet behind it")
            .at_least(purity(two, &stage.truth), PURE)
            .refutes("random labels", purity(&random, &stage.truth)),
        Check::of("share of the rear sheet's left and right patch in one group, the smaller")
            .at_least(shares.smaller, PURE)
            .refutes("random labels", of_random.smaller),
        Check::of("difference between the number of patches of that group that are apart in the photo and two")
            .at_most((large(two, shares.group) - 2.0).abs(), 0.0)
            .refutes("random labels", (large(&random, of_random.group) - 2.0).abs()),
        Check::of("share of the light exchanged by the rear sheet's visible parts that the front sheet's back side reflects")
            .at_least(1.0 - without_back / by_all, 0.25)
            .refutes("a black back side", 0.0),
    ];
    for (groups, labels) in &found.labels[1..] {
        checks.push(Check::of(format!("purity of {groups} groups")).stated(purity(labels, &stage.truth)));
        let bands = bands(labels, &stage.truth, stage.resolution);
        checks.push(Check::of(format!("horizontal bands among {groups} groups")).stated(bands.count as f64));
    }
    checks.push(Check::of("second eigenvalue of the normalized cut").stated(found.eigenvalues[1]));
    Ok(Reproduced {
        setting: format!(
            "a bent sheet in front of another, which it hides in the middle, {}, {PHOTOS} photos, 10 eigenvectors",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &found, 2),
        photos: found.photos,
        ..Reproduced::of(Figure::Fig6, bench.rig())
    })
}

/// The group of most of the rear sheet's pixels, and its smaller share of the sheet's left and right patch.
struct PatchShares {
    group: u8,
    smaller: f64,
}

fn patch_shares(labels: &[u8], stage: &Stage) -> PatchShares {
    let width = stage.resolution.width;
    let share = |group: u8, is_left: bool| {
        let pixels = (0..labels.len())
            .filter(|&pixel| stage.truth[pixel] == REAR_SHEET && labels[pixel] != MASKED)
            .filter(|pixel| (2 * (pixel % width) < width) == is_left);
        let (own, all) = pixels.fold((0_usize, 0_usize), |(own, all), pixel| {
            (own + usize::from(labels[pixel] == group), all + 1)
        });
        own as f64 / all as f64
    };
    let smaller = |group: u8| share(group, true).min(share(group, false));
    let group = u8::from(smaller(1) >= smaller(0));
    PatchShares { group, smaller: smaller(group) }
}

pub(super) const SIDE: usize = 128;
pub(super) const PHOTOS: usize = 50;
const GROUPS: usize = 10;
const EIGENVECTORS: usize = 20;
/// The standard deviation of the blur of patterns and photos, in pixels.
const BLUR: f64 = 1.0;
const CELLS: usize = 9;

pub(super) fn fig8(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let (empty_stage, capture) = run(bench, Set::Carton, side)?;
    let (empty, plain) = (capture.segmentation()?, capture.regrouped(&[CELLS], Coordinates::Plain)?);
    let (egg_stage, capture) = run(bench, Set::CartonEggs, side)?;
    let eggs = capture.segmentation()?;
    let (without, with) = (labels(&empty, GROUPS), labels(&eggs, GROUPS));
    let [nine_without, nine_with] = [&empty, &eggs].map(|of| labels(of, CELLS));
    let [ten_random, nine_random] = [GROUPS, CELLS].map(|groups| random_labels(&empty_stage.truth, groups));
    let light = &mut bench.truth(&egg_stage, Part::Global)?;
    let mut cut = |labels: &[u8]| -> Result<f64> { Ok(evidence(light, labels)?.cut()) };
    let [cut_with, cut_without] = [cut(with)?, cut(without)?];
    let smallest = |labels: &[u8]| {
        let count = |group: usize| labels.iter().filter(|label| usize::from(**label) == group).count();
        100.0 * (0..GROUPS).map(count).min().unwrap_or(0) as f64 / labels.len() as f64
    };
    let off_nine = |found: &Segmentation| (found.regions.count as f64 - CELLS as f64).abs();
    let truth = &empty_stage.truth;
    let checks = vec![
        Check::of("purity of ten groups: the share of pixels in the cell that most of their group is in, empty")
            .at_least(purity(without, truth), 0.95)
            .refutes("random labels", purity(&ten_random, truth)),
        Check::of("adjusted Rand index of nine groups with the nine cells, empty")
            .at_least(adjusted_rand_index(nine_without, truth)?, 0.95)
            .refutes("random labels", adjusted_rand_index(&nine_random, truth)?),
        Check::of("adjusted Rand index of nine groups by the plain k-means of Algorithm 2 with the nine cells, empty")
            .stated(adjusted_rand_index(labels(&plain, CELLS), truth)?),
        Check::of("with eggs: light that ten groups cut, over what the ten groups of the empty carton cut: they change")
            .at_most(cut_with / cut_without, 0.9)
            .refutes("the groups of the empty carton", 1.0),
        Check::of("with eggs: pixels of the smallest of ten groups, %").stated(smallest(with)),
        Check::of("adjusted Rand index of ten groups with eggs and ten without").stated(adjusted_rand_index(with, without)?),
        Check::of("difference between the number of regions that the light shows and nine, empty")
            .at_most(off_nine(&empty), 0.0)
            .refutes("the carton with eggs", off_nine(&eggs)),
        Check::of("localized eigenvectors, empty").stated(empty.embedding.local() as f64),
        Check::of("adjusted Rand index of nine groups with the cells, with eggs").stated(adjusted_rand_index(nine_with, &egg_stage.truth)?),
    ];
    let panels = panels_of("empty", "Empty", &empty_stage, &empty)
        .chain(panels_of("eggs", "With eggs", &egg_stage, &eggs))
        .collect();
    Ok(Reproduced {
        setting: format!(
            "a carton of 3 × 3 cells, {}, {PHOTOS} photos and {EIGENVECTORS} eigenvectors each, from one pattern, blurred by {BLUR} pixel",
            empty_stage.resolution
        ),
        checks,
        panels,
        plots: vec![spectra(&empty, &eggs)],
        photos: empty.photos + eggs.photos,
        ..Reproduced::of(Figure::Fig8, bench.rig())
    })
}

fn spectra(empty: &Segmentation, eggs: &Segmentation) -> Plot {
    Plot::linear(
        "Eigenvalues of the normalized cut: as many near one as there are cells that exchange no light, beside those of a few pixels.",
        ["eigenvector", "eigenvalue λ"],
        [("empty", counted(&empty.eigenvalues)), ("with eggs", counted(&eggs.eigenvalues))],
    )
}

fn run(bench: &mut Bench, set: Set, side: usize) -> Result<(std::sync::Arc<Stage>, Capture)> {
    let stage = bench.stage(set, side)?;
    let mut operator = bench.photos(&stage, Part::Global)?;
    let mut capture = Capture::new(asked_of_carton(&stage))?;
    let blur = Blur::new(stage.resolution, BLUR).ok_or(Error::Interrupted)?;
    capture.run(&mut Blurred::new(&mut operator, blur)?)?;
    Ok((stage, capture))
}

fn asked_of_carton(stage: &Stage) -> SegmentOptions {
    SegmentOptions { eigenvectors: EIGENVECTORS, ..asked(PHOTOS, &[GROUPS, CELLS], stage.resolution) }
}

fn panels_of(name: &str, what: &str, stage: &Stage, found: &Segmentation) -> impl Iterator<Item = Panel> {
    panels(stage, found, 0).into_iter().map(move |panel| Panel {
        name: format!("{name}-{}", panel.name),
        caption: format!("{what}: {}", panel.caption),
        ..panel
    })
}

/// The number of photos that figure 9 shows.
const FIRST: usize = 5;

pub(super) fn fig9(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Carton, bench.side(SIDE))?;
    let run = Recording::of(&mut bench.photos(&stage, Part::Global)?, &stage)?;
    let by_light = Recording::of(&mut bench.truth(&stage, Part::Global)?, &stage)?;
    let nine = labels(&run.found, CELLS);
    let random = Start::default().block(stage.pixels(), FIRST);
    Ok(Reproduced {
        setting: format!("the empty carton, {}, the run of figure 8", stage.resolution),
        checks: vec![
            Check::of(format!("adjusted Rand index of the nine groups that these {PHOTOS} photos give"))
                .at_least(adjusted_rand_index(nine, &stage.truth)?, 0.95)
                .refutes("random labels", adjusted_rand_index(&random_labels(&stage.truth, CELLS), &stage.truth)?),
            Check::of("largest part of a pattern outside the span of the patterns and photos before, the second to the fifth")
                .at_most(run.outside(&run.patterns()), 1e-6)
                .refutes("random patterns", run.outside(&random))
                .without_devices(by_light.outside(&by_light.patterns())),
        ],
        photos: run.found.photos,
        strips: vec![Strip {
            caption: "Above what is projected, below its photo without direct light; blue is negative. White comes first, then the \
                      pattern that the process starts from. Each one after it is made from the photos before it."
                .into(),
            resolution: stage.resolution,
            photos: run.shots,
        }],
        ..Reproduced::of(Figure::Fig9, bench.rig())
    })
}

/// A segmentation of the carton, with the patterns after their blur, and the photos before theirs.
struct Recording {
    found: Segmentation,
    shots: Vec<Product>,
    blur: Blur,
}

impl Recording {
    fn of(operator: &mut dyn Operator, stage: &Stage) -> Result<Self> {
        let mut recorded = Recorded::new(operator);
        let blur = || Blur::new(stage.resolution, BLUR).ok_or(Error::Interrupted);
        let found = segment(&mut Blurred::new(&mut recorded, blur()?)?, &asked_of_carton(stage))?;
        Ok(Self { found, shots: recorded.products, blur: blur()? })
    }

    /// The products of the process. The first photos measure the degree: of white, and of white on the pixels that are not masked.
    fn process(&self) -> &[Product] {
        &self.shots[self.found.photos - self.found.history.len()..]
    }

    fn patterns(&self) -> Vec<Vec<f64>> {
        self.process().iter().take(FIRST).map(|shot| shot.from.clone()).collect()
    }

    /// The largest part of these patterns, from the second on, outside the span of what came before it.
    ///
    /// With the blur `K` and the degree `D`, the process has the patterns `p = K D^-½ v` and the photos `q = G p`, and makes the next `v` from
    /// `D^-½ K q` and the earlier ones. It removes the known vector `D^½ 1`, whose pattern is `K 1`. The next pattern is therefore in the span
    /// of `K 1`, the earlier `p`, and the earlier `K D⁻¹ K q`.
    fn outside(&self, patterns: &[Vec<f64>]) -> f64 {
        let degree = &self.found.degree;
        let scaled = |light: &[f64]| -> Vec<f64> {
            let divide = |(light, degree): (&f64, &f64)| if *degree > 0.0 { light / degree } else { 0.0 };
            self.blur.apply(&light.iter().zip(degree).map(divide).collect::<Vec<_>>())
        };
        let mut pairs = patterns
            .iter()
            .zip(self.process())
            .map(|(pattern, shot)| [pattern.clone(), scaled(&self.blur.apply(&shot.to))]);
        // `K 1` on the pixels that are not masked, and the pattern that the process starts from with its image.
        let known = std::iter::once(scaled(degree)).chain(pairs.next().into_iter().flatten());
        largest_outside(known.collect(), pairs)
    }
}
