//! The description of a still camera, as a rig file has it.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer};

use crate::rig::CameraInfo;
use crate::rig::cameras::CameraKind;
use crate::rig::pixels::{Colour, Sensor, Tiles};

/// A description of a still camera (e.g. a DSLR) that the program `gphoto2` drives, and whose RAW files another program decodes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gphoto2Spec {
    /// The kind of camera.
    pub kind: CameraKind,
    /// The model, as `gphoto2 --auto-detect` names it. `None`: the only camera.
    #[serde(default)]
    pub model: Option<String>,
    /// Width and height of the part of the RAW picture that is used, in photosites.
    pub size: [usize; 2],
    /// The offset of that part from the sensor's top left photosite, to the right and down.
    #[serde(default)]
    pub offset: [usize; 2],
    /// The colour filters of the 2×2 cell at the picture's top left photosite. `None`: the sensor is gray.
    #[serde(default)]
    pub tiles: Option<Tiles>,
    /// How cells become pixels.
    #[serde(default)]
    pub colour: Colour,
    /// Bits of a photosite's count.
    #[serde(default = "fourteen")]
    pub bits: u32,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`. The white level of most sensors is lower.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// The sensitivity: one of the camera's choices, e.g. `100`. `None`: it is left unchanged.
    #[serde(default, deserialize_with = "worded")]
    pub iso: Option<String>,
    /// The aperture of the lens: one of the camera's choices, e.g. `8`. `None`: it is left unchanged.
    #[serde(default, deserialize_with = "worded")]
    pub aperture: Option<String>,
    /// The format of the files: one of the camera's choices, e.g. `RAW` or `NEF (Raw)`. `None`: it is left unchanged.
    #[serde(default, deserialize_with = "worded")]
    pub image_format: Option<String>,
    /// Values of other settings, by the names that `gphoto2` gives them.
    #[serde(default)]
    pub settings: BTreeMap<String, String>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Steps of the shutter speed to a doubling. With `stops = 3`, each speed is replaced by the nearest power of the cube root of 2,
    /// which is the true speed of most cameras (1/60 means 1/64 s, 30 means 32 s); with 2, of the square root. `None`: the camera's
    /// numbers are taken literally.
    #[serde(default)]
    pub stops: Option<u32>,
    /// Seconds beyond the exposure that `gphoto2` may take for a photo, and that the decoder may take for its file.
    #[serde(default = "half_a_minute")]
    pub timeout: f64,
    /// The `gphoto2` program: its absolute path, or a name on `PATH`.
    #[serde(default = "gphoto2")]
    pub program: String,
    /// The program that decodes RAW, with its arguments; the file's name is appended. It prints a PGM or leaves one beside the file,
    /// with the sensor's counts, neither scaled nor rotated.
    #[serde(default = "dcraw")]
    pub decoder: Vec<String>,
}

fn fourteen() -> u32 {
    14
}

fn exposures() -> [f64; 2] {
    [1e-3, 30.0]
}

fn half_a_minute() -> f64 {
    30.0
}

fn gphoto2() -> String {
    "gphoto2".into()
}

/// `dcraw` with the options for raw counts (`-D`), linear 16 bits (`-4`), no rotation (`-t 0`), to standard output (`-c`).
fn dcraw() -> Vec<String> {
    ["dcraw", "-4", "-D", "-t", "0", "-c"].map(String::from).to_vec()
}

/// Reads a text, or a number as its text.
fn worded<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "one of the camera's choices as text or number")]
    enum Worded {
        Whole(i64),
        Number(f64),
        Text(String),
    }
    Ok(Some(match Worded::deserialize(deserializer)? {
        Worded::Whole(number) => number.to_string(),
        Worded::Number(number) => number.to_string(),
        Worded::Text(text) => text,
    }))
}

impl Gphoto2Spec {
    /// The only camera, with `width` by `height` gray photosites.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            kind: CameraKind::Gphoto2,
            model: None,
            size: [width, height],
            offset: [0, 0],
            tiles: None,
            colour: Colour::default(),
            bits: fourteen(),
            saturation: None,
            iso: None,
            aperture: None,
            image_format: None,
            settings: BTreeMap::new(),
            exposures: exposures(),
            stops: None,
            timeout: half_a_minute(),
            program: gphoto2(),
            decoder: dcraw(),
        }
    }

    /// The camera's properties. The name contains every setting that changes counts, so that photos and calibrations of other settings
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

    /// The settings that the rig file asks for: the possible names of each, and its value.
    pub(super) fn wanted(&self) -> impl Iterator<Item = (Vec<&str>, &str)> {
        let known: [(&[&str], &Option<String>); 3] = [
            (&["iso"], &self.iso),
            (&["aperture", "f-number"], &self.aperture),
            (&["imageformat", "imagequality"], &self.image_format),
        ];
        let known = known.into_iter().filter_map(|(names, value)| Some((names.to_vec(), value.as_deref()?)));
        known.chain(self.settings.iter().map(|(name, value)| (vec![name.as_str()], value.as_str())))
    }
}
