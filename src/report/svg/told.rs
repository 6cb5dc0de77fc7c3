//! The data of a drawing for the page's scripts: the values of curves, and the pixels of points.

use std::fmt::Write;

use super::{Chart, escape};

impl Chart {
    /// Begins a curve whose values the page's scripts show. `points` are its values. Values without a place in the drawing are left out.
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

    /// Begins points that stand for pixels.
    pub fn open_pixels(&mut self, pixels: &[usize], axes: [usize; 2]) {
        let pixels: Vec<String> = pixels.iter().map(usize::to_string).collect();
        draw!(self.body, r#"<g data-axes="{},{}" data-pixels="{}">"#, axes[0], axes[1], pixels.join(" "));
    }

    /// Ends the curve or the points that were begun last.
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
}
