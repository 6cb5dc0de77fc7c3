//! Scatter plots with coloured points; some points are marked and named.

use super::axis::{Axis, Scale};
use super::svg::{Chart, Layout, nothing_to_plot};

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
    /// The pixels of the points, and the indices of the eigenvectors along the axes, from 0; `None` if the points are not pixels.
    pub pixels: Option<(Vec<usize>, [usize; 2])>,
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
        let mut chart = Chart::new(Layout::FULL, (x, y), [&self.x_label, &self.y_label], &[]);
        let places: Vec<_> = self.points.iter().map(|(at, _)| chart.place(*at)).collect();
        if let Some((pixels, axes)) = &self.pixels {
            let told = pixels.iter().zip(&places).filter(|(_, place)| place.is_some());
            chart.open_pixels(&told.map(|(&pixel, _)| pixel).collect::<Vec<_>>(), *axes);
        }
        for (place, (_, [red, green, blue])) in places.into_iter().zip(&self.points) {
            if let Some(place) = place {
                chart.dot(place, 2.0, &format!("#{red:02x}{green:02x}{blue:02x}"));
            }
        }
        if self.pixels.is_some() {
            chart.close();
        }
        let marked: Vec<((f64, f64), &str)> =
            self.marked.iter().filter_map(|(at, name)| Some((chart.place(*at)?, name.as_str()))).collect();
        marked.iter().for_each(|(place, _)| chart.ring(*place, 6.5));
        chart.names(&marked);
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
