//! The file, and each device by itself.

use std::time::Instant;

use anyhow::Result;

use super::finding::{Finding, Findings, Grade};
use crate::measure::MeasureOptions;
use crate::measure::{RigFile, RigKind};
#[cfg(any(feature = "gige", feature = "usb3"))]
use crate::rig;
use crate::rig::{CameraSpec, Frame, HardwareRig, Helper, Projector, ProjectorInfo, X11Spec};

/// How far an exposure may be from a whole number of refreshes, as a share of one.
const WHOLE: f64 = 0.02;

/// What stands in the file, and whether its exposures suit its projector.
pub(super) fn file(file: &RigFile) -> Finding {
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    let kind = match file.kind {
        RigKind::Virtual(_) => "virtual",
        RigKind::Hardware(_) => "hardware",
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
            "correct exposures, or leave them out: then they are chosen so",
        ),
    }
}

/// An exposure that is no whole multiple of the refresh: it sees more of one refresh than of another.
fn uneven(options: &MeasureOptions, frame_time: f64) -> Option<f64> {
    let is_uneven = |exposure: &f64| {
        let refreshes = exposure / frame_time;
        (refreshes - refreshes.round().max(1.0)).abs() > WHOLE
    };
    options.exposures.iter().copied().find(|exposure| frame_time > 0.0 && is_uneven(exposure))
}

/// Projector and camera, each opened by itself; whether both can be used.
pub(super) fn devices(kind: &RigKind, findings: &mut Findings) -> Result<bool> {
    let RigKind::Hardware(rig) = kind else {
        let (projector, camera) = (kind.projector_info(), kind.camera_info());
        findings.add(Finding::ok("projector", format!("simulated: {} bits", projector.bits)))?;
        let [shortest, longest] = camera.exposures;
        let found = format!("simulated: {} bits, exposures {shortest} to {longest} s", camera.bits);
        findings.add(Finding::ok("camera", found))?;
        return Ok(true);
    };
    let has_monitor = monitor(&rig.projector, findings)?;
    let shows = has_monitor && screen(rig, findings)?;
    // The camera is looked at whatever the projector does: two faults are told at once.
    let sees = camera(rig, findings)?;
    Ok(shows && sees)
}

fn monitor(spec: &X11Spec, findings: &mut Findings) -> Result<bool> {
    let monitor = match spec.monitor() {
        Ok(monitor) => monitor,
        Err(why) => {
            findings.add(Finding::error("monitor", &why))?;
            return Ok(false);
        }
    };
    let [x, y] = monitor.place;
    let refresh = monitor.frame_time.map_or_else(
        || format!("refresh not told, {:.5} s by the file", spec.frame_time),
        |time| format!("a refresh every {time:.5} s"),
    );
    let found = format!("\"{}\": {} pixels at ({x}, {y}), {refresh}", monitor.name, monitor.resolution);
    findings.add(match spec.monitor_size {
        Some(_) => Finding::ok("monitor", found),
        None => Finding::graded(
            "monitor",
            Grade::Warning,
            found,
            "the projector's own pixels: another mode is scaled by it, which the server does not see",
            format!(
                "if these are its own, write monitor_size = [{}, {}] in [projector]",
                monitor.resolution.width, monitor.resolution.height
            ),
        ),
    })?;
    Ok(true)
}

/// Every level is shown and read back.
fn screen(rig: &HardwareRig, findings: &mut Findings) -> Result<bool> {
    let shown = Helper::find().and_then(|helper| {
        let mut projector = rig.open_projector(&helper)?;
        let began = Instant::now();
        let frames = ramp(projector.info())?;
        frames.iter().try_for_each(|frame| projector.show(frame).map(|_| ()))?;
        projector.confirm()?;
        Ok((frames.len(), began.elapsed().as_secs_f64() / frames.len() as f64))
    });
    let (finding, shows) = match shown {
        Ok((frames, seconds)) => {
            let frames = if frames == 1 { "a frame".to_owned() } else { format!("{frames} frames") };
            let found = format!("all 256 levels read back as drawn, in {frames} of {:.0} ms", 1e3 * seconds);
            (Finding::ok("screen", found), true)
        }
        Err(why) => (Finding::error("screen", &why), false),
    };
    findings.add(finding)?;
    Ok(shows)
}

/// As many frames as it takes for each level to be in each channel somewhere.
fn ramp(info: &ProjectorInfo) -> crate::Result<Vec<Frame>> {
    let (pixels, levels) = (info.resolution.pixels(), usize::from(info.highest()) + 1);
    (0..levels.div_ceil(pixels))
        .map(|frame| {
            // Channels are apart, so that one that is shown in another's place is found.
            let level = |sample: usize| {
                let (pixel, channel) = (sample / info.channels, sample % info.channels);
                ((frame * pixels + pixel + 85 * channel) % levels) as u16
            };
            Frame::new(info.resolution, info.channels, (0..pixels * info.channels).map(level).collect())
        })
        .collect()
}

fn camera(rig: &HardwareRig, findings: &mut Findings) -> Result<bool> {
    let spec = &rig.camera;
    let can = can(spec);
    let opened = rig.open_camera().and_then(|mut camera| {
        let [shortest, longest] = camera.info().exposures;
        let set = [camera.configure(longest)?, camera.configure(shortest)?];
        Ok((camera.info().clone(), set))
    });
    let (finding, sees) = match opened {
        Ok((info, [longest, shortest])) => {
            let found = format!(
                "{}: {} pixels, exposures {shortest} to {longest} s{can}",
                info.name, info.resolution
            );
            (Finding::ok("camera", found), true)
        }
        Err(why) => (Finding::error("camera", &why), false),
    };
    findings.add(finding)?;
    Ok(sees)
}

/// What the camera could do besides, as far as it answers.
fn can(spec: &CameraSpec) -> String {
    let abilities = match spec {
        #[cfg(feature = "gige")]
        CameraSpec::Gige(spec) => rig::camera_abilities(spec.address).ok().map(|can| can.to_string()),
        #[cfg(feature = "usb3")]
        CameraSpec::Usb3(spec) => {
            rig::usb_camera_abilities(spec.serial.as_deref()).ok().map(|can| can.to_string())
        }
        _ => None::<String>,
    };
    abilities.map_or_else(String::new, |abilities| format!(" (it can do {abilities})"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn a_ramp_has_every_level_in_every_channel() {
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
    fn exposures_are_whole_refreshes_or_named() {
        let of = |exposures: &[f64]| MeasureOptions { exposures: exposures.to_vec(), ..Default::default() };
        let refresh = 1.0 / 60.0;
        assert_eq!(uneven(&of(&[refresh, 0.05]), refresh), None);
        assert_eq!(uneven(&of(&[refresh, 0.04]), refresh), Some(0.04));
        assert_eq!(uneven(&of(&[0.004]), refresh), Some(0.004), "a part of a refresh is none");
        assert_eq!(uneven(&of(&[0.04]), 0.0), None, "it shows steadily");
    }
}
