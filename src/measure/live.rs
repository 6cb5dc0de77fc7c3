//! Raw frames from open devices. Each returned frame was exposed while its pattern was on screen, and no frame is returned twice.
//!
//! A frame of the camera is accepted when three conditions hold. The frame is new, so its number is larger than the number of every earlier
//! frame. Its exposure time is the exposure that was set. Its exposure began after the pattern had settled and after every earlier frame.
//! Other frames are counted, refused and taken again, up to a limit. A camera that delivers no frame is restarted between the tries.

use std::sync::Arc;

use super::{CaptureRequest, Effort, FrameSource, Times};
use crate::error::{Error, Result};
use crate::rig::{CameraInfo, Devices, Frame, ProjectorInfo, RawFrame};

/// The largest relative difference between the exposure of a frame and the set exposure. Some cameras report a 32-bit number.
const EXPOSURE_TOLERANCE: f64 = 1e-6;

/// The frame source of open devices.
pub struct LiveFrames {
    devices: Devices,
    settle: f64,
    tries: u32,
    /// The frame on screen, and the time of its confirmation.
    shown: Option<(Arc<Frame>, f64)>,
    /// The exposure that was requested, and the exposure that the camera set.
    exposure: Option<[f64; 2]>,
    /// The number and the start of the last new frame. The number is unknown after the camera restarts, which may reset it.
    last: (Option<u64>, f64),
    /// The start of the session, on the rig's clock.
    opened: f64,
    effort: Effort,
}

impl LiveFrames {
    /// Takes frames from `devices`. Exposures begin at least `settle` seconds after a pattern is confirmed. Each frame is tried at most
    /// `tries` times.
    pub fn new(devices: Devices, settle: f64, tries: u32) -> Self {
        let opened = devices.clock.now();
        Self {
            devices,
            settle,
            tries: tries.max(1),
            shown: None,
            exposure: None,
            last: (None, f64::NEG_INFINITY),
            opened,
            effort: Effort::default(),
        }
    }

    /// Calls `doing`, and adds its duration to this `part` of the session's time.
    fn timed<T>(&mut self, part: fn(&mut Times) -> &mut f64, doing: impl FnOnce(&mut Devices) -> T) -> T {
        let began = self.devices.clock.now();
        let done = doing(&mut self.devices);
        *part(&mut self.effort.times) += self.devices.clock.now() - began;
        done
    }

    /// Shows `frame` unless it is already on screen. Returns the time at which the frame has settled.
    fn show(&mut self, frame: &Arc<Frame>) -> Result<f64> {
        if let Some((shown, at)) = &self.shown
            && (Arc::ptr_eq(shown, frame) || shown == frame)
        {
            return Ok(at + self.settle);
        }
        // If showing the frame fails, the content of the screen is unknown.
        self.shown = None;
        let at = self.timed(|times| &mut times.show, |devices| devices.projector.show(frame))?.at;
        let (waited, times) = (self.devices.projector.waited(), &mut self.effort.times);
        times.show -= waited.refresh + waited.settle;
        times.refresh += waited.refresh;
        times.settle += waited.settle;
        self.shown = Some((Arc::clone(frame), at));
        self.effort.shown += 1;
        Ok(at + self.settle)
    }

    /// Sets the exposure unless it is already set. Returns the exposure that the camera really set, in seconds.
    fn configure(&mut self, asked: f64) -> Result<f64> {
        if let Some([before, set]) = self.exposure
            && before == asked
        {
            return Ok(set);
        }
        self.exposure = None;
        let set = self.timed(|times| &mut times.transfer, |devices| devices.camera.configure(asked))?;
        if !(set.is_finite() && set > 0.0) {
            return Err(self.fault(
                format!("it was asked for an exposure of {asked} s and says that it has set {set} s"),
                "give exposures within the camera's range, and check its driver",
            ));
        }
        self.exposure = Some([asked, set]);
        Ok(set)
    }

    /// Takes one frame. Its exposure must not begin before the time `ready`. Returns `None` when the frame was refused, and counts the
    /// refusal.
    fn take(&mut self, exposure: f64, ready: f64) -> Result<Option<RawFrame>> {
        let before = self.devices.camera.losses().incomplete;
        let captured = self.timed(|times| &mut times.transfer, |devices| devices.camera.capture())?;
        let Some(frame) = captured else {
            let came = self.devices.camera.losses().incomplete > before;
            *(if came { &mut self.effort.incomplete } else { &mut self.effort.dropped }) += 1;
            return Ok(None);
        };
        self.check_shape(&frame)?;
        let (last_id, last_started) = self.last;
        if last_id.map_or(frame.started <= last_started, |last| frame.id <= last) {
            self.effort.repeated += 1;
            return Ok(None);
        }
        self.last = (Some(frame.id), frame.started.max(last_started));
        let is_as_set = (frame.exposure - exposure).abs() <= EXPOSURE_TOLERANCE * exposure;
        if frame.started < ready || frame.started <= last_started || !is_as_set {
            self.effort.late += 1;
            return Ok(None);
        }
        self.effort.times.expose += frame.exposure;
        self.effort.times.transfer -= frame.exposure;
        // The projector may have shown something else in the meantime.
        self.timed(|times| &mut times.show, |devices| devices.projector.confirm())?;
        self.effort.taken += 1;
        Ok(Some(frame))
    }

    fn check_shape(&self, frame: &RawFrame) -> Result<()> {
        let info = self.devices.camera.info();
        frame.check()?;
        if (frame.resolution, frame.channels) != (info.resolution, info.channels) {
            return Err(self.fault(
                format!(
                    "it delivered a frame of {} with {} channels instead of {} with {}",
                    frame.resolution, frame.channels, info.resolution, info.channels
                ),
                "set the camera's region and pixel format as the rig file says",
            ));
        }
        if !frame.started.is_finite() {
            return Err(self.fault(
                "it delivered a frame without the time of its exposure".into(),
                "switch the camera's timestamps on: without them, a frame of the previous pattern cannot be recognized",
            ));
        }
        Ok(())
    }

    fn restart(&mut self) -> Result<()> {
        self.timed(|times| &mut times.transfer, |devices| devices.camera.restart())?;
        // The camera may restart its frame numbers. New frames are then recognized by their time.
        self.last.0 = None;
        self.effort.restarts += 1;
        Ok(())
    }

    fn fault(&self, fault: String, help: &str) -> Error {
        Error::rig(self.devices.camera.info().name.clone(), fault).help(help)
    }

    /// The error for a request whose frames were all refused. `before` is the effort before this request, and `missing` counts packets that
    /// never came.
    fn give_up(&self, before: &Effort, missing: u64) -> Error {
        let now = &self.effort;
        let [dropped, incomplete] = [now.dropped - before.dropped, now.incomplete - before.incomplete];
        let [repeated, late] = [now.repeated - before.repeated, now.late - before.late];
        let lacking = match incomplete {
            0 => String::new(),
            _ => format!(" {incomplete} came incomplete ({missing} packets were lost, and not sent again),"),
        };
        let mut fault = format!(
            "no good frame in {} tries: {dropped} did not come,{lacking} {repeated} came a second time, {late} were exposed \
             before the pattern had settled",
            self.tries
        );
        if now.restarts > before.restarts {
            fault.push_str("; a restart of the camera did not help");
        }
        self.fault(
            fault,
            if incomplete > dropped + repeated + late {
                "the network loses packets: connect the camera to a network card of its own by a good cable, allow jumbo frames there, or give a smaller \
                 `packet_size` in [camera]; the photos taken so far are kept"
            } else if late > dropped + repeated {
                "give a longer `settle` or more `tries` in [measurement]; a free-running camera must be triggered"
            } else {
                "check the camera's cable and power, or give more `tries` in [measurement]; the photos taken so far are kept"
            },
        )
    }
}

impl FrameSource for LiveFrames {
    fn projector(&self) -> &ProjectorInfo {
        self.devices.projector.info()
    }

    fn camera(&self) -> &CameraInfo {
        self.devices.camera.info()
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        let exposure = self.configure(request.exposure)?;
        let ready = self.show(&request.frame)?;
        let (before, missing) = (self.effort, self.devices.camera.losses().missing);
        let wait = |devices: &mut Devices| {
            // The sleep of a real clock may end a little early.
            while devices.clock.now() < ready {
                devices.clock.sleep(ready - devices.clock.now());
            }
        };
        for tried in 1..=self.tries {
            self.timed(|times| &mut times.settle, wait);
            if let Some(frame) = self.take(exposure, ready)? {
                return Ok(frame);
            }
            let hangs = (self.effort.late, self.effort.restarts) == (before.late, before.restarts);
            if hangs && tried < self.tries && 2 * tried >= self.tries {
                self.restart()?;
            }
        }
        let missing = self.devices.camera.losses().missing - missing;
        Err(self.give_up(&before, missing))
    }

    fn follow(&mut self, request: &CaptureRequest, frame: &RawFrame) -> Result<()> {
        let shown = self.devices.projector.restore(&request.frame)?;
        self.shown = Some((Arc::clone(&request.frame), shown.at));
        self.last = (Some(frame.id), frame.started);
        Ok(())
    }

    fn set_settle(&mut self, seconds: f64) {
        self.settle = seconds;
    }

    fn effort(&self) -> Effort {
        let seconds = self.devices.clock.now() - self.opened;
        let (times, losses) = (self.effort.times, self.devices.camera.losses());
        // With a simulated clock, the difference is only a rounding error, which may be negative.
        let process = (seconds - times.sum()).max(0.0);
        Effort {
            seconds,
            times: Times { process, ..times },
            resent: losses.resent,
            missing: losses.missing,
            ..self.effort
        }
    }
}
