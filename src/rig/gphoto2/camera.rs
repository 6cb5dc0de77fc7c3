//! The still camera as a rig's camera: it sets the shutter speed, releases the shutter, and decodes the file to counts.

use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::TempDir;

use super::answers::Setting;
use super::body::{Body, prepare};
use super::pgm;
use super::program::{Ran, last, run};
use super::spec::Gphoto2Spec;
use crate::error::{Error, Result};
use crate::rig::{Camera, CameraInfo, RawFrame, WallClock, camera_fault};

/// The largest factor between a shutter speed and the exposure that is asked for: half a stop, with a margin for rounded speeds.
const NEAR: f64 = 1.5;

/// An open still camera that `gphoto2` drives.
pub struct Gphoto2 {
    info: CameraInfo,
    spec: Gphoto2Spec,
    clock: WallClock,
    body: Body,
    /// The name and the setting of the shutter speed.
    shutter: (String, Setting),
    /// The exposure that was asked for, and the one that was set, in seconds.
    exposure: [f64; 2],
    id: u64,
}

impl Gphoto2 {
    /// Opens the camera and sets it as `spec` says. Frames carry the times of `clock`, and numbers from `after + 1` on.
    ///
    /// # Errors
    /// [`Error::Rig`] when a program is not installed, there is no such camera, or it has no such choice.
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

    /// Releases the shutter and downloads the file; returns its path, and the folder that it is in.
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

    /// Decodes a RAW file to the counts of the part of the sensor that is used.
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
        let picture = pgm::read(&bytes).ok_or_else(|| {
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
        // No still camera says when its shutter opened; it opened after it was released.
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
        // A camera that was switched off and on has another port and may have other settings.
        (self.body, self.shutter) = prepare(&self.spec)?;
        self.configure(self.exposure[0]).map(|_| ())
    }
}

/// The files in a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    // If our own temporary folder cannot be read, there are no usable files in it.
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}
