//! The check of the rig file, the disk, each device separately, and the calibration with its pixel map.

use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

use crate::bench::rig_check::{Finding, Grade, Recorder};
use crate::calibrate::map_check;
use crate::error::{Error, Result};
use crate::finding::{SIGMAS, decimal};
use crate::io::atomic;
use crate::measure::{Calibration, FrameSource, MeasureOptions, RigFile, RigKind, sight};
use crate::rig::{CameraInfo, CameraSpec, Frame, HardwareRig, Helper, Projector, ProjectorInfo, X11Spec};

/// An exposure may differ from a whole number of projector refreshes by this fraction of a refresh.
const REFRESH_FRACTION: f64 = 0.02;

/// The check warns when there is disk space for fewer photos than this. A long session takes this many: a capture with several exposures
/// and repeated photos, its calibration, and a second try.
const SESSION_PHOTOS: u64 = 5000;

/// The check fails when there is disk space for fewer photos than this, because not even one capture fits.
const MIN_PHOTOS: u64 = 200;

/// The check warns when the error of the pixel map exceeds this, in projector pixels. The calibration promises this accuracy.
const MAP_OFFSET_WARNING: f64 = 0.1;

/// The check fails when the error of the pixel map exceeds this, in projector pixels. A neighbouring pixel then gets a third of the direct
/// light.
const MAP_OFFSET_FAILURE: f64 = 0.3;

/// The check fails when a random pattern and its photo have a correlation below this.
const MIN_CORRELATION: f64 = 0.5;

/// Describes the rig of the file, and checks whether its exposures suit its projector.
pub(crate) fn file(file: &RigFile) -> Finding {
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    let [shown, seen] = [projector.resolution, camera.resolution];
    let found = format!("{} rig, patterns of {shown} and photos of {seen} pixels", file.kind.word());
    match uneven(&file.measurement, projector.frame_time) {
        None => Finding::ok("file", found),
        Some(exposure) => {
            let found = format!("{found}; [measurement] has an exposure of {exposure} s");
            let expected =
                format!("whole multiples of the projector's refresh, {:.5} s", projector.frame_time);
            let help = "correct the exposures, or leave them out: the program then chooses suitable ones";
            Finding::graded("file", Grade::Warning, found, expected, help)
        }
    }
}

/// The first exposure that is not a whole multiple of the refresh time. Such an exposure covers its last refresh only in part.
fn uneven(options: &MeasureOptions, frame_time: f64) -> Option<f64> {
    let is_uneven = |exposure: &f64| {
        let refreshes = exposure / frame_time;
        (refreshes - refreshes.round().max(1.0)).abs() > REFRESH_FRACTION
    };
    options.exposures.iter().copied().find(|exposure| frame_time > 0.0 && is_uneven(exposure))
}

/// Opens projector and camera separately. Returns whether both can be used.
pub(crate) fn devices(
    kind: &RigKind,
    helper: &dyn Fn() -> Result<Helper>,
    recorder: &mut Recorder<'_, '_>,
) -> Result<bool> {
    let RigKind::Hardware(rig) = kind else {
        let (projector, camera) = (kind.projector_info(), kind.camera_info());
        let whose = if matches!(kind, RigKind::Program(_)) { "of a program" } else { "simulated" };
        recorder.add(Finding::ok("projector", format!("{whose}: {} bits", projector.bits)))?;
        let [shortest, longest] = camera.exposures;
        let found = format!("{whose}: {} bits, exposures {shortest} to {longest} s", camera.bits);
        recorder.add(Finding::ok("camera", found))?;
        return Ok(true);
    };
    let has_monitor = monitor(&rig.projector, recorder)?;
    let shows = has_monitor && screen(rig, helper, recorder)?;
    // The camera is checked even if the projector fails, so that faults of both are reported at once.
    let captures = camera(rig, helper, recorder)?;
    Ok(shows && captures)
}

/// Finds the projector's monitor. Returns whether it exists.
fn monitor(spec: &X11Spec, recorder: &mut Recorder<'_, '_>) -> Result<bool> {
    let monitor = match spec.monitor() {
        Ok(monitor) => monitor,
        Err(error) => return recorder.failure("monitor", error),
    };
    let [x, y] = monitor.place;
    let refresh = monitor.frame_time.map_or_else(
        || format!("unknown refresh time, {:.5} s by the file", spec.frame_time),
        |time| format!("a refresh every {time:.5} s"),
    );
    let ramp = if monitor.knows_ramp {
        "a straight gamma ramp"
    } else {
        "a gamma ramp that the server does not tell"
    };
    let found =
        format!("\"{}\": {} pixels at ({x}, {y}), {refresh}, {ramp}", monitor.name, monitor.resolution);
    // A finding that is ok drops its remedy.
    let (grade, expected) = match spec.monitor_size {
        Some(_) => (Grade::Ok, ""),
        None => (
            Grade::Warning,
            "the projector's native pixels: it scales any other mode, and the X server cannot know that",
        ),
    };
    let help = format!(
        "if these are its native pixels, write monitor_size = [{}, {}] in [projector]",
        monitor.resolution.width, monitor.resolution.height
    );
    recorder.add(Finding::graded("monitor", grade, found, expected, help))?;
    Ok(true)
}

/// Shows every level and reads it back from the screen. Returns whether the screen has the expected levels.
fn screen(
    rig: &HardwareRig,
    helper: &dyn Fn() -> Result<Helper>,
    recorder: &mut Recorder<'_, '_>,
) -> Result<bool> {
    let shown = helper().and_then(|helper| {
        let mut projector = rig.open_projector(&helper)?;
        let began = Instant::now();
        let frames = ramp(projector.info())?;
        frames.iter().try_for_each(|frame| projector.show(frame).map(|_| ()))?;
        projector.confirm()?;
        Ok((frames.len(), began.elapsed().as_secs_f64() / frames.len() as f64))
    });
    match shown {
        Ok((frames, seconds)) => {
            let frames = if frames == 1 { "a frame".to_owned() } else { format!("{frames} frames") };
            let found = format!("all 256 levels read back as drawn, in {frames} of {:.0} ms", 1e3 * seconds);
            recorder.add(Finding::ok("screen", found))?;
            Ok(true)
        }
        Err(error) => recorder.failure("screen", error),
    }
}

fn ramp(info: &ProjectorInfo) -> Result<Vec<Frame>> {
    let (pixels, levels) = (info.resolution.pixels(), usize::from(info.highest()) + 1);
    (0..levels.div_ceil(pixels))
        .map(|frame| {
            // The channels have different levels, so that exchanged channels are detected.
            let level = |sample: usize| {
                let (pixel, channel) = (sample / info.channels, sample % info.channels);
                ((frame * pixels + pixel + 85 * channel) % levels) as u16
            };
            Frame::new(info.resolution, info.channels, (0..pixels * info.channels).map(level).collect())
        })
        .collect()
}

/// Opens the camera, and sets its longest and its shortest exposure. Returns whether it can be used.
fn camera(
    rig: &HardwareRig,
    helper: &dyn Fn() -> Result<Helper>,
    recorder: &mut Recorder<'_, '_>,
) -> Result<bool> {
    let describes_itself = matches!(rig.camera, CameraSpec::Genicam(_));
    let asked = match describes_itself {
        true => helper().and_then(|helper| rig.camera_abilities(&helper)),
        false => Ok(None),
    };
    let abilities = match asked {
        Ok(abilities) => abilities.map_or_else(String::new, |can| format!(" (it can do {can})")),
        Err(error) => return recorder.failure("camera", error),
    };
    let opened = rig.open_checked_camera().and_then(|mut camera| {
        let [shortest, longest] = camera.info().exposures;
        let set = [camera.configure(longest)?, camera.configure(shortest)?];
        Ok((camera.info().clone(), set))
    });
    match opened {
        Ok((info, [longest, shortest])) => {
            let found = format!(
                "{}: {} pixels, exposures {shortest} to {longest} s{abilities}",
                info.name, info.resolution
            );
            recorder.add(Finding::ok("camera", found))?;
            Ok(true)
        }
        Err(error) => recorder.failure("camera", error),
    }
}

/// Checks whether the folder is writable, and has space for a session's photos.
pub(crate) fn space(folder: &Path, camera: &CameraInfo) -> Finding {
    let there = existing(folder);
    // Only the permission is checked. No file remains.
    if let Err(why) = atomic::check_writable(&there.join("krylux-check")) {
        return Finding::error("disk", &why);
    }
    // A journal stores two bytes per sample. Levels and headers are neglected, because they take less space than the photos.
    let photo_bytes = 2 * (camera.resolution.pixels() * camera.channels) as u64;
    let Some(free) = free(&there) else {
        return Finding::ok("disk", format!("{} can be written; the free space is unknown", there.display()));
    };
    let photos = free / photo_bytes.max(1);
    let found = format!(
        "{} has {:.1} GB free, for {} photos of {:.2} MB",
        there.display(),
        free as f64 / 1e9,
        if photos > 1_000_000 { "over a million".to_owned() } else { photos.to_string() },
        photo_bytes as f64 / 1e6
    );
    let grade = match photos {
        ..MIN_PHOTOS => Grade::Fails,
        MIN_PHOTOS..SESSION_PHOTOS => Grade::Warning,
        _ => Grade::Ok,
    };
    let expected = format!("space for {SESSION_PHOTOS} photos");
    let help = "free some space, or give another folder by -o";
    Finding::graded("disk", grade, found, expected, help).measured(photos as f64, 0.0, SESSION_PHOTOS as f64)
}

fn existing(folder: &Path) -> PathBuf {
    let named = folder.ancestors().find(|path| path.is_dir());
    match named {
        Some(path) if !path.as_os_str().is_empty() => path.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

#[cfg(unix)]
fn free(folder: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(folder).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize))
}

#[cfg(not(unix))]
fn free(_: &Path) -> Option<u64> {
    None
}

pub(crate) fn calibration(file: &RigFile, recorder: &mut Recorder<'_, '_>) -> Result<Option<Calibration>> {
    let (finding, known) = match (file.load_calibration(), &file.calibration) {
        (Some(Ok(known)), Some(folder)) => {
            let found = format!(
                "{}{}; light settles in {} s, and drifts {:.2} % per hour",
                folder.display(),
                age(folder),
                decimal(known.stability.settle, 4),
                100.0 * known.stability.drift_per_hour
            );
            (Finding::ok("calibration", found), Some(known))
        }
        (Some(Err(error)), _) => (Finding::error("calibration", &error), None),
        _ => {
            let found = "the rig file names none: responses, noise and pixel map are assumed to be ideal";
            let expected = "the folder that `krylux rig calibrate` wrote";
            let help = "run it with --use, which names its folder in the rig file";
            (Finding::graded("calibration", Grade::Warning, found, expected, help), None)
        }
    };
    recorder.add(finding)?;
    Ok(known)
}

/// The age of the calibration, such as `, 3 days old`. The text is empty if the file system does not know the age.
fn age(folder: &Path) -> String {
    let written = std::fs::metadata(folder.join("calibration.toml")).and_then(|file| file.modified()).ok();
    let hours = written
        .and_then(|written| SystemTime::now().duration_since(written).ok())
        .map(|age| age.as_secs_f64() / 3600.0);
    match hours {
        Some(hours) if hours >= 48.0 => format!(", {:.0} days old", hours / 24.0),
        Some(hours) => format!(", {hours:.1} hours old"),
        None => String::new(),
    }
}

/// Photographs random squares to measure the error of the pixel map. Without a calibration, both rasters are assumed to cover one field.
pub(crate) fn pixel_map(
    known: Option<&Calibration>,
    frames: &mut dyn FrameSource,
    exposure: f64,
    recorder: &mut Recorder<'_, '_>,
) -> Result<()> {
    let ideal = Calibration::ideal(frames.projector(), frames.camera());
    let known = known.unwrap_or(&ideal);
    let help = match sight::too_few(frames.camera().resolution, frames.projector().resolution) {
        Some(_) => "the camera has too few pixels: see `pixels` above",
        None => {
            "align the bench and calibrate it: the pixel map does not fit, or something has moved since the calibration"
        }
    };
    let expected = format!("within {MAP_OFFSET_WARNING} pixels, beyond noise");
    let finding = match map_check(frames, known, exposure) {
        Err(Error::Numerical(fault)) => {
            let fault = fault.lines().next().unwrap_or_default();
            Finding::graded("pixel map", Grade::Fails, fault, expected, help)
        }
        Err(error) => return Err(error),
        // If no shift fits, the correlation is not a finite number.
        Ok(found) if found.agreement < MIN_CORRELATION || found.agreement.is_nan() => {
            let by = if found.agreement.is_finite() {
                format!(" (correlation {:.2})", found.agreement)
            } else {
                String::new()
            };
            let text = format!("the photo does not show the pattern that was projected{by}");
            Finding::graded("pixel map", Grade::Fails, text, expected, help)
        }
        Ok(found) => {
            let grade = offset_grade(found.off, found.error);
            let [right, down] = found.shift;
            let text = format!(
                "off by {:.3} ± {:.3} pixels at most, by ({right:.3}, {down:.3}) in the centre",
                found.off, found.error
            );
            let finding = Finding::graded("pixel map", grade, text, expected, help);
            finding.measured(found.off, found.error, MAP_OFFSET_WARNING)
        }
    };
    recorder.add(finding)
}

/// The grade of an offset with this standard error, both in projector pixels. An offset that is too uncertain to be judged is a warning.
fn offset_grade(offset: f64, error: f64) -> Grade {
    match offset - SIGMAS * error {
        surely if surely > MAP_OFFSET_FAILURE => Grade::Fails,
        surely if surely > MAP_OFFSET_WARNING => Grade::Warning,
        surely if surely.is_finite() && SIGMAS * error <= MAP_OFFSET_FAILURE => Grade::Ok,
        _ => Grade::Warning,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn the_ramp_has_every_level_in_every_channel() {
        for (width, height, channels) in [(12, 12, 1), (12, 12, 3), (64, 48, 3), (1, 1, 1)] {
            let resolution = Resolution::new(width, height);
            let info = ProjectorInfo { name: String::new(), resolution, channels, bits: 8, frame_time: 0.0 };
            let frames = ramp(&info).expect("as many levels as samples");
            for channel in 0..channels {
                let levels = frames.iter().flat_map(|f| f.levels().iter().skip(channel).step_by(channels));
                let found: std::collections::HashSet<u16> = levels.copied().collect();
                assert_eq!(found.len(), 256, "{width}x{height}, channel {channel}");
            }
        }
    }

    #[test]
    fn an_exposure_that_is_not_a_whole_number_of_refreshes_is_found() {
        let of = |exposures: &[f64]| MeasureOptions { exposures: exposures.to_vec(), ..Default::default() };
        let refresh = 1.0 / 60.0;
        assert_eq!(uneven(&of(&[refresh, 0.05]), refresh), None);
        assert_eq!(uneven(&of(&[refresh, 0.04]), refresh), Some(0.04));
        assert_eq!(uneven(&of(&[0.004]), refresh), Some(0.004), "a part of a refresh is not a whole number");
        assert_eq!(uneven(&of(&[0.04]), 0.0), None, "a projector without refresh suits any exposure");
    }

    #[test]
    fn the_space_of_a_missing_folder_is_that_of_the_nearest_folder_above() {
        let folder = tempfile::TempDir::new().expect("a temporary folder can be made");
        assert_eq!(existing(&folder.path().join("a/b")), folder.path());
        assert_eq!(existing(Path::new("not-there")), Path::new("."));
        let camera = |side| CameraInfo {
            name: String::new(),
            resolution: Resolution::new(side, 1),
            channels: 1,
            bits: 12,
            exposures: [1e-4, 1.0],
        };
        let finding = space(&folder.path().join("a/b"), &camera(1));
        assert_eq!(finding.grade, Grade::Ok, "{finding:?}");
        // No disk has space for photos of an exabyte each.
        let finding = space(folder.path(), &camera(1 << 59));
        assert_eq!(finding.grade, if cfg!(unix) { Grade::Fails } else { Grade::Ok }, "{finding:?}");
    }

    #[test]
    fn an_offset_counts_beyond_its_noise_and_an_uncertain_one_is_a_warning() {
        for (offset, error, expected) in [
            (0.02, 0.01, Grade::Ok),
            (0.15, 0.03, Grade::Ok),
            (0.2, 0.03, Grade::Warning),
            (0.5, 0.03, Grade::Fails),
            (13.0, 96.0, Grade::Warning),
            (f64::NAN, 0.0, Grade::Warning),
        ] {
            assert_eq!(offset_grade(offset, error), expected, "{offset} ± {error}");
        }
    }
}
