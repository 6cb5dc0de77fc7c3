//! `captures.toml`: what the files in a folder of captures are.

use std::path::Path;

use serde::Deserialize;

use super::raw::Converter;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::raster::decode_srgb;
use crate::measure::rig_file::parse;

/// The name of the file.
pub const NAME: &str = "captures.toml";

/// The content of `captures.toml`. The guide explains each key.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spec {
    /// The arrangement of the files; it sets the defaults of other keys.
    #[serde(default)]
    pub layout: Layout,
    /// The projector pixel that lights each camera pixel directly: `"coaxial"`, `"found"` among the captures, `"none"`, or a file.
    pub map: Option<String>,
    #[serde(default)]
    pub patterns: PatternSpec,
    #[serde(default)]
    pub photos: PhotoSpec,
}

/// Arrangements of files that are in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Layout {
    /// Numbered patterns, and photos with the same numbers.
    #[default]
    Pairs,
    /// One photo for each pixel of the projector, as dual photography takes them.
    Pixels,
    /// One photo for each place of a shifted checkerboard, as for direct and global light.
    Checkerboards,
    /// A training set of CompenNet or DeProCams: `prj/train/img_*.png` and `cam/raw/train/img_*.png`.
    Compennet,
}

/// The table `[patterns]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PatternSpec {
    /// The files, with `*` in place of the number, or one `.npy` file of `N×H×W`.
    pub files: Option<String>,
    /// Columns and rows of the projector, for layouts whose patterns are not files.
    pub size: Option<[usize; 2]>,
    /// Pixels of a checkerboard's squares.
    pub square: Option<usize>,
    /// Places of a checkerboard in each direction.
    pub shifts: Option<usize>,
    /// The highest level of integers, as a number of bits.
    pub bits: Option<u32>,
    /// The projector's response.
    pub response: Option<Response>,
}

/// The table `[photos]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PhotoSpec {
    /// The files, with `*` in place of the number, or one `.npy` file of `N×H×W`. Several are repeated takes.
    pub files: Option<Several<String>>,
    /// The highest level of integers, as a number of bits.
    pub bits: Option<u32>,
    /// The level without light.
    #[serde(default)]
    pub black_level: f64,
    /// The program that converts files of other formats than pictures.
    pub converter: Option<Converter>,
    /// The camera's response.
    pub response: Option<Response>,
    /// Seconds: of all photos, of each take, or of each photo.
    pub exposure: Option<Several<f64>>,
    /// A photo of black, or several, taken with the (first) exposure.
    pub black: Option<Several<String>>,
    /// A photo of white, or several, taken with the (first) exposure.
    pub white: Option<Several<String>>,
    /// The share of the range above which a level counts as saturated.
    pub saturation: Option<f64>,
}

/// One value, or a list.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Several<T> {
    One(T),
    Many(Vec<T>),
}

impl<T: Clone> Several<T> {
    pub(super) fn list(&self) -> Vec<T> {
        match self {
            Self::One(value) => vec![value.clone()],
            Self::Many(values) => values.clone(),
        }
    }
}

/// A response: the light of a level, both from 0 to 1.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub(super) enum Response {
    /// `"linear"` or `"srgb"`.
    Named(String),
    /// The exponent of a power.
    Gamma(f64),
    /// Points `[level, light]` of a curve, joined by straight lines.
    Curve(Vec<[f64; 2]>),
}

impl Response {
    /// The light of a level. Levels below zero keep their sign, so that noise around black stays without bias.
    pub(super) fn light(&self, level: f64) -> f64 {
        match self {
            Self::Named(name) if name == "srgb" => f64::from(decode_srgb(level.abs() as f32)).copysign(level),
            Self::Named(_) => level,
            Self::Gamma(gamma) => level.abs().powf(*gamma).copysign(level),
            Self::Curve(points) => {
                let at = points.iter().position(|[x, _]| *x > level).unwrap_or(points.len() - 1).max(1);
                let [[a, b], [c, d]] = [points[at - 1], points[at]];
                b + (d - b) * (level - a) / (c - a)
            }
        }
    }

    fn check(&self) -> std::result::Result<(), String> {
        match self {
            Self::Named(name) if ["linear", "srgb"].contains(&name.as_str()) => Ok(()),
            Self::Named(name) => Err(format!("the response \"{name}\" is not known")),
            Self::Gamma(gamma) if (0.1..=10.0).contains(gamma) => Ok(()),
            Self::Gamma(gamma) => {
                Err(format!("a response with the exponent {gamma} is no camera's or projector's"))
            }
            Self::Curve(points) => {
                let rises = points.windows(2).all(|pair| pair[1][0] > pair[0][0] && pair[1][1] >= pair[0][1]);
                if points.len() >= 2 && rises {
                    Ok(())
                } else {
                    Err("the points of a response do not rise".into())
                }
            }
        }
    }
}

impl Spec {
    /// Parses the file at `path`, and checks what it says.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = String::from_utf8(crate::file::read(path)?)
            .map_err(|_| Error::data(path, "it is not text").help("write it as TOML; see the guide"))?;
        let mut spec: Self = parse(path, &text)?;
        let default = |place: &mut Option<String>, files: &str| {
            place.get_or_insert_with(|| files.to_owned());
        };
        if spec.layout == Layout::Compennet {
            default(&mut spec.patterns.files, "prj/train/img_*.png");
            spec.photos.files.get_or_insert_with(|| Several::One("cam/raw/train/img_*.png".into()));
            spec.patterns.response.get_or_insert(Response::Gamma(2.2));
            spec.photos.response.get_or_insert(Response::Gamma(2.2));
        }
        spec.check().map_err(|(fault, help)| Error::data(path, fault).help(help))?;
        Ok(spec)
    }

    fn check(&self) -> std::result::Result<(), (String, String)> {
        let (patterns, photos) = (&self.patterns, &self.photos);
        let responses = [("patterns", &patterns.response), ("photos", &photos.response)];
        for (table, response) in responses.into_iter().filter_map(|(table, of)| Some((table, of.as_ref()?))) {
            let help = "give \"linear\", \"srgb\", an exponent such as 2.2, or rising points [[level, light], …] from 0 to 1";
            response.check().map_err(|fault| (format!("[{table}]: {fault}"), help.into()))?;
        }
        for (table, bits) in [("patterns", patterns.bits), ("photos", photos.bits)] {
            if bits.is_some_and(|bits| !(1..=16).contains(&bits)) {
                return Err((format!("[{table}]: bits = {}", bits.unwrap_or(0)), "give 1 to 16 bits".into()));
            }
        }
        let exposures = photos.exposure.as_ref().map_or_else(Vec::new, Several::list);
        if let Some(exposure) = exposures.iter().find(|exposure| !(**exposure > 0.0 && exposure.is_finite()))
        {
            return Err((format!("[photos]: an exposure of {exposure} s"), "give seconds above 0".into()));
        }
        if photos.saturation.is_some_and(|share| !(share > 0.0 && share <= 1.0)) {
            return Err((
                "[photos]: saturation".into(),
                "give a share of the range above 0 and at most 1".into(),
            ));
        }
        let needed = [
            (photos.files.is_none(), "[photos] has no files", "files = \"photos/*.png\""),
            (
                self.layout == Layout::Pairs && patterns.files.is_none(),
                "[patterns] has no files",
                "files = \"patterns/*.png\"",
            ),
            (
                matches!(self.layout, Layout::Pixels | Layout::Checkerboards) && self.size().is_none(),
                "[patterns] has no size, and this layout has no files of patterns",
                "size = [32, 24], the columns and rows of the projector",
            ),
        ];
        match needed.into_iter().find(|(is_missing, ..)| *is_missing) {
            Some((_, fault, help)) => Err((fault.into(), format!("add, for example, {help}"))),
            None => Ok(()),
        }
    }

    /// The projector's size, if the file states one.
    pub(super) fn size(&self) -> Option<Resolution> {
        self.patterns
            .size
            .map(|[width, height]| Resolution::new(width, height))
            .filter(|size| size.pixels() > 0)
    }
}
