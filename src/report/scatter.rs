//! Scatter plots with coloured points; some points are marked and named.

use super::axis::{Axis, Scale};
use super::svg::{Chart, nothing_to_plot};

/// A scatter plot.
#[derive(Clone, Debug, Default)]
pub struct ScatterPlot {
    /// Label of the horizontal axis.
    pub x_label: String,
    /// Label of the vertical axis.
    pub y_label: String,
    /// Points with their colours (sRGB), drawn in this order.
    pub points: Vec<((f64, f64), [u8; 3])>,
    /// Marked points with their names.
    pub marked: Vec<((f64, f64), String)>,
}

impl ScatterPlot {
    /// The plot as an SVG document. Equal plots give equal bytes.
    pub fn render(&self) -> String {
        let all = || self.points.iter().map(|(at, _)| *at).chain(self.marked.iter().map(|(at, _)| *at));
        let (Some(x), Some(y)) = (
            Axis::around(Scale::Linear, all().map(|at| at.0), 8),
            Axis::around(Scale::Linear, all().map(|at| at.1), 6),
        ) else {
            return nothing_to_plot();
        };
        let mut chart = Chart::new(x, y, &self.x_label, &self.y_label, &[]);
        for (at, [red, green, blue]) in &self.points {
            if let Some(place) = chart.place(*at) {
                chart.dot(place, 2.0, &format!("#{red:02x}{green:02x}{blue:02x}"));
            }
        }
        for (at, name) in &self.marked {
            if let Some(place) = chart.place(*at) {
                chart.ring(place, 6.5);
                chart.note((place.0 + 10.0, place.1 - 8.0), name);
            }
        }
        chart.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_drawn_and_marked_ones_are_named() {
        let plot = ScatterPlot {
            points: vec![((0.0, 1.0), [1, 2, 3]), ((2.0, -1.0), [255, 0, 0]), ((f64::NAN, 0.0), [0; 3])],
            marked: vec![((1.0, 0.5), "3 & 4".into())],
            ..ScatterPlot::default()
        };
        let svg = plot.render();
        assert_eq!((svg.matches("<circle").count(), svg.matches("#ff0000").count()), (3, 1), "{svg}");
        assert!(svg.contains("3 &amp; 4"));
        assert!(ScatterPlot::default().render().contains("no values"));
    }
}
