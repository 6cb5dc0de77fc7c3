//! The paper's figures and their reproductions: numbers and planes of values, before any painting.

use super::check::Check;
use super::rig::Rig;
use crate::image::Resolution;
use crate::operator::Product;
use crate::report::plot::{LinePlot, Series};

/// A figure of the paper that can be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Figure {
    /// Power iteration.
    Fig2,
    /// Segmentation of the zigzag.
    Fig4,
    /// Pixels as points in the space of eigenvectors.
    Fig5,
    /// Two sheets of paper.
    Fig6,
    /// The egg carton.
    Fig8,
    /// The photos of a segmentation.
    Fig9,
    /// The photos of a compensation.
    Fig10,
    /// Compensation in focus.
    Fig11,
    /// Compensation out of focus.
    Fig12,
    /// Bit planes.
    Fig13,
    /// Random patterns beside those of Krylov methods.
    Random,
    /// How independent photos are.
    Conditioning,
    /// The polynomials behind the methods.
    Polynomials,
    /// Camera and projector apart: the transpose by exchanging them.
    Apart,
    /// What is left of the disparity of a coaxial pair.
    Disparity,
}

impl Figure {
    /// All figures in order; those that the paper argues with and does not show come last.
    pub const ALL: [Self; 15] = [
        Self::Fig2,
        Self::Fig4,
        Self::Fig5,
        Self::Fig6,
        Self::Fig8,
        Self::Fig9,
        Self::Fig10,
        Self::Fig11,
        Self::Fig12,
        Self::Fig13,
        Self::Random,
        Self::Conditioning,
        Self::Polynomials,
        Self::Apart,
        Self::Disparity,
    ];
}

/// A reproduced figure.
#[derive(Clone, Debug)]
pub struct Reproduced {
    /// The figure.
    pub figure: Figure,
    /// The rig that took the photos.
    pub rig: Rig,
    /// Setting: scene, resolution, photos.
    pub setting: String,
    /// Measured numbers and their bounds.
    pub checks: Vec<Check>,
    /// Pictures.
    pub panels: Vec<Panel>,
    /// Plots.
    pub plots: Vec<Plot>,
    /// Contact sheets of its photos.
    pub strips: Vec<Strip>,
    /// Number of photos of the result: products with the light transport matrix.
    pub photos: usize,
    /// Frames that the virtual camera took for all products of the figure, comparisons with other methods among them; calibration is not.
    /// 0 by an ideal rig, which takes none.
    pub frames: u64,
    /// Wall-clock time, in seconds.
    pub seconds: f64,
}

impl Reproduced {
    /// A figure in front of which nothing has been measured yet.
    pub(super) fn of(figure: Figure, rig: Rig) -> Self {
        let (checks, panels, plots, strips) = Default::default();
        Self {
            figure,
            rig,
            setting: String::new(),
            checks,
            panels,
            plots,
            strips,
            photos: 0,
            frames: 0,
            seconds: 0.0,
        }
    }

    /// Whether every number meets its bound.
    pub fn is_met(&self) -> bool {
        self.checks.iter().all(Check::is_met)
    }
}

/// A picture of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Suffix of its file name, e.g. `groups-2`.
    pub name: String,
    /// Description, with the unit of the values.
    pub caption: String,
    /// Resolution.
    pub resolution: Resolution,
    /// The values.
    pub content: Content,
}

/// The values of a picture, one per pixel.
#[derive(Clone, Debug)]
pub enum Content {
    /// Labels of groups; 255 is a masked pixel.
    Labels(Vec<u8>),
    /// Signed values around 0.
    Signed(Vec<f64>),
    /// Nonnegative amounts.
    Amounts(Vec<f64>),
    /// Light, developed as a photo.
    Light {
        /// Values in the unit that the caption names.
        values: Vec<f64>,
        /// The value shown as white; `None` selects it by automatic exposure.
        white: Option<f64>,
    },
}

/// Lines over a common axis.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Text below the plot.
    pub caption: String,
    /// The lines.
    pub lines: LinePlot,
}

impl Plot {
    /// Lines over the axis `x_label`, with a logarithmic axis `y_label`.
    pub(super) fn logarithmic(
        caption: impl Into<String>,
        [x_label, y_label]: [&str; 2],
        series: Vec<Series>,
    ) -> Self {
        let (x_label, y_label) = (x_label.into(), y_label.into());
        let lines = LinePlot { x_label, y_label, logarithmic: true, series, ..LinePlot::default() };
        Self { caption: caption.into(), lines }
    }
}

/// Photos in the order in which they were taken, for a contact sheet.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Text above the photos.
    pub caption: String,
    /// Resolution of each pattern and photo.
    pub resolution: Resolution,
    /// The patterns and their photos, as the method requested and received them; either may be signed.
    pub photos: Vec<Product>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_order_and_begin_the_titles() {
        assert!(Figure::ALL.is_sorted());
        for figure in Figure::ALL {
            if let Some(number) = figure.name().strip_prefix("fig") {
                assert!(figure.title().starts_with(&format!("Figure {number}: ")), "{}", figure.title());
            }
            assert!(figure.statement().ends_with('.') || figure.statement().ends_with("suffice."));
        }
    }
}
