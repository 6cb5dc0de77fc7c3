//! What is written about a still camera.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer};

use crate::rig::CameraInfo;
use crate::rig::cameras::CameraKind;
use crate::rig::pixels::{Colour, Sensor, Tiles};

/// A still camera (a DSLR, say) that the program `gphoto2` drives, and whose RAW files another program decodes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gphoto2Spec {
    /// What it is.
    pub kind: CameraKind,
    /// The model, as `gphoto2 --auto-detect` names it; none: the only camera there is.
    #[serde(default)]
    pub model: Option<String>,
    /// Width and height of the part of the RAW picture that is used, in photosites.
    pub size: [usize; 2],
    /// Where that part begins, to the right and down.
    #[serde(default)]
    pub offset: [usize; 2],
    /// The filters before the sensor, of the cell at the picture's first photosite; none: it is gray.
    #[serde(default)]
    pub tiles: Option<Tiles>,
    /// What becomes of the cells.
    #[serde(default)]
    pub colour: Colour,
    /// Bits of a photosite's count.
    #[serde(default = "fourteen")]
    pub bits: u32,
    /// A photosite that counts so much is full; none: with all bits set. The white level of most sensors is less.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// The sensitivity, as the camera words its choices, e.g. `100`.
    #[serde(default, deserialize_with = "worded")]
    pub iso: Option<String>,
    /// The lens's aperture, likewise, e.g. `8`.
    #[serde(default, deserialize_with = "worded")]
    pub aperture: Option<String>,
    /// The format of its files, likewise, e.g. `RAW` or `NEF (Raw)`.
    #[serde(default, deserialize_with = "worded")]
    pub image_format: Option<String>,
    /// Other settings, by gphoto2's names for them.
    #[serde(default)]
    pub settings: BTreeMap<String, String>,
    /// The shortest and the longest exposure that are used, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// What shutter speeds really are: `stops = 3` takes each for the nearest power of the cube root of 2, as with most cameras (1/60 is
    /// 1/64 s, 30 is 32 s), 2 of the square root; none: as the camera says them.
    #[serde(default)]
    pub stops: Option<u32>,
    /// Seconds beyond the exposure that gphoto2 may take for a photo, and the decoder for its file.
    #[serde(default = "half_a_minute")]
    pub timeout: f64,
    /// The program itself, where it is not on the `PATH` (then from the root on) or has another name.
    #[serde(default = "gphoto2")]
    pub program: String,
    /// The program that decodes RAW, with its arguments; the file's name is added. It prints a PGM, or leaves one beside the file:
    /// the sensor's own counts, neither scaled nor turned.
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

/// dcraw's raw counts (`-D`) of 16 bits on a line (`-4`), not turned (`-t 0`), printed (`-c`).
fn dcraw() -> Vec<String> {
    ["dcraw", "-4", "-D", "-t", "0", "-c"].map(String::from).to_vec()
}

/// A text, or a number for the text that it is.
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
    /// The only camera there is, with so many gray photosites.
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

    /// The camera, as it presents itself. Its name says all that changes the numbers: photos and calibrations of other settings are
    /// another camera's.
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

    /// Settings that the file asks for: the names that cameras have for each, and its value.
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
