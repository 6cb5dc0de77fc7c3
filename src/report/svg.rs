//! A plot as SVG: the frame with grid, labels and legend, and the marks inside the frame.
//!
//! Text and lines use the page's text colour (`currentColor`) for light mode, dark mode and print. The crate `plotters` is not used, since
//! it supports only fixed colours.

use std::fmt::Write;

use super::axis::Axis;

/// Appends formatted markup. Writing to a string cannot fail.
macro_rules! draw {
    ($target:expr, $($format:tt)*) => {
        let _ = write!($target, $($format)*);
    };
}

pub(super) struct Chart {
    pub x: Axis,
    pub y: Axis,
    /// Height reserved above the frame for the legend.
    top: f64,
    body: String,
    /// Points of the drawn curves. The notes of the horizontal marks avoid them.
    drawn: Vec<(f64, f64)>,
    marks: Vec<(f64, String)>,
    layout: Layout,
    labels: [String; 2],
}

/// The dimensions of a drawing, in its units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    width: f64,
    /// The height of the frame. It does not depend on the legend.
    frame: f64,
    left: f64,
    bottom: f64,
    has_labels: bool,
}

impl Layout {
    /// The layout of a single plot. Its text is still 10 pixels high on a phone 340 pixels wide.
    pub const FULL: Self = Self { width: 480.0, frame: 260.0, left: 88.0, bottom: 56.0, has_labels: true };
    /// The layout of one of many small plots. All have the same axes, whose labels are outside the plots.
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

/// The estimated width of a letter, half the height of a sans-serif face. The true width is unknown, since the font is not available here.
const LETTER: f64 = 7.7;

impl Chart {
    /// Draws grid, ticks and axis labels. `legend` lists (colour, dashes, name), in rows above the frame.
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
            // The last label is shifted if it would exceed the drawing.
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

    /// The number of ticks from one label of the horizontal axis to the next. More frequent labels would overlap.
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

    /// Begins a curve whose values the page's scripts show. `points` are these values. Values outside the drawing are left out.
    pub fn open_curve(&mut self, name: &str, color: &str, points: &[(f64, f64)]) {
        let told = points.iter().filter_map(|&(x, y)| {
            let (across, down) = self.place((x, y))?;
            Some(format!("{:e} {:e} {across:.1} {down:.1}", x as f32, y as f32))
        });
        let told: Vec<String> = told.collect();
        draw!(
            self.body,
            r#"<g data-name="{}" data-color="{color}" data-points="{}">"#,
            escape(name),
            told.join(",")
        );
    }

    /// Begins a group of points, each of which represents a pixel.
    pub fn open_pixels(&mut self, pixels: &[usize], axes: [usize; 2]) {
        let pixels: Vec<String> = pixels.iter().map(usize::to_string).collect();
        draw!(self.body, r#"<g data-axes="{},{}" data-pixels="{}">"#, axes[0], axes[1], pixels.join(" "));
    }

    /// Ends the curve or the group of points that was begun last.
    pub fn close(&mut self) {
        self.body.push_str("</g>");
    }

    /// A line behind the curves, without values for the scripts.
    pub fn shadow(&mut self, points: &[(f64, f64)]) {
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        draw!(
            self.body,
            r#"<polyline points="{}" fill="none" stroke="currentColor" stroke-opacity="0.16"/>"#,
            path.join(" ")
        );
    }

    /// Writes names beside points. If possible, a name is placed where it covers no other name and no marked point.
    pub fn names(&mut self, named: &[((f64, f64), &str)]) {
        let points: Vec<(f64, f64)> = named.iter().map(|(at, _)| *at).collect();
        let mut taken = Vec::new();
        for ((x, y), name) in named {
            let width = LETTER * name.chars().count() as f64 + 4.0;
            let places: Vec<_> = [10.0, 20.0, 34.0]
                .into_iter()
                .flat_map(|away| {
                    let lefts = [x + away, x - away - width, x - width / 2.0];
                    let bases = [y - away + 2.0, y + away + 10.0, y + 5.0];
                    lefts.into_iter().flat_map(move |left| bases.map(|base| (left, base)))
                })
                .map(|(left, base)| [left, base - FONT, left + width, base + 3.0])
                .filter(|place| place[0] >= self.layout.left && place[2] <= self.layout.width)
                .filter(|place| place[1] >= self.top - FONT && place[3] <= self.bottom())
                .collect();
            let Some(place) = clearest(&places, &points, &taken) else { continue };
            taken.push(place);
            draw!(
                self.body,
                r#"<text class="halo" x="{:.1}" y="{:.1}" font-weight="600">{}</text>"#,
                place[0],
                place[3] - 3.0,
                escape(name)
            );
        }
    }

    /// Draws a dashed horizontal line over the full width. Its note is placed where no curve passes.
    pub fn horizontal_mark(&mut self, value: f64, note: &str) {
        let Some(y) = self.y.position(value).map(|along| self.down(along)) else { return };
        let (left, right) = (self.layout.left, self.layout.right());
        draw!(
            self.body,
            r#"<line x1="{left}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="currentColor" stroke-opacity="0.7" stroke-width="1.2" stroke-dasharray="2 4"/>"#
        );
        self.marks.push((y, note.to_owned()));
    }

    /// Writes the notes of the marks above or below their lines, as far left as possible without covering a curve or another note.
    fn draw_notes(&mut self) {
        let mut notes = Vec::new();
        for (y, note) in std::mem::take(&mut self.marks) {
            let (width, left, right) =
                (LETTER * note.chars().count() as f64, self.layout.left, self.layout.right());
            let lefts =
                (0..9).map(|eighths| left + 8.0 + f64::from(eighths) / 8.0 * (right - left - 8.0 - width));
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

/// Splits a text into two rows if it is wider than `length`.
fn rows(text: &str, length: f64) -> Vec<&str> {
    let half = text.len() / 2;
    let break_at = text.match_indices(' ').map(|(at, _)| at).min_by_key(|at| at.abs_diff(half));
    match break_at {
        Some(at) if LETTER * text.chars().count() as f64 > length => vec![&text[..at], &text[at + 1..]],
        _ => vec![text],
    }
}

fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // Control characters become spaces, since XML forbids most of them, even escaped.
            character if character.is_control() => escaped.push(' '),
            character => escaped.push(character),
        }
    }
    escaped
}

/// A rectangle: left, top, right and bottom.
type Frame = [f64; 4];

/// The distance of samples along lines. A smaller distance would not change the placement of notes.
const STEP: f64 = 3.0;

/// Samples along the lines between `corners`. They are dense enough to detect every line through a note.
fn along(corners: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    corners.windows(2).flat_map(|ends| {
        let [(x, y), (to_x, to_y)] = [ends[0], ends[1]];
        let steps = ((to_x - x).hypot(to_y - y) / STEP).ceil().max(1.0) as usize;
        (0..=steps).map(move |step| {
            let share = step as f64 / steps as f64;
            (x + share * (to_x - x), y + share * (to_y - y))
        })
    })
}

/// The place that covers the fewest points and notes, or the first such place; `None` if there are no places.
fn clearest(places: &[Frame], points: &[(f64, f64)], notes: &[Frame]) -> Option<Frame> {
    let hidden = |place: &Frame| {
        let inside =
            |&&(x, y): &&(f64, f64)| (place[0]..=place[2]).contains(&x) && (place[1]..=place[3]).contains(&y);
        let meets = |note: &&Frame| {
            note[0] < place[2] && place[0] < note[2] && note[1] < place[3] && place[1] < note[3]
        };
        // The penalty for overlapping notes is large, because such notes are unreadable.
        points.iter().filter(inside).count() + 1000 * notes.iter().filter(meets).count()
    };
    places.iter().copied().min_by_key(hidden)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_stands_where_no_curve_passes_and_no_other_note_stands() {
        let places = [[0.0, 0.0, 50.0, 10.0], [100.0, 0.0, 150.0, 10.0], [200.0, 0.0, 250.0, 10.0]];
        let curve: Vec<_> = along(&[(0.0, -40.0), (40.0, 40.0)]).collect();
        assert_eq!(clearest(&places, &[], &[]), Some(places[0]));
        assert_eq!(clearest(&places, &curve, &[]), Some(places[1]));
        assert_eq!(clearest(&places, &curve, &[[90.0, 5.0, 110.0, 15.0]]), Some(places[2]));
        assert_eq!(clearest(&[], &curve, &[]), None);
    }

    #[test]
    fn a_line_is_seen_all_along() {
        let points: Vec<_> = along(&[(0.0, 0.0), (30.0, 40.0)]).collect();
        assert!(points.windows(2).all(|pair| (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1) <= STEP));
        assert!(points.contains(&(0.0, 0.0)) && points.contains(&(30.0, 40.0)));
    }

    #[test]
    fn a_label_longer_than_its_axis_takes_two_rows() {
        assert_eq!(rows("relative residual", 260.0), ["relative residual"]);
        let long = "relative error of global light, Frobenius norm";
        assert_eq!(rows(long, 260.0), ["relative error of global", "light, Frobenius norm"]);
        assert_eq!(rows("withoutanyspace", 10.0), ["withoutanyspace"]);
    }
}
