//! The paper's figures with their statements, and their reproductions: measured numbers with bounds, and the values of the pictures.

use super::check::Check;
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
    /// Random patterns compared with the patterns of Krylov methods.
    Random,
    /// The independence of photos.
    Conditioning,
    /// The polynomials behind the methods.
    Polynomials,
    /// Camera and projector apart, with photos of the transpose by exchanging the devices.
    Apart,
    /// The disparity that remains in a coaxial pair.
    Disparity,
    /// Eigenvectors of equal eigenvalues.
    Mixture,
}

impl Figure {
    /// All figures in order. Remarks of the paper without a figure come last.
    pub const ALL: [Self; 16] = [
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
        Self::Mixture,
    ];
}

/// A reproduced figure.
#[derive(Clone, Debug)]
pub struct Reproduced {
    /// The figure.
    pub figure: Figure,
    /// The rig that took the photos.
    pub rig: Rig,
    /// The setting: scene, resolution, number of photos.
    pub setting: String,
    /// Measured numbers and their bounds.
    pub checks: Vec<Check>,
    /// Pictures.
    pub panels: Vec<Panel>,
    /// Plots.
    pub plots: Vec<Plot>,
    /// Contact sheets of the photos.
    pub strips: Vec<Strip>,
    /// The number of photos behind the result, which are products with the light transport matrix.
    pub photos: usize,
    /// The number of frames that the virtual camera took for all products of the figure. It includes comparisons with other methods, but
    /// not the calibration. It is 0 for an ideal rig, which takes no frames.
    pub frames: u64,
    /// Wall-clock time, in seconds.
    pub seconds: f64,
}

impl Reproduced {
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
        /// The value that is shown as white; `None` for automatic exposure.
        white: Option<f64>,
    },
}

/// The points of a line.
pub(super) type Points = Vec<(f64, f64)>;

/// Points with the number of each value, from 1, and the value.
pub(super) fn counted(values: &[f64]) -> Points {
    values.iter().enumerate().map(|(index, &value)| (index as f64 + 1.0, value)).collect()
}

/// The first number from which all values of a curve are good; infinite if its last value is not good.
pub(super) fn good_from(curve: &[(f64, f64)], is_good: impl Fn(f64) -> bool) -> f64 {
    let from = curve.iter().rposition(|&(_, value)| !is_good(value)).map_or(0, |at| at + 1);
    curve.get(from).map_or(f64::INFINITY, |&(number, _)| number)
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
    pub(super) fn linear(
        caption: impl Into<String>,
        [x_label, y_label]: [&str; 2],
        lines: impl IntoIterator<Item = (impl Into<String>, Points)>,
    ) -> Self {
        let series = lines.into_iter().map(|(name, points)| Series { name: name.into(), points }).collect();
        let (x_label, y_label) = (x_label.into(), y_label.into());
        Self { caption: caption.into(), lines: LinePlot { x_label, y_label, series, ..LinePlot::default() } }
    }

    /// The plot with a logarithmic vertical axis, labelled `y_label`.
    pub(super) fn logarithmic(
        caption: impl Into<String>,
        labels: [&str; 2],
        lines: impl IntoIterator<Item = (impl Into<String>, Points)>,
    ) -> Self {
        let mut plot = Self::linear(caption, labels, lines);
        plot.lines.logarithmic = true;
        plot
    }

    pub(super) fn marked(mut self, value: f64, name: &str) -> Self {
        self.lines.marks.push((value, name.into()));
        self
    }
}

/// Photos in the order in which they were taken, for a contact sheet.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Text above the photos.
    pub caption: String,
    /// Resolution of each pattern and photo.
    pub resolution: Resolution,
    /// The patterns and their photos, in the values that the method requested and received. Both may be signed.
    pub photos: Vec<Product>,
}

impl Figure {
    /// Name on the command line: `fig2`.
    pub fn name(self) -> &'static str {
        WORDS[self as usize][0]
    }

    /// Number and subject, for example `Figure 2: power iteration`. Remarks of the paper without a figure have no number.
    pub fn title(self) -> &'static str {
        WORDS[self as usize][1]
    }

    /// The statement of the paper, with its section, in our words, and the part of it that is ours.
    pub fn statement(self) -> &'static str {
        WORDS[self as usize][2]
    }
}

/// Name on the command line, title and statement of each figure, in the order of [`Figure::ALL`].
const WORDS: [[&str; 3]; Figure::ALL.len()] = [
    [
        "fig2",
        "Figure 2: power iteration",
        "Figure 2: a folded sheet is lit white, and each photo is projected back. In that scene the patterns shrink to one point of a concave \
         fold, which seems to be the most specular one. The last pattern is the principal eigenvector: its photo is the pattern times the \
         eigenvalue (section 5.1). It is nowhere negative (appendix A).",
    ],
    [
        "fig4",
        "Figure 4: segmentation of a folded sheet",
        "Section 8.2: 50 photos beside black and white, and ten eigenvectors, divide a sheet in zigzag folds at 100×100 pixels. Two groups \
         are its two concave parts. Six groups cut these parts horizontally. Ten do so, too, with some vertical cuts.",
    ],
    [
        "fig5",
        "Figure 5: pixels by their eigenvector entries",
        "Figure 5: the entries of the smallest generalized eigenvectors at a pixel form a feature vector. Pixels whose feature vectors are \
         close are likely to be in one group (also section 5.2).",
    ],
    [
        "fig6",
        "Figure 6: one sheet behind another",
        "Figure 6: two regions exchange no light, and one hides a part of the other from the camera. Each is one group, although the patches \
         of the rear one do not touch in the photo. Light behind the front sheet connects them (region 3), and its back side reflects light \
         to the rear sheet (region 2). Section 8.2: 128×128 pixels and 50 photos.",
    ],
    [
        "fig8",
        "Figure 8: an egg carton",
        "Figure 8: ten groups of an egg carton with eggs. Without eggs each cell is a group. An egg changes the groups, because it is convex \
         (section 8.2). Patterns and photos are blurred a little. Section 8.2 counts 50 photos. The caption counts one hundred photos and \
         twenty eigenvectors.",
    ],
    [
        "fig9",
        "Figure 9: the photos of a segmentation",
        "Figure 9: the first five patterns of the segmentation of the empty carton, each above its photo. Each photo makes the next pattern \
         (sections 4, 5.2 and 7.1).",
    ],
    [
        "fig10",
        "Figure 10: the photos of a compensation",
        "Figure 10: the first five patterns and photos of the compensation of figure 12.",
    ],
    [
        "fig11",
        "Figure 11: compensation",
        "Section 8.3 and figure 11: indirect light near the fold of a cardboard at a right angle washes out a projected image. MINRES \
         converges within about five photos, and the photo of its pattern is much nearer to the target.",
    ],
    [
        "fig12",
        "Figure 12: compensation out of focus",
        "Section 8.3 and figure 12: a scene with much indirect light, whose back wall is out of focus for camera and projector. MINRES \
         converges after about eight iterations, and its residual stays above zero. Negative values of the pattern are set to zero. The \
         photo approximates the target, with sharp detail. Section 6.3 proposes to map the target to [α, 1], without a value of α.",
    ],
    [
        "fig13",
        "Figure 13: bit planes",
        "Figure 13 and section 7.2: a binary projector shows a sinusoid with large rounding errors. Binary patterns, each of the error that \
         those before left, have the right photo as the weighted sum of their photos. Photos of small weight drown in the noise of those of \
         large weight.",
    ],
    [
        "random",
        "Random patterns at equal photos",
        "Section 6.1: combinations of photos of random patterns converge slowly to the compensating pattern, and a Krylov subspace that starts \
         from the target is built instead. The comparison for segmentation is ours.",
    ],
    [
        "conditioning",
        "Photos that are projected back as they are",
        "Section 7.1: photos that are projected back become more and more alike, and the basis that they form is ill conditioned. Each photo is \
         therefore made orthogonal to all photos before it.",
    ],
    [
        "polynomials",
        "Polynomials of the light transport matrix",
        "Section 4: what a Krylov subspace contains is a polynomial of the matrix times the first pattern (equation 1). With leading coefficient \
         1 and the least norm, the zeros of the polynomial estimate eigenvalues (Arnoldi). With value 1 at 0, it is the residual of GMRES.",
    ],
    [
        "apart",
        "Camera and projector apart",
        "Figure 1: the matrix of a camera and a projector that are apart is not symmetric. Its transpose belongs to the devices exchanged \
         (sections 3 and 4), which section 9 leaves to future work. The symmetric matrices A Aᵀ and AᵀA and their groups are ours.",
    ],
    [
        "disparity",
        "Disparity of a nearly coaxial pair",
        "Section 8.1: a beam splitter aligns camera and projector, and methods for symmetric matrices need this alignment to be accurate. How \
         much misalignment they bear is our measurement.",
    ],
    [
        "mixture",
        "Appendix B: equal eigenvalues",
        "Appendix B: where the largest eigenvalue is not distinct, power iteration need not converge to one vector. Its photos become a linear \
         combination of the principal eigenvectors. Appendix A: a matrix that can be divided (reducible) has such eigenvalues.",
    ],
];

/// The kind of rig that measures the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rig {
    /// A rig that shows any real-valued pattern and measures the light without error.
    Ideal,
    /// An 8-bit projector and a 14-bit camera with realistic errors, calibrated from captures.
    Virtual,
}

impl Rig {
    /// The name of the rig on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Virtual => "virtual",
        }
    }
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
            let statement = figure.statement();
            let has_source =
                ["Section ", "Figure ", "Appendix "].iter().any(|word| statement.starts_with(word));
            assert!(has_source && statement.ends_with('.'), "{statement}");
        }
    }

    #[test]
    fn fewest_photos_are_those_after_the_last_impure_ones() {
        let fewest = |curve: &[(f64, f64)]| good_from(curve, |purity| purity >= 0.99);
        assert_eq!(fewest(&[(4.0, 0.5), (5.0, 1.0), (6.0, 0.9), (7.0, 0.99), (50.0, 1.0)]), 7.0);
        assert_eq!(fewest(&[(4.0, 1.0), (50.0, 1.0)]), 4.0);
        assert_eq!(fewest(&[(4.0, 1.0), (50.0, 0.7)]), f64::INFINITY);
    }

    #[test]
    fn photos_until_as_good_are_counted_from_the_last_that_was_worse() {
        let curve = [(1.0, 0.5), (2.0, 0.1), (3.0, 0.2), (4.0, 0.05)];
        let photos_to = |wanted: f64| good_from(&curve, |apart| apart <= wanted);
        assert_eq!(photos_to(0.15), 4.0);
        assert_eq!(photos_to(0.6), 1.0);
        assert_eq!(photos_to(0.01), f64::INFINITY);
    }
}
