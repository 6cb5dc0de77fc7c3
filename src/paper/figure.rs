//! A figure of the paper, and what became of it here: numbers and planes of values, not yet pictures.

use super::bench::Rig;
use super::check::Check;
use crate::image::Resolution;
use crate::operator::Product;

/// A figure of the paper that can be made again.
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
    /// All of them, in order.
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

    /// Its name on the command line: `fig2`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fig2 => "fig2",
            Self::Fig4 => "fig4",
            Self::Fig5 => "fig5",
            Self::Fig6 => "fig6",
            Self::Fig8 => "fig8",
            Self::Fig9 => "fig9",
            Self::Fig10 => "fig10",
            Self::Fig11 => "fig11",
            Self::Fig12 => "fig12",
            Self::Fig13 => "fig13",
        }
    }

    /// Its number and subject: `Figure 2: power iteration`.
    pub fn title(self) -> &'static str {
        match self {
            Self::Fig2 => "Figure 2: power iteration",
            Self::Fig4 => "Figure 4: segmentation of a folded sheet",
            Self::Fig5 => "Figure 5: pixels by their eigenvector entries",
            Self::Fig6 => "Figure 6: patches apart in the photo",
            Self::Fig8 => "Figure 8: an egg carton",
            Self::Fig9 => "Figure 9: the photos of a segmentation",
            Self::Fig10 => "Figure 10: the photos of a compensation",
            Self::Fig11 => "Figure 11: compensation",
            Self::Fig12 => "Figure 12: compensation out of focus",
            Self::Fig13 => "Figure 13: bit planes",
        }
    }

    /// What the paper says that its figure shows, in our words.
    pub fn statement(self) -> &'static str {
        match self {
            Self::Fig2 => {
                "A photo, projected back again and again, becomes the principal eigenvector of the light transport \
                 matrix: a pattern whose photo is itself. It has no negative pixel."
            }
            Self::Fig4 => {
                "50 photos and ten eigenvectors split a folded sheet of 100×100 pixels where no light is exchanged; six \
                 and ten groups cut the same sheets horizontally."
            }
            Self::Fig5 => {
                "The entries of the leading eigenvectors at a pixel tell with which others it exchanges light: pixels \
                 of one fold have alike entries, wherever they are in the photo."
            }
            Self::Fig6 => {
                "Groups follow the light and not the picture: patches that are apart in the photo, but light each \
                 other, share a group."
            }
            Self::Fig8 => {
                "100 photos and 20 eigenvectors find the cells of an egg carton, one group each. With eggs in it light \
                 takes other ways, and the groups change."
            }
            Self::Fig9 => {
                "The photos of a segmentation in the order in which they were taken, each made from those before."
            }
            Self::Fig10 => {
                "The photos of a compensation in the order in which they were taken: five suffice."
            }
            Self::Fig11 => {
                "Five photos are enough to find a pattern under which a corner of two white walls looks like a given \
                 picture, interreflections included."
            }
            Self::Fig12 => {
                "The same with a projector out of focus: what is to be projected has its edges enhanced, and looks \
                 sharp where it lands."
            }
            Self::Fig13 => {
                "A projector of one bit shows a sinusoid as stripes. In bit planes, each of what those before could not \
                 show, the weighted sum of the photos is that of the sinusoid; but each photo adds its noise."
            }
        }
    }
}

/// A figure made again.
#[derive(Clone, Debug)]
pub struct Reproduced {
    /// Which.
    pub figure: Figure,
    /// By which rig.
    pub rig: Rig,
    /// How it was made: scene, pixels, photos.
    pub setting: String,
    /// Numbers and their bounds.
    pub checks: Vec<Check>,
    /// Pictures.
    pub panels: Vec<Panel>,
    /// Plots.
    pub plots: Vec<Curves>,
    /// Its photos in order.
    pub strips: Vec<Strip>,
    /// Photos that the answer took: products with the light transport matrix.
    pub photos: usize,
    /// Wall-clock time, in seconds.
    pub seconds: f64,
}

impl Reproduced {
    /// Whether every number is what it has to be.
    pub fn is_met(&self) -> bool {
        self.checks.iter().all(Check::is_met)
    }
}

/// A picture to be.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Part of its file's name, e.g. `groups-2`.
    pub name: String,
    /// What it shows, with the unit of its values.
    pub caption: String,
    /// Its pixels.
    pub resolution: Resolution,
    /// What is in them.
    pub content: Content,
}

/// The values of a picture, one for each pixel.
#[derive(Clone, Debug)]
pub enum Content {
    /// Groups; 255 is a masked pixel.
    Labels(Vec<u8>),
    /// Values of both signs around 0.
    Signed(Vec<f64>),
    /// Amounts from 0.
    Amounts(Vec<f64>),
    /// Light: shown as the eye sees it, `white` being white.
    Light {
        /// In the unit that the caption names.
        values: Vec<f64>,
        /// What is shown as white; `None`: what is brighter than almost all of it.
        white: Option<f64>,
    },
}

/// Lines over a common axis.
#[derive(Clone, Debug)]
pub struct Curves {
    /// Below it.
    pub caption: String,
    /// Along the horizontal axis, with the unit.
    pub x_label: String,
    /// Along the vertical axis, with the unit.
    pub y_label: String,
    /// Whether the vertical axis is logarithmic.
    pub logarithmic: bool,
    /// The lines.
    pub lines: Vec<Curve>,
    /// Heights to be marked, with notes.
    pub marks: Vec<(f64, String)>,
}

/// One line.
#[derive(Clone, Debug)]
pub struct Curve {
    /// In the legend.
    pub name: String,
    /// (x, y)
    pub points: Vec<(f64, f64)>,
}

/// Photos in the order in which they were taken.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Above it.
    pub caption: String,
    /// Pixels of each.
    pub resolution: Resolution,
    /// What was projected, and what was seen.
    pub shots: Vec<Shot>,
}

/// A pattern and its photo, as the method asked and was answered: either may be signed.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What was projected.
    pub pattern: Vec<f64>,
    /// What was seen.
    pub photo: Vec<f64>,
}

impl From<Product> for Shot {
    fn from(product: Product) -> Self {
        Self { pattern: product.from, photo: product.to }
    }
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
