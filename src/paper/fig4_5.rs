//! Figures 4 and 5: segmentation of the zigzag, and its pixels as points in the space of eigenvectors.
//!
//! In figure 4, two groups exchange no light, six groups are cut horizontally, and ten groups also have some vertical cuts (section 8.2).
//!
//! The folded sheets of the zigzag have creases that are sharp at every scale. Their light has only four separate eigenvalues, which give
//! two groups and the two halves of each. With more groups, cutting off the tips of the creases costs less than forming bands
//! ([`continuous`]). The value of the cut measures this cost. Bent sheets are cut into bands. The paper's sheets are folded and are cut into
//! bands, too. They scatter light below their surface (section 8.2), which is not simulated and may blunt the crease.

use std::ops::ControlFlow;

use super::bench::{Bench, Set, Stage};
use super::check::Check;
use super::figure::{Content, Figure, Panel, Plot, Points, Reproduced, counted, good_from};
use super::groups::{asked, bands, continuous, labels, panels, purity, random_labels, straight_bands};
use crate::analysis::segment::{evidence, segment};
use crate::analysis::{Capture, Coordinates, SegmentOptions, Segmentation};
use crate::error::Result;
use crate::observer::{OnStep, Step};
use crate::operator::{Observed, Operator};
use crate::transport::Part;

pub(super) const SIDE: usize = 100;
pub(super) const PHOTOS: usize = 50;
const PURE: f64 = 0.99;
/// The numbers of groups for the zigzag: two, six and ten as in section 8.2, and four for the halves.
const FOLDED: [usize; 4] = [2, 4, 6, 10];
const BENT: [usize; 2] = [6, 10];
/// The angle between the faces of a fold of the zigzag, in radians. A face extends 0.2 m to the side over 0.3 m of depth.
const OPENING: f64 = 2.0 * 0.588_002_603_547_567_5;

/// The edge of the continuous spectrum of the zigzag's folds.
fn edge() -> f64 {
    continuous(OPENING, 0.0)
}

pub(super) fn fig4(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Zigzag, side)?;
    let (capture, curve) = segment_step_by_step(&mut bench.photos(&stage, Part::Global)?, &stage)?;
    let found = capture.segmentation()?;
    let plain = capture.regrouped(&[2], Coordinates::Plain)?;
    let bent_stage = bench.stage(Set::TwoSheets, side)?;
    let bent =
        segment(&mut bench.photos(&bent_stage, Part::Global)?, &asked(PHOTOS, &BENT, bent_stage.resolution))?;
    let [mut light, mut bent_light] =
        [bench.truth(&stage, Part::Global)?, bench.truth(&bent_stage, Part::Global)?];

    let random = |stage: &Stage, groups| random_labels(&stage.truth, groups);
    let impure = purity(&random(&stage, 2), &stage.truth);
    let mut checks = vec![
        Check::of("purity of two groups at 50 photos")
            .at_least(purity(labels(&found, 2), &stage.truth), PURE)
            .refutes("random labels", impure),
        Check::of("fewest photos from which on the purity is 0.99, of 4 to 20 and 50 photos")
            .at_most(good_from(&curve, |purity| purity >= PURE), 12.0)
            .refutes("random labels at all photos", good_from(&[(4.0, impure)], |purity| purity >= PURE)),
        Check::of("purity of two groups by the plain k-means of Algorithm 2")
            .stated(purity(labels(&plain, 2), &stage.truth)),
    ];
    let bands_of = |stage: &Stage, labels: &[u8]| bands(labels, &stage.truth, stage.resolution);
    let on_bent = bands_of(&bent_stage, labels(&bent, 6));
    let on_folds = bands_of(&stage, labels(&found, 6));
    for (what, stage, found) in [("bent sheets", &bent_stage, on_bent), ("folded sheets", &stage, on_folds)] {
        let by_chance = bands_of(stage, &random(stage, 6));
        checks.extend([
            Check::of(format!("{what}: groups that are horizontal bands, of 6"))
                .at_least(found.count as f64, 6.0)
                .refutes("random labels", by_chance.count as f64),
            Check::of(format!("{what}: share of pixels in the group of most of their row, 6 groups"))
                .stated(found.share),
        ]);
    }
    for groups in BENT {
        checks.push(is_cheap("bent sheets", groups, &bent, (&bent_stage, &mut bent_light))?);
        checks.push(is_cheap("folded sheets", groups, &found, (&stage, &mut light))?);
    }
    let ten = [("bent sheets", &bent_stage, &bent), ("folded sheets", &stage, &found)];
    checks.extend(ten.map(|(what, stage, of)| {
        let count = bands_of(stage, labels(of, 10)).count as f64;
        Check::of(format!("{what}: groups that are horizontal bands, of 10")).stated(count)
    }));
    let edge = edge();
    let value = |index: usize| found.eigenvalues.get(index).copied().unwrap_or(f64::NAN);
    let [halves, next] = [value(3) / edge, value(4) / edge];
    checks.extend([
        Check::of("folded sheets: second eigenvalue of the normalized cut").stated(value(1)),
        Check::of("edge of the continuous spectrum of a sharp crease, derived").stated(edge),
        Check::of("fourth eigenvalue, of the halves, over that edge")
            .at_least(halves, 1.0)
            .refutes("the fifth eigenvalue", next),
        Check::of("fifth eigenvalue over that edge: it is not separate")
            .at_most(next, 1.0)
            .refutes("the fourth eigenvalue", halves),
    ]);
    let bent_panels = bent.labels.iter().map(|(groups, labels)| {
        let caption = format!("{groups} groups of sheets that are bent instead of folded");
        bent_stage.panel(format!("bent-groups-{groups}"), caption, Content::Labels(labels.clone()))
    });
    Ok(Reproduced {
        setting: format!(
            "zigzag and two-sheets, {}, {PHOTOS} photos and 10 eigenvectors each",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &found, 4).into_iter().map(folded).chain(bent_panels).collect(),
        plots: vec![purity_plot(curve), spectra(&found, &bent, edge)],
        photos: found.photos + bent.photos,
        ..Reproduced::of(Figure::Fig4, bench.rig())
    })
}

fn folded(mut panel: Panel) -> Panel {
    if matches!(panel.content, Content::Labels(_)) {
        panel.caption += " of folded sheets";
    }
    panel
}

/// Checks that the groups solve the stated problem: their cut must cost at most as much as a cut into straight bands.
fn is_cheap(
    what: &str,
    groups: usize,
    found: &Segmentation,
    (stage, light): (&Stage, &mut dyn Operator),
) -> Result<Check> {
    let straight = straight_bands(&found.degree, &found.mask, &stage.truth, groups, stage.resolution);
    let mut cut = |labels: &[u8]| -> Result<f64> { Ok(evidence(light, labels)?.cut()) };
    let straight = cut(&straight)?;
    let random = random_labels(&stage.truth, groups);
    Ok(Check::of(format!("{what}: the cut of {groups} groups over that of straight bands"))
        .at_most(cut(labels(found, groups))? / straight, 1.0)
        .refutes("random labels", cut(&random)? / straight))
}

/// The capture after all photos, and the purity of two groups after 4 to 20 photos and at the end. A single capture is interrupted for
/// each of these results, and continued.
fn segment_step_by_step(operator: &mut dyn Operator, stage: &Stage) -> Result<(Capture, Points)> {
    let mut capture = Capture::new(asked(PHOTOS, &FOLDED, stage.resolution))?;
    let mut curve = Vec::new();
    for photos in 4..=20 {
        let observer = OnStep::new(|step: &Step<'_>| match step.done >= photos {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        });
        capture.run(&mut Observed::new(operator, &observer))?;
        let two = capture.regrouped(&[2], Coordinates::Commute)?;
        curve.push((two.photos as f64, purity(labels(&two, 2), &stage.truth)));
    }
    capture.run(operator)?;
    let two = capture.regrouped(&[2], Coordinates::Commute)?;
    curve.push((two.photos as f64, purity(labels(&two, 2), &stage.truth)));
    Ok((capture, curve))
}

fn spectra(folded: &Segmentation, bent: &Segmentation, edge: f64) -> Plot {
    let [quarter, half] = [0.25, 0.5].map(|frequency| continuous(OPENING, frequency));
    let caption = format!(
        "Why a sharp crease forbids bands. A strip at distance s of one face sends to that at t of the other the share K(s,t) = s t \
         sin²φ / (2 (s² + t² − 2 s t cos φ)^(3/2)), at φ = 67.4° here. K is homogeneous of degree −1: s^(−a) is its eigenfunction, \
         with κ(a) = ∫ K(1,t) t^(−a) dt, and all a = ½ + iω give a continuum. With g(κ) = κ + 0.8 κ² + … + 0.8⁴ κ⁵ for up to six \
         bounces, the normalized cut has λ(ω) = g(κ(½ + iω)) / g(κ(0)): {edge:.3} at ω = 0, the edge, {quarter:.3} at ¼ and \
         {half:.3} at ½. Only eigenvalues above the edge are separate: those of the two sheets and of their halves. Below it \
         eigenvectors are those of the crease's tip at the size of a pixel. A bent sheet has one for each half wave from top to \
         bottom, which are the bands. This holds for matte paper whose crease is sharp: light below the surface of real paper, which is not \
         simulated, may blunt the crease."
    );
    let lines = [("folded sheets", folded), ("bent sheets", bent)];
    let lines = lines.map(|(name, found)| (name, counted(&found.eigenvalues)));
    Plot::linear(caption, ["eigenvector", "eigenvalue λ"], lines).marked(edge, "edge of a sharp crease")
}

fn purity_plot(points: Points) -> Plot {
    let caption = "Purity of two groups if the photos had ended there.";
    Plot::linear(caption, ["photos", "purity"], [("two groups", points)]).marked(PURE, "wanted")
}

/// The chosen pixels: name, and position in the photo from 0 to 1.
const CHOSEN: [(&str, [f64; 2]); 4] = [
    ("A: left sheet, its left face, above", [0.12, 0.25]),
    ("B: left sheet, its right face, above", [0.38, 0.25]),
    ("C: left sheet, its left face, below", [0.12, 0.75]),
    ("D: right sheet, its left face, above", [0.62, 0.25]),
];

pub(super) fn fig5(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Zigzag, side)?;
    let options = asked(PHOTOS, &SegmentOptions::default().groups, stage.resolution);
    let found = segment(&mut bench.photos(&stage, Part::Global)?, &options)?;
    let features: Vec<Vec<f64>> = (0..stage.pixels()).map(|pixel| found.feature(pixel)).collect();
    let chosen = CHOSEN.map(|(name, [x, y])| {
        let at = |share: f64| (share * side as f64) as usize;
        (name, at(y) * side + at(x))
    });
    let distances = chosen.map(|(_, pixel)| distances(&features, pixel));
    let separate = ranked_by_separate(&found, &stage, &chosen.map(|(_, pixel)| pixel));
    // A wrong answer: pixels are alike where they are near in the picture.
    let in_picture: Vec<Vec<f64>> =
        (0..stage.pixels()).map(|pixel| vec![(pixel % side) as f64, (pixel / side) as f64]).collect();
    let picture = chosen.map(|(_, pixel)| self::distances(&in_picture, pixel));
    let least = |distances: &[Vec<f64>]| {
        let ranks = chosen.iter().zip(distances).map(|((_, pixel), from)| ranked(from, &stage.truth, *pixel));
        ranks.fold(f64::INFINITY, f64::min)
    };
    let ratio = |of: &[Vec<f64>], near: usize, far: usize| of[0][chosen[near].1] / of[0][chosen[far].1];
    let pairs = Check::of(
        "share of pixel pairs of which the one on the same sheet is nearer, the least of four pixels",
    );
    let checks = vec![
        pairs
            .at_least(least(&distances), 0.99)
            .refutes("distances in the picture", least(&picture))
            .without("In the eigenvectors of separate eigenvalues alone", separate),
        Check::of("share of such pairs in the eigenvectors of separate eigenvalues alone").stated(separate),
        Check::of("distance from A to B, which faces it, over that to D, beside B but on the other sheet")
            .at_most(ratio(&distances, 1, 3), 0.25)
            .refutes("distances in the picture", ratio(&picture, 1, 3)),
        Check::of("distance from A to B, which faces it, over that to C, on the same face but below")
            .at_most(ratio(&distances, 1, 2), 0.4)
            .refutes("distances in the picture", ratio(&picture, 1, 2)),
    ];
    let lines = chosen.iter().map(|&(name, pixel)| {
        (name, features[pixel].iter().enumerate().map(|(k, &entry)| (k as f64 + 2.0, entry)).collect())
    });
    Ok(Reproduced {
        setting: format!("zigzag, {}, {PHOTOS} photos, 10 eigenvectors", stage.resolution),
        checks,
        panels: distance_maps(&stage, &chosen, &distances),
        plots: vec![Plot::linear(
            "What each pixel has in the eigenvectors, weighted as for the groups. A and B are alike, though \
                      they are apart in the photo.",
            ["eigenvector", "entry / √(1 − λ)"],
            lines,
        )],
        photos: found.photos,
        ..Reproduced::of(Figure::Fig5, bench.rig())
    })
}

/// The smallest probability `ranked` of the pixels. The distances use only the eigenvectors of separate eigenvalues.
fn ranked_by_separate(found: &Segmentation, stage: &Stage, pixels: &[usize]) -> f64 {
    // The first eigenvector has equal entries at all pixels, so it is not a coordinate.
    let count = found.eigenvalues.iter().skip(1).filter(|value| **value > edge()).count();
    let feature = |pixel| found.feature(pixel).into_iter().take(count).collect();
    let features: Vec<Vec<f64>> = (0..stage.pixels()).map(feature).collect();
    let rank = |&pixel: &usize| ranked(&distances(&features, pixel), &stage.truth, pixel);
    pixels.iter().map(rank).fold(f64::INFINITY, f64::min)
}

fn distances(features: &[Vec<f64>], pixel: usize) -> Vec<f64> {
    let square = |(other, own): (&f64, &f64)| (other - own).powi(2);
    let distance = |other: &Vec<f64>| other.iter().zip(&features[pixel]).map(square).sum::<f64>().sqrt();
    features.iter().map(distance).collect()
}

/// The probability that a random pixel of the region of `pixel` is nearer to `pixel` than a random pixel of another region. It is the area
/// under the ROC curve.
fn ranked(distances: &[f64], truth: &[u8], pixel: usize) -> f64 {
    let mut order: Vec<usize> = (0..distances.len()).collect();
    order.sort_by(|&a, &b| distances[a].total_cmp(&distances[b]));
    let (mut inside, mut nearer) = (0_u64, 0_u64);
    for other in order {
        if truth[other] == truth[pixel] {
            inside += 1;
        } else {
            nearer += inside;
        }
    }
    let outside = distances.len() as u64 - inside;
    nearer as f64 / (inside * outside) as f64
}

fn distance_maps(stage: &Stage, chosen: &[(&str, usize)], distances: &[Vec<f64>]) -> Vec<Panel> {
    let maps = chosen.iter().zip(distances).map(|((name, _), from)| {
        let caption = format!("Distance of each pixel from {name}");
        stage.panel(format!("from-{}", &name[..1].to_lowercase()), caption, Content::Amounts(from.clone()))
    });
    // Values above the brightest value of the photo mark the chosen pixels.
    let white = stage.white();
    let brightest = white.iter().copied().fold(0.0, f64::max);
    let mut marked: Vec<f64> = white.iter().map(|value| 0.6 * value).collect();
    let width = stage.resolution.width;
    for &(_, pixel) in chosen {
        for step in [-2_isize, -1, 0, 1, 2] {
            for at in [pixel.checked_add_signed(step), pixel.checked_add_signed(step * width as isize)] {
                if let Some(value) = at.and_then(|at| marked.get_mut(at)) {
                    *value = brightest;
                }
            }
        }
    }
    let photo = stage.panel(
        "chosen",
        "The pixels looked at: A and B above on the left sheet, C below, D on the right sheet",
        Content::Light { values: marked, white: Some(brightest) },
    );
    std::iter::once(photo).chain(maps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_one_when_all_of_the_region_is_nearer_and_a_half_without_order() {
        let truth = [0, 0, 0, 1, 1, 1];
        assert_eq!(ranked(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &truth, 0), 1.0);
        assert_eq!(ranked(&[0.0, 4.0, 5.0, 1.0, 2.0, 3.0], &truth, 0), 3.0 / 9.0);
    }

    #[test]
    fn distances_are_euclidean() {
        let features = [vec![0.0, 0.0], vec![3.0, 4.0]];
        assert_eq!(distances(&features, 0), [0.0, 5.0]);
    }
}
