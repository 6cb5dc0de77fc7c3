//! Plots of a report as SVG: residuals over photos, and spectra.

use super::axis::{Axis, Scale, Tick};
use super::html::Block;
use super::svg::{Chart, Layout, nothing_to_plot};

/// Line colours that colour-blind readers can distinguish, on white and on black.
const COLORS: [&str; 8] =
    ["#2b87c4", "#dd6b1f", "#149a74", "#c671a3", "#d99c0b", "#7a6fd0", "#5cb8e6", "#8b8b35"];

/// The dash patterns. The first pattern is used once for each colour, then the second, and so on.
const DASHES: [&str; 3] = ["", "7 5", "2 5"];

/// A line is drawn with dots if it has at most this number of points.
const MOST_DOTS: usize = 48;

/// Lines over a common axis, e.g. the relative residual of each method over its photos.
#[derive(Clone, Debug, Default)]
pub struct LinePlot {
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Whether the vertical axis is logarithmic.
    pub logarithmic: bool,
    /// The lines. If there are several, a legend names them.
    pub series: Vec<Series>,
    /// Dashed horizontal lines with a note, e.g. the noise floor.
    pub marks: Vec<(f64, String)>,
}

/// A line plot as a block of the page. `x` labels the linear horizontal axis, and `y` the logarithmic vertical axis.
pub(crate) fn lines([x, y]: [&str; 2], series: Vec<Series>, caption: &str) -> Block {
    let plot =
        LinePlot { x_label: x.into(), y_label: y.into(), logarithmic: true, series, marks: Vec::new() };
    Block::Plot { svg: plot.render(), caption: caption.into() }
}

/// A line through points.
pub(crate) fn line(name: impl Into<String>, points: impl Iterator<Item = (f64, f64)>) -> Series {
    Series { name: name.into(), points: points.collect() }
}

/// One line.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// The points (x, y). NaN leaves a gap, and so does a value ≤ 0 on a logarithmic axis.
    pub points: Vec<(f64, f64)>,
}

impl LinePlot {
    /// The plot as an SVG document. Equal plots give equal bytes.
    pub fn render(&self) -> String {
        let Some(axes) = self.axes(6) else { return nothing_to_plot() };
        let name = |(index, series): (usize, &Series)| (color(index), dashes(index), series.name.clone());
        let named: Vec<_> = match self.series.len() {
            0 | 1 => Vec::new(),
            _ => self.series.iter().enumerate().map(name).collect(),
        };
        let legend: Vec<_> =
            named.iter().map(|(color, dashes, name)| (*color, *dashes, name.as_str())).collect();
        let mut chart = Chart::new(Layout::FULL, axes, [&self.x_label, &self.y_label], &legend);
        for (value, note) in &self.marks {
            chart.horizontal_mark(*value, note);
        }
        for (index, series) in self.series.iter().enumerate() {
            series.draw(&mut chart, color(index), dashes(index));
        }
        chart.finish()
    }

    /// A small plot for each line, with the name of the line. All plots have the same axes. Each shows the other lines as shadows.
    pub fn small_multiples(&self) -> Vec<(String, String)> {
        let small = |(index, series): (usize, &Series)| {
            let Some(axes) = self.axes(3) else { return (series.name.clone(), nothing_to_plot()) };
            let mut chart = Chart::new(Layout::SMALL, axes, [&self.x_label, &self.y_label], &[]);
            for (value, _) in &self.marks {
                chart.horizontal_mark(*value, "");
            }
            for (_, other) in self.series.iter().enumerate().filter(|(other, _)| *other != index) {
                for run in other.runs(&chart) {
                    chart.shadow(&run);
                }
            }
            series.draw(&mut chart, COLORS[0], "");
            (series.name.clone(), chart.finish())
        };
        self.series.iter().enumerate().map(small).collect()
    }

    /// Axes around all points and marks; `None` if there is nothing to plot.
    fn axes(&self, wanted: usize) -> Option<(Axis, Axis)> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let scale = if self.logarithmic { Scale::Log } else { Scale::Linear };
        let heights = points().map(|point| point.1).chain(self.marks.iter().map(|mark| mark.0));
        let x = Axis::around(Scale::Linear, points().map(|point| point.0), wanted)?;
        Some((x, Axis::around(scale, heights, wanted)?))
    }
}

impl Series {
    /// The points of the line, split at its gaps, in the units of the drawing.
    fn runs(&self, chart: &Chart) -> Vec<Vec<(f64, f64)>> {
        let places: Vec<_> = self.points.iter().map(|&point| chart.place(point)).collect();
        places.split(Option::is_none).map(|run| run.iter().flatten().copied().collect()).collect()
    }

    fn draw(&self, chart: &mut Chart, color: &str, dashes: &str) {
        let runs = self.runs(chart);
        chart.open_curve(&self.name, color, &self.points);
        for run in runs {
            if run.len() > 1 {
                chart.polyline(&run, color, dashes);
            }
            if run.len() == 1 || self.points.len() <= MOST_DOTS {
                run.iter().for_each(|&place| chart.dot(place, 3.2, color));
            }
        }
        chart.close();
    }
}

/// Values over their index, as stems from zero with error bars, e.g. eigenvalues ± residuals.
#[derive(Clone, Debug, Default)]
pub struct StemPlot {
    /// Label of the horizontal axis.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// The values in order. The first value has number 1.
    pub values: Vec<f64>,
    /// Half the length of each value's error bar. There may be fewer entries than `values`, or none.
    pub errors: Vec<f64>,
}

impl StemPlot {
    /// The plot as an SVG document. Equal plots give equal bytes.
    pub fn render(&self) -> String {
        let error =
            |index: usize| self.errors.get(index).copied().filter(|error| error.is_finite()).unwrap_or(0.0);
        let ends = self
            .values
            .iter()
            .enumerate()
            .flat_map(|(index, &value)| [value - error(index), value + error(index)]);
        let any = self.values.iter().any(|value| value.is_finite());
        let Some(y) = Axis::around(Scale::Linear, ends.chain([0.0]), 6).filter(|_| any) else {
            return nothing_to_plot();
        };
        let count = self.values.len();
        let stride =
            [1, 2, 5, 10, 20, 50, 100].into_iter().find(|stride| count / stride <= 12).unwrap_or(count / 10);
        let ticks = (1..=count)
            .filter(|number| stride == 1 || number % stride == 0)
            .map(|number| Tick { value: number as f64, label: number.to_string() })
            .collect();
        let x = Axis::exactly(0.4, count as f64 + 0.6, ticks);
        let mut chart = Chart::new(Layout::FULL, (x, y), [&self.x_label, &self.y_label], &[]);
        if let (Some(left), Some(right)) = (chart.place((0.4, 0.0)), chart.place((count as f64 + 0.6, 0.0))) {
            chart.segment(left, right, "currentColor", 1.2, 0.6);
        }
        let points: Vec<_> =
            self.values.iter().enumerate().map(|(index, &value)| (index as f64 + 1.0, value)).collect();
        chart.open_curve(&self.y_label, COLORS[0], &points);
        for (index, &value) in self.values.iter().enumerate() {
            let number = index as f64 + 1.0;
            let (Some(base), Some(top)) = (chart.place((number, 0.0)), chart.place((number, value))) else {
                continue;
            };
            chart.segment(base, top, COLORS[0], 2.0, 0.45);
            let bar = [value - error(index), value + error(index)].map(|end| chart.place((number, end)));
            if let [Some(low), Some(high)] = bar
                // A shorter error bar is not drawn, since the dot would hide it.
                && low.1 - high.1 > 9.0
            {
                chart.segment(low, high, COLORS[1], 2.0, 1.0);
                for end in [low, high] {
                    chart.segment((end.0 - 5.0, end.1), (end.0 + 5.0, end.1), COLORS[1], 2.0, 1.0);
                }
            }
            chart.dot(top, 4.5, COLORS[0]);
        }
        chart.close();
        chart.finish()
    }
}

fn color(index: usize) -> &'static str {
    COLORS[index % COLORS.len()]
}

fn dashes(index: usize) -> &'static str {
    DASHES[index / COLORS.len() % DASHES.len()]
}
