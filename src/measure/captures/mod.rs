//! A folder of captures that others took: patterns and photos, as linear light.
//!
//! `captures.toml` in the folder says what the files are ([guide](https://docs.rs/krylux), "Captures of others"). A folder with this file is
//! a source as any other.

mod files;
mod raw;
mod spec;

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, percent};
use crate::image::{Image, Resolution};
use crate::io::npy;
use crate::measure::shifted_checkerboards;

use files::Stack;
pub use spec::NAME;
use spec::{Layout, Response, Several, Spec};

/// Patterns and photos as linear light.
#[derive(Clone, Debug)]
pub struct Captures {
    /// The name of the folder.
    pub name: String,
    /// `captures.toml`.
    pub path: PathBuf,
    /// The patterns (`N` images of the projector's pixels), from 0 to 1.
    pub patterns: Vec<Image>,
    /// The photos (`N` images of the camera's pixels), the mean of all takes, without black. A sample is NaN where every take was saturated.
    pub photos: Vec<Image>,
    /// The photo of black.
    pub ambient: Image,
    /// The standard deviation of each sample of a photo, if there are repeated takes.
    pub noise: Option<Image>,
    /// The map from camera to projector.
    pub map: CaptureMap,
    /// The unit of photos.
    pub unit: &'static str,
    /// The findings about the files.
    pub findings: Vec<Finding>,
}

/// The map from the camera's to the projector's pixels.
#[derive(Clone, Debug, PartialEq)]
pub enum CaptureMap {
    /// Camera and projector see the same picture.
    Coaxial,
    /// The map is to be found from the photos.
    Found,
    /// There is none.
    None,
    /// Column and row of the projector for each camera pixel.
    Given(Vec<Option<[f64; 2]>>),
}

/// Levels of at least this share of the range count as saturated, unless the file says otherwise.
const SATURATED: f64 = 0.99;

/// Whether a folder holds captures that are described.
pub fn is_captures(folder: &Path) -> bool {
    folder.join(NAME).is_file()
}

impl Captures {
    /// Reads a folder of captures.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Data`] naming the file: `captures.toml`, a missing picture, a picture without its partner, or a picture whose
    /// size or number of channels differs from the others.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let spec = Spec::read(&path)?;
        let reader = Reader { folder, path: &path, spec: &spec };
        reader.captures()
    }
}

struct Reader<'a> {
    folder: &'a Path,
    path: &'a Path,
    spec: &'a Spec,
}

impl Reader<'_> {
    fn captures(&self) -> Result<Captures> {
        let takes = self.spec.photos.files.as_ref().map_or_else(Vec::new, Several::list);
        let takes: Vec<Stack> =
            takes.iter().map(|name| Stack::find(self.folder, name, "photos")).collect::<Result<_>>()?;
        let Some(first) = takes.first() else {
            return Err(Error::data(self.path, "[photos] has an empty list of files").help("name the photos"));
        };
        takes[1..].iter().try_for_each(|take| take.match_with(first))?;
        let mut patterns = self.patterns(first)?;
        let exposures = self.exposures(takes.len(), first.len())?;
        let dark = self.frame(self.spec.photos.black.as_ref(), exposures(0, 0))?;
        let mut photos = Vec::new();
        let mut findings = Vec::new();
        let mut spread: Option<Vec<[f64; 2]>> = None;
        for at in 0..first.len() {
            let mut of_takes = Vec::new();
            for (take, stack) in takes.iter().enumerate() {
                let light = self.light(
                    &stack.path(at),
                    stack.read(at, self.spec.photos.converter)?,
                    exposures(take, at),
                )?;
                of_takes.push(self.alike(light, &stack.path(at), photos.first().or(dark.as_ref()))?);
            }
            photos.push(mean(&of_takes, &mut spread)?);
        }
        if let Some(white) = self.frame(self.spec.photos.white.as_ref(), exposures(0, 0))? {
            let white = self.alike(white, self.path, photos.first())?;
            patterns.push(Image::filled(patterns[0].resolution(), 1, 1.0));
            photos.push(white);
        }
        findings.extend(saturated(&photos, first));
        let ambient = match dark {
            Some(dark) => dark,
            None => Image::filled(photos[0].resolution(), photos[0].channels(), 0.0),
        };
        for photo in &mut photos {
            photo.samples_mut().iter_mut().zip(ambient.samples()).for_each(|(value, dark)| *value -= dark);
        }
        let noise = spread.map(|spread| noise(&spread, &photos, takes.len())).transpose()?;
        let name = self.folder.file_name().map(|name| name.to_string_lossy().into_owned());
        Ok(Captures {
            name: name.unwrap_or_else(|| "captures".into()),
            path: self.path.to_path_buf(),
            map: self.map(photos[0].resolution(), patterns[0].resolution())?,
            unit: if self.spec.photos.exposure.is_some() { "full scale/s" } else { "full scale" },
            patterns,
            photos,
            ambient,
            noise,
            findings,
        })
    }

    /// The patterns, one for each photo.
    fn patterns(&self, photos: &Stack) -> Result<Vec<Image>> {
        let spec = &self.spec.patterns;
        let Some(name) = &spec.files else { return self.computed(photos) };
        let stack = Stack::find(self.folder, name, "patterns")?;
        photos.match_with(&stack)?;
        let response = spec.response.clone().unwrap_or(Response::Gamma(1.0));
        let mut patterns: Vec<Image> = Vec::new();
        for at in 0..stack.len() {
            let path = stack.path(at);
            let (mut image, levels) = stack.read(at, None)?;
            let full = spec.bits.map(highest).or(levels.map(f64::from)).unwrap_or(1.0);
            require_range(&path, &image, full, "[patterns]")?;
            for value in image.samples_mut() {
                *value = response.light(f64::from(*value) / full) as f32;
            }
            let image = image.gray().unwrap_or(image);
            if let Some(first) = patterns.first().filter(|first| first.resolution() != image.resolution()) {
                return Err(unlike(&path, image.resolution(), first.resolution(), "patterns"));
            }
            patterns.push(image);
        }
        if let Some(size) = self.spec.size().filter(|size| *size != patterns[0].resolution()) {
            return Err(unlike(self.path, patterns[0].resolution(), size, "patterns"));
        }
        Ok(patterns)
    }

    /// Patterns that the layout tells.
    fn computed(&self, photos: &Stack) -> Result<Vec<Image>> {
        let size = self.spec.size().unwrap_or(Resolution::new(1, 1));
        let pattern = |values: Vec<f64>| Image::from_planes(size, &[values]);
        match self.spec.layout {
            Layout::Checkerboards => {
                let (square, shifts) = (
                    self.spec.patterns.square.unwrap_or(2).max(1),
                    self.spec.patterns.shifts.unwrap_or(4).max(1),
                );
                photos.require(
                    shifts * shifts,
                    &format!("{shifts}×{shifts} places take {}", shifts * shifts),
                )?;
                shifted_checkerboards(size, square, shifts).map(pattern).collect()
            }
            _ => {
                let count = size.pixels();
                photos.require(count, &format!("a projector of {size} has {count} pixels"))?;
                let lit = |k: usize| (0..count).map(|pixel| f64::from(u8::from(pixel == k))).collect();
                (0..count).map(|k| pattern(lit(k))).collect()
            }
        }
    }

    /// The exposure of each take and photo, relative to one second, or 1 where none is stated.
    fn exposures(&self, takes: usize, photos: usize) -> Result<impl Fn(usize, usize) -> f64 + use<>> {
        let list = self.spec.photos.exposure.as_ref().map_or_else(|| vec![1.0], Several::list);
        let by_take = list.len() == takes && takes > 1;
        if !(list.len() == 1 || by_take || list.len() == photos) {
            return Err(Error::data(
                self.path,
                format!("[photos]: exposure has {} values for {photos} photos of {takes} takes", list.len()),
            )
            .help("give one value for all photos, one for each take, or one for each photo"));
        }
        Ok(move |take: usize, photo: usize| {
            let at = if list.len() == 1 {
                0
            } else if by_take {
                take
            } else {
                photo
            };
            list.get(at).copied().unwrap_or(1.0)
        })
    }

    /// The light of a photo's levels. Saturated samples become NaN.
    fn light(&self, path: &Path, (mut image, levels): (Image, Option<f32>), exposure: f64) -> Result<Image> {
        let spec = &self.spec.photos;
        let stated = spec.bits.map(highest).or(levels.map(f64::from));
        let full = stated.unwrap_or(1.0);
        if stated.is_some() {
            require_range(path, &image, full, "[photos]")?;
        }
        if spec.black_level < 0.0 || spec.black_level >= full {
            return Err(Error::data(self.path, format!("[photos]: black_level = {}", spec.black_level))
                .help(format!("give a level from 0 to {full}")));
        }
        // Numbers without a range saturate only if the file says where.
        let limit = match (stated, spec.saturation) {
            (None, None) => f64::INFINITY,
            (_, share) => share.unwrap_or(SATURATED) * full,
        };
        let linear = Response::Gamma(1.0);
        let response = spec.response.as_ref().unwrap_or(&linear);
        for value in image.samples_mut() {
            let level = f64::from(*value);
            let light = response.light((level - spec.black_level) / (full - spec.black_level)) / exposure;
            *value = if level >= limit { f32::NAN } else { light as f32 };
        }
        Ok(image)
    }

    /// A separate frame, the mean of its takes.
    fn frame(&self, names: Option<&Several<String>>, exposure: f64) -> Result<Option<Image>> {
        let Some(names) = names.map(Several::list) else { return Ok(None) };
        let mut frames: Vec<Image> = Vec::new();
        for name in names {
            let path = self.folder.join(name);
            let frame = self.light(&path, raw::read(&path, self.spec.photos.converter)?, exposure)?;
            frames.push(self.alike(frame, &path, frames.first())?);
        }
        if frames.is_empty() { Ok(None) } else { mean(&frames, &mut None).map(Some) }
    }

    /// Refuses a photo that is unlike the first.
    fn alike(&self, photo: Image, path: &Path, first: Option<&Image>) -> Result<Image> {
        let Some(first) = first else { return Ok(photo) };
        if photo.resolution() != first.resolution() {
            return Err(unlike(path, photo.resolution(), first.resolution(), "photos"));
        }
        if photo.channels() != first.channels() {
            let [found, expected] =
                [&photo, first].map(|of| if of.channels() == 1 { "gray" } else { "coloured" });
            return Err(Error::data(path, format!("it is {found}, and the photos before it are {expected}"))
                .help("convert it"));
        }
        Ok(photo)
    }

    fn map(&self, camera: Resolution, projector: Resolution) -> Result<CaptureMap> {
        let name = self.spec.map.as_deref().unwrap_or("found");
        match name {
            "coaxial" => return Ok(CaptureMap::Coaxial),
            "found" => return Ok(CaptureMap::Found),
            "none" => return Ok(CaptureMap::None),
            _ => {}
        }
        let path = self.folder.join(name);
        if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("npy")) {
            return Err(Error::data(self.path, format!("map = \"{name}\" is not known"))
                .help("give \"coaxial\", \"found\", \"none\", or a .npy file of H×W×2"));
        }
        let array = npy::read_npy(&path)?;
        let expected = [camera.height, camera.width, 2];
        if array.shape != expected {
            return Err(Error::data(&path, format!("its shape is {:?}", array.shape)).help(format!(
                "give column and row of the projector for each camera pixel, as an array of {}×{}×2",
                camera.height, camera.width
            )));
        }
        let [width, height] = [projector.width, projector.height].map(|side| side as f64);
        let is_in = |[x, y]: &[f64; 2]| (-0.5..width - 0.5).contains(x) && (-0.5..height - 0.5).contains(y);
        let places = array.values.chunks_exact(2).map(|pair| Some([pair[0], pair[1]]).filter(is_in));
        Ok(CaptureMap::Given(places.collect()))
    }
}

/// The highest level of integers with this many bits.
fn highest(bits: u32) -> f64 {
    f64::from((1_u32 << bits) - 1)
}

fn require_range(path: &Path, image: &Image, full: f64, table: &str) -> Result<()> {
    let out =
        image.samples().iter().map(|value| f64::from(*value)).find(|value| *value < 0.0 || *value > full);
    out.map_or(Ok(()), |value| {
        Err(Error::data(path, format!("it has the level {value}, which is not from 0 to {full}"))
            .help(format!("correct `bits` in {table}; without it, floating-point numbers are from 0 to 1")))
    })
}

fn unlike(path: &Path, found: Resolution, expected: Resolution, what: &str) -> Error {
    Error::data(path, format!("it has {found} pixels, and the {what} before it have {expected}"))
        .help(format!("all {what} have one size"))
}

/// The mean of takes. Saturated samples do not take part. `spread` gathers, for each sample, the sum of squares of the differences between
/// takes and the number of degrees of freedom.
fn mean(takes: &[Image], spread: &mut Option<Vec<[f64; 2]>>) -> Result<Image> {
    let first = &takes[0];
    let count = first.samples().len();
    if takes.len() > 1 {
        spread.get_or_insert_with(|| vec![[0.0; 2]; count]);
    }
    let sample = |at: usize| {
        let values = takes.iter().map(|take| f64::from(take.samples()[at])).filter(|value| !value.is_nan());
        let (sum, number) =
            values.clone().fold((0.0, 0.0), |(sum, number), value| (sum + value, number + 1.0));
        let mean = if number > 0.0 { sum / number } else { f64::NAN };
        (mean, values.map(|value| (value - mean).powi(2)).sum::<f64>(), number - 1.0)
    };
    let mut samples = Vec::with_capacity(count);
    for at in 0..count {
        let (mean, squares, freedom) = sample(at);
        samples.push(mean as f32);
        if let Some(spread) = spread.as_mut().filter(|_| freedom > 0.0) {
            spread[at][0] += squares;
            spread[at][1] += freedom;
        }
    }
    Image::new(first.resolution(), first.channels(), samples)
}

/// The standard deviation of each sample of a mean of takes. The variance rises with the light, so it is a straight line through the
/// variances of all pixels.
fn noise(spread: &[[f64; 2]], photos: &[Image], takes: usize) -> Result<Image> {
    let light = |at: usize| {
        let values =
            photos.iter().map(|photo| f64::from(photo.samples()[at])).filter(|value| !value.is_nan());
        let (sum, number) = values.fold((0.0, 0.0), |(sum, number), value| (sum + value, number + 1.0));
        if number > 0.0 { (sum / number).max(0.0) } else { 0.0 }
    };
    let points: Vec<[f64; 2]> = spread
        .iter()
        .enumerate()
        .filter(|(_, [_, freedom])| *freedom > 0.0)
        .map(|(at, [squares, freedom])| [light(at), squares / freedom])
        .collect();
    let count = points.len().max(1) as f64;
    let [x, y] = [0, 1].map(|of| points.iter().map(|point| point[of]).sum::<f64>() / count);
    let [xx, xy] = points.iter().fold([0.0; 2], |[xx, xy], point| {
        [xx + (point[0] - x).powi(2), xy + (point[0] - x) * (point[1] - y)]
    });
    let slope = if xx > 0.0 { (xy / xx).max(0.0) } else { 0.0 };
    let base = (y - slope * x).max(0.0);
    let deviation = |at: usize| ((base + slope * light(at)) / takes as f64).sqrt() as f32;
    Image::new(photos[0].resolution(), photos[0].channels(), (0..spread.len()).map(deviation).collect())
}

/// The finding about saturated samples.
fn saturated(photos: &[Image], stack: &Stack) -> Option<Finding> {
    let share = |photo: &Image| {
        photo.samples().iter().filter(|value| value.is_nan()).count() as f64 / photo.samples().len() as f64
    };
    let shares: Vec<f64> = photos.iter().map(share).collect();
    let (at, most) = shares.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if most == 0.0 {
        return Some(Finding::ok("saturation", "no sample is saturated"));
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let found = format!(
        "{} % of all samples are saturated; most in {}: {} %",
        percent(mean),
        stack.path(at).display(),
        percent(most)
    );
    Some(Finding::graded(
        "saturation",
        Grade::Warning,
        found,
        "none",
        "saturated samples are left out; add a take with a shorter exposure",
    ))
}
