//! Figure 5: pixels as points in the space of eigenvectors.

use super::bench::Bench;
use super::check::Check;
use super::fig4::OPENING;
use super::figure::{Content, Figure, Panel, Plot, Reproduced};
use super::fold::continuous;
use super::stage::{Set, Stage};
use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, Segmentation};
use crate::error::Result;
use crate::report::plot::{LinePlot, Series};
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;

/// Chosen pixels: name and position in the photo, 0 to 1.
const CHOSEN: [(&str, [f64; 2]); 4] = [
    ("A: left sheet, its left face, above", [0.12, 0.25]),
    ("B: left sheet, its right face, above", [0.38, 0.25]),
    ("C: left sheet, its left face, below", [0.12, 0.75]),
    ("D: right sheet, its left face, above", [0.62, 0.25]),
];

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Zigzag, side)?;
    let options = SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        starts: Some(1),
        resolution: Some(stage.resolution),
        ..SegmentOptions::default()
    };
    let found = segment(&mut bench.photos(&stage, Part::Global)?, &options)?;
    let features: Vec<Vec<f64>> = (0..stage.pixels()).map(|pixel| found.feature(pixel)).collect();
    let chosen = CHOSEN.map(|(name, [x, y])| {
        let at = |share: f64| (share * side as f64) as usize;
        (name, at(y) * side + at(x))
    });
    let distances = chosen.map(|(_, pixel)| distances(&features, pixel));
    let ranks: Vec<f64> =
        chosen.iter().zip(&distances).map(|((_, pixel), from)| ranked(from, &stage.truth, *pixel)).collect();
    let separate = ranked_by_separate(&found, &stage, &chosen.map(|(_, pixel)| pixel));
    let between = |a: usize, b: usize| distances[a][chosen[b].1];
    let checks = vec![
        Check::at_least(
            "share of pixel pairs of which the one on the same sheet is nearer, the least of four pixels",
            ranks.iter().copied().fold(f64::INFINITY, f64::min),
            0.99,
        )
        .because(format!(
            "Noise in the eigenvectors of the crease is the cause: below {:.3} no eigenvalue is separate (figure 4), and those vectors are \
             resolved by no number of photos. In the separate eigenvectors alone the share is {separate:.4}.",
            edge()
        )),
        Check::stated("the same in the eigenvectors of separate eigenvalues alone", separate),
        Check::at_most(
            "distance from A to B, which faces it, over that to D, beside B but on the other sheet",
            between(0, 1) / between(0, 3),
            0.5,
        ),
        Check::at_most(
            "distance from A to B, which faces it, over that to C, on the same face but below",
            between(0, 1) / between(0, 2),
            1.0,
        ),
    ];
    let lines = chosen.iter().map(|&(name, pixel)| Series {
        name: name.into(),
        points: features[pixel].iter().enumerate().map(|(k, &entry)| (k as f64 + 2.0, entry)).collect(),
    });
    Ok(Reproduced {
        setting: format!("zigzag, {}, {PHOTOS} photos, 10 eigenvectors", stage.resolution),
        checks,
        panels: panels(&stage, &chosen, &distances),
        plots: vec![Plot {
            caption: "What each pixel has in the eigenvectors, weighted as for the groups. A and B are alike, though \
                      they are apart in the photo."
                .into(),
            lines: LinePlot {
                x_label: "eigenvector".into(),
                y_label: "entry / √(1 − λ)".into(),
                series: lines.collect(),
                ..LinePlot::default()
            },
        }],
        photos: found.photos,
        ..Reproduced::of(Figure::Fig5, bench.rig())
    })
}

/// The edge of the continuous spectrum of the zigzag's creases.
fn edge() -> f64 {
    continuous(OPENING, 0.0)
}

/// The least rank of the pixels by the coordinates of separate eigenvalues only.
fn ranked_by_separate(found: &Segmentation, stage: &Stage, pixels: &[usize]) -> f64 {
    // The first eigenvector is the same in all pixels and no coordinate.
    let count = found.eigenvalues.iter().skip(1).filter(|value| **value > edge()).count();
    let feature = |pixel| found.feature(pixel).into_iter().take(count).collect();
    let features: Vec<Vec<f64>> = (0..stage.pixels()).map(feature).collect();
    let rank = |&pixel: &usize| ranked(&distances(&features, pixel), &stage.truth, pixel);
    pixels.iter().map(rank).fold(f64::INFINITY, f64::min)
}

/// Distances from `pixel` to all pixels in feature space.
fn distances(features: &[Vec<f64>], pixel: usize) -> Vec<f64> {
    let square = |(other, own): (&f64, &f64)| (other - own).powi(2);
    let distance = |other: &Vec<f64>| other.iter().zip(&features[pixel]).map(square).sum::<f64>().sqrt();
    features.iter().map(distance).collect()
}

/// The probability that a random pixel of `pixel`'s region is nearer to it than a random pixel of another region (area under the
/// ROC curve; Mann–Whitney statistic).
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

fn panels(stage: &Stage, chosen: &[(&str, usize)], distances: &[Vec<f64>]) -> Vec<Panel> {
    let maps = chosen.iter().zip(distances).map(|((name, _), from)| {
        let caption = format!("Distance of each pixel from {name}");
        stage.panel(format!("from-{}", &name[..1].to_lowercase()), caption, Content::Amounts(from.clone()))
    });
    // The chosen pixels are marked in the photo by values above its brightest one.
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
