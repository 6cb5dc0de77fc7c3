//! Residuals over the number of photos, as a file and as a plot.

use std::fmt::Write;

use super::html::Block;
use super::plot::{LinePlot, line};

/// A number of photos, and the residual after these photos.
pub(crate) type Row = (usize, f64);

/// The content of `residuals.csv`. `count` is the header of the first column.
pub(crate) fn csv(count: &str, history: &[Row]) -> String {
    let mut text = format!("{count},relative_residual\n");
    for (photo, residual) in history {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{photo},{residual:e}");
    }
    text
}

/// A plot with one named line per method and dashed horizontal marks.
pub(crate) fn plot(count: &str, lines: &[(&str, &[Row])], marks: Vec<(f64, String)>, caption: &str) -> Block {
    Block::Plot { svg: lines_of(count, lines, marks).render(), caption: caption.into() }
}

/// A small plot for each method, over the `count` of photos or frames.
pub(crate) fn multiples(
    count: &str,
    lines: &[(&str, &[Row])],
    marks: Vec<(f64, String)>,
    caption: &str,
) -> Block {
    let marked: Vec<&str> = marks.iter().map(|(_, note)| note.as_str()).collect();
    let mut caption = format!("Relative residual over {count}; other methods in gray. {caption}");
    if !marked.is_empty() {
        caption += &format!(" Dotted: {}.", marked.join(", "));
    }
    Block::Multiples { plots: lines_of(count, lines, marks).small_multiples(), caption }
}

fn lines_of(count: &str, lines: &[(&str, &[Row])], marks: Vec<(f64, String)>) -> LinePlot {
    let at = |(photo, residual): &Row| (*photo as f64, *residual);
    let series = |(name, history): &(&str, &[Row])| line(*name, history.iter().map(at));
    LinePlot {
        x_label: count.into(),
        y_label: "relative residual".into(),
        logarithmic: true,
        series: lines.iter().map(series).collect(),
        marks,
    }
}
