//! The camera as a rig sees it: one frame for each trigger, each with a number and a time of its own.

use std::time::Duration;

use viva_genicam::{Frame, GenicamError};

use super::anchor::Anchor;
use super::fault;
use super::link::Link;
use super::spec::GigeSpec;
use crate::error::Result;
use crate::rig::{Camera, CameraInfo, RawFrame, WallClock};

/// Half of the numbers that the camera has for frames: what is further back is not back, but past the last of them.
const WRAP: u64 = 1 << 15;

/// A GigE Vision camera.
pub struct GigeVision {
    info: CameraInfo,
    spec: GigeSpec,
    clock: WallClock,
    link: Option<Link>,
    anchor: Option<Anchor>,
    /// What was asked for, and what was set.
    exposure: Option<[f64; 2]>,
    numbers: Numbers,
    /// Packets sent again, in the sessions before this one.
    resent: u64,
}

/// Frame numbers that grow over all sessions.
struct Numbers {
    /// Added to the camera's.
    base: u64,
    /// The camera's last.
    last: u64,
}

impl GigeVision {
    /// Opens the camera. Times are told by `clock`; frames are numbered from past `after` on.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when no camera answers there, another program holds it, or it cannot do what `spec` says.
    pub fn open(spec: &GigeSpec, clock: WallClock, after: u64) -> Result<Self> {
        let mut camera = Self {
            info: spec.info(),
            spec: spec.clone(),
            clock,
            link: Some(Link::open(spec)?),
            anchor: None,
            exposure: None,
            numbers: Numbers { base: after, last: 0 },
            resent: 0,
        };
        camera.configure(spec.exposures[0])?;
        Ok(camera)
    }

    /// Triggers a frame and waits for it; what came, when the trigger was sent, and when it came.
    fn frame(&mut self, exposure: f64) -> std::result::Result<Option<(Frame, [f64; 2])>, GenicamError> {
        let Some(link) = &mut self.link else { return Ok(None) };
        // What came too late for the trigger before is not for this one.
        while link.stream.next_frame_blocking(Duration::ZERO).is_ok_and(|frame| frame.is_some()) {}
        let now = self.clock.seconds();
        if self.anchor.is_none_or(|anchor| anchor.is_old(now)) {
            self.anchor = Anchor::take(&mut link.camera, self.clock);
        }
        let triggered = self.clock.seconds();
        link.camera.trigger_software()?;
        let patience = Duration::from_secs_f64(exposure + self.spec.timeout);
        match link.stream.next_frame_blocking(patience) {
            Ok(frame) => Ok(frame.map(|frame| (frame, [triggered, self.clock.seconds()]))),
            Err(GenicamError::Timeout(_)) => Ok(None),
            Err(why) => Err(why),
        }
    }

    /// When the exposure began, as far as the camera and the trigger tell.
    fn started(&self, frame: &Frame, exposure: f64, [triggered, came]: [f64; 2]) -> f64 {
        let (Some(anchor), Some(stamp)) = (self.anchor, frame.ts_dev) else {
            // Nothing but the trigger tells. A frame of an earlier one would be taken for this one's, which draining prevents.
            return triggered;
        };
        let [time, error] = anchor.time_of(stamp);
        if time < triggered - error {
            return time;
        }
        // Some cameras stamp the exposure's end.
        time.min(came - exposure).max(triggered)
    }

    /// Sets the exposure of an open camera.
    fn set(&mut self, exposure: f64) -> Result<f64> {
        match &mut self.link {
            Some(link) => link.configure(&self.spec, exposure),
            None => Err(fault("the camera is closed", "open it again")),
        }
    }

    fn reopen(&mut self) -> Result<()> {
        self.close();
        self.link = Some(Link::open(&self.spec)?);
        self.numbers.begin();
        Ok(())
    }

    fn close(&mut self) {
        if let Some(link) = self.link.take() {
            self.resent += link.stream.stats().resend_recovered;
        }
        self.anchor = None;
    }
}

impl Camera for GigeVision {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        let [shortest, longest] = self.info.exposures;
        if !(shortest..=longest).contains(&exposure) {
            return Err(fault(
                format!("an exposure of {exposure} s cannot be set"),
                format!(
                    "give exposures from {shortest} to {longest} s in [measurement], or correct those of [camera]"
                ),
            ));
        }
        if self.link.is_none() {
            self.reopen()?;
        }
        let set = match self.set(exposure) {
            Ok(set) => set,
            // It may have been switched off and on since the last frame.
            Err(_) => self.reopen().and_then(|()| self.set(exposure))?,
        };
        self.exposure = Some([exposure, set]);
        Ok(set)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        let exposure = self.exposure.map_or(self.info.exposures[0], |[_, set]| set);
        let (frame, times) = match self.frame(exposure) {
            Ok(Some(came)) => came,
            Ok(None) => return Ok(None),
            // It is gone, or somebody else's: opened anew at the next restart, or an error then.
            Err(_) => {
                self.close();
                return Ok(None);
            }
        };
        let (width, height) = (frame.width as usize, frame.height as usize);
        let needed = width * height * self.spec.pixel_format.bytes();
        if frame.row_stride().is_some() || frame.payload.len() < needed {
            return Err(fault(
                format!("a frame came with {} bytes, where {needed} were expected", frame.payload.len()),
                "give another size or pixel_format in [camera]",
            ));
        }
        Ok(Some(RawFrame {
            resolution: crate::image::Resolution::new(width, height),
            channels: 1,
            counts: self.spec.pixel_format.counts(&frame.payload[..needed]),
            exposure,
            id: self.numbers.of(frame.block_id),
            started: self.started(&frame, exposure, times),
        }))
    }

    fn restart(&mut self) -> Result<()> {
        self.reopen()?;
        if let Some([asked, _]) = self.exposure {
            self.exposure = Some([asked, self.set(asked)?]);
        }
        Ok(())
    }

    fn resent(&self) -> u64 {
        self.resent + self.link.as_ref().map_or(0, |link| link.stream.stats().resend_recovered)
    }
}

impl Numbers {
    /// The number of the frame that the camera calls `number`.
    fn of(&mut self, number: u64) -> u64 {
        if number + WRAP < self.last {
            // From 65535 it goes on at 1.
            self.base += 2 * WRAP - 1;
        }
        self.last = number;
        self.base + number
    }

    /// The camera counts anew.
    fn begin(&mut self) {
        self.base += self.last;
        self.last = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_grow_past_the_cameras_last_one_and_over_restarts() {
        let mut numbers = Numbers { base: 10, last: 0 };
        assert_eq!(
            [1, 2, 2, 65_535, 1, 2].map(|number| numbers.of(number)),
            [11, 12, 12, 65_545, 65_546, 65_547]
        );
        numbers.begin();
        assert_eq!([1, 2].map(|number| numbers.of(number)), [65_548, 65_549]);
    }
}
