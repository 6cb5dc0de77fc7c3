//! Names, titles and statements of the figures: what the paper says about each, in our words.

use super::figure::Figure;

impl Figure {
    /// Name on the command line: `fig2`.
    pub fn name(self) -> &'static str {
        words(self)[0]
    }

    /// Number and subject: `Figure 2: power iteration`. What the paper does not show has no number.
    pub fn title(self) -> &'static str {
        words(self)[1]
    }

    /// The paper's statement about the figure, in our words.
    pub fn statement(self) -> &'static str {
        words(self)[2]
    }
}

/// Name on the command line, title and statement.
fn words(figure: Figure) -> [&'static str; 3] {
    match figure {
        Figure::Fig2 => FIG2,
        Figure::Fig4 => FIG4,
        Figure::Fig5 => FIG5,
        Figure::Fig6 => FIG6,
        Figure::Fig8 => FIG8,
        Figure::Fig9 => FIG9,
        Figure::Fig10 => FIG10,
        Figure::Fig11 => FIG11,
        Figure::Fig12 => FIG12,
        Figure::Fig13 => FIG13,
        Figure::Random => RANDOM,
        Figure::Conditioning => CONDITIONING,
        Figure::Polynomials => POLYNOMIALS,
        Figure::Apart => APART,
        Figure::Disparity => DISPARITY,
    }
}

const FIG2: [&str; 3] = [
    "fig2",
    "Figure 2: power iteration",
    "A photo of a folded sheet, projected back again and again, shrinks to one spot: the principal eigenvector \
     of the light transport matrix, a pattern whose photo is itself.",
];

const FIG4: [&str; 3] = [
    "fig4",
    "Figure 4: segmentation of a folded sheet",
    "50 photos and ten eigenvectors split a folded sheet of 100×100 pixels where no light is exchanged; six \
     and ten groups cut the same sheets horizontally.",
];

const FIG5: [&str; 3] = [
    "fig5",
    "Figure 5: pixels by their eigenvector entries",
    "The entries of the leading eigenvectors at a pixel tell with which others it exchanges light: pixels \
     of one fold have alike entries, wherever they are in the photo.",
];

const FIG6: [&str; 3] = [
    "fig6",
    "Figure 6: patches apart in the photo",
    "Groups follow the light and not the picture: patches that are occluded from each other are two groups, and \
     patches that are apart in the photo, but light each other, share one.",
];

const FIG8: [&str; 3] = [
    "fig8",
    "Figure 8: an egg carton",
    "50 blurred photos divide an egg carton into ten groups, which follow its cells. With eggs in it light \
     takes other ways, and the groups change.",
];

const FIG9: [&str; 3] = [
    "fig9",
    "Figure 9: the photos of a segmentation",
    "The photos of the segmentation of the empty carton in the order in which they were taken, each made from \
     those before.",
];

const FIG10: [&str; 3] = [
    "fig10",
    "Figure 10: the photos of a compensation",
    "The photos of the compensation out of focus in the order in which they were taken: eight bring nearly what \
     twelve do.",
];

const FIG11: [&str; 3] = [
    "fig11",
    "Figure 11: compensation",
    "Five photos are enough to find a pattern under which a corner of two white walls looks like a given \
     picture, interreflections included.",
];

const FIG12: [&str; 3] = [
    "fig12",
    "Figure 12: compensation out of focus",
    "The same with a projector out of focus: what is to be projected has its edges enhanced, and looks \
     sharp where it lands.",
];

const FIG13: [&str; 3] = [
    "fig13",
    "Figure 13: bit planes",
    "A projector of one bit shows a sinusoid as stripes. In bit planes, each of what those before could not \
     show, the weighted sum of the photos is that of the sinusoid; but each photo adds its noise.",
];

const RANDOM: [&str; 3] = [
    "random",
    "Random patterns at equal photos",
    "Photos of random patterns tell of the light transport, too, but answers by them converge slowly: each \
     pattern is made without regard to the photos before.",
];

const CONDITIONING: [&str; 3] = [
    "conditioning",
    "Photos that are projected back as they are",
    "Photos that are projected back unchanged become more and more alike, and the basis that they are is ill \
     conditioned. Each new one is therefore made orthogonal to those before.",
];

const POLYNOMIALS: [&str; 3] = [
    "polynomials",
    "Equations 1 to 3: polynomials of the light transport matrix",
    "Whatever k photos of a Krylov method tell is a polynomial of degree k of the matrix: the residual is one with \
     value 1 at 0 that is small where eigenvalues are, and the eigenvalues found are the zeros of another.",
];

const APART: [&str; 3] = [
    "apart",
    "Camera and projector apart",
    "Where camera and projector do not share one viewpoint, the light transport matrix is not symmetric. Photos with the two exchanged are \
     those of its transpose, and light that goes there and back is a symmetric matrix again, by which the same methods apply.",
];

const DISPARITY: [&str; 3] = [
    "disparity",
    "Disparity of a nearly coaxial pair",
    "Camera and projector are brought to one viewpoint by a beam splitter, so that the matrix is symmetric; what is left of the disparity \
     between them has to be small.",
];
