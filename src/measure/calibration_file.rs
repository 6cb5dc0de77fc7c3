//! The folder of a calibration: `calibration.toml` holds the numbers, and array files beside it hold the curves and the pixel map.
//!
//! | file | holds |
//! |---|---|
//! | `calibration.toml` | the devices, the camera's numbers, the stability, the checksum |
//! | `projector-curve.npy` | the projector's response, channels × levels |
//! | `camera-curve.npy` | linear DN for each count; absent for a linear camera |
//! | `flat-{projector,camera}.npy` | the uneven brightness of both devices, on the projector's pixels; absent where it was not measured |
//! | `registration-{starts,pixels,weights}.npy` | the pixel map in compressed sparse rows: camera pixels of each projector pixel |
//!
//! The checksum is the [identity](Calibration::identity) of the calibration and covers all of these files. Loading detects a file that was
//! changed or belongs to another calibration.

use std::path::Path;

use serde::Deserialize;

use super::calibration::FlatField;
use super::lens_map::LensMap;
use super::{Calibration, CameraResponse, Registration, Stability};
use crate::error::{Error, Result};
use crate::file;
use crate::image::Resolution;
use crate::io::{atomic, npy};
use crate::rig::{CameraInfo, ProjectorInfo};

/// The version of the folder's format. Folders of format 1, which have no `[map]`, can also be read.
const FORMAT: u32 = 2;

const RECORD: &str = "calibration.toml";
const PROJECTOR: &str = "projector-curve.npy";
const CAMERA: &str = "camera-curve.npy";
const FLAT: [&str; 2] = ["flat-projector.npy", "flat-camera.npy"];
const STARTS: &str = "registration-starts.npy";
const PIXELS: &str = "registration-pixels.npy";
const WEIGHTS: &str = "registration-weights.npy";

const HELP: &str = "restore the folder, or measure it anew with `krylux rig calibrate`";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    format: u32,
    identity: String,
    projector: ProjectorInfo,
    camera: CameraInfo,
    response: Response,
    stability: Stability,
    map: Option<Map>,
    #[serde(default)]
    flat_field: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Map {
    homography: [f64; 8],
    distortion: [f64; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Response {
    black: f64,
    saturation: f64,
    gain: f64,
    read_noise: f64,
    linear: bool,
}

impl Calibration {
    /// Writes the calibration into `folder`, and creates the folder if necessary. `calibration.toml` is written last, so a folder with this
    /// file is complete.
    ///
    /// # Errors
    /// [`Error::Write`] with the name of the file.
    pub fn save(&self, folder: &Path) -> Result<()> {
        file::make_folder(folder)?;
        file::follow_no_links_below(folder);
        let record = folder.join(RECORD);
        file::remove(&record)?;
        let levels = self.projector.first().map_or(0, Vec::len);
        npy::write_npy(&folder.join(PROJECTOR), &[self.projector.len(), levels], &self.projector.concat())?;
        if let Some(curve) = &self.camera.curve {
            npy::write_npy(&folder.join(CAMERA), &[curve.len()], curve)?;
        }
        if let Some(flat) = &self.flat_field {
            for (name, values) in FLAT.into_iter().zip([&flat.projector, &flat.camera]) {
                npy::write_npy(&folder.join(name), &[values.len()], values)?;
            }
        }
        let rows = &self.registration;
        let starts: Vec<u64> = rows.starts.iter().map(|&start| start as u64).collect();
        npy::write_npy(&folder.join(STARTS), &[starts.len()], &starts)?;
        npy::write_npy(&folder.join(PIXELS), &[rows.pixels.len()], &rows.pixels)?;
        npy::write_npy(&folder.join(WEIGHTS), &[rows.weights.len()], &rows.weights)?;
        atomic::write_bytes(&record, self.record().as_bytes())
    }

    /// Reads the calibration in `folder`.
    ///
    /// # Errors
    /// [`Error::Read`] when a file cannot be read; [`Error::Data`] with the name of a malformed file, or with the name of
    /// `calibration.toml` when the checksum is wrong.
    pub fn load(folder: &Path) -> Result<Self> {
        file::follow_no_links_below(folder);
        let path = folder.join(RECORD);
        let text = file::read_text(&path)?;
        let record: Record =
            toml::from_str(&text).map_err(|error| damaged(&path, error.to_string().trim_end().into()))?;
        if !(1..=FORMAT).contains(&record.format) {
            let fault = format!(
                "its format is {}, but this version of krylux reads formats 1 to {FORMAT}",
                record.format
            );
            return Err(damaged(&path, fault));
        }
        let Record { projector: projector_info, camera: camera_info, response, stability, map, .. } = record;
        let flat_field =
            if record.flat_field { Some(flat_field(folder, projector_info.resolution)?) } else { None };
        let (camera, projector) = (camera_info.resolution, projector_info.resolution);
        let lens =
            map.map(|Map { homography, distortion }| LensMap { camera, projector, homography, distortion });
        let registration = Registration { lens, ..registration(folder, camera, projector)? };
        let Response { black, saturation, gain, read_noise, linear } = response;
        let curve = match linear {
            true => None,
            false => Some(curves(folder, CAMERA, None, camera_info.bits, "count")?.concat()),
        };
        let calibration = Self {
            projector: curves(
                folder,
                PROJECTOR,
                Some(projector_info.channels),
                projector_info.bits,
                "level",
            )?,
            camera: CameraResponse { black, saturation, gain, read_noise, curve },
            registration,
            flat_field,
            stability,
            projector_info,
            camera_info,
        };
        if blake3::Hash::from_bytes(calibration.identity()).to_string() != record.identity {
            return Err(damaged(&path, "its checksum does not fit the other files of the folder".into()));
        }
        Ok(calibration)
    }

    /// The BLAKE3 hash of the complete calibration, which is part of the key of every journaled photo.
    pub fn identity(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.head().as_bytes());
        let lengths = |length: usize, hasher: &mut blake3::Hasher| {
            hasher.update(&(length as u64).to_le_bytes());
        };
        let numbers = |values: &[f64], hasher: &mut blake3::Hasher| {
            hasher.update(&(values.len() as u64).to_le_bytes());
            values.iter().for_each(|value| {
                hasher.update(&value.to_le_bytes());
            });
        };
        lengths(self.projector.len(), &mut hasher);
        self.projector.iter().for_each(|curve| numbers(curve, &mut hasher));
        numbers(self.camera.curve.as_deref().unwrap_or_default(), &mut hasher);
        let rows = &self.registration;
        rows.starts.iter().for_each(|&start| lengths(start, &mut hasher));
        rows.pixels.iter().for_each(|pixel| {
            hasher.update(&pixel.to_le_bytes());
        });
        numbers(&rows.weights, &mut hasher);
        if let Some(flat) = &self.flat_field {
            numbers(&flat.projector, &mut hasher);
            numbers(&flat.camera, &mut hasher);
        }
        *hasher.finalize().as_bytes()
    }

    /// Checks that the calibration belongs to these devices: names, pixels, channels and bits must agree.
    ///
    /// # Errors
    /// [`Error::Rig`] with the name of the device and the difference.
    pub fn check(&self, projector: &ProjectorInfo, camera: &CameraInfo) -> Result<()> {
        let of_projector =
            |info: &ProjectorInfo| devices(&info.name, info.resolution, info.channels, info.bits);
        let of_camera = |info: &CameraInfo| devices(&info.name, info.resolution, info.channels, info.bits);
        let pairs = [
            ("projector", of_projector(&self.projector_info), of_projector(projector)),
            ("camera", of_camera(&self.camera_info), of_camera(camera)),
        ];
        for (device, calibrated, found) in pairs {
            if calibrated != found {
                return Err(Error::rig(
                    device,
                    format!("the calibration is of {calibrated}, but the rig has {found}"),
                )
                .help(
                    "name the calibration that belongs to this rig, or make one with `krylux rig calibrate`",
                ));
            }
        }
        Ok(())
    }

    /// The numbers as text, in the form of `calibration.toml`. Rust prints the shortest decimals that read back as the same bits.
    fn head(&self) -> String {
        let Self { projector_info: projector, camera_info: camera, camera: response, .. } = self;
        let map = self.registration.lens.as_ref().map_or_else(String::new, |lens| {
            format!(
                "\n# camera to projector: see the documentation of LensMap\n[map]\nhomography = {:?}\ndistortion = {:?}\n",
                lens.homography, lens.distortion
            )
        });
        format!(
            "[projector]\nname = {}\nresolution = {}\nchannels = {}\nbits = {}\nframe_time = {:?}\n\n\
             [camera]\nname = {}\nresolution = {}\nchannels = {}\nbits = {}\nexposures = [{:?}, {:?}]\n\n\
             # DN; gain in electrons per linear DN\n\
             [response]\nblack = {:?}\nsaturation = {:?}\ngain = {:?}\nread_noise = {:?}\nlinear = {}\n\n\
             # seconds; relative change of white per hour\n\
             [stability]\nsettle = {:?}\ndrift_per_hour = {:?}\n{map}",
            quoted(&projector.name),
            size(projector.resolution),
            projector.channels,
            projector.bits,
            projector.frame_time,
            quoted(&camera.name),
            size(camera.resolution),
            camera.channels,
            camera.bits,
            camera.exposures[0],
            camera.exposures[1],
            response.black,
            response.saturation,
            response.gain,
            response.read_noise,
            response.curve.is_none(),
            self.stability.settle,
            self.stability.drift_per_hour,
        )
    }

    fn record(&self) -> String {
        let identity = blake3::Hash::from_bytes(self.identity()).to_string();
        format!(
            "# Made by krylux rig calibrate; the arrays beside it belong to it.\nformat = {FORMAT}\nidentity = \"{identity}\"\nflat_field = {}\n\n{}",
            self.flat_field.is_some(),
            self.head()
        )
    }
}

fn devices(name: &str, resolution: Resolution, channels: usize, bits: u32) -> String {
    let colours = if channels == 1 { "gray" } else { "coloured" };
    format!("`{name}` with {resolution} {colours} pixels of {bits} bits")
}

/// Quotes a TOML string. TOML's basic strings have the syntax of JSON strings.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn size(Resolution { width, height }: Resolution) -> String {
    format!("{{ width = {width}, height = {height} }}")
}

fn damaged(path: &Path, fault: String) -> Error {
    Error::data(path, fault).help(HELP)
}

/// Reads an array of this shape. A 0 in the shape stands for any length.
fn array(folder: &Path, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
    let path = folder.join(name);
    let array = npy::read_npy(&path)?;
    let fits = array.shape.len() == shape.len()
        && array.shape.iter().zip(shape).all(|(found, wanted)| *wanted == 0 || found == wanted);
    if !fits {
        let fault = format!("its shape is {:?}, but {shape:?} was expected (0: any)", array.shape);
        return Err(damaged(&path, fault));
    }
    Ok(array.values)
}

fn flat_field(folder: &Path, projector: Resolution) -> Result<FlatField> {
    let [projector, camera] = FLAT.map(|name| array(folder, name, &[projector.pixels()]));
    let flat = FlatField { projector: projector?, camera: camera? };
    flat.check().map_err(|error| damaged(&folder.join(FLAT[0]), error.to_string()))?;
    Ok(flat)
}

/// Reads `channels` curves of `2^bits` ascending values. With `None`, the array is a single curve and has no dimension for channels.
fn curves(folder: &Path, name: &str, channels: Option<usize>, bits: u32, of: &str) -> Result<Vec<Vec<f64>>> {
    let length = 1_usize.checked_shl(bits).unwrap_or(0);
    let shape: Vec<usize> = channels.into_iter().chain([length]).collect();
    let values = array(folder, name, &shape)?;
    let curves: Vec<Vec<f64>> = values.chunks(length.max(1)).map(<[f64]>::to_vec).collect();
    // A curve with NaN is not sorted.
    if curves.iter().any(|curve| !curve.is_sorted_by(|a, b| a <= b)) {
        return Err(damaged(&folder.join(name), format!("its values do not ascend with the {of}")));
    }
    Ok(curves)
}

fn registration(folder: &Path, camera: Resolution, projector: Resolution) -> Result<Registration> {
    let starts = array(folder, STARTS, &[projector.pixels() + 1])?;
    let pixels = array(folder, PIXELS, &[0])?;
    let map = Registration {
        camera,
        projector,
        starts: starts.into_iter().map(|start| start as usize).collect(),
        weights: array(folder, WEIGHTS, &[pixels.len()])?,
        pixels: pixels.into_iter().map(|pixel| pixel as u32).collect(),
        lens: None,
    };
    match map.fault() {
        Some((part, fault)) => Err(damaged(&folder.join(format!("registration-{part}.npy")), fault)),
        None => Ok(map),
    }
}
