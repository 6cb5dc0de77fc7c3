//! The segmentation that follows from eigenvectors.

use super::Regions;
use super::capture::Capture;
use super::embedding::{Embedding, LEAST_SHARE, mean};
use super::graph::Graph;
use super::grouping::{confidence, divided};
use super::options::{Coordinates, Cut, SegmentOptions};
use crate::analysis::kmeans::{Clusters, KmeansOptions, kmeans};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio, SIGMAS};
use crate::krylov::{Factorization, HistoryRow, RitzPair, Status, Which};

/// The largest number of groups. Labels are bytes, and 255 is the label of masked pixels.
const MOST_GROUPS: usize = 254;

/// The label of a masked pixel.
pub const MASKED: u8 = 255;

/// No eigenvalue of a matrix of light exceeds the largest row sum. An excess of more than this share shows a fault of the photos that
/// rounding or a little noise does not explain.
const IMPOSSIBLE: f64 = 0.05;

/// A label counts as sure if its confidence has at least this value.
pub const SURE: f64 = 0.95;

/// The status sentence counts an eigenvector as resolved if its residual is below this share of the matrix norm.
const RESOLVED: f64 = 1e-2;

/// A segmentation of `n` pixels with `k` eigenvectors. `k` is the requested number, or less if there were too few photos.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// The label of each pixel (`n`) for each requested number of groups `K`. Labels are numbered by first appearance in raster
    /// order; masked pixels have [`MASKED`] (255).
    pub labels: Vec<(usize, Vec<u8>)>,
    /// The confidence in the label of each pixel (`n`, from 0 to 1) for each number of groups: the probability of the pixel's group among
    /// all groups, computed from the pixel's coordinates. It does not say whether the number of groups is right. 0 on masked pixels.
    pub confidence: Vec<(usize, Vec<f64>)>,
    /// The `k` eigenvalues: `λ` of `D^-½ G D^-½`, descending from 1, for the normalized cut; `λ` of `D − G`, ascending from 0, for the
    /// average cut. The first eigenvalue is known.
    pub eigenvalues: Vec<f64>,
    /// The residual norm of each eigenvalue, for an eigenvector of `D^-½ G D^-½` or `D − G` of norm 1. The first residual is a bound.
    pub residuals: Vec<f64>,
    /// The `k` generalized eigenvectors `u` of length `n`, zero on masked pixels, with `uᵀ D u = 1` (normalized cut) or `uᵀ u = 1` (average
    /// cut). The first eigenvector is constant.
    pub eigenvectors: Vec<Vec<f64>>,
    /// The map from eigenvectors to the coordinates that k-means groups.
    pub embedding: Embedding,
    /// The weight of each pixel in k-means (`n`): its degree, or 1 for the average cut and for plain coordinates; 0 on masked pixels.
    pub weights: Vec<f64>,
    /// The number of regions with almost no exchange, estimated from the eigenvalues.
    pub regions: Regions,
    /// The degree `D` of each pixel (`n`) in units of radiance, including `μ m`; zero on masked pixels.
    pub degree: Vec<f64>,
    /// True on masked pixels (`n`).
    pub mask: Vec<bool>,
    /// The type of cut that the eigenvalues belong to.
    pub cut: Cut,
    /// The number of photos taken, including the photos of the degree.
    pub photos: usize,
    /// One row per Lanczos photo: the number of photos so far, the eigenvalues and the residuals (without the known pair).
    pub history: Vec<HistoryRow>,
    /// The status as a sentence without its full stop.
    pub status: String,
}

impl Segmentation {
    /// A pixel's coordinates for k-means: its weighted entries in all eigenvectors except the known eigenvector (`k − 1` numbers).
    pub fn feature(&self, pixel: usize) -> Vec<f64> {
        let entries = self.eigenvectors.iter().enumerate().skip(1);
        entries.map(|(index, u)| self.embedding.coordinate(index, u[pixel])).collect()
    }

    /// The share of the unmasked pixels whose label has at least the confidence [`SURE`], for this number of groups.
    pub fn share_of_sure(&self, groups: usize) -> Option<f64> {
        let (_, confidence) = self.confidence.iter().find(|(of, _)| *of == groups)?;
        let seen = self.mask.iter().filter(|masked| !**masked).count();
        Some(confidence.iter().filter(|value| **value >= SURE).count() as f64 / seen.max(1) as f64)
    }

    /// Checks whether light can have these eigenvalues: at most 1 in magnitude for `D^-½ G D^-½`, from 0 to twice the largest degree for
    /// `D − G`. For plain coordinates, also whether each group has the light of a region.
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = self.of_eigenvalues();
        if !self.embedding.is_clamped() && !self.labels.is_empty() {
            findings.push(self.smallest_group());
        }
        findings
    }

    /// The smallest group: its light as a share of all light, and its pixels. Plain coordinates have large entries where an eigenvector is
    /// localized on a few pixels, and k-means then makes these pixels a group of their own.
    fn smallest_group(&self) -> Finding {
        let all: f64 = self.degree.iter().sum();
        let (mut least, mut fewest) = (f64::INFINITY, usize::MAX);
        for (groups, labels) in &self.labels {
            let mut found = vec![(0.0, 0_usize); *groups];
            for (&label, degree) in labels.iter().zip(&self.degree).filter(|(label, _)| **label != MASKED) {
                let (light, pixels) = &mut found[usize::from(label)];
                *light += degree;
                *pixels += 1;
            }
            for (light, pixels) in found {
                (least, fewest) = (least.min(light / all), fewest.min(pixels));
            }
        }
        let is_region = least >= LEAST_SHARE && fewest > 1;
        Finding::graded(
            "smallest group",
            if is_region { Grade::Ok } else { Grade::Fails },
            format!(
                "the least light of a group is {:.2} %, and the fewest pixels are {fewest}",
                100.0 * least
            ),
            format!("at least {} %, and two pixels", 100.0 * LEAST_SHARE),
            "a few pixels with an eigenvector of their own are not a region: `--coordinates commute` gives them no influence",
        )
    }

    fn of_eigenvalues(&self) -> Vec<Finding> {
        let values = self.eigenvalues.iter().copied();
        // Each eigenvalue is converted to its distance from the middle of its range, relative to half of the range.
        let half = self.degree.iter().copied().fold(0.0, f64::max);
        let sizes = values.map(|value| match self.cut {
            Cut::Normalized => value.abs().into(),
            Cut::Average => Ratio::of((value - half).abs(), half, 0.0),
        });
        let sizes: Option<Vec<f64>> = sizes.map(Ratio::value).collect();
        let Some(largest) = sizes.map(|sizes| sizes.into_iter().fold(0.0, f64::max)) else {
            return vec![Finding::unmeasured("eigenvalues", "there is no light between the pixels")];
        };
        vec![possible(largest, 0.0)]
    }

    /// Makes the segmentation with these options from the photos that a capture has taken so far. The capture must have taken a Lanczos
    /// step.
    pub(super) fn of(
        capture: &Capture,
        options: &SegmentOptions,
        graph: &Graph,
        lanczos: &Factorization,
    ) -> Result<Self> {
        // The process finds as many copies of an eigenvalue as it has starts. One more eigenvalue shows the gap after the regions.
        let wanted = (options.eigenvectors - 1).max(lanczos.block() + 1);
        let pairs = lanczos.ritz(Which::LargestAlgebraic, wanted)?;
        let mut vectors: Vec<Vec<f64>> = pairs.iter().map(|pair| lanczos.ritz_vector(pair)).collect();
        let known = options.cut.known_vector(graph);
        let length = crate::krylov::norm(&known);
        vectors.insert(0, known.iter().map(|value| value / length).collect());
        if options.cut == Cut::Normalized {
            for vector in &mut vectors {
                for (value, degree) in vector.iter_mut().zip(graph.degree()) {
                    *value /= degree.sqrt();
                }
            }
        }
        let mut weights = match options.cut {
            Cut::Normalized => graph.degree().to_vec(),
            Cut::Average => vec![1.0; graph.degree().len()],
        };
        let mut embedding = Embedding::new(options.cut, graph, &pairs, &vectors, &weights);
        let norm = if options.cut == Cut::Normalized { 1.0 } else { mean(graph.degree()) };
        let mut regions =
            count_regions(&embedding, &pairs, &vectors, &weights, (norm, lanczos.block(), options.leak));
        regions.confirm(capture.unseen);
        // Eigenvectors beyond the requested number only served to count the regions, so they are dropped.
        let most = if options.groups.is_empty() { regions.count } else { 0 };
        let kept = vectors.len().min(options.eigenvectors.max(most));
        vectors.truncate(kept);
        let pairs = &pairs[..kept - 1];
        embedding.truncate(kept);
        if options.coordinates == Coordinates::Plain {
            embedding.make_plain();
            weights.fill(1.0);
        }
        let features: Vec<Vec<f64>> = (1..kept)
            .map(|index| vectors[index].iter().map(|&entry| embedding.coordinate(index, entry)).collect())
            .collect();
        let grouped = |groups| kmeans(&features, &weights, &KmeansOptions::new(groups, options.seed));
        let found: Vec<Clusters> = match &options.groups[..] {
            [] => vec![undivided(&mut regions, (&features, &weights), grouped)],
            groups => groups.iter().map(|&groups| grouped(groups)).collect(),
        };
        let labels = found.iter().map(|clusters| {
            (clusters.centres.len(), graph.scatter(&number_by_appearance(&clusters.labels), MASKED))
        });
        let confidence = found.iter().map(|clusters| {
            (clusters.centres.len(), graph.scatter(&confidence(&features, &weights, clusters), 0.0))
        });
        let resolved = 1 + pairs.iter().filter(|pair| pair.is_resolved(RESOLVED, norm)).count();
        let sign = options.cut.sign();
        let known_value = if options.cut == Cut::Normalized { 1.0 } else { 0.0 };
        Ok(Self {
            labels: labels.collect(),
            confidence: confidence.collect(),
            eigenvalues: std::iter::once(known_value)
                .chain(pairs.iter().map(|pair| sign * pair.value))
                .collect(),
            residuals: std::iter::once(options.cut.known_residual(graph))
                .chain(pairs.iter().map(|pair| pair.residual))
                .collect(),
            eigenvectors: vectors.iter().map(|vector| graph.scatter(vector, 0.0)).collect(),
            weights: graph.scatter(&weights, 0.0),
            regions,
            degree: graph.scatter(graph.degree(), 0.0),
            mask: graph.mask(),
            cut: options.cut,
            photos: capture.photos(),
            history: capture.history().to_vec(),
            status: status(capture, resolved, options.eigenvectors.max(kept), embedding.local()),
            embedding,
        })
    }
}

/// Describes how many of the `wanted` eigenvectors the capture resolved, and what more photos would give, as a sentence.
fn status(capture: &Capture, resolved: usize, wanted: usize, local: usize) -> String {
    let localized = if local == 0 { String::new() } else { format!(", and {local} are localized") };
    let ended = match capture.status() {
        Some(Status::ReachedTolerance | Status::BudgetSpent) if resolved == wanted => String::new(),
        Some(Status::BudgetSpent) => "; more photos may resolve others".into(),
        Some(status) => format!("; {status}"),
        None => "; the capture broke off".into(),
    };
    let photos = capture.photos();
    format!(
        "{photos} photos: a residual below {RESOLVED} for {resolved} of {wanted} eigenvectors{localized}{ended}"
    )
}

/// Checks whether the eigenvalues of a matrix of light are possible. `largest` is the largest magnitude of an eigenvalue relative to the
/// largest row sum, and `error` is the standard error of `largest`. All entries of such a matrix are at least 0, so no eigenvalue is larger
/// than the largest row sum.
pub fn possible(largest: f64, error: f64) -> Finding {
    let bound = 1.0 + IMPOSSIBLE;
    let grade = if largest - SIGMAS * error <= bound { Grade::Ok } else { Grade::Fails };
    let found = format!("the largest has {largest:.3} of the size that light can give it");
    let help = "what is measured is not light alone: look for noise, drift, or direct light that is not removed (`krylux audit`)";
    Finding::graded("eigenvalues", grade, found, format!("at most {bound}"), help)
        .measured(largest, error, bound)
}

/// Makes one group per region, and divides each group whose coordinates form two clusters. The eigenvalues count a region only after its
/// eigenvector is found, but other eigenvectors may already separate the region.
fn undivided(
    regions: &mut Regions,
    (features, weights): (&[Vec<f64>], &[f64]),
    grouped: impl Fn(usize) -> Clusters,
) -> Clusters {
    let most = MOST_GROUPS.min(weights.len()).max(2);
    loop {
        let found = grouped(regions.count.clamp(2, most));
        // If there is only one region, it becomes two groups only because two is the smallest number of groups. No group is divided then.
        let more = if regions.count < 2 { 0 } else { divided(features, weights, &found) };
        if more == 0 || regions.count + more > most {
            return found;
        }
        regions.divide(more);
    }
}

/// Counts the regions from all eigenvectors that are not localized. `norm` is the norm of the matrix. The Krylov process began from
/// `starts` patterns, and its operator carries the share `leak` of a region's light across the region's border.
fn count_regions(
    embedding: &Embedding,
    pairs: &[RitzPair],
    vectors: &[Vec<f64>],
    weights: &[f64],
    (norm, starts, leak): (f64, usize, f64),
) -> Regions {
    let told: Vec<usize> = (0..vectors.len()).filter(|&index| !embedding.is_local(index)).collect();
    let gap = |index: usize| {
        (
            embedding.gaps[index],
            index.checked_sub(1).map_or(0.0, |pair| pairs[pair].beyond_noise(weights.len()) / norm),
        )
    };
    let mut gaps: Vec<(f64, f64)> = told.iter().map(|&index| gap(index)).collect();
    // If the last eigenvector is localized, its eigenvalue still bounds the next region's eigenvalue.
    gaps.extend(Some(vectors.len() - 1).filter(|&last| embedding.is_local(last)).map(gap));
    let second = told.get(1).map(|&index| (vectors[index].as_slice(), pairs[index - 1].residual));
    Regions::suggested(&gaps, second, weights, starts, leak)
}

fn number_by_appearance(labels: &[usize]) -> Vec<u8> {
    let mut names: Vec<usize> = Vec::new();
    labels
        .iter()
        .map(|label| {
            let name = names.iter().position(|seen| seen == label).unwrap_or_else(|| {
                names.push(*label);
                names.len() - 1
            });
            // The cast is exact, because there are at most 254 groups.
            name as u8
        })
        .collect()
}
