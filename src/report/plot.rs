//! Plots of a report as SVG: residuals over photos, and spectra.

use super::axis::{Axis, Scale, Tick};
use super::svg::{Chart, nothing_to_plot};

/// Line colours that colour-blind readers can distinguish, on white and on black.
const COLORS: [&str; 8] =
    ["#2b87c4", "#dd6b1f", "#149a74", "#c671a3", "#d99c0b", "#7a6fd0", "#5cb8e6", "#8b8b35"];

/// Dash patterns of successive rounds through the colours.
const DASHES: [&str; 3] = ["", "7 5", "2 5"];

/// Maximum number of points at which a line is drawn with dots.
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
    /// The lines; a legend names them if there are several.
    pub series: Vec<Series>,
    /// Dashed horizontal lines with a note, e.g. the noise floor.
    pub marks: Vec<(f64, String)>,
}

/// One line.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points (x, y). NaN leaves a gap, as do values ≤ 0 on a logarithmic axis.
    pub points: Vec<(f64, f64)>,
}

impl LinePlot {
    /// The plot as an SVG document. Equal plots give equal bytes.
    pub fn render(&self) -> String {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let scale = if self.logarithmic { Scale::Log } else { Scale::Linear };
        let heights = points().map(|point| point.1).chain(self.marks.iter().map(|mark| mark.0));
        let (Some(x), Some(y)) =
            (Axis::around(Scale::Linear, points().map(|point| point.0), 6), Axis::around(scale, heights, 6))
        else {
            return nothing_to_plot();
        };
        let legend: Vec<_> = if self.series.len() < 2 {
            Vec::new()
        } else {
            self.series
                .iter()
                .enumerate()
                .map(|(index, series)| (color(index), dashes(index), series.name.as_str()))
                .collect()
        };
        let mut chart = Chart::new(x, y, &self.x_label, &self.y_label, &legend);
        for (value, note) in &self.marks {
            chart.horizontal_mark(*value, note);
        }
        for (index, series) in self.series.iter().enumerate() {
            let places: Vec<_> = series.points.iter().map(|&point| chart.place(point)).collect();
            for run in places.split(Option::is_none) {
                let run: Vec<(f64, f64)> = run.iter().flatten().copied().collect();
                if run.len() > 1 {
                    chart.polyline(&run, color(index), dashes(index));
                }
                if run.len() == 1 || series.points.len() <= MOST_DOTS {
                    run.iter().for_each(|&place| chart.dot(place, 3.2, color(index)));
                }
            }
        }
        chart.finish()
    }
}

/// Values over their index, as stems from zero with error bars, e.g. eigenvalues ± residuals.
#[derive(Clone, Debug, Default)]
pub struct StemPlot {
    /// Label of the horizontal axis.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// The values in order; the first has number 1.
    pub values: Vec<f64>,
    /// Half the length of each value's error bar; may have fewer entries than `values`, or none.
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
        let mut chart = Chart::new(x, y, &self.x_label, &self.y_label, &[]);
        if let (Some(left), Some(right)) = (chart.place((0.4, 0.0)), chart.place((count as f64 + 0.6, 0.0))) {
            chart.segment(left, right, "currentColor", 1.2, 0.6);
        }
        for (index, &value) in self.values.iter().enumerate() {
            let number = index as f64 + 1.0;
            let (Some(base), Some(top)) = (chart.place((number, 0.0)), chart.place((number, value))) else {
                continue;
            };
            chart.segment(base, top, COLORS[0], 2.0, 0.45);
            let bar = [value - error(index), value + error(index)].map(|end| chart.place((number, end)));
            if let [Some(low), Some(high)] = bar
                // The dot would hide a shorter bar.
                && low.1 - high.1 > 9.0
            {
                chart.segment(low, high, COLORS[1], 2.0, 1.0);
                for end in [low, high] {
                    chart.segment((end.0 - 5.0, end.1), (end.0 + 5.0, end.1), COLORS[1], 2.0, 1.0);
                }
            }
            chart.dot(top, 4.5, COLORS[0]);
        }
        chart.finish()
    }
}

fn color(index: usize) -> &'static str {
    COLORS[index % COLORS.len()]
}

fn dashes(index: usize) -> &'static str {
    DASHES[index / COLORS.len() % DASHES.len()]
}
