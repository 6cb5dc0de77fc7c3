//! The frame of a plot as SVG: grid, labels and legend, and the marks drawn within it.
//!
//! Text and lines use the page's text colour (`currentColor`) for light mode, dark mode and print. `plotters` supports only fixed colours.

use std::fmt::Write;

use super::axis::Axis;
use super::notes::along;

/// Appends formatted markup. Writing to a string cannot fail.
macro_rules! draw {
    ($target:expr, $($format:tt)*) => {
        let _ = write!($target, $($format)*);
    };
}

mod notes;
mod text;
mod told;

use text::{escape, rows};

pub(super) struct Chart {
    pub x: Axis,
    pub y: Axis,
    /// Height reserved above the frame for the legend.
    top: f64,
    body: String,
    /// Points of the drawn curves, which notes of the horizontal marks avoid.
    drawn: Vec<(f64, f64)>,
    marks: Vec<(f64, String)>,
    layout: Layout,
    labels: [String; 2],
}

/// The dimensions of a drawing, in its units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    width: f64,
    /// The frame's height, which does not depend on the legend.
    frame: f64,
    left: f64,
    bottom: f64,
    has_labels: bool,
}

impl Layout {
    /// A drawing whose text is still 10 pixels high on a phone 340 pixels wide.
    pub const FULL: Self = Self { width: 480.0, frame: 260.0, left: 88.0, bottom: 56.0, has_labels: true };
    /// One of many plots with the same axes, which are labelled elsewhere.
    pub const SMALL: Self = Self { width: 250.0, frame: 120.0, left: 56.0, bottom: 30.0, has_labels: false };

    fn right(self) -> f64 {
        self.width - RIGHT
    }

    fn across(self, along: f64) -> f64 {
        self.left + along * (self.right() - self.left)
    }
}

const RIGHT: f64 = 16.0;
const FONT: f64 = 14.5;

/// Estimated width of a letter: half the height of a sans-serif face, since the font is not available here.
const LETTER: f64 = 7.7;

impl Chart {
    /// Draws grid, ticks and axis labels. `legend` lists (colour, dashes, name), set in rows above the frame.
    pub fn new(
        layout: Layout,
        (x, y): (Axis, Axis),
        labels: [&str; 2],
        legend: &[(&str, &str, &str)],
    ) -> Self {
        let mut body = String::new();
        let top = draw_legend(&mut body, layout, legend);
        let labels = labels.map(str::to_owned);
        let mut chart = Self { x, y, top, body, drawn: Vec::new(), marks: Vec::new(), layout, labels };
        chart.draw_ticks();
        if layout.has_labels {
            chart.draw_labels();
        }
        chart
    }

    fn draw_ticks(&mut self) {
        let (left, right, bottom) = (self.layout.left, self.layout.right(), self.bottom());
        let mut lines = String::new();
        for tick in &self.y.ticks {
            let Some(y) = self.y.position(tick.value).map(|along| self.down(along)) else { continue };
            let faint = if tick.label.is_empty() { 0.07 } else { 0.16 };
            draw!(
                lines,
                r#"<line x1="{left}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="currentColor" stroke-opacity="{faint}"/>"#
            );
            draw!(
                lines,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                left - 10.0,
                y + 4.5,
                tick.label
            );
        }
        let stride = self.stride();
        for (index, tick) in self.x.ticks.iter().enumerate() {
            let Some(x) = self.x.position(tick.value).map(|along| self.layout.across(along)) else {
                continue;
            };
            draw!(
                lines,
                r#"<line x1="{x:.1}" y1="{bottom}" x2="{x:.1}" y2="{:.1}" stroke="currentColor" stroke-opacity="0.55"/>"#,
                bottom + 5.0
            );
            if index % stride != 0 {
                continue;
            }
            // The last label must stay inside the drawing.
            let most = self.layout.width - LETTER / 2.0 * tick.label.chars().count() as f64;
            draw!(
                lines,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
                x.min(most),
                bottom + 20.0,
                tick.label
            );
        }
        draw!(
            lines,
            r#"<line x1="{left}" y1="{bottom}" x2="{right}" y2="{bottom}" stroke="currentColor" stroke-opacity="0.55"/>"#
        );
        self.body.push_str(&lines);
    }

    /// The number of ticks from one label of the horizontal axis to the next. More labels would overlap.
    fn stride(&self) -> usize {
        let ends = |stride: usize| {
            let labelled = self.x.ticks.iter().step_by(stride);
            labelled.filter_map(|tick| {
                let middle = self.layout.across(self.x.position(tick.value)?);
                let half = LETTER / 2.0 * tick.label.chars().count() as f64;
                Some((middle - half, middle + half))
            })
        };
        let is_apart = |stride: &usize| {
            let mut last = f64::NEG_INFINITY;
            ends(*stride).all(|(start, end)| start >= std::mem::replace(&mut last, end) + LETTER)
        };
        [1, 2, 5, 10, 20, 50].into_iter().find(is_apart).unwrap_or(100)
    }

    fn draw_labels(&mut self) {
        let (left, right, bottom) = (self.layout.left, self.layout.right(), self.bottom());
        let mut lines = String::new();
        let (middle_x, middle_y) = (f64::midpoint(left, right), f64::midpoint(self.top, bottom));
        draw!(
            lines,
            r#"<text x="{middle_x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
            bottom + 46.0,
            escape(&self.labels[0])
        );
        for (row, text) in rows(&self.labels[1], self.layout.frame).iter().enumerate() {
            draw!(
                lines,
                r#"<text transform="translate({:.1} {middle_y:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
                14.0 + 17.0 * row as f64,
                escape(text)
            );
        }
        self.body.push_str(&lines);
    }

    /// Position of a point in the drawing's units; `None` if the point is not on the axes.
    pub fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.layout.across(self.x.position(x)?), self.down(self.y.position(y)?)))
    }

    fn down(&self, along: f64) -> f64 {
        self.bottom() - along * self.layout.frame
    }

    fn bottom(&self) -> f64 {
        self.top + self.layout.frame
    }

    /// Draws a line through points given in the drawing's units.
    pub fn polyline(&mut self, points: &[(f64, f64)], color: &str, dashes: &str) {
        self.drawn.extend(along(points));
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        draw!(
            self.body,
            r#"<polyline points="{}" fill="none" stroke="{color}" stroke-width="2.2" stroke-linejoin="round" stroke-linecap="round"{}/>"#,
            path.join(" "),
            dash_attribute(dashes)
        );
    }

    /// Draws a straight line between two points given in the drawing's units.
    pub fn segment(&mut self, from: (f64, f64), to: (f64, f64), color: &str, width: f64, opacity: f64) {
        draw!(
            self.body,
            r#"<line x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" stroke="{color}" stroke-width="{width}" stroke-opacity="{opacity}"/>"#,
            from.0,
            from.1,
            to.0,
            to.1
        );
    }

    pub fn dot(&mut self, (x, y): (f64, f64), radius: f64, color: &str) {
        draw!(self.body, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="{color}"/>"#);
    }

    /// Draws an unfilled circle that is visible on light and dark points.
    pub fn ring(&mut self, (x, y): (f64, f64), radius: f64) {
        draw!(
            self.body,
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="none" stroke="currentColor" stroke-width="2"/>"#
        );
    }

    pub fn finish(mut self) -> String {
        self.draw_notes();
        let told = format!(
            r#" aria-label="{1} over {0}" data-x="{0}" data-y="{1}" data-frame="{2},{3},{4},{5}""#,
            escape(&self.labels[0]),
            escape(&self.labels[1]),
            self.layout.left,
            self.top,
            self.layout.right(),
            self.bottom()
        );
        wrap(&self.body, &told, self.layout.width, self.bottom() + self.layout.bottom)
    }
}

/// A drawing that states that there are no values to plot.
pub(super) fn nothing_to_plot() -> String {
    let body = format!(
        r#"<text x="{}" y="{}" text-anchor="middle" fill-opacity="0.6">no values to plot</text>"#,
        Layout::FULL.width / 2.0,
        Layout::FULL.frame / 2.0
    );
    wrap(&body, r#" aria-label="no values to plot""#, Layout::FULL.width, Layout::FULL.frame)
}

fn wrap(body: &str, told: &str, width: f64, height: f64) -> String {
    format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="system-ui, 'Helvetica Neue', Arial, sans-serif" font-size="{FONT}" fill="currentColor" role="img"{told}>{body}</svg>"#
    )
}

/// Draws the legend in as many rows as needed and returns the top of the frame.
fn draw_legend(body: &mut String, layout: Layout, legend: &[(&str, &str, &str)]) -> f64 {
    const ROW: f64 = 22.0;
    let (mut x, mut baseline) = (layout.left, 18.0);
    for &(color, dashes, name) in legend {
        let width = 34.0 + LETTER * name.chars().count() as f64 + 18.0;
        if x > layout.left && x + width > layout.right() {
            (x, baseline) = (layout.left, baseline + ROW);
        }
        let middle = baseline - 4.5;
        draw!(
            body,
            r#"<line x1="{x:.1}" y1="{middle:.1}" x2="{:.1}" y2="{middle:.1}" stroke="{color}" stroke-width="3" stroke-linecap="round"{}/>"#,
            x + 24.0,
            dash_attribute(dashes)
        );
        draw!(body, r#"<text x="{:.1}" y="{baseline:.1}">{}</text>"#, x + 34.0, escape(name));
        x += width;
    }
    if legend.is_empty() { 14.0 } else { baseline + 18.0 }
}

fn dash_attribute(dashes: &str) -> String {
    if dashes.is_empty() { String::new() } else { format!(r#" stroke-dasharray="{dashes}""#) }
}
