//! Raw frames from an open bench, each exposed while its pattern was on screen, and none handed out twice.
//!
//! A camera's frame is trusted only if it is new (its number is past that of every frame before), if its exposure is the one
//! that was set, and if that began after the pattern had settled and after every frame before. What is not is counted,
//! refused and taken anew, within a limit; a camera that hangs is restarted on the way.

use std::sync::Arc;

use super::{CaptureRequest, Effort, FrameSource, Times};
use crate::error::{Error, Result};
use crate::rig::{CameraInfo, Devices, Frame, ProjectorInfo, RawFrame};

/// Exposures differ from what was set by less, relatively: some cameras hand them out as 32-bit numbers.
const EXPOSURE_TOLERANCE: f64 = 1e-6;

/// Takes frames from a bench.
pub struct LiveFrames {
    bench: Devices,
    settle: f64,
    tries: u32,
    /// What is on screen, and when that was confirmed.
    shown: Option<(Arc<Frame>, f64)>,
    /// The exposure that was asked for, and the one that was set.
    exposure: Option<[f64; 2]>,
    /// Number (not known after a restart, which may set it back) and time of the last frame that was new.
    last: (Option<u64>, f64),
    /// When the session began.
    opened: f64,
    effort: Effort,
}

/// Why a frame is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Refused {
    Dropped,
    Repeated,
    Late,
}

impl LiveFrames {
    /// Takes frames from `bench`, `settle` seconds after a pattern is confirmed at the earliest, with `tries` tries for each.
    pub fn new(bench: Devices, settle: f64, tries: u32) -> Self {
        let opened = bench.clock.now();
        Self {
            bench,
            settle,
            tries: tries.max(1),
            shown: None,
            exposure: None,
            last: (None, f64::NEG_INFINITY),
            opened,
            effort: Effort::default(),
        }
    }

    /// Does something that takes time, and counts it as `part` of it.
    fn spend<T>(&mut self, part: fn(&mut Times) -> &mut f64, doing: impl FnOnce(&mut Devices) -> T) -> T {
        let began = self.bench.clock.now();
        let done = doing(&mut self.bench);
        *part(&mut self.effort.times) += self.bench.clock.now() - began;
        done
    }

    /// Puts `frame` on screen unless it is there; when it has settled.
    fn show(&mut self, frame: &Arc<Frame>) -> Result<f64> {
        if let Some((shown, at)) = &self.shown
            && (Arc::ptr_eq(shown, frame) || shown == frame)
        {
            return Ok(at + self.settle);
        }
        // Should it fail, nobody knows what is on screen.
        self.shown = None;
        let at = self.spend(|times| &mut times.show, |bench| bench.projector.show(frame))?.at;
        let (waited, times) = (self.bench.projector.waited(), &mut self.effort.times);
        times.show -= waited.refresh + waited.settle;
        times.refresh += waited.refresh;
        times.settle += waited.settle;
        self.shown = Some((Arc::clone(frame), at));
        self.effort.shown += 1;
        Ok(at + self.settle)
    }

    /// Sets the exposure unless it is set; what was really set.
    fn configure(&mut self, asked: f64) -> Result<f64> {
        if let Some([before, set]) = self.exposure
            && before == asked
        {
            return Ok(set);
        }
        self.exposure = None;
        let set = self.spend(|times| &mut times.transfer, |bench| bench.camera.configure(asked))?;
        if !(set.is_finite() && set > 0.0) {
            return Err(self.fault(
                format!("asked for an exposure of {asked} s, it says that it has set {set} s"),
                "give exposures within the camera's range, and check its driver",
            ));
        }
        self.exposure = Some([asked, set]);
        Ok(set)
    }

    /// Takes one frame, which must have begun from `ready` on.
    fn take(&mut self, exposure: f64, ready: f64) -> Result<std::result::Result<RawFrame, Refused>> {
        let captured = self.spend(|times| &mut times.transfer, |bench| bench.camera.capture())?;
        let Some(frame) = captured else { return Ok(Err(Refused::Dropped)) };
        self.check_shape(&frame)?;
        let (last_id, last_started) = self.last;
        let is_repeated = last_id.map_or(frame.started <= last_started, |last| frame.id <= last);
        if is_repeated {
            return Ok(Err(Refused::Repeated));
        }
        self.last = (Some(frame.id), frame.started.max(last_started));
        let is_as_set = (frame.exposure - exposure).abs() <= EXPOSURE_TOLERANCE * exposure;
        if frame.started < ready || frame.started <= last_started || !is_as_set {
            return Ok(Err(Refused::Late));
        }
        self.effort.times.expose += frame.exposure;
        self.effort.times.transfer -= frame.exposure;
        // A photo of something else must not count.
        self.spend(|times| &mut times.show, |bench| bench.projector.confirm())?;
        Ok(Ok(frame))
    }

    fn check_shape(&self, frame: &RawFrame) -> Result<()> {
        let info = self.bench.camera.info();
        frame.check()?;
        if (frame.resolution, frame.channels) != (info.resolution, info.channels) {
            return Err(self.fault(
                format!(
                    "a frame of {} with {} channels came, where {} with {} was expected",
                    frame.resolution, frame.channels, info.resolution, info.channels
                ),
                "set the camera's region and pixel format as the rig file says",
            ));
        }
        if !frame.started.is_finite() {
            return Err(self.fault(
                "a frame came without the time of its exposure".into(),
                "switch the camera's timestamps on: without them, a frame of the pattern before cannot be told",
            ));
        }
        Ok(())
    }

    fn count(&mut self, refused: Refused) {
        match refused {
            Refused::Dropped => self.effort.dropped += 1,
            Refused::Repeated => self.effort.repeated += 1,
            Refused::Late => self.effort.late += 1,
        }
    }

    fn restart(&mut self) -> Result<()> {
        self.spend(|times| &mut times.transfer, |bench| bench.camera.restart())?;
        // It may count its frames anew; their time tells whether they are new.
        self.last.0 = None;
        self.effort.restarts += 1;
        Ok(())
    }

    fn fault(&self, fault: String, help: &str) -> Error {
        Error::Rig { device: self.bench.camera.info().name.clone(), fault, help: help.into() }
    }

    fn give_up(&self, refused: &[Refused], restarted: bool) -> Error {
        let number = |what| refused.iter().filter(|&&refused| refused == what).count();
        let [dropped, repeated, late] = [Refused::Dropped, Refused::Repeated, Refused::Late].map(number);
        let mut fault = format!(
            "no good frame in {} tries: {dropped} did not come, {repeated} came a second time, {late} were exposed \
             before the pattern had settled",
            refused.len()
        );
        if restarted {
            fault.push_str("; a restart of the camera did not help");
        }
        self.fault(
            fault,
            if late > dropped + repeated {
                "give a longer `settle` or more `tries` in [measurement]; a camera that runs free must be triggered"
            } else {
                "check the camera's cable and power, or give more `tries` in [measurement]; what was taken so far is kept"
            },
        )
    }
}

impl FrameSource for LiveFrames {
    fn projector(&self) -> &ProjectorInfo {
        self.bench.projector.info()
    }

    fn camera(&self) -> &CameraInfo {
        self.bench.camera.info()
    }

    fn capture(&mut self, shot: &CaptureRequest) -> Result<RawFrame> {
        let exposure = self.configure(shot.exposure)?;
        let ready = self.show(&shot.frame)?;
        let mut refused = Vec::new();
        let mut restarted = false;
        loop {
            let wait = |bench: &mut Devices| {
                // A real clock may wake a little early.
                while bench.clock.now() < ready {
                    bench.clock.sleep(ready - bench.clock.now());
                }
            };
            self.spend(|times| &mut times.settle, wait);
            let why = match self.take(exposure, ready)? {
                Ok(frame) => {
                    self.effort.taken += 1;
                    return Ok(frame);
                }
                Err(why) => why,
            };
            self.count(why);
            refused.push(why);
            if refused.len() >= self.tries as usize {
                return Err(self.give_up(&refused, restarted));
            }
            let hangs = !refused.contains(&Refused::Late);
            if !restarted && hangs && 2 * refused.len() >= self.tries as usize {
                self.restart()?;
                restarted = true;
            }
        }
    }

    fn follow(&mut self, shot: &CaptureRequest, frame: &RawFrame) -> Result<()> {
        let shown = self.bench.projector.restore(&shot.frame)?;
        self.shown = Some((Arc::clone(&shot.frame), shown.at));
        self.last = (Some(frame.id), frame.started);
        Ok(())
    }

    fn set_settle(&mut self, seconds: f64) {
        self.settle = seconds;
    }

    fn effort(&self) -> Effort {
        let seconds = self.bench.clock.now() - self.opened;
        let times = self.effort.times;
        // Where time is simulated nothing is left but rounding, of either sign.
        let process = (seconds - times.sum()).max(0.0);
        Effort {
            seconds,
            times: Times { process, ..times },
            resent: self.bench.camera.resent(),
            ..self.effort
        }
    }
}
