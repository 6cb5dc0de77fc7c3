//! Light transport compensation: the pattern to project so that the scene looks like a target.

mod answer;
mod page;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::options::{count, method, not_planned, number};
use crate::analysis::compensate::{compare_methods, compensate_by_model, compensate_with};
use crate::analysis::{CompensateOptions, Crosstalk, Precondition, Prior, Target};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::{model, name, picture};
use crate::krylov::{Constraint, Method};
use crate::lab::{ChannelChoice, GivenArray, Lab, LabOperator, Log, Verb, model_shape, open_model};
use crate::operator::product;
use crate::scene::predicted_direct;
use crate::transport::{Channels, Part};

pub use answer::Compensated;

/// Find what to project so that the scene looks like a target image
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(after_help = "Example:\n  krylux compensate scene.glb --target target.png -o out/compensated")]
pub struct Compensate {
    /// What is to be seen: an image file (.npy, .exr, .png, .tif …) of values in [0, 1], as large as --size
    #[arg(long, value_name = "FILE", required = true, value_parser = PathBufValueParser::new().map(Picture::File))]
    pub target: Option<Picture>,
    /// As in section 8.3 of the paper: MINRES (GMRES where the rig is not coaxial) without preconditioner, five photos, and the answer
    /// clamped. Options given beside it replace these. Section 6.3 of the paper proposes --lift
    #[arg(long)]
    pub paper: bool,
    /// How: inside the projector's range: krylov-box, fista, jacobi; not negative: mrnsd, multiplicative; clipped
    /// afterwards: minres, gmres, fgmres, cg, cgs, bicgstab, lsqr, lsmr [default: krylov-box]
    #[arg(long, value_name = "NAME", value_parser = method)]
    pub method: Option<Method>,
    /// Photos that the method may take, beside the white one [default: 20, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
    /// Done when what is seen differs from the target by at most this share of it; exit status 1 if that is not reached
    /// [default: 0.001, and no such status]
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    pub rtol: Option<f64>,
    /// Move the target's values from [0, 1] to [α, 1], so that less light has to be taken away [default: 0]
    #[arg(long, value_name = "α", value_parser = number::<f64>)]
    pub lift: Option<f64>,
    /// The least that is projected: patterns have values in [FLOOR, 1]
    #[arg(long, value_name = "FLOOR", default_value_t = 0.0, value_parser = number::<f64>)]
    pub floor: f64,
    /// What speeds up methods without a box [default: diagonal]
    #[arg(long, value_enum)]
    pub precondition: Option<Precondition>,
    /// A lens is out of focus: krylov-box then models the light as a mixture of blurs, which it always does if the rig is not coaxial
    #[arg(long)]
    pub out_of_focus: bool,
    /// The width of the lens' blur in pixels, for --precondition defocus [default: measured by one photo more]
    #[arg(long, value_name = "PIXELS", value_parser = number::<f64>)]
    pub defocus: Option<f64>,
    /// The radiance that 1 in the target stands for, in W/(m² sr), or in DN/s on a rig [default: half the median of the white photo]
    #[arg(long, value_name = "L", value_parser = number::<f64>)]
    pub peak: Option<f64>,
    /// The folder of a run on this source, by `krylux relight` or any verb that keeps its photos: the pattern is computed from a model of
    /// its photos, and --photos only correct it. If SOURCE is itself a run of `krylux relight`, no photo is taken
    #[arg(long, value_name = "FOLDER")]
    pub model: Option<PathBuf>,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    #[serde(skip)]
    pub channels: Channels,
    /// What each camera channel sees of each projector colour, row by row: nine numbers, or `measure`: from three photos more, of
    /// red, green and blue. The light is mixed so, and all three colours are solved as one system
    #[arg(long, value_name = "measure|M11,M12,...")]
    pub crosstalk: Option<Mixing>,
    /// Solve each channel by itself and un-mix the colours afterwards
    #[arg(long, requires = "crosstalk")]
    pub unmix: bool,
    /// Give every method as many photos, and show them all on one plot
    #[arg(long)]
    pub compare_methods: bool,
}

/// A picture in a request: a file, or pixel values.
#[derive(Clone, Debug)]
pub enum Picture {
    /// The file of an image.
    File(PathBuf),
    /// The pixel values. The record of a run does not contain them.
    Pixels(Image),
}

impl From<Image> for Picture {
    fn from(image: Image) -> Self {
        Self::Pixels(image)
    }
}

impl Serialize for Picture {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::File(path) => name::serialize(path, serializer),
            Self::Pixels(_) => serializer.serialize_none(),
        }
    }
}

impl<'de> Deserialize<'de> for Picture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        name::deserialize(deserializer).map(Self::File)
    }
}

/// How the colours of projector and camera mix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mixing {
    /// Measured by three photos of red, green and blue.
    Measure,
    /// The response of each camera channel to each projector colour, row by row.
    #[serde(untagged)]
    Matrix([[f64; 3]; 3]),
}

impl FromStr for Mixing {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text == "measure" {
            return Ok(Self::Measure);
        }
        let entry = |entry: &str| {
            number(entry.trim()).map_err(|_| format!("`{entry}` is no number; give nine, or `measure`"))
        };
        let entries: Vec<f64> = text.split(',').map(entry).collect::<std::result::Result<_, String>>()?;
        match entries.as_chunks::<3>() {
            (&[a, b, c], []) => Ok(Self::Matrix([a, b, c])),
            _ => Err(format!(
                "{} numbers for a matrix of 3 by 3; give nine, a row for each camera channel",
                entries.len()
            )),
        }
    }
}

impl Verb for Compensate {
    const NAME: &'static str = "compensate";
    type Answer = Compensated;

    fn check(&self) -> Result<()> {
        if self.target.is_none() {
            return Err(no_target());
        }
        // Zero photos pass this check, since they are valid with a model.
        let options = self.options(true, None);
        CompensateOptions { photos: options.photos.max(1), ..options }.check()?;
        match self.crosstalk {
            Some(Mixing::Matrix(matrix)) => Crosstalk::new(matrix).map(drop),
            _ => Ok(()),
        }
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        if let Some(folder) = &self.model {
            check_model(lab, model_shape(folder)?.1)?;
        } else if !lab.has_saved_model() {
            self.options(true, None).check()?;
            if self.crosstalk.is_some() && lab.channels() == Channels::Luma {
                return Err(Error::option("--crosstalk", "gray light has no colours to mix")
                    .help("add --channels rgb"));
            }
        }
        self.target(lab.resolution(), lab.channels()).map(drop)
    }

    fn channels(&self, source: &Path) -> Result<ChannelChoice> {
        match &self.model {
            Some(folder) => Ok(model_shape(folder)?.0.into()),
            None if model::is_in(source) => Ok(ChannelChoice::Native),
            None => Ok(self.channels.into()),
        }
    }

    fn give(&mut self, given: Vec<GivenArray>) -> Result<()> {
        for array in given {
            match array.field.as_str() {
                "target" => self.target = Some(array.image()?.into()),
                _ => return Err(array.not_taken()),
            }
        }
        Ok(())
    }

    /// Finds the pattern, either from photos of the source or from a model of its light transport.
    fn answer(&self, lab: &mut Lab) -> Result<Compensated> {
        if self.model.is_some() || lab.has_saved_model() {
            return self.by_model(lab);
        }
        let is_symmetric = self.crosstalk.is_none() && lab.is_symmetric()?;
        let mut options = self.options(is_symmetric, lab.photos_of_run());
        if self.method.is_none() && !self.paper && lab.resolution() != lab.projector_resolution() {
            // Light that is let through in both directions gives the least-squares optimum itself.
            options.method = Method::Fista;
        }
        let options = CompensateOptions { baseline: lab.is_simulated()?, ..options };
        lab.allow_photos(options.photos);
        let target = Target::new(&self.target(lab.resolution(), lab.channels())?, &lab.ambient()?)?;
        let target = target.for_projector(lab.projector_resolution());
        let prior = self.prior(&options, lab)?;
        let mut channels = lab.operators(Part::Full)?;
        lab.expect(1 + options.photos);
        let (found, methods) = lab.photos(|_| {
            let found = compensate_with(&mut channels, &target, &options, &prior)?;
            let methods = match self.compare_methods {
                true => compare_methods(&mut channels, &target, &options, &prior)?,
                false => Vec::new(),
            };
            Ok((found, methods))
        })?;
        Ok(Compensated { methods, ..Compensated::new(self, found, options, lab) })
    }
}

impl Compensate {
    /// The options of the method. `is_symmetric` describes the light transport. `photos_of_run` is the default budget of a replayed run.
    pub fn options(&self, is_symmetric: bool, photos_of_run: Option<usize>) -> CompensateOptions {
        let base = match self.paper {
            true => CompensateOptions::paper(is_symmetric),
            false => CompensateOptions::default(),
        };
        let method = self.method.unwrap_or(base.method);
        let is_free = method.facts().constraint == Constraint::None;
        CompensateOptions {
            method,
            photos: self.photos.or(photos_of_run).unwrap_or(base.photos),
            rtol: self.rtol.unwrap_or(base.rtol),
            must_reach: self.rtol.is_some(),
            floor: self.floor,
            lift: self.lift.unwrap_or(base.lift),
            peak: self.peak,
            precondition: self.precondition.or(base.precondition.filter(|_| is_free)),
            defocus: self.defocus,
            out_of_focus: self.out_of_focus,
            ..base
        }
    }

    /// Refuses options for which a plan cannot predict the answer on a rig, with [`Error::Option`].
    pub fn check_plan(&self) -> Result<()> {
        let given = [
            (self.peak.is_some(), "--peak"),
            (self.crosstalk.is_some(), "--crosstalk"),
            (self.channels == Channels::Rgb, "--channels"),
            (self.compare_methods, "--compare-methods"),
            (self.model.is_some(), "--model"),
        ];
        not_planned(Self::NAME, &given)
    }

    /// The target image. Its size and its values are checked.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--target`, or [`Error::Data`] and [`Error::Read`] naming its file.
    pub fn target(&self, resolution: Resolution, channels: Channels) -> Result<Image> {
        let image = match &self.target {
            Some(Picture::File(path)) => picture::read_sized(path, resolution, "the camera")?,
            Some(Picture::Pixels(image)) => image.clone(),
            None => return Err(no_target()),
        };
        let unusable = |fault: String, help: &str| match &self.target {
            Some(Picture::File(path)) => Error::data(path, fault).help(help),
            _ => Error::option("--target", fault).help(help),
        };
        let image = match image.channels() > channels.count() {
            true => image.gray().ok_or_else(|| {
                unusable(
                    "it has colours, but --channels luma has none".into(),
                    "give a gray image, or --channels rgb",
                )
            })?,
            false => image,
        };
        let range = |(low, high): (f32, f32), &value: &f32| (low.min(value), high.max(value));
        let (low, high) = image.samples().iter().fold((f32::INFINITY, f32::NEG_INFINITY), range);
        if low < 0.0 || high > 1.0 {
            let fault = format!("its values are from {low} to {high}, but a target's are from 0 to 1");
            return Err(unusable(fault, "scale it, and say by --peak what 1 stands for"));
        }
        if high == 0.0 {
            return Err(unusable("it is black".into(), "give an image with light in it"));
        }
        Ok(image)
    }

    /// Computes the answer from a model of the light transport. A model of the source needs no photo. A model from `--model` is corrected
    /// by photos.
    fn by_model(&self, lab: &mut Lab) -> Result<Compensated> {
        let mut model = match &self.model {
            Some(folder) => open_model(folder, lab.observer())?,
            None => lab.model()?,
        };
        let mut options = CompensateOptions { photos: 1, baseline: false, ..self.options(true, None) };
        if self.method.is_none() && model.resolution != model.projector {
            options.method = Method::Fista;
        }
        let target = self.target(model.resolution, Channels::of(model.channels.len()))?;
        let target = Target::new(&target, &model.ambient)?.for_projector(model.projector);
        if self.model.is_none() {
            let mut no_photos = |_: &[Vec<f64>]| Err(Error::Interrupted);
            let found = lab.timed("model", |_| {
                compensate_by_model(&mut model.channels, &target, &options, 0, &mut no_photos)
            })?;
            let model = Some((model.source, model.unit));
            return Ok(Compensated { model, ..Compensated::new(self, found, options, lab) });
        }
        let corrections = self.photos.unwrap_or(CompensateOptions::default().photos);
        let mut operators = lab.operators(Part::Full)?;
        lab.expect(corrections);
        let found = lab.photos(|_| {
            let mut photograph = |patterns: &[Vec<f64>]| {
                let photo = |(of, pattern): (&mut LabOperator, &Vec<f64>)| product(of, pattern);
                operators.iter_mut().zip(patterns).map(photo).collect()
            };
            compensate_by_model(&mut model.channels, &target, &options, corrections, &mut photograph)
        })?;
        Ok(Compensated::new(self, found, options, lab))
    }

    /// Knowledge about the light transport beside the photos.
    fn prior(&self, options: &CompensateOptions, lab: &mut Lab) -> Result<Prior> {
        let geometry = match (options.precondition, lab.scene()) {
            (Some(Precondition::Geometry), Ok(scene)) => predicted_direct(scene, lab.resolution()),
            // Without a scene, the solver reports that the shape of the scene is unknown.
            _ => Vec::new(),
        };
        let (crosstalk, photos) = match self.crosstalk {
            None => (None, 0),
            Some(Mixing::Matrix(matrix)) => (Some(Crosstalk::new(matrix)?), 0),
            Some(Mixing::Measure) => {
                let photos = lab.primaries()?;
                let measured = Crosstalk::measured(&photos)?;
                let row = |row: &[f64; 3]| row.map(|entry| format!("{entry:.4}")).join(" ");
                lab.observer().info(format_args!(
                    "crosstalk {} (red, green and blue, in each camera channel)",
                    measured.matrix().each_ref().map(row).join(" | ")
                ));
                (Some(measured), photos.len())
            }
        };
        let mut crosstalk = match crosstalk {
            // The products of a rig are measured with gray patterns, so the crosstalk is expressed relative to white.
            Some(crosstalk) if !lab.is_simulated()? => Some(crosstalk.relative_to_white()?),
            crosstalk => crosstalk,
        };
        crosstalk.iter_mut().for_each(|crosstalk| crosstalk.coupled = !self.unmix);
        let direct = match options.precondition {
            Some(Precondition::Direct) if lab.is_simulated()? => lab.white_of(Part::Direct)?,
            _ => Vec::new(),
        };
        let map = lab.maps_to_projector()?;
        Ok(Prior { direct, geometry, crosstalk, map, photos, start: None })
    }
}

fn no_target() -> Error {
    Error::option("--target", "it is not said what is to be seen").help("give a picture of values in [0, 1]")
}

/// Refuses a model if its photos or patterns differ in resolution from those of the source.
fn check_model(lab: &Lab, [photos, patterns]: [Resolution; 2]) -> Result<()> {
    if (lab.resolution(), lab.projector_resolution()) == (photos, patterns) {
        return Ok(());
    }
    let [name, own] = [lab.name(), lab.resolution().to_string()];
    Err(Error::option("--model", format!("its photos have {photos} pixels, but those of {name} have {own}"))
        .help(format!("give --size {photos}, or the source that it was captured from")))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::verbs::{from_json, signature};

    #[test]
    fn the_declaration_gives_defaults_and_record_and_signature() {
        let request = Compensate { target: Some(Picture::File("a.npy".into())), ..Compensate::default() };
        assert_eq!((request.floor, request.channels, request.method), (0.0, Channels::Luma, None));
        let record = serde_json::to_value(&request).expect("a record");
        assert_eq!((&record["target"], record.get("channels")), (&json!("a.npy"), None));
        let (_, parameters) = signature::<Compensate>();
        let names: Vec<&str> = parameters.iter().map(|of| &*of.name).collect();
        assert!(
            names.starts_with(&["target", "paper", "method"]) && !names.contains(&"channels"),
            "{names:?}"
        );
        assert_eq!(parameters[0].kind, "ArrayLike | str | PathLike[str] | None");
    }

    #[test]
    fn fields_by_name_are_a_request_and_wrong_ones_are_named() {
        let asked = |fields: serde_json::Value| {
            let fields = fields.as_object().cloned().unwrap_or_default();
            from_json::<Compensate>(fields).map_err(|error| error.to_string())
        };
        let rows = [[1.0, 0.25, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let request = asked(json!({ "method": "bicgstab", "precondition": "defocus", "crosstalk": rows }))
            .expect("a request");
        assert_eq!(request.method, Some(Method::BiCgStab));
        assert_eq!(request.precondition, Some(Precondition::Defocus));
        assert_eq!(request.crosstalk, Some(Mixing::Matrix(rows)));
        let measured = asked(json!({ "crosstalk": "measure" })).expect("a request");
        assert_eq!(measured.crosstalk, Some(Mixing::Measure));
        for (name, value) in [("method", "magic"), ("precondition", "magic"), ("crosstalk", "magic")] {
            let found = asked(json!({ name: value })).expect_err("a wrong field");
            assert!(found.starts_with(&format!("--{name}: ")), "{found}");
        }
    }

    #[test]
    fn a_mixing_matrix_is_nine_numbers() {
        let rows = [[1.0, 0.3, 0.05], [0.1, 1.0, 0.25], [0.02, 0.15, 1.0]];
        assert_eq!("1,0.3,0.05, 0.1,1,0.25, 0.02,0.15,1".parse(), Ok(Mixing::Matrix(rows)));
        assert_eq!("measure".parse(), Ok(Mixing::Measure));
        for wrong in ["1,2,3", "1,2,3,4,5,6,7,8,9,10", "1,2,3,4,5,6,7,8,x", ""] {
            assert!(wrong.parse::<Mixing>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_target_has_values_from_0_to_1_and_some_light() {
        let size = Resolution::new(2, 2);
        let of = |value: f32, channels: usize| {
            let target = Some(Image::filled(size, channels, value).into());
            Compensate { target, ..Compensate::default() }.target(size, Channels::Luma)
        };
        assert_eq!(of(0.5, 3).map(|image| image.channels()).ok(), Some(1), "gray light in three channels");
        for value in [-0.5, 0.0, 1.5] {
            assert!(of(value, 1).is_err_and(|error| error.to_string().starts_with("--target")), "{value}");
        }
        assert!(Compensate::default().check().is_err_and(|error| error.to_string().starts_with("--target")));
    }
}
