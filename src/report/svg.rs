//! The frame of a plot as SVG: scales, ticks, grid and labels.
//!
//! Text and lines take the page's own colour (`currentColor`), so that one drawing serves light, dark and paper.

use std::fmt::Write;

/// Appends formatted markup; writing to a string cannot fail.
macro_rules! draw {
    ($target:expr, $($format:tt)*) => {
        let _ = write!($target, $($format)*);
    };
}

/// How values are laid out along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm; values ≤ 0 have no place and are left out.
    Log,
}

/// One axis: where values lie along it and which carry a label.
pub(super) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    pub ticks: Vec<Tick>,
}

pub(super) struct Tick {
    pub value: f64,
    /// Empty for a faint line between labelled ones.
    pub label: String,
}

impl Axis {
    /// An axis that holds all `values` that have a place on it, widened to round numbers; `None` if none has.
    /// About `wanted` ticks are labelled.
    pub fn around(scale: Scale, values: impl Iterator<Item = f64>, wanted: usize) -> Option<Self> {
        let placed = values.filter(|&value| value.is_finite() && (scale == Scale::Linear || value > 0.0));
        let (low, high) = placed
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low > high {
            return None;
        }
        Some(match scale {
            Scale::Linear => Self::linear(low, high, wanted),
            Scale::Log => Self::logarithmic(low, high, wanted),
        })
    }

    fn linear(mut low: f64, mut high: f64, wanted: usize) -> Self {
        if low == high {
            let margin = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
            (low, high) = (low - margin, high + margin);
        }
        let step = round_step((high - low) / wanted.max(1) as f64);
        let (first, last) = ((low / step).floor(), (high / step).ceil());
        let decimals = (-step.log10()).ceil().clamp(0.0, 12.0) as usize;
        let ticks = (0..=(last - first) as usize)
            .map(|index| {
                let value = (first + index as f64) * step;
                Tick { value, label: linear_label(value, step, decimals) }
            })
            .collect();
        Self { scale: Scale::Linear, low: first * step, high: last * step, ticks }
    }

    fn logarithmic(low: f64, high: f64, wanted: usize) -> Self {
        let (mut first, mut last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
        if first == last {
            (first, last) = (first - 1, last + 1);
        }
        let stride = ((last - first) as usize).div_ceil(wanted.max(1)).max(1) as i32;
        let mut ticks = Vec::new();
        for exponent in first..=last {
            let labelled = (exponent - first) % stride == 0;
            let label = if labelled { power_of_ten(exponent) } else { String::new() };
            ticks.push(Tick { value: 10_f64.powi(exponent), label });
            if last - first <= 2 && exponent < last {
                let between = [2, 5].map(|digit| Tick {
                    value: f64::from(digit) * 10_f64.powi(exponent),
                    label: if last - first == 1 {
                        format!("{digit}·{}", power_of_ten(exponent))
                    } else {
                        String::new()
                    },
                });
                ticks.extend(between);
            }
        }
        Self { scale: Scale::Log, low: 10_f64.powi(first), high: 10_f64.powi(last), ticks }
    }

    /// An axis from `low` to `high` with these ticks, evenly laid out.
    pub fn exactly(low: f64, high: f64, ticks: Vec<Tick>) -> Self {
        Self { scale: Scale::Linear, low, high, ticks }
    }

    /// Where a value lies, 0 to 1; `None` for one without a place.
    pub fn position(&self, value: f64) -> Option<f64> {
        let along = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log if value > 0.0 => (value / self.low).ln() / (self.high / self.low).ln(),
            Scale::Log => return None,
        };
        along.is_finite().then_some(along)
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `step`.
fn round_step(step: f64) -> f64 {
    let magnitude = 10_f64.powf(step.log10().floor());
    let leading = step / magnitude;
    // A hair of slack, so that a step of exactly 2 is not taken for 2.0000000000000004.
    let rounded = [1.0, 2.0, 5.0].into_iter().find(|&digit| leading <= digit * (1.0 + 1e-9)).unwrap_or(10.0);
    rounded * magnitude
}

fn linear_label(value: f64, step: f64, decimals: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let plain = (1e-4..1e6).contains(&step.abs()) && value.abs() < 1e7;
    let text = if plain { format!("{value:.decimals$}") } else { format!("{:e}", round_to_digits(value, 6)) };
    // A true minus sign is as wide as the digits.
    text.replace('-', "\u{2212}")
}

/// `value` with what multiplication by a step left behind beyond `digits` significant digits removed.
fn round_to_digits(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

fn power_of_ten(exponent: i32) -> String {
    const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match exponent {
        0 => "1".into(),
        1 => "10".into(),
        _ => {
            let digits = exponent.unsigned_abs().to_string();
            let raised = digits.chars().filter_map(|digit| Some(SUPERSCRIPTS[digit.to_digit(10)? as usize]));
            format!("10{}{}", if exponent < 0 { "⁻" } else { "" }, raised.collect::<String>())
        }
    }
}

/// A drawing with a frame of two axes.
pub(super) struct Chart {
    pub x: Axis,
    pub y: Axis,
    /// Height kept free above the frame, for a legend.
    top: f64,
    body: String,
}

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 380.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 20.0;
const BOTTOM: f64 = 56.0;

impl Chart {
    /// Draws grid, ticks and axis labels. `legend` is (colour, dashes, name) of each entry, in rows above the frame.
    pub fn new(x: Axis, y: Axis, x_label: &str, y_label: &str, legend: &[(&str, &str, &str)]) -> Self {
        let mut body = String::new();
        let top = draw_legend(&mut body, legend);
        let mut chart = Self { x, y, top, body };
        chart.draw_frame(x_label, y_label);
        chart
    }

    fn draw_frame(&mut self, x_label: &str, y_label: &str) {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
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
            draw!(
                lines,
                r#"<text x="{x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
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
            HEIGHT - 10.0,
            escape(x_label)
        );
        draw!(
            lines,
            r#"<text transform="translate(18 {middle_y:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
            escape(y_label)
        );
        self.body.push_str(&lines);
    }

    /// Where a point lies on the drawing, in its own units; `None` for one without a place on the axes.
    pub fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((across(self.x.position(x)?), self.down(self.y.position(y)?)))
    }

    fn down(&self, along: f64) -> f64 {
        HEIGHT - BOTTOM - along * (HEIGHT - BOTTOM - self.top)
    }

    /// A line through points of the drawing.
    pub fn polyline(&mut self, points: &[(f64, f64)], color: &str, dashes: &str) {
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        draw!(
            self.body,
            r#"<polyline points="{}" fill="none" stroke="{color}" stroke-width="2.2" stroke-linejoin="round" stroke-linecap="round"{}/>"#,
            path.join(" "),
            dash_attribute(dashes)
        );
    }

    /// A straight line between two points of the drawing.
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

    /// A filled circle.
    pub fn dot(&mut self, (x, y): (f64, f64), radius: f64, color: &str) {
        draw!(self.body, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="{color}"/>"#);
    }

    /// A dashed horizontal line over the whole width with a note at its right end.
    pub fn horizontal_mark(&mut self, value: f64, note: &str) {
        let Some(y) = self.y.position(value).map(|along| self.down(along)) else { return };
        let right = WIDTH - RIGHT;
        draw!(
            self.body,
            r#"<line x1="{LEFT}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="currentColor" stroke-opacity="0.7" stroke-width="1.2" stroke-dasharray="2 4"/>"#
        );
        draw!(
            self.body,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="end" fill-opacity="0.75">{}</text>"#,
            right,
            y - 6.0,
            escape(note)
        );
    }

    /// The whole drawing.
    pub fn finish(self) -> String {
        wrap(&self.body)
    }
}

/// A drawing that says so where there is nothing to plot.
pub(super) fn nothing_to_plot() -> String {
    wrap(&format!(
        r#"<text x="{}" y="{}" text-anchor="middle" fill-opacity="0.6">no values to plot</text>"#,
        WIDTH / 2.0,
        HEIGHT / 2.0
    ))
}

fn wrap(body: &str) -> String {
    format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="system-ui, 'Helvetica Neue', Arial, sans-serif" font-size="13.5" fill="currentColor" role="img">{body}</svg>"#
    )
}

/// Draws the entries in as many rows as they need; returns where the frame may begin.
fn draw_legend(body: &mut String, legend: &[(&str, &str, &str)]) -> f64 {
    const ROW: f64 = 22.0;
    let (mut x, mut baseline) = (LEFT, 18.0);
    for &(color, dashes, name) in legend {
        // Without the font at hand: letters of a sans-serif face are about half as wide as high.
        let width = 34.0 + 7.2 * name.chars().count() as f64 + 22.0;
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

fn across(along: f64) -> f64 {
    LEFT + along * (WIDTH - RIGHT - LEFT)
}

fn dash_attribute(dashes: &str) -> String {
    if dashes.is_empty() { String::new() } else { format!(r#" stroke-dasharray="{dashes}""#) }
}

/// Text as XML content.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            // XML has no place for other control characters, not even escaped.
            character if character.is_control() => escaped.push(' '),
            character => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.label.as_str()).filter(|label| !label.is_empty()).collect()
    }

    fn axis(scale: Scale, values: &[f64]) -> Axis {
        Axis::around(scale, values.iter().copied(), 5).unwrap_or_else(|| unreachable!("no values"))
    }

    #[test]
    fn linear_ticks_are_round_and_enclose_the_values() {
        assert_eq!(labels(&axis(Scale::Linear, &[0.0, 1.0])), ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(&axis(Scale::Linear, &[-7.0, 31.0])), ["−10", "0", "10", "20", "30", "40"]);
        assert_eq!(labels(&axis(Scale::Linear, &[3.0, 3.0])).first(), Some(&"2.6"));
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        assert_eq!(labels(&axis(Scale::Log, &[2e-3, 0.7])), ["10⁻³", "10⁻²", "10⁻¹", "1"]);
        assert_eq!(labels(&axis(Scale::Log, &[1.0, 1e12])), ["1", "10³", "10⁶", "10⁹", "10¹²"]);
        assert!(Axis::around(Scale::Log, [0.0, -1.0, f64::NAN].into_iter(), 5).is_none());
    }

    #[test]
    fn positions_run_from_zero_to_one() {
        let log = axis(Scale::Log, &[1e-4, 1.0]);
        approx::assert_relative_eq!(log.position(1e-2).unwrap_or(f64::NAN), 0.5);
        assert_eq!(log.position(0.0), None);
    }
}
