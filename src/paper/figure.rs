//! The paper's figures with their statements, and their reproductions: measured numbers with bounds, and the values of the pictures.

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
}

impl Figure {
    /// All figures in order. Arguments of the paper without a figure come last.
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

    /// Number and subject, for example `Figure 2: power iteration`. Arguments of the paper without a figure have no number.
    pub fn title(self) -> &'static str {
        WORDS[self as usize][1]
    }

    /// The paper's statement about the figure, in our words.
    pub fn statement(self) -> &'static str {
        WORDS[self as usize][2]
    }
}

/// Name on the command line, title and statement of each figure, in the order of [`Figure::ALL`].
const WORDS: [[&str; 3]; Figure::ALL.len()] = [
    [
        "fig2",
        "Figure 2: power iteration",
        "A photo of a folded sheet, projected back again and again, shrinks to one spot: the principal eigenvector \
         of the light transport matrix, a pattern whose photo is itself.",
    ],
    [
        "fig4",
        "Figure 4: segmentation of a folded sheet",
        "50 photos and ten eigenvectors split a folded sheet of 100×100 pixels where no light is exchanged; six \
         and ten groups cut the same sheets horizontally.",
    ],
    [
        "fig5",
        "Figure 5: pixels by their eigenvector entries",
        "The entries of the leading eigenvectors at a pixel tell with which others it exchanges light: pixels \
         of one fold have alike entries, wherever they are in the photo.",
    ],
    [
        "fig6",
        "Figure 6: patches apart in the photo",
        "Groups follow the light and not the picture: patches that are occluded from each other are two groups, and \
         patches that are apart in the photo, but light each other, share one.",
    ],
    [
        "fig8",
        "Figure 8: an egg carton",
        "50 blurred photos divide an egg carton into ten groups, which follow its cells. With eggs in it light \
         takes other ways, and the groups change.",
    ],
    [
        "fig9",
        "Figure 9: the photos of a segmentation",
        "The photos of the segmentation of the empty carton in the order in which they were taken, each made from \
         those before.",
    ],
    [
        "fig10",
        "Figure 10: the photos of a compensation",
        "The photos of the compensation out of focus in the order in which they were taken: eight bring nearly what \
         twelve do.",
    ],
    [
        "fig11",
        "Figure 11: compensation",
        "Five photos are enough to find a pattern under which a corner of two white walls looks like a given \
         picture, interreflections included.",
    ],
    [
        "fig12",
        "Figure 12: compensation out of focus",
        "The same with a projector out of focus: what is to be projected has its edges enhanced, and looks \
         sharp where it lands.",
    ],
    [
        "fig13",
        "Figure 13: bit planes",
        "A projector of one bit shows a sinusoid as stripes. In bit planes, each of what those before could not \
         show, the weighted sum of the photos is that of the sinusoid; but each photo adds its noise.",
    ],
    [
        "random",
        "Random patterns at equal photos",
        "Photos of random patterns tell of the light transport, too, but answers by them converge slowly: each \
         pattern is made without regard to the photos before.",
    ],
    [
        "conditioning",
        "Photos that are projected back as they are",
        "Photos that are projected back unchanged become more and more alike, and the basis that they are is ill \
         conditioned. Each new one is therefore made orthogonal to those before.",
    ],
    [
        "polynomials",
        "Equations 1 to 3: polynomials of the light transport matrix",
        "Whatever k photos of a Krylov method tell is a polynomial of degree k of the matrix: the residual is one with \
         value 1 at 0 that is small where eigenvalues are, and the eigenvalues found are the zeros of another.",
    ],
    [
        "apart",
        "Camera and projector apart",
        "Where camera and projector do not share one viewpoint, the light transport matrix is not symmetric. Photos with the two exchanged are \
         those of its transpose, and light that goes there and back is a symmetric matrix again, by which the same methods apply.",
    ],
    [
        "disparity",
        "Disparity of a nearly coaxial pair",
        "Camera and projector are brought to one viewpoint by a beam splitter, so that the matrix is symmetric; what is left of the disparity \
         between them has to be small.",
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

/// The bound of a measured number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// At least this value.
    AtLeast(f64),
    /// At most this value.
    AtMost(f64),
    /// There is no bound, and the number is only reported.
    Stated,
}

/// A measured number with its bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Quantity and unit.
    pub what: String,
    /// The measured value.
    pub value: f64,
    /// The bound.
    pub limit: Limit,
    /// The known reason why the number may miss its bound; empty if no reason is known.
    pub cause: String,
}

impl Check {
    /// A quantity, with its unit, without a measured value yet.
    pub fn of(what: impl Into<String>) -> Self {
        Self { what: what.into(), value: f64::NAN, limit: Limit::Stated, cause: String::new() }
    }

    /// A number that must be `limit` or more.
    #[must_use]
    pub fn at_least(self, value: f64, limit: f64) -> Self {
        Self { value, limit: Limit::AtLeast(limit), ..self }
    }

    /// A number that must be `limit` or less.
    #[must_use]
    pub fn at_most(self, value: f64, limit: f64) -> Self {
        Self { value, limit: Limit::AtMost(limit), ..self }
    }

    /// A number without a bound.
    #[must_use]
    pub fn stated(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// Adds the reason why the number may miss its bound.
    #[must_use]
    pub fn because(self, cause: impl Into<String>) -> Self {
        Self { cause: cause.into(), ..self }
    }

    /// The reason why the number misses its bound; empty if the bound is met or no reason is known.
    pub fn cause(&self) -> &str {
        if self.is_met() { "" } else { &self.cause }
    }

    /// Whether the number meets its bound. NaN meets no bound, except [`Limit::Stated`].
    pub fn is_met(&self) -> bool {
        match self.limit {
            Limit::AtLeast(limit) => self.value >= limit,
            Limit::AtMost(limit) => self.value <= limit,
            Limit::Stated => true,
        }
    }

    /// The distance by which the number misses its bound; 0 if it meets the bound.
    pub fn shortfall(&self) -> f64 {
        match self.limit {
            _ if self.is_met() => 0.0,
            Limit::AtLeast(limit) => limit - self.value,
            Limit::AtMost(limit) => self.value - limit,
            Limit::Stated => 0.0,
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
            assert!(figure.statement().ends_with('.') || figure.statement().ends_with("suffice."));
        }
    }

    #[test]
    fn bounds_are_met_at_the_bound_and_missed_by_the_difference() {
        assert!(Check::of("purity").at_least(0.99, 0.99).is_met());
        assert!(Check::of("photos").at_most(12.0, 12.0).is_met());
        let missed = [Check::of("purity").at_least(0.75, 1.0), Check::of("photos").at_most(14.25, 14.0)];
        assert!(missed.iter().all(|check| !check.is_met() && check.shortfall() == 0.25));
        assert!(Check::of("seconds").stated(7.0).is_met());
        let of = |value: f64| Check::of("purity").at_least(value, 0.99).because("the lamp is off");
        assert_eq!([of(1.0).cause(), of(0.5).cause()], ["", "the lamp is off"]);
    }

    #[test]
    fn not_a_number_meets_no_bound() {
        let missed = [Check::of("a").at_least(f64::NAN, 0.0), Check::of("b").at_most(f64::NAN, 1.0)];
        assert!(missed.iter().all(|check| !check.is_met() && check.shortfall().is_nan()));
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
