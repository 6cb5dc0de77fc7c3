//! Single pictures of a source: a photo under a pattern, and the true region of each pixel.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::pattern::Pattern;
use super::plan::{fact_of, range};
use crate::error::{Error, Result};
use crate::finding::{Grade, worst};
use crate::image::{Image, Resolution};
use crate::io::name::Name;
use crate::io::{npy, picture, raster};
use crate::lab::{
    self, Lab, Log, OperatorChoice, OperatorSettings, SinglePhoto, SourceKind, byte_count, text,
};
use crate::report::print::printed;
use crate::report::{content::Content, figure};
use crate::transport::Channels;

/// Take one photo of a scene under a pattern
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "Example:\n  krylux photo scene.glb --pattern checker:8 -o photo.exr -o photo.png")]
pub struct TakePhoto {
    /// What is projected: white, black, left, checker:N, stripes:N, pixel:X,Y, or an image file (.npy, .exr, .png, .tif …)
    #[arg(long, value_name = "PATTERN", default_value = "white")]
    pub pattern: Pattern,
    /// Gray or coloured [default: rgb; a rig's photo is what its camera sees]
    #[arg(long, value_enum)]
    pub channels: Option<Channels>,
    /// Trace for this one photo, or build the matrix and multiply (the same photo, to rounding); auto multiplies if the
    /// matrix is in the cache
    #[arg(long, value_enum, default_value = "auto")]
    pub operator: OperatorChoice,
    /// The memory that the photo may take, or the matrix while it is assembled, e.g. 8GiB or 500MB [default: half of the machine's]
    #[arg(long, value_name = "BYTES", value_parser = byte_count)]
    pub memory: Option<u64>,
    /// Where the photo goes, by extension: .exr and .npy keep the radiance, .png is for people; may be given several times
    /// [default: photo.png, or the first free one of photo-2.png, photo-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The exposure of .png files: a factor, after which light of 1 is white; or auto, with which the brightest half per cent is white, unless
    /// half of the photo would then be brighter than half of white
    #[arg(long, value_name = "auto|X", default_value = "auto")]
    pub exposure: Exposure,
    /// Pixels of .png files for each pixel of the photo, along each side [default: 1; without -o, at least 512 pixels a side, with
    /// a bar of the values]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub scale: Option<u8>,
    /// The file for the standard error of each pixel, an image as large as the photo; a scene is then traced for this photo alone
    #[arg(long, value_name = "FILE")]
    pub error: Option<PathBuf>,
}

/// The largest side, in pixels, of a picture that is enlarged.
const MOST_PIXELS: usize = 16_384;

/// The exposure of a picture for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// The exposure of [`raster::exposure`].
    Auto,
    /// All light is multiplied by this factor. Light of 1 is then white.
    Times(f32),
}

impl FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.trim().parse() {
            _ if text == "auto" => Ok(Self::Auto),
            Ok(factor) if factor > 0.0 && f32::is_finite(factor) => Ok(Self::Times(factor)),
            _ => Err(format!("`{text}` is neither auto nor a number above 0")),
        }
    }
}

/// Write which region of the scene each pixel sees: the truth that a segmentation is measured against
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "Example:\n  krylux labels scene.glb --size 128 -o labels.png")]
pub struct WriteLabels {
    /// Pixels of the camera, and of the projector where that has no --projector-size: 128, or 128x96 [default: 128]
    #[arg(long, value_name = "N|WxH", value_parser = lab::size)]
    pub size: Option<Resolution>,
    /// The graphics adapter whose name contains this; `krylux info` lists them
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Where they go: .npy keeps the numbers (255 is a pixel that sees nothing), .png shows them; may be given several times
    /// [default: labels.png, or the first free one of labels-2.png, labels-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    pub files: Vec<PathBuf>,
}

impl TakePhoto {
    /// How the photo of a scene is computed. Only a photo that is traced separately has a known error.
    pub fn operator(&self, source: &Path) -> OperatorSettings {
        let is_traced = self.error.is_some() && SourceKind::of(source) == SourceKind::Scene;
        let choice = match self.operator {
            OperatorChoice::Auto if is_traced => OperatorChoice::Retrace,
            choice => choice,
        };
        OperatorSettings { choice, memory: self.memory, ..OperatorSettings::default() }
    }

    /// Writes an image. A `.png` file has the requested exposure and scale, or is for people and states the unit of `printed_in`.
    fn write_picture(&self, file: &Path, image: &Image, printed_in: Option<&str>) -> Result<()> {
        picture::write_shown(file, image, |image| {
            let factor = match self.exposure {
                Exposure::Auto => raster::exposure(image),
                Exposure::Times(factor) => factor,
            };
            match printed_in {
                Some(unit) => printed(&figure::light(image, factor, unit, "").named("photo", "")),
                None => raster::develop(image, factor).enlarged(usize::from(self.scale.unwrap_or(1))),
            }
        })
    }

    /// Refuses a scale with which a picture of this resolution would be too large for viewers and memory. Fails with [`Error::Option`].
    pub fn check_scale(&self, Resolution { width, height }: Resolution) -> Result<()> {
        let scale = self.scale.unwrap_or(1);
        let side = width.max(height).saturating_mul(usize::from(scale));
        if scale == 1 || side <= MOST_PIXELS {
            return Ok(());
        }
        let fault = format!("{scale} makes a picture with a side of {side} pixels");
        Err(Error::option("--scale", fault)
            .help(format!("choose one with at most {MOST_PIXELS} pixels a side")))
    }

    /// Writes the photo into `files`, writes its standard error if a file is named for it, and ends the open run. The returned flag is
    /// false if a finding about the rig fails. Fails if a file cannot be written or the standard error is not known.
    pub fn write(
        &self,
        lab: &mut Lab,
        taken: &SinglePhoto,
        files: &[PathBuf],
    ) -> Result<(Content<'static>, bool)> {
        let photo = &taken.photo;
        let is_for_people = self.files.is_empty() && self.scale.is_none();
        for file in files {
            self.write_picture(file, photo, is_for_people.then_some(lab.unit()))?;
            tell_written(lab, file);
        }
        if let Some(file) = &self.error {
            self.write_picture(file, taken.standard_error.as_ref().ok_or_else(unknown_error)?, None)?;
            tell_written(lab, file);
        }
        let mut content = Content::default();
        let range = range(photo.samples().iter().map(|&sample| f64::from(sample)));
        let unit = lab.unit();
        let [shown_mean, least, greatest] = range.map(|value| text::decimal(value, 5));
        content.line(format_args!("radiance  mean {shown_mean}, from {least} to {greatest} {unit}"));
        let of = if taken.is_of_white { "the white photo" } else { "the photo" };
        if let Some(noise) = taken.noise {
            content.line(format_args!("noise     {} % of {of}", text::percent(noise)));
        }
        content.fact("files", files.iter().map(Name::from).collect::<Vec<_>>());
        content.fact("error_file", self.error.as_ref().map(Name::from));
        content.fact("resolution", photo.resolution());
        content.fact("noise", taken.noise);
        content.fact("radiance", fact_of(range));
        content.fact("unit", unit);
        match lab.kind() {
            SourceKind::Scene => content.fact("samples_per_pixel", lab.trace_settings().map(|s| s.samples)),
            _ => content.fact("rig", &taken.rig),
        }
        lab.end_run(1, "photographed")?;
        let findings = taken.rig.as_ref().map_or(&[][..], |rig| &rig.findings);
        for finding in findings.iter().filter(|finding| finding.grade != Grade::Ok) {
            content.line(format_args!("finding   {finding}"));
        }
        Ok((content, worst(findings) != Grade::Fails))
    }
}

/// Tells the observer of each file at once, since a later file may fail.
fn tell_written(lab: &Lab, file: &Path) {
    lab.observer().info(format_args!("wrote     {}", file.display()));
}

fn unknown_error() -> Error {
    let help = "of a scene, give --spp 2 or more, and leave out --operator replay; of other sources only a rig knows it";
    Error::option("--error", "the standard error of this photo is not known").help(help)
}

impl WriteLabels {
    /// Writes the labels into `files`. Fails as [`Lab::labels`] and if a file cannot be written.
    pub fn ask(lab: &Lab, files: &[PathBuf]) -> Result<Content<'static>> {
        let (resolution, labels) = (lab.resolution(), lab.labels()?);
        let regions = &lab.scene()?.regions;
        let mut content = Content::default();
        for file in files {
            write_labels(file, resolution, &labels)?;
            tell_written(lab, file);
        }
        let count = |region| labels.iter().filter(|&&label| usize::from(label) == region).count();
        let pixels: Vec<usize> = (0..regions.len()).map(count).collect();
        for (index, (name, &pixels)) in regions.iter().zip(&pixels).enumerate() {
            let share = 100.0 * pixels as f64 / labels.len() as f64;
            content.line(format_args!("region    {index}: {share:5.1} %  {name}"));
        }
        content.fact("files", files.iter().map(Name::from).collect::<Vec<_>>());
        content.fact("resolution", resolution);
        content.fact("regions", regions);
        content.fact("pixels", pixels);
        Ok(content)
    }
}

fn write_labels(file: &Path, resolution: Resolution, labels: &[u8]) -> Result<()> {
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("npy") => npy::write_npy(file, &[resolution.height, resolution.width], labels),
        Some("png") => {
            printed(&figure::labels(resolution, labels, "").named("true regions", "")).write_png(file)
        }
        _ => {
            Err(Error::data(file, "labels are written as numbers or as a picture")
                .help("name it .npy or .png"))
        }
    }
}
