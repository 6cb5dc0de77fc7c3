//! The check of the rig file, and of each device by itself.

use std::time::Instant;

use super::thresholds::REFRESH_FRACTION;
use super::{Finding, Grade, Recorder};
use crate::error::Result;
use crate::measure::{MeasureOptions, RigFile, RigKind};
use crate::rig::{CameraSpec, Frame, HardwareRig, Helper, Projector, ProjectorInfo, X11Spec};

/// What the file describes, and whether its exposures suit its projector.
pub(crate) fn file(file: &RigFile) -> Finding {
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    let kind = match file.kind {
        RigKind::Virtual(_) => "virtual",
        RigKind::Hardware(_) => "hardware",
        RigKind::Program(_) => "program",
    };
    let [shown, seen] = [projector.resolution, camera.resolution];
    let found = format!("{kind} rig, patterns of {shown} and photos of {seen} pixels");
    match uneven(&file.measurement, projector.frame_time) {
        None => Finding::ok("file", found),
        Some(exposure) => Finding::graded(
            "file",
            Grade::Warning,
            format!("{found}; [measurement] has an exposure of {exposure} s"),
            format!("whole multiples of the projector's refresh, {:.5} s", projector.frame_time),
            "correct the exposures, or leave them out: the program then chooses suitable ones",
        ),
    }
}

/// The first exposure that is not a whole multiple of the refresh time. Such an exposure contains more of one
/// refresh than of another.
fn uneven(options: &MeasureOptions, frame_time: f64) -> Option<f64> {
    let is_uneven = |exposure: &f64| {
        let refreshes = exposure / frame_time;
        (refreshes - refreshes.round().max(1.0)).abs() > REFRESH_FRACTION
    };
    options.exposures.iter().copied().find(|exposure| frame_time > 0.0 && is_uneven(exposure))
}

/// Opens projector and camera, each by itself. Returns whether both can be used.
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
    // The camera is checked whatever the projector does, so that two faults are reported at once.
    let captures = camera(rig, helper, recorder)?;
    Ok(shows && captures)
}

/// Finds the monitor that is the projector. Returns whether there is one.
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
    recorder.add(match spec.monitor_size {
        Some(_) => Finding::ok("monitor", found),
        None => Finding::graded(
            "monitor",
            Grade::Warning,
            found,
            "the projector's native pixels: it scales any other mode, and the X server cannot know that",
            format!(
                "if these are its native pixels, write monitor_size = [{}, {}] in [projector]",
                monitor.resolution.width, monitor.resolution.height
            ),
        ),
    })?;
    Ok(true)
}

/// Shows every level and reads it back. Returns whether the projector shows what it should.
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

/// The frames that together contain each level in each channel.
fn ramp(info: &ProjectorInfo) -> Result<Vec<Frame>> {
    let (pixels, levels) = (info.resolution.pixels(), usize::from(info.highest()) + 1);
    (0..levels.div_ceil(pixels))
        .map(|frame| {
            // The channels differ, so that exchanged channels are found.
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
    let describes_itself = matches!(rig.camera, CameraSpec::Gige(_) | CameraSpec::Usb3(_));
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
}
