//! A still camera that the program `gphoto2` drives. Another program decodes its RAW files. Both programs run as separate processes, and
//! krylux parses their output. This driver has not been tried on hardware.

pub(crate) mod answers;
pub(crate) mod body;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use tempfile::TempDir;

use super::cameras::CameraKind;
use super::sensor::{Colour, Sensor, Tiles};
use super::{Camera, CameraInfo, RawFrame, WallClock, camera_fault, number};
use crate::error::{Error, Result};
use answers::Setting;
use body::{Body, Ran, last, prepare, run};

/// The largest allowed factor between a shutter speed and the requested exposure: half a stop, with a margin for rounded speeds.
const NEAR: f64 = 1.5;

/// An open still camera that `gphoto2` drives.
pub struct Gphoto2 {
    info: CameraInfo,
    spec: Gphoto2Spec,
    clock: WallClock,
    body: Body,
    shutter: (String, Setting),
    /// The requested exposure, and the exposure that was set, in seconds.
    exposure: [f64; 2],
    id: u64,
}

impl Gphoto2 {
    /// Opens the camera and sets it up by `spec`. The times of frames are read from `clock`, and their numbers begin at `after + 1`.
    ///
    /// # Errors
    /// [`Error::Rig`] when a program is not installed, or the camera of `spec` is not found or does not offer a choice in `spec`.
    pub fn open(spec: &Gphoto2Spec, clock: WallClock, after: u64) -> Result<Self> {
        let (body, shutter) = prepare(spec)?;
        let mut camera = Self {
            info: spec.info(),
            spec: spec.clone(),
            clock,
            body,
            shutter,
            exposure: [0.0; 2],
            id: after,
        };
        camera.configure(spec.exposures[0])?;
        Ok(camera)
    }

    /// Releases the shutter and downloads the file. Returns the file's path and folder.
    fn release(&self) -> Result<(PathBuf, TempDir)> {
        let limit = Duration::from_secs_f64(self.exposure[1] + self.spec.timeout);
        let arguments = ["--force-overwrite", "--filename", "photo.%C", "--capture-image-and-download"];
        let Ran { folder, said, .. } = self.body.run(&arguments, limit)?;
        let mut files = files(folder.path());
        // A camera may save RAW and JPEG together.
        let is_lossy = |path: &PathBuf| {
            path.extension()
                .is_some_and(|end| ["jpg", "jpeg"].iter().any(|jpeg| end.eq_ignore_ascii_case(jpeg)))
        };
        let lossy = files.iter().any(is_lossy);
        files.retain(|path| !is_lossy(path));
        match <[PathBuf; 1]>::try_from(files) {
            Ok([path]) => Ok((path, folder)),
            Err(files) if files.is_empty() && lossy => Err(camera_fault(
                "the camera took a JPEG, which is not linear",
                "give image_format in [camera] one of its choices for RAW",
            )),
            Err(files) => Err(camera_fault(
                format!("gphoto2 left {} files where one RAW file was expected: {said}", files.len()),
                "give image_format in [camera] one of the camera's choices for RAW alone",
            )),
        }
    }

    fn decode(&self, raw: &Path, folder: TempDir) -> Result<Vec<u16>> {
        let limit = Duration::from_secs_f64(self.spec.timeout);
        let (program, arguments) = self.spec.decoder.split_first().ok_or_else(|| {
            camera_fault("there is no decoder", "give decoder in [camera], or leave it out for dcraw")
        })?;
        let name = raw.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let arguments: Vec<String> = arguments.iter().cloned().chain([name]).collect();
        let before = files(folder.path());
        let ran = run(program, &arguments, Some(folder), limit)?;
        let new = files(ran.folder.path()).into_iter().find(|path| !before.contains(path));
        let bytes = match new {
            Some(path) if ran.answer.is_empty() => std::fs::read(&path).map_err(Error::reading(path))?,
            _ => ran.answer,
        };
        let picture = answers::read_pgm(&bytes).ok_or_else(|| {
            let begins = last(&bytes[..bytes.len().min(32)]);
            camera_fault(
                format!(
                    "{program} gave no gray picture (PGM) but {} bytes that begin with \"{begins}\"; {}",
                    bytes.len(),
                    ran.said
                ),
                "correct decoder in [camera]: it must print, or leave beside the file, the sensor's counts as PGM",
            )
        })?;
        let Gphoto2Spec { size, offset, bits, .. } = self.spec;
        let counts = picture.part(size, offset).ok_or_else(|| {
            let [[w, h], [x, y], [width, height]] = [size, offset, picture.size];
            camera_fault(
                format!("its RAW picture has {width}x{height} photosites, fewer than {w}x{h} at ({x}, {y})"),
                "correct size or offset in [camera]",
            )
        })?;
        match counts.iter().max() {
            Some(&most) if u32::from(most) >> bits > 0 => Err(camera_fault(
                format!("its RAW picture counts up to {most}, more than {bits} bits hold"),
                "correct bits in [camera], or have the decoder leave counts as they are",
            )),
            _ => Ok(counts),
        }
    }
}

impl Camera for Gphoto2 {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        self.info.check_exposure(exposure)?;
        let (name, setting) = &self.shutter;
        let near = setting.nearest_speed(exposure, self.spec.stops);
        let near = near.filter(|(_, set)| (NEAR.recip()..=NEAR).contains(&(set / exposure)));
        let Some((speed, set)) = near else {
            return Err(camera_fault(
                format!("the camera has no shutter speed near {exposure} s"),
                format!(
                    "it has {}: correct exposures in [camera] or [measurement]",
                    setting.choices.join(", ")
                ),
            ));
        };
        self.body.put(name, speed)?;
        self.exposure = [exposure, set];
        Ok(set)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        // A still camera does not report when its shutter opened. The shutter opens after this time.
        let started = self.clock.seconds();
        let (raw, folder) = self.release()?;
        let counts = self.spec.sensor().pixels(self.decode(&raw, folder)?);
        self.id += 1;
        Ok(Some(RawFrame {
            resolution: self.info.resolution,
            channels: self.info.channels,
            counts,
            exposure: self.exposure[1],
            id: self.id,
            started,
        }))
    }

    fn restart(&mut self) -> Result<()> {
        // A camera that was switched off and on has another port, and may have other settings.
        (self.body, self.shutter) = prepare(&self.spec)?;
        self.configure(self.exposure[0]).map(|_| ())
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    // A temporary folder that cannot be read counts as empty.
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

/// A description of a still camera (for example a DSLR) that the program `gphoto2` drives. Another program decodes its RAW files.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gphoto2Spec {
    /// The kind of camera.
    pub kind: CameraKind,
    /// The model as printed by `gphoto2 --auto-detect`. `None`: the only camera.
    pub model: Option<String>,
    /// Width and height of the used part of the RAW picture, in photosites.
    pub size: [usize; 2],
    /// The position of the top left photosite of this part, to the right and down from the picture's top left photosite.
    #[serde(default)]
    pub offset: [usize; 2],
    /// The colour filters of the 2×2 cell at the picture's top left photosite. `None`: the sensor is gray.
    pub tiles: Option<Tiles>,
    /// The conversion of cells to pixels.
    #[serde(default)]
    pub colour: Colour,
    /// Bits of a photosite's count.
    #[serde(default = "number::<14, _>")]
    pub bits: u32,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`. Most sensors have a lower white level.
    pub saturation: Option<u16>,
    /// The sensitivity, which is one of the camera's choices, for example `100`. `None`: the camera's setting is left unchanged.
    #[serde(default, deserialize_with = "worded")]
    pub iso: Option<String>,
    /// The aperture of the lens, which is one of the camera's choices, for example `8`. `None`: the camera's setting is left unchanged.
    #[serde(default, deserialize_with = "worded")]
    pub aperture: Option<String>,
    /// The format of the files, one of the camera's choices such as `RAW` or `NEF (Raw)`. `None`: the camera's setting is left unchanged.
    #[serde(default, deserialize_with = "worded")]
    pub image_format: Option<String>,
    /// Values of other settings, by their names in `gphoto2`.
    #[serde(default)]
    pub settings: BTreeMap<String, String>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// The number of steps of the shutter speed per doubling of the exposure. With `stops = 3`, each speed is replaced by the nearest power
    /// of the cube root of 2, which is the true speed of most cameras (1/60 means 1/64 s, 30 means 32 s). With `stops = 2`, the square root
    /// replaces the cube root. `None`: the camera's numbers are taken literally.
    pub stops: Option<u32>,
    /// Seconds beyond the exposure that `gphoto2` may take for a photo. The decoder may take the same number of seconds for the file.
    #[serde(default = "number::<30, _>")]
    pub timeout: f64,
    /// The `gphoto2` program: its absolute path, or a name on `PATH`.
    #[serde(default = "gphoto2")]
    pub program: String,
    /// The program that decodes RAW, with its arguments. The file's name is appended. The program prints a PGM file or leaves a PGM file
    /// beside the RAW file. The PGM has the sensor's counts, neither scaled nor rotated.
    #[serde(default = "dcraw")]
    pub decoder: Vec<String>,
}

fn exposures() -> [f64; 2] {
    [1e-3, 30.0]
}

fn gphoto2() -> String {
    "gphoto2".into()
}

/// `dcraw` with options for raw counts (`-D`), linear 16 bits (`-4`), no rotation (`-t 0`), and output to standard output (`-c`).
fn dcraw() -> Vec<String> {
    ["dcraw", "-4", "-D", "-t", "0", "-c"].map(String::from).to_vec()
}

fn worded<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<String>, D::Error> {
    match toml::Value::deserialize(deserializer)? {
        toml::Value::Integer(number) => Ok(Some(number.to_string())),
        toml::Value::Float(number) => Ok(Some(number.to_string())),
        toml::Value::String(text) => Ok(Some(text)),
        _ => Err(D::Error::custom("give one of the camera's choices as text or number")),
    }
}

impl Gphoto2Spec {
    /// A description of the only camera, with `width` by `height` gray photosites.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            kind: CameraKind::Gphoto2,
            model: None,
            size: [width, height],
            offset: [0, 0],
            tiles: None,
            colour: Colour::default(),
            bits: 14,
            saturation: None,
            iso: None,
            aperture: None,
            image_format: None,
            settings: BTreeMap::new(),
            exposures: exposures(),
            stops: None,
            timeout: 30.0,
            program: gphoto2(),
            decoder: dcraw(),
        }
    }

    /// The camera's properties. The name contains every setting that changes counts. Photos and calibrations with other settings therefore
    /// belong to another camera.
    pub fn info(&self) -> CameraInfo {
        let model = self.model.as_deref().map_or_else(String::new, |model| format!(" {model}"));
        let mut info = self.sensor().info(&format!("gphoto2{model}"), self.exposures);
        let settings = self.wanted().map(|(names, value)| format!("{} {value}", names[0]));
        let stops = self.stops.map(|stops| format!("stops {stops}"));
        let decoder = (self.decoder != dcraw()).then(|| format!("by {}", self.decoder.join(" ")));
        for part in settings.chain(stops).chain(decoder) {
            info.name.push_str(", ");
            info.name.push_str(&part);
        }
        info
    }

    pub(crate) fn sensor(&self) -> Sensor {
        let Self { size, offset, bits, tiles, colour, saturation, .. } = *self;
        Sensor { size, offset, bits, tiles, colour, saturation }
    }

    /// The settings that the rig file requests. For each setting: its possible names in `gphoto2`, and the value.
    pub(crate) fn wanted(&self) -> impl Iterator<Item = (Vec<&str>, &str)> {
        let known: [(&[&str], &Option<String>); 3] = [
            (&["iso"], &self.iso),
            (&["aperture", "f-number"], &self.aperture),
            (&["imageformat", "imagequality"], &self.image_format),
        ];
        let known = known.into_iter().filter_map(|(names, value)| Some((names.to_vec(), value.as_deref()?)));
        known.chain(self.settings.iter().map(|(name, value)| (vec![name.as_str()], value.as_str())))
    }
}
