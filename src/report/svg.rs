//! The frame of a plot as SVG: grid, labels and legend, and the marks drawn within it.
//!
//! Text and lines use the page's text colour (`currentColor`), so that one drawing suits light mode, dark mode and print.
//! `plotters`, the usual crate, supports fixed colours only.

use std::fmt::Write;

use super::axis::Axis;
use super::notes::{along, clearest};

/// Appends formatted markup; writing to a string cannot fail.
macro_rules! draw {
    ($target:expr, $($format:tt)*) => {
        let _ = write!($target, $($format)*);
    };
}

/// A drawing framed by two axes.
pub(super) struct Chart {
    pub x: Axis,
    pub y: Axis,
    /// Height reserved above the frame for the legend.
    top: f64,
    body: String,
    /// Points of the drawn curves. Notes of the horizontal marks avoid them.
    drawn: Vec<(f64, f64)>,
    marks: Vec<(f64, String)>,
}

/// The drawing's width: on a phone, 340 pixels wide, its text still has a height of 10 pixels.
const WIDTH: f64 = 480.0;
/// The frame's height, independent of the height of the legend.
const FRAME: f64 = 260.0;
const LEFT: f64 = 88.0;
const RIGHT: f64 = 16.0;
const BOTTOM: f64 = 56.0;
const FONT: f64 = 14.5;

/// Estimated width of a letter: half the height of a sans-serif face, since the font is not available here.
const LETTER: f64 = 7.7;

impl Chart {
    /// Draws grid, ticks and axis labels. `legend` lists (colour, dashes, name), set in rows above the frame.
    pub fn new(x: Axis, y: Axis, x_label: &str, y_label: &str, legend: &[(&str, &str, &str)]) -> Self {
        let mut body = String::new();
        let top = draw_legend(&mut body, legend);
        let mut chart = Self { x, y, top, body, drawn: Vec::new(), marks: Vec::new() };
        chart.draw_frame(x_label, y_label);
        chart
    }

    fn draw_frame(&mut self, x_label: &str, y_label: &str) {
        let (right, bottom) = (WIDTH - RIGHT, self.bottom());
        let mut lines = String::new();
        for tick in &self.y.ticks {
            let Some(y) = self.y.position(tick.value).map(|along| self.down(along)) else { continue };
            let faint = if tick.label.is_empty() { 0.07 } else { 0.16 };
            draw!(
                lines,
                r#"<line x1="{LEFT}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="currentColor" stroke-opacity="{faint}"/>"#
            );
            draw!(
                lines,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                LEFT - 10.0,
                y + 4.5,
                tick.label
            );
        }
        for tick in &self.x.ticks {
            let Some(x) = self.x.position(tick.value).map(across) else { continue };
            draw!(
                lines,
                r#"<line x1="{x:.1}" y1="{bottom}" x2="{x:.1}" y2="{:.1}" stroke="currentColor" stroke-opacity="0.55"/>"#,
                bottom + 5.0
            );
            // The last label must stay inside the drawing.
            let most = WIDTH - LETTER / 2.0 * tick.label.chars().count() as f64;
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
            r#"<line x1="{LEFT}" y1="{bottom}" x2="{right}" y2="{bottom}" stroke="currentColor" stroke-opacity="0.55"/>"#
        );
        let (middle_x, middle_y) = (f64::midpoint(LEFT, right), f64::midpoint(self.top, bottom));
        draw!(
            lines,
            r#"<text x="{middle_x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
            bottom + 46.0,
            escape(x_label)
        );
        for (row, text) in rows(y_label, FRAME).iter().enumerate() {
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
        Some((across(self.x.position(x)?), self.down(self.y.position(y)?)))
    }

    fn down(&self, along: f64) -> f64 {
        self.bottom() - along * FRAME
    }

    /// Vertical position of the frame's lower edge.
    fn bottom(&self) -> f64 {
        self.top + FRAME
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

    /// Draws a filled circle.
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

    /// Writes text that starts at a point, or ends there if it would leave the frame.
    pub fn note(&mut self, (x, y): (f64, f64), text: &str) {
        let anchor = if x > WIDTH - RIGHT - 8.6 * text.chars().count() as f64 { "end" } else { "start" };
        let x = if anchor == "end" { x - 20.0 } else { x };
        draw!(self.body, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escape(text));
    }

    /// Draws a dashed horizontal line over the full width; its note is placed where no curve passes.
    pub fn horizontal_mark(&mut self, value: f64, note: &str) {
        let Some(y) = self.y.position(value).map(|along| self.down(along)) else { return };
        let right = WIDTH - RIGHT;
        draw!(
            self.body,
            r#"<line x1="{LEFT}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="currentColor" stroke-opacity="0.7" stroke-width="1.2" stroke-dasharray="2 4"/>"#
        );
        self.marks.push((y, note.to_owned()));
    }

    /// Writes the notes of the marks above or below their lines, as far left as no curve or other note is covered.
    fn draw_notes(&mut self) {
        let mut notes = Vec::new();
        for (y, note) in std::mem::take(&mut self.marks) {
            let (width, right) = (LETTER * note.chars().count() as f64, WIDTH - RIGHT);
            let lefts =
                (0..9).map(|eighths| LEFT + 8.0 + f64::from(eighths) / 8.0 * (right - LEFT - 8.0 - width));
            let places: Vec<_> = lefts
                .flat_map(|left| {
                    [y - 6.0, y + 16.0].map(|base| [left, base - FONT, left + width, base + 4.0])
                })
                .filter(|place| place[1] >= self.top - FONT && place[3] <= self.bottom())
                .collect();
            let Some(place) = clearest(&places, &self.drawn, &notes) else { continue };
            notes.push(place);
            draw!(
                self.body,
                r#"<text x="{:.1}" y="{:.1}" fill-opacity="0.75">{}</text>"#,
                place[0],
                place[3] - 4.0,
                escape(&note)
            );
        }
    }

    /// The complete SVG document.
    pub fn finish(mut self) -> String {
        self.draw_notes();
        wrap(&self.body, self.bottom() + BOTTOM)
    }
}

/// A drawing that says that there are no values to plot.
pub(super) fn nothing_to_plot() -> String {
    let body = format!(
        r#"<text x="{}" y="{}" text-anchor="middle" fill-opacity="0.6">no values to plot</text>"#,
        WIDTH / 2.0,
        FRAME / 2.0
    );
    wrap(&body, FRAME)
}

fn wrap(body: &str, height: f64) -> String {
    format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="system-ui, 'Helvetica Neue', Arial, sans-serif" font-size="{FONT}" fill="currentColor" role="img">{body}</svg>"#
    )
}

/// Draws the legend in as many rows as needed and returns the top of the frame.
fn draw_legend(body: &mut String, legend: &[(&str, &str, &str)]) -> f64 {
    const ROW: f64 = 22.0;
    let (mut x, mut baseline) = (LEFT, 18.0);
    for &(color, dashes, name) in legend {
        let width = 34.0 + LETTER * name.chars().count() as f64 + 18.0;
        if x > LEFT && x + width > WIDTH - RIGHT {
            (x, baseline) = (LEFT, baseline + ROW);
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

/// Splits a text that is wider than `length` into two rows.
fn rows(text: &str, length: f64) -> Vec<&str> {
    let half = text.len() / 2;
    let break_at = text.match_indices(' ').map(|(at, _)| at).min_by_key(|at| at.abs_diff(half));
    match break_at {
        Some(at) if LETTER * text.chars().count() as f64 > length => vec![&text[..at], &text[at + 1..]],
        _ => vec![text],
    }
}

fn across(along: f64) -> f64 {
    LEFT + along * (WIDTH - RIGHT - LEFT)
}

fn dash_attribute(dashes: &str) -> String {
    if dashes.is_empty() { String::new() } else { format!(r#" stroke-dasharray="{dashes}""#) }
}

/// Escapes text for XML content.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            // XML forbids other control characters, even escaped ones.
            character if character.is_control() => escaped.push(' '),
            character => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_longer_than_its_axis_takes_two_rows() {
        assert_eq!(rows("relative residual", FRAME), ["relative residual"]);
        let long = "relative error of global light, Frobenius norm";
        assert_eq!(rows(long, FRAME), ["relative error of global", "light, Frobenius norm"]);
        assert_eq!(rows("withoutanyspace", 10.0), ["withoutanyspace"]);
    }
}
