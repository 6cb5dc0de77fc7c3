//! Eigenvalues and eigenvectors, or singular values and vectors, of the light transport matrix.

mod pairs;
mod singular;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::options::{LightPart, check_vectors, count, number};
use crate::analysis::segment::possible;
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio};
use crate::image::Resolution;
use crate::io::manifest::CheckVerdict;
use crate::krylov::{
    self, Completeness, Confirm, EigsMethod, EigsOptions, HistoryRow, PairStatus, SingularOptions, Start,
    Which, eigs, singular,
};
use crate::lab::text::capital;
use crate::lab::{Answer, Lab, LabOperator, Verb, Verified};
use crate::operator::{Operator, Symmetry};
use crate::report::content::Content;
use crate::report::run::AnswerPage;
use crate::transport::Part;

pub use pairs::Eigenpairs;
pub use singular::SingularTriplets;

/// Compute eigenvalues and eigenvectors of a scene's light transport matrix, or of a matrix from a file
#[derive(Clone, Debug, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(
    after_help = "Examples:\n  krylux eigs scene.glb --count 6 --method block-lanczos -o out/eigs\n  krylux eigs matrix.npz --count 4 --photos 400 --tolerance 1e-6\n  krylux eigs apart.glb --singular --count 4     # camera and projector apart: patterns and their photos"
)]
pub struct Eigs {
    /// How many eigenpairs
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = count::<usize>)]
    pub count: usize,
    /// Which light of a scene or rig
    #[arg(long, value_enum, default_value = "full")]
    pub part: LightPart,
    /// At which end of the spectrum
    #[arg(long, value_enum, default_value = "la")]
    pub which: End,
    /// Photos (products with the matrix) to take at most [default: 50, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
    /// Done when each residual norm is at most this share of the matrix norm; exit with 1 if that is not reached. Without
    /// it, the search ends at 1e-8, or at the noise of the photos if that is larger
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    pub tolerance: Option<f64>,
    /// The method
    #[arg(long, value_enum, default_value = "lanczos")]
    pub method: Method,
    /// Vectors in the block of block-lanczos: as many copies of a repeated eigenvalue are found
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count::<usize>)]
    pub block: usize,
    /// Basis vectors of lanczos and block-lanczos to keep at most, by restarts [default: all]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub max_basis: Option<usize>,
    /// Confirm that no eigenvalue was missed that lies beyond the last one by more than this share of the spectrum's spread. On a rig it
    /// takes further photos: 28 at 128×128 pixels for 0.05, 62 for 0.01. Matrices and traced scenes, whose products cost no photo, are
    /// confirmed in any case [default there: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = number::<f64>)]
    pub confirm: Option<f64>,
    /// Compute singular values and vectors in place of eigenvalues: they exist for any matrix. Each step takes one photo, and one of the
    /// transpose, with camera and projector exchanged
    #[arg(long, conflicts_with_all = ["method", "block", "which", "max_basis"])]
    pub singular: bool,
}

/// A method for eigenpairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Algorithm 1 in section 4 of the paper: one pair, of largest magnitude
    Power,
    /// Symmetric matrices: the best in nearly all cases
    Lanczos,
    /// Symmetric matrices with repeated eigenvalues
    BlockLanczos,
    /// Any square matrix: complex pairs
    Arnoldi,
}

/// An end of the spectrum, named as in ARPACK.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// Largest (largest real part)
    #[serde(alias = "LA")]
    La,
    /// Smallest (smallest real part)
    #[serde(alias = "SA")]
    Sa,
    /// Largest magnitude
    #[serde(alias = "LM")]
    Lm,
    /// Smallest magnitude
    #[serde(alias = "SM")]
    Sm,
    /// Both ends in turn
    #[serde(alias = "BE")]
    Be,
    /// Largest imaginary part
    #[serde(alias = "LI")]
    Li,
}

/// Eigenpairs, or singular values with their vectors.
#[derive(Clone, Debug)]
pub enum Spectrum {
    /// Eigenpairs of a square matrix.
    Pairs(Eigenpairs),
    /// Singular values with their patterns and photos.
    Triplets(SingularTriplets),
}

impl Verb for Eigs {
    const NAME: &'static str = "eigs";
    type Answer = Spectrum;

    fn check_on(&self, lab: &Lab) -> Result<()> {
        let [photos, patterns] = [lab.resolution(), lab.projector_resolution()];
        if photos != patterns && !self.singular {
            let fault = format!(
                "photos have {photos} pixels and patterns {patterns}; only a square matrix has eigenvalues"
            );
            return Err(Error::option("--singular", fault).help("add --singular for singular values"));
        }
        check_vectors("--block", self.block, patterns.pixels())
    }

    fn answer(&self, lab: &mut Lab) -> Result<Spectrum> {
        let seed = lab.seed();
        if let Some(run) = lab.run() {
            run.manifest.seed = Some(seed);
        }
        Ok(match self.singular {
            true => Spectrum::Triplets(self.triplets(lab)?),
            false => Spectrum::Pairs(self.pairs(lab)?),
        })
    }
}

impl Eigs {
    /// The options of the method. `seed` selects the starting vector, and `photos_of_run` is the default budget of a replayed run.
    pub fn options(&self, seed: u64, photos_of_run: Option<usize>) -> EigsOptions {
        EigsOptions {
            count: self.count,
            which: match self.which {
                End::La => Which::LargestAlgebraic,
                End::Sa => Which::SmallestAlgebraic,
                End::Lm => Which::LargestMagnitude,
                End::Sm => Which::SmallestMagnitude,
                End::Be => Which::BothEnds,
                End::Li => Which::LargestImaginary,
            },
            products: self.photos.or(photos_of_run).unwrap_or(50),
            tolerance: self.tolerance.unwrap_or(EigsOptions::default().tolerance),
            method: match self.method {
                Method::Power => EigsMethod::Power,
                Method::Lanczos => EigsMethod::Lanczos,
                Method::BlockLanczos => EigsMethod::BlockLanczos { block: self.block },
                Method::Arnoldi => EigsMethod::Arnoldi,
            },
            max_basis: self.max_basis,
            start: Start::Random { seed },
            confirm: self.confirm.map(|share| Confirm { share, ..Confirm::default() }),
            ..EigsOptions::default()
        }
    }

    /// Eigenpairs of one part of the light transport matrix. If a model from a run's photos computes them, their standard errors are set
    /// to the error bounds. Fails as [`eigs()`] and [`Lab::operator`].
    pub fn pairs(&self, lab: &mut Lab) -> Result<Eigenpairs> {
        let mut options = self.options(lab.seed(), lab.photos_of_run());
        options.noise = self.noise(lab)?;
        lab.allow_photos(options.products);
        let mut operator = lab.operator(self.part.into())?;
        let is_lanczos = matches!(self.method, Method::Lanczos | Method::BlockLanczos);
        if is_lanczos && operator.symmetry() != Symmetry::Symmetric {
            let fault = format!(
                "Lanczos needs a symmetric matrix (a coaxial rig's), and that of {} need not be",
                lab.name()
            );
            return Err(Error::option("--method", fault)
                .help("give --method arnoldi, or --singular for singular values"));
        }
        let (confirm, photos) = confirm_within(options.confirm, &operator);
        lab.expect(options.products + photos);
        let options = &EigsOptions { confirm, ..options };
        let mut found = lab.photos(|_| eigs(&mut operator, options))?;
        // The error of a model does not average out over the pixels as noise does, because it makes all large eigenvalues smaller.
        if lab.is_model()? {
            found.standard_errors.clone_from(&found.bounds);
        }
        let finding = possible_of(lab, self.part.into(), &found)?;
        lab.add_findings(finding);
        Ok(Eigenpairs::new(found, self, picture(lab, lab.projector_resolution())))
    }

    /// Singular values of one part of the light transport matrix, with patterns and photos. Every second photo is one of the transpose.
    ///
    /// # Errors
    /// The errors of [`singular()`] and [`Lab::operator`]; a rig that is not coaxial cannot take photos of its transpose
    /// ([`crate::operator::Exchanged`]).
    pub fn triplets(&self, lab: &mut Lab) -> Result<SingularTriplets> {
        let EigsOptions { count, products, tolerance, start, confirm, .. } =
            self.options(lab.seed(), lab.photos_of_run());
        let noise = self.noise(lab)?;
        lab.allow_photos(products);
        let mut operator = lab.operator(self.part.into())?;
        let (confirm, photos) = confirm_within(confirm, &operator);
        lab.expect(products + 2 * photos);
        let options = &SingularOptions { count, products, tolerance, noise, start, confirm };
        let found = lab.photos(|_| singular(&mut operator, options))?;
        let sizes = picture(lab, lab.resolution()).map(|of_photos| [of_photos, lab.projector_resolution()]);
        Ok(SingularTriplets::new(found, self, sizes))
    }

    /// The noise of products. If no tolerance is given, the search ends at this level.
    fn noise(&self, lab: &mut Lab) -> Result<f64> {
        if self.tolerance.is_some() {
            return Ok(0.0);
        }
        Ok(lab.product_noise(self.part.into())?.unwrap_or(0.0))
    }
}

/// The size of the pictures that show vectors. It is `None` for a matrix that does not know its pictures.
fn picture(lab: &Lab, size: Resolution) -> Option<Resolution> {
    lab.has_pictures().then_some(size)
}

/// Checks that the eigenvalues of a rig's light are possible. No eigenvalue may exceed the largest row sum, which the white photo shows.
fn possible_of(lab: &mut Lab, part: Part, found: &krylov::Eigs) -> Result<Option<Finding>> {
    let most = lab.with_measurement(|measurement| {
        let mut sums = measurement.white()?.planes.swap_remove(0).values;
        if part != Part::Full {
            let direct = measurement.direct()?.planes.swap_remove(0).values;
            let rest = |(sum, direct): (&mut f64, f64)| {
                *sum = if part == Part::Direct { direct } else { *sum - direct }
            };
            sums.iter_mut().zip(direct).for_each(rest);
        }
        Ok(sums.into_iter().fold(0.0, f64::max))
    })?;
    let Some(most) = most else { return Ok(None) };
    let pairs = found.values.iter().zip(&found.imaginary_values).zip(&found.standard_errors);
    let sizes = pairs.map(|((real, imaginary), error)| [real.hypot(*imaginary), *error]);
    let [size, error] = sizes.fold([0.0; 2], |most, one| if one[0] > most[0] { one } else { most });
    Ok(Some(match Ratio::of(size, most, 0.0).value() {
        Some(largest) => possible(largest, error / most),
        None => Finding::unmeasured("eigenvalues", "there is no light of this part"),
    }))
}

/// The options for confirming an answer by further products, and the largest number of photos for these products.
fn confirm_within(asked: Option<Confirm>, operator: &LabOperator) -> (Option<Confirm>, usize) {
    let confirm =
        asked.map(|confirm| if operator.is_free() { confirm } else { confirm.on_rig(operator.cols()) });
    let photos = confirm.filter(|_| !operator.is_free()).map_or(0, |confirm| confirm.products);
    (confirm, photos)
}

fn missing(completeness: Completeness, (found, wanted): (usize, usize), products: usize) -> String {
    if found < wanted && completeness == Completeness::Exact {
        format!("missing   there are only {found}, and {wanted} were asked for")
    } else if products > 0 && completeness.is_known() {
        format!("missing   {completeness} ({products} further products confirm it)")
    } else {
        format!("missing   {completeness}")
    }
}

/// The number of results that converged or are within the noise, such as `4 of 6 eigenvalues within the noise; 50 photos`. If `check`, the
/// verdict of independent light, refutes the results, their residuals say nothing about the light, and the headline says so instead.
fn headline(
    name: &str,
    statuses: &[PairStatus],
    wanted: usize,
    photos: usize,
    check: Option<CheckVerdict>,
) -> String {
    let count = |wanted: PairStatus| statuses.iter().filter(|status| **status == wanted).count();
    let (exact, noisy) = (count(PairStatus::Converged), count(PairStatus::LimitedByNoise));
    if check == Some(CheckVerdict::Refuted) {
        return format!("{} {name}, refuted by independent light; {photos} photos", statuses.len());
    }
    let how = match (exact, noisy) {
        (_, 0) => "converged",
        (0, _) => "within the noise",
        _ => "converged or within the noise",
    };
    match exact + noisy {
        found if found == wanted => format!("all {wanted} {name} {how}; {photos} photos"),
        found => format!("{found} of {wanted} {name} {how}; {photos} photos"),
    }
}

/// The sentence about the answer on its page.
fn sentence(headline: &str, status: krylov::Status, completeness: Completeness) -> String {
    format!("{headline}; {status}. {}.", capital(&completeness.to_string()))
}

/// The finding about convergence: whether all wanted pairs or triplets were found and meet the tolerance. If `strict` is false, residuals
/// within the noise of the photos suffice.
fn converged(name: &'static str, statuses: &[PairStatus], wanted: usize, strict: bool) -> Finding {
    let is_good = |status: &&PairStatus| match status {
        PairStatus::Converged => true,
        PairStatus::LimitedByNoise => !strict,
        PairStatus::NotResolved => false,
    };
    let count = statuses.iter().filter(is_good).count();
    let grade = if count == wanted { Grade::Ok } else { Grade::Fails };
    let within = if strict { "converged" } else { "converged, or are within the noise" };
    let help = "give more --photos, or ask for fewer";
    Finding::graded(name, grade, format!("{count} of {wanted} {within}"), "all that are wanted", help)
}

fn in_words(statuses: &[PairStatus]) -> Vec<&'static str> {
    let word = |status: &PairStatus| match status {
        PairStatus::Converged => "converged",
        PairStatus::LimitedByNoise => "limited by noise",
        PairStatus::NotResolved => "not resolved",
    };
    statuses.iter().map(word).collect()
}

/// The shape of an array of vectors: `k×H×W` for pictures of `size`, otherwise `k×n`.
fn shape(size: Option<Resolution>, vectors: &[Vec<f64>]) -> Vec<usize> {
    match size {
        Some(Resolution { width, height }) => vec![vectors.len(), height, width],
        None => vec![vectors.len(), vectors.first().map_or(0, Vec::len)],
    }
}

/// Converts the history into `(photos, values, residuals)` after each photo.
fn history(rows: &[HistoryRow]) -> Vec<(usize, &[f64], &[f64])> {
    rows.iter().map(|row| (row.products, row.values.as_slice(), row.residuals.as_slice())).collect()
}

impl Spectrum {
    fn inner(&self) -> &dyn Answer {
        match self {
            Self::Pairs(found) => found,
            Self::Triplets(found) => found,
        }
    }
}

impl Answer for Spectrum {
    fn names(&self) -> [&'static str; 2] {
        self.inner().names()
    }

    fn photos(&self) -> usize {
        self.inner().photos()
    }

    fn headline(&self) -> String {
        self.inner().headline()
    }

    fn content(&self) -> Content<'_> {
        self.inner().content()
    }

    fn findings(&self) -> Vec<Finding> {
        self.inner().findings()
    }

    fn verify(&mut self, lab: &mut Lab) -> Result<Option<Verified>> {
        match self {
            Self::Pairs(found) => found.verify(lab),
            Self::Triplets(_) => Ok(None),
        }
    }

    fn show(&self, lab: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        self.inner().show(lab, page)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_confirm_only_what_is_known() {
        let open = missing(Completeness::NotExcluded, (3, 3), 36);
        assert!(!open.contains("confirm") && open.contains("not excluded"), "{open}");
        assert!(missing(Completeness::Exact, (3, 3), 36).contains("(36 further products confirm it)"));
    }
}
