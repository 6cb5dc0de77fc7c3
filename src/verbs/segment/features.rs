//! Pixels as points in the space of eigenvectors: the coordinates of chosen pixels and the distances between them.

use std::fmt::Write;

use crate::analysis::{FeatureView, Segmentation};
use crate::finding::decimal;
use crate::report::html::Block;
use crate::report::palette::Palette;
use crate::report::run::AnswerPage;
use crate::report::scatter::ScatterPlot;

/// The maximum number of points in a plot. More points would overlap and enlarge the page.
const POINTS: usize = 2500;

/// The name of the chosen pixel `index`: A, B, …, Z, AA, …
fn name(mut index: usize) -> String {
    let mut letters = String::new();
    loop {
        // A remainder below 26 is a letter.
        letters.insert(0, char::from(b'A' + (index % 26) as u8));
        if index < 26 {
            return letters;
        }
        index = index / 26 - 1;
    }
}

/// The content of `features.csv`: the coordinates of the chosen pixels.
pub(super) fn csv(view: &FeatureView) -> String {
    let count = view.coordinates.first().map_or(0, Vec::len);
    let mut text = String::from("pixel,x,y");
    for index in 0..count {
        // Writing to a string cannot fail.
        let _ = write!(text, ",u{}", index + 2);
    }
    for (index, (&(x, y), coordinates)) in view.pixels.iter().zip(&view.coordinates).enumerate() {
        let _ = write!(text, "\n{},{x},{y}", name(index));
        for value in coordinates {
            let _ = write!(text, ",{value:e}");
        }
    }
    text + "\n"
}

pub(super) fn show(found: &Segmentation, view: &FeatureView, palette: &Palette, page: &mut AnswerPage<'_>) {
    let mut blocks: Vec<Block> =
        [[0, 1], [2, 3]].into_iter().filter_map(|axes| scatter(found, view, palette, axes)).collect();
    blocks.extend([coordinates(view), distances(view)]);
    let text = "A pixel's coordinates are its values in the eigenvectors, by default each over √(1 − λ). Pixels that exchange much light lie close together, however far apart they are in the picture; these are the points that the groups are made of.";
    page.section("Pixels in the space of eigenvectors", text, blocks);
}

/// A scatter plot over two eigenvectors, given by their indices. Index 0 is the second eigenvector.
fn scatter(found: &Segmentation, view: &FeatureView, palette: &Palette, [x, y]: [usize; 2]) -> Option<Block> {
    let coordinate = |axis: usize, pixel: usize| -> Option<f64> {
        Some(found.embedding.coordinate(axis + 1, found.eigenvectors.get(axis + 1)?[pixel]))
    };
    coordinate(y, 0)?;
    let (groups, labels) = found.labels.first()?;
    let shown: Vec<usize> = (0..labels.len()).filter(|&pixel| !found.mask[pixel]).collect();
    // Every `stride`-th shown pixel becomes a point. The points cover all columns unless the stride and the width have a common factor.
    let stride = shown.len().div_ceil(POINTS);
    let points = shown.iter().step_by(stride.max(1)).filter_map(|&pixel| {
        Some((pixel, ((coordinate(x, pixel)?, coordinate(y, pixel)?), palette.color(labels[pixel]))))
    });
    let (pixels, points): (Vec<usize>, Vec<_>) = points.unzip();
    let marked = view.coordinates.iter().enumerate().map(|(index, at)| ((at[x], at[y]), name(index)));
    let plot = ScatterPlot {
        x_label: format!("eigenvector {}, weighted", x + 2),
        y_label: format!("eigenvector {}, weighted", y + 2),
        points,
        marked: marked.collect(),
        pixels: Some((pixels, [x + 1, y + 1])),
    };
    Some(Block::Plot {
        svg: plot.render(),
        caption: format!(
            "Pixels in the colours of the {groups} groups{}; the chosen ones are marked.",
            if stride > 1 { format!(", one in {stride} of them") } else { String::new() }
        ),
    })
}

fn coordinates(view: &FeatureView) -> Block {
    let count = view.coordinates.first().map_or(0, Vec::len);
    let row = |(index, (&(x, y), at)): (usize, (&(usize, usize), &Vec<f64>))| {
        let mut cells = vec![name(index), x.to_string(), y.to_string()];
        cells.extend(at.iter().map(|&value| decimal(value, 4)));
        cells
    };
    let headers = ["pixel", "column", "row"].into_iter().map(String::from);
    Block::table(
        headers.chain((0..count).map(|index| format!("u{}", index + 2))),
        view.pixels.iter().zip(&view.coordinates).enumerate().map(row).collect(),
        "Coordinates of the chosen pixels, also in features.csv",
    )
}

fn distances(view: &FeatureView) -> Block {
    let row = |(index, distances): (usize, &Vec<f64>)| {
        std::iter::once(name(index)).chain(distances.iter().map(|&value| decimal(value, 3))).collect()
    };
    Block::table(
        std::iter::once(String::new()).chain((0..view.pixels.len()).map(name)),
        view.distances.iter().enumerate().map(row).collect(),
        "Distances between them, in units of the root mean square distance of all pixels from the origin",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_named_by_letters_and_listed_with_their_coordinates() {
        assert_eq!([0, 25, 26, 27, 701, 702].map(name), ["A", "Z", "AA", "AB", "ZZ", "AAA"]);
        let view = FeatureView {
            pixels: vec![(3, 4), (5, 6)],
            coordinates: vec![vec![0.5, -1.0], vec![0.25, 2.0]],
            distances: vec![vec![0.0, 1.0], vec![1.0, 0.0]],
        };
        assert_eq!(csv(&view), "pixel,x,y,u2,u3\nA,3,4,5e-1,-1e0\nB,5,6,2.5e-1,2e0\n");
    }
}
