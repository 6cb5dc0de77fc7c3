//! Light transport segmentation: groups of pixels that exchange light.

mod answer;
mod features;
mod page;

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::options::{count, not_planned, number};
use crate::analysis::segment::{Capture, feature_view};
use crate::analysis::separate::SeparateBy;
use crate::analysis::{Blurred, Coordinates, Cut, SegmentOptions, WithoutDirect, segment::evidence};
use crate::error::{Error, Result};
use crate::image::{Blur, Resolution};
use crate::krylov::Confirm;
use crate::lab::{Lab, Log, Verb};
use crate::operator::{Adjoint, Gram, Operator, Symmetry};
use crate::transport::Part;

pub use answer::Segmented;

/// Segment a scene by how light travels in it: pixels that exchange light form a group
#[derive(Clone, Debug, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(
    after_help = "Examples:\n  krylux segment scene.glb --groups 2,6 -o out/groups\n  krylux segment out/groups --groups 3     # the same photos, another question"
)]
pub struct Segment {
    /// Numbers of groups, all from the same photos [default: the number of regions that the light shows]
    #[arg(long, value_name = "K,K,...", value_delimiter = ',', value_parser = count::<usize>)]
    pub groups: Vec<usize>,
    /// Photos to take at most [default: 50, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
    /// Patterns that the photos start from: no fewer than regions; 1 is a single Krylov subspace, as in section 4 of the
    /// paper [default: a quarter of the photos, from 1 to 12]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub starts: Option<usize>,
    /// Eigenvectors that the groups are made from
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = count::<usize>)]
    pub eigenvectors: usize,
    /// Weigh the light across a cut against each side's light, or against its number of pixels
    #[arg(long, value_enum, default_value = "normalized")]
    pub cut: Cut,
    /// What k-means groups
    #[arg(long, value_enum, default_value = "commute")]
    pub coordinates: Coordinates,
    /// Added to every edge of the graph, in units of A: very small groups are worth less
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = number::<f64>)]
    pub mu: f64,
    /// Keep the direct light, as a rig that cannot tell it apart would: the same as --direct keep
    #[arg(long)]
    pub keep_direct: bool,
    /// Mask pixels with less than this share of the median global light
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = number::<f64>)]
    pub mask_below: f64,
    /// Confirm that no region was missed: none whose eigenvalue is above those found by more than this share of the spectrum's spread. On
    /// a rig it takes further photos: 28 at 128×128 pixels for 0.05. Traced scenes are confirmed in any case [default there: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = number::<f64>)]
    pub confirm: Option<f64>,
    /// How direct light, which says nothing about groups, is kept apart
    #[arg(long, value_enum, default_value = "source", conflicts_with = "keep_direct")]
    pub direct: Direct,
    /// Photos of direct light where it is measured: of random patterns, or of squares shifted to as many places
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = count::<usize>)]
    pub direct_photos: usize,
    /// Pixels of a square's side, for --direct patterns
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count::<usize>)]
    pub direct_square: usize,
    /// Standard deviation in pixels of a Gaussian that blurs patterns and photos alike: less noise, and still symmetric [default: 1 on a
    /// calibrated rig whose camera has fewer than two pixels along a side for each of the projector's, else 0]
    #[arg(long, value_name = "PIXELS", value_parser = number::<f64>)]
    pub blur: Option<f64>,
    /// Show where these pixels lie in the space of eigenvectors, and how far apart
    #[arg(long, value_name = "X,Y;X,Y;...", value_delimiter = ';')]
    pub features: Vec<Pixel>,
    /// Light each group alone, one more photo for each: how much of its light stays within it
    #[arg(long)]
    pub evidence: bool,
    /// Exit with 1 if the groups agree less than this with the scene's true labels (adjusted Rand index, at the number of
    /// groups that the labels have)
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    pub min_rand_index: Option<f64>,
}

/// How direct light is kept apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direct {
    /// The source leaves it out: a simulator exactly, a rig as its file says
    #[value(alias = "simulator")]
    Source,
    /// Measured by Nayar's shifted checkerboards
    Patterns,
    /// Estimated from photos of random patterns, as the diagonal of A
    Estimator,
    /// Kept, as by a rig that cannot tell it apart
    Keep,
}

/// A pixel: its column and its row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pixel(pub usize, pub usize);

impl FromStr for Pixel {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parsed =
            text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
        let (x, y) = parsed.ok_or_else(|| format!("`{text}` is no pixel; write column,row as in 20,35"))?;
        Ok(Self(x, y))
    }
}

impl Verb for Segment {
    const NAME: &'static str = "segment";
    const NEEDS_PICTURES: bool = true;
    type Answer = Segmented;

    fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| Err(Error::option(option, fault).help(help));
        Capture::new(self.options(0, None))?;
        let blur = self.blur.unwrap_or(0.0);
        if !(0.0..1000.0).contains(&blur) {
            return refuse("--blur", format!("{blur} pixels"), "give a standard deviation from 0 on");
        }
        if self.direct == Direct::Patterns && self.shifts().is_none() {
            let fault = format!("{} photos of shifted squares", self.direct_photos);
            return refuse("--direct-photos", fault, "give a square number from 4 on: 4, 9, 16, 25");
        }
        Ok(())
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        self.check_pixels(lab.resolution())
    }

    /// Segments the scene into groups of pixels that exchange light. If camera and projector are apart, the pixels of a group receive the
    /// same light. The journal of the run keeps the true labels of the scene, if the scene has them.
    fn answer(&self, lab: &mut Lab) -> Result<Segmented> {
        let options = self.options(lab.seed(), lab.photos_of_run());
        lab.allow_photos(options.photos);
        let truth = lab.timed("true labels", |lab| lab.truth())?;
        lab.keep_truth(truth.as_ref());
        let mut operator = lab.operator(self.part())?;
        let confirm = options.confirm.filter(|_| !operator.is_free());
        lab.expect(self.photos(&options) + confirm.map_or(0, |confirm| confirm.steps(operator.cols())));
        let (resolution, blur) = (lab.resolution(), self.blur_on(lab));
        let request = &Self { blur: Some(blur), ..self.clone() };
        let found = lab.photos(|_| request.with_transpose(&mut operator, resolution, options))?;
        found.against(truth)
    }
}

impl Segment {
    /// The options of the method. `seed` determines all random choices, and `photos_of_run` is the default budget of a replayed run.
    pub fn options(&self, seed: u64, photos_of_run: Option<usize>) -> SegmentOptions {
        SegmentOptions {
            photos: self.photos.or(photos_of_run).unwrap_or(50),
            groups: self.groups.clone(),
            eigenvectors: self.eigenvectors,
            // The starting patterns follow from the photos of the run, so that a request for fewer photos uses the same patterns.
            starts: self.starts.or(photos_of_run.map(SegmentOptions::automatic_starts)),
            cut: self.cut,
            mu: self.mu,
            coordinates: self.coordinates,
            mask_below: self.mask_below,
            confirm: self.confirm.map(|share| Confirm { share, ..Confirm::default() }),
            seed,
            ..SegmentOptions::default()
        }
    }

    /// The part of the light that the operator must provide.
    pub fn part(&self) -> Part {
        if self.direct == Direct::Source && !self.keep_direct { Part::Global } else { Part::Full }
    }

    /// Refuses options for which a plan cannot predict the answer on a rig, with [`Error::Option`].
    pub fn check_plan(&self) -> Result<()> {
        let given = [
            (self.blur.is_some(), "--blur"),
            (!self.features.is_empty(), "--features"),
            (self.evidence, "--evidence"),
            (matches!(self.direct, Direct::Patterns | Direct::Estimator), "--direct"),
            (self.min_rand_index.is_some(), "--min-rand-index"),
        ];
        not_planned(Self::NAME, &given)
    }

    /// Takes all photos with `operator` (`n × n`), which provides the light of [`Segment::part`]. Fails as [`Verb::check`],
    /// [`SeparateBy::measure`], [`Capture::run`] and [`evidence()`].
    pub fn run(&self, operator: &mut dyn Operator, resolution: Resolution, seed: u64) -> Result<Segmented> {
        self.check()?;
        self.check_pixels(resolution)?;
        self.photographed(operator, resolution, self.options(seed, None))
    }

    fn photographed(
        &self,
        operator: &mut dyn Operator,
        resolution: Resolution,
        options: SegmentOptions,
    ) -> Result<Segmented> {
        let by = self.direct_method();
        let direct = by.map(|by| by.measure(operator, resolution, options.seed)).transpose()?;
        let mut found = match &direct {
            Some(direct) => {
                self.blurred(&mut WithoutDirect::new(operator, &direct.direct)?, resolution, options)?
            }
            None => self.blurred(operator, resolution, options)?,
        };
        if !self.features.is_empty() {
            let chosen: Vec<_> = self.features.iter().map(|&Pixel(x, y)| (x, y)).collect();
            found.features = Some(feature_view(&found.segmentation, resolution, &chosen)?);
        }
        found.direct = direct;
        Ok(found)
    }

    /// Takes the photos with an operator that also has the transpose. If camera and projector are apart, the matrix `A` is not symmetric,
    /// and the graph is that of `A Aᵀ`. In this graph, two camera pixels are neighbours if the same light reaches both. Each product with
    /// `A Aᵀ` takes two photos: one with the devices exchanged, and one with the devices as they are.
    fn with_transpose(
        &self,
        operator: &mut dyn Adjoint,
        resolution: Resolution,
        options: SegmentOptions,
    ) -> Result<Segmented> {
        let mut operator = operator;
        if operator.symmetry() == Symmetry::Symmetric {
            return self.photographed(&mut operator, resolution, options);
        }
        self.check_apart()?;
        let photos = options.photos / 2;
        let starts = options.starts.or(Some(SegmentOptions::automatic_starts(photos)));
        let half = SegmentOptions { photos, starts, ..options };
        let mut found = self.photographed(&mut Gram::of_photos(operator), resolution, half)?;
        found.there_and_back = true;
        found.segmentation.photos *= 2;
        found.segmentation.history.iter_mut().for_each(|row| row.products *= 2);
        found.segmentation.status = format!(
            "{} photos there and back, of A Aᵀ: {}",
            found.segmentation.photos, found.segmentation.status
        );
        Ok(found)
    }

    fn blurred(
        &self,
        operator: &mut dyn Operator,
        resolution: Resolution,
        options: SegmentOptions,
    ) -> Result<Segmented> {
        match Blur::new(resolution, self.blur.unwrap_or(0.0)) {
            Some(blur) => self.grouped(&mut Blurred::new(operator, blur)?, resolution, options),
            None => self.grouped(operator, resolution, options),
        }
    }

    fn grouped(
        &self,
        operator: &mut dyn Operator,
        resolution: Resolution,
        options: SegmentOptions,
    ) -> Result<Segmented> {
        let leak = leak(self.blur.unwrap_or(0.0), resolution);
        let mut capture = Capture::new(SegmentOptions { resolution: Some(resolution), leak, ..options })?;
        capture.run(operator)?;
        let segmentation = capture.segmentation()?;
        let counts = segmentation.labels.iter().filter(|_| self.evidence);
        let evidence = counts.map(|(_, labels)| evidence(operator, labels)).collect::<Result<_>>()?;
        Ok(Segmented { evidence, ..Segmented::new(self, segmentation, resolution) })
    }

    /// The number of positions of the shifted squares along a side; `None` unless the number of photos is a square number of at least 4.
    fn shifts(&self) -> Option<usize> {
        let shifts = self.direct_photos.isqrt();
        (shifts >= 2 && shifts * shifts == self.direct_photos).then_some(shifts)
    }

    /// The method that measures direct light; `None` if direct light is not measured.
    fn direct_method(&self) -> Option<SeparateBy> {
        match self.direct {
            Direct::Source | Direct::Keep => None,
            Direct::Estimator => Some(SeparateBy::Random { photos: self.direct_photos }),
            Direct::Patterns => {
                let shifts = self.shifts()?;
                Some(SeparateBy::Checkerboards { square: self.direct_square, shifts })
            }
        }
    }

    /// The largest number of photos in total.
    fn photos(&self, options: &SegmentOptions) -> usize {
        // If the number of groups is still unknown, it is at most one more than the number of starting patterns.
        let groups = match options.groups.as_slice() {
            [] => options.starts.unwrap_or(SegmentOptions::automatic_starts(options.photos)) + 1,
            groups => groups.iter().sum(),
        };
        let evidence = if self.evidence { groups } else { 0 };
        let direct = if self.direct_method().is_some() { self.direct_photos } else { 0 };
        options.photos + evidence + direct
    }

    /// The requested blur of patterns and photos, or else the blur that the rig needs.
    fn blur_on(&self, lab: &Lab) -> f64 {
        if let Some(blur) = self.blur {
            return blur;
        }
        let blur = lab.blur();
        if blur > 0.0 {
            lab.observer().note(format_args!(
                "note: the camera has fewer than two pixels along a side for each of the projector's, so patterns and photos are blurred by \
                 {blur} pixel; --blur 0 leaves them as they are"
            ));
        }
        blur
    }

    fn check_pixels(&self, resolution: Resolution) -> Result<()> {
        let outside = |&&Pixel(x, y): &&Pixel| x >= resolution.width || y >= resolution.height;
        let Some(Pixel(x, y)) = self.features.iter().find(outside) else { return Ok(()) };
        Err(Error::option("--features", format!("pixel {x},{y} is outside of the picture"))
            .help(format!("it has {resolution} pixels; columns and rows are counted from 0")))
    }

    /// Refuses options that need a symmetric matrix.
    fn check_apart(&self) -> Result<()> {
        let refuse = |option: &str, fault: &str, help: &str| Err(Error::option(option, fault).help(help));
        if self.direct_method().is_some() {
            let fault = "direct light is no diagonal where camera and projector stand apart";
            return refuse("--direct", fault, "give --direct keep: direct light connects no groups");
        }
        if self.evidence {
            let fault = "a group of the camera's pixels cannot be lit alone by a projector that stands apart";
            return refuse("--evidence", fault, "leave it out");
        }
        Ok(())
    }
}

/// The light that a blur carries across a straight border, as a fraction of the light of half a picture. Patterns and photos are blurred by
/// `blur` pixels each, so both blurs together have a standard deviation of `√2 blur`. The light of a strip that is `1/√(2π)` of this
/// deviation wide crosses the border.
fn leak(blur: f64, resolution: Resolution) -> f64 {
    let half = resolution.width.min(resolution.height) as f64 / 2.0;
    blur / std::f64::consts::PI.sqrt() / half
}

#[cfg(test)]
mod tests {
    use serde_json::{Map, json};

    use super::*;
    use crate::verbs::{from_json, signature};

    #[test]
    fn the_declaration_gives_defaults_and_record_and_signature() {
        let request = Segment { groups: vec![2, 6], photos: Some(40), ..Segment::default() };
        assert_eq!((request.eigenvectors, request.mask_below, request.cut), (10, 0.01, Cut::Normalized));
        let record = serde_json::to_value(&request).expect("a record");
        assert_eq!((&record["groups"], &record["direct"]), (&json!([2, 6]), &json!("source")));
        assert_eq!(serde_json::from_value::<Segment>(record).expect("a request"), request);
        let (about, parameters) = signature::<Segment>();
        assert!(about.starts_with("Segment a scene"), "{about}");
        let of =
            |name: &str| parameters.iter().find(|of| of.name == name).map(|of| (&*of.kind, &*of.default));
        assert_eq!(of("mu"), Some(("float", "0.0")));
        assert_eq!(of("cut"), Some(("Literal[\"normalized\", \"average\"]", "\"normalized\"")));
        assert_eq!(of("photos"), Some(("int | None", "null")));
    }

    #[test]
    fn fields_by_name_are_a_request_and_wrong_ones_are_named() {
        let asked = |fields: serde_json::Value| {
            let fields: Map<_, _> = fields.as_object().cloned().unwrap_or_default();
            from_json::<Segment>(fields).map_err(|error| error.to_string())
        };
        let request =
            asked(json!({ "groups": 2, "cut": "average", "features": [[1, 2]] })).expect("a request");
        assert_eq!(
            (request.groups, request.cut, request.features),
            (vec![2], Cut::Average, vec![Pixel(1, 2)])
        );
        for (wrong, name) in [
            (json!({ "groop": 2 }), "--groop: there is no such option\n  help: the nearest is --groups"),
            (json!({ "mu": "much" }), "--mu: \"much\" cannot be used"),
            (json!({ "photos": 1_u64 << 40 }), "--photos: 1099511627776 is too large"),
            (json!({ "photos": -1 }), "--photos: -1 cannot be used"),
            (json!({ "cut": "fair" }), "--cut: \"fair\" cannot be used"),
        ] {
            let found = asked(wrong.clone()).expect_err("a wrong field");
            assert!(found.starts_with(name), "{wrong}: {found}");
        }
    }
}
