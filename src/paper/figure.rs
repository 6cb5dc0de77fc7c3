//! The paper's figures and their reproductions: numbers and planes of values, before any painting.

use super::bench::Rig;
use super::check::Check;
use crate::image::Resolution;
use crate::operator::Product;
use crate::report::plot::LinePlot;

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
}

impl Figure {
    /// All figures in order.
    pub const ALL: [Self; 10] = [
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
    ];

    /// Name on the command line: `fig2`.
    pub fn name(self) -> &'static str {
        self.words()[0]
    }

    /// Number and subject: `Figure 2: power iteration`.
    pub fn title(self) -> &'static str {
        self.words()[1]
    }

    /// The paper's statement about the figure, in our words.
    pub fn statement(self) -> &'static str {
        self.words()[2]
    }

    /// Name, title and statement.
    fn words(self) -> [&'static str; 3] {
        match self {
            Self::Fig2 => [
                "fig2",
                "Figure 2: power iteration",
                "A photo, projected back again and again, becomes the principal eigenvector of the light transport \
                 matrix: a pattern whose photo is itself. It has no negative pixel.",
            ],
            Self::Fig4 => [
                "fig4",
                "Figure 4: segmentation of a folded sheet",
                "50 photos and ten eigenvectors split a folded sheet of 100×100 pixels where no light is exchanged; six \
                 and ten groups cut the same sheets horizontally.",
            ],
            Self::Fig5 => [
                "fig5",
                "Figure 5: pixels by their eigenvector entries",
                "The entries of the leading eigenvectors at a pixel tell with which others it exchanges light: pixels \
                 of one fold have alike entries, wherever they are in the photo.",
            ],
            Self::Fig6 => [
                "fig6",
                "Figure 6: patches apart in the photo",
                "Groups follow the light and not the picture: patches that are apart in the photo, but light each \
                 other, share a group.",
            ],
            Self::Fig8 => [
                "fig8",
                "Figure 8: an egg carton",
                "100 photos and 20 eigenvectors find the cells of an egg carton, one group each. With eggs in it light \
                 takes other ways, and the groups change.",
            ],
            Self::Fig9 => [
                "fig9",
                "Figure 9: the photos of a segmentation",
                "The photos of a segmentation in the order in which they were taken, each made from those before.",
            ],
            Self::Fig10 => [
                "fig10",
                "Figure 10: the photos of a compensation",
                "The photos of a compensation in the order in which they were taken: five suffice.",
            ],
            Self::Fig11 => [
                "fig11",
                "Figure 11: compensation",
                "Five photos are enough to find a pattern under which a corner of two white walls looks like a given \
                 picture, interreflections included.",
            ],
            Self::Fig12 => [
                "fig12",
                "Figure 12: compensation out of focus",
                "The same with a projector out of focus: what is to be projected has its edges enhanced, and looks \
                 sharp where it lands.",
            ],
            Self::Fig13 => [
                "fig13",
                "Figure 13: bit planes",
                "A projector of one bit shows a sinusoid as stripes. In bit planes, each of what those before could not \
                 show, the weighted sum of the photos is that of the sinusoid; but each photo adds its noise.",
            ],
        }
    }
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
    /// Wall-clock time, in seconds.
    pub seconds: f64,
}

impl Reproduced {
    /// A figure in front of which nothing has been measured yet.
    pub(super) fn of(figure: Figure, rig: Rig) -> Self {
        let (checks, panels, plots, strips) = Default::default();
        Self { figure, rig, setting: String::new(), checks, panels, plots, strips, photos: 0, seconds: 0.0 }
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
            let number = figure.name().trim_start_matches("fig");
            assert!(figure.title().starts_with(&format!("Figure {number}: ")), "{}", figure.title());
            assert!(figure.statement().ends_with('.') || figure.statement().ends_with("suffice."));
        }
    }
}
