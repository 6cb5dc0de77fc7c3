//! The video camera as a rig's camera. It runs freely: for each photo, frames that may have begun before are discarded.

use std::time::Duration;

use v4l::Device;
use v4l::buffer::{Flags, Type};
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream;

use super::decode::counts;
use super::set_up::{Layout, set_exposure, set_up};
use super::spec::V4lSpec;
use crate::error::Result;
use crate::rig::busy::{in_use, is_busy};
use crate::rig::{Camera, CameraInfo, RawFrame, WallClock, camera_fault};

/// The number of frames that the driver buffers. After a pause these are from before the pause.
const BUFFERS: u32 = 2;

/// An open camera of Linux's video interface.
pub struct V4l {
    info: CameraInfo,
    spec: V4lSpec,
    clock: WallClock,
    device: Device,
    layout: Layout,
    /// The stream of frames. `None`: not started, or ended by an error.
    stream: Option<Stream<'static>>,
    /// The exposure that was asked for, and the one that was set, in seconds.
    exposure: [f64; 2],
    id: u64,
}

impl V4l {
    /// Opens the camera. Frames carry the times of `clock`, and numbers from `after + 1` on.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when there is no such device, it is in use, or it cannot do what `spec` says.
    pub fn open(spec: &V4lSpec, clock: WallClock, after: u64) -> Result<Self> {
        let (device, layout) = ready(spec)?;
        let mut camera = Self {
            info: spec.info(),
            spec: spec.clone(),
            clock,
            device,
            layout,
            stream: None,
            exposure: [spec.exposures[0]; 2],
            id: after,
        };
        camera.configure(spec.exposures[0])?;
        Ok(camera)
    }

    /// Discards the frames that may be too early, and returns the counts of the next one. `None`: the frame is damaged.
    fn next(&mut self) -> std::io::Result<Option<Vec<u16>>> {
        let stream = match &mut self.stream {
            Some(stream) => stream,
            None => self.stream.insert(Stream::with_buffers(&self.device, Type::VideoCapture, BUFFERS)?),
        };
        // The timeout covers the exposure and the interval of the camera's frame rate.
        stream.set_timeout(Duration::from_secs_f64(self.exposure[1] + self.spec.timeout));
        for _ in 0..BUFFERS + self.spec.skip {
            stream.next()?;
        }
        let (bytes, about) = stream.next()?;
        if about.flags.contains(Flags::ERROR) {
            return Ok(None);
        }
        let bytes = bytes.get(..about.bytesused as usize).unwrap_or(bytes);
        let Layout { size, stride, .. } = self.layout;
        Ok(counts(self.spec.pixel_format, size, stride, bytes))
    }
}

/// Opens the device and sets it up.
fn ready(spec: &V4lSpec) -> Result<(Device, Layout)> {
    let mut device = Device::with_path(&spec.device).map_err(|why| match is_busy(&why) {
        true => in_use(&spec.device),
        false => camera_fault(
            format!("{} cannot be opened: {why}", spec.device),
            "`krylux rig list` names the video devices; the user must be of the group `video`",
        ),
    })?;
    let layout = set_up(&mut device, spec)?;
    Ok((device, layout))
}

impl Camera for V4l {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        self.info.check_exposure(exposure)?;
        let set = set_exposure(&mut self.device, &self.spec, exposure)?;
        self.exposure = [exposure, set];
        Ok(set)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        // Frames that began before this time are discarded.
        let started = self.clock.seconds();
        let counts = match self.next() {
            Ok(Some(counts)) => counts,
            Ok(None) => return Ok(None),
            Err(why) if is_busy(&why) => return Err(in_use(&self.spec.device)),
            // The frame did not arrive in time, or the camera failed: the next capture starts a new stream, and the next restart opens
            // the device again.
            Err(_) => {
                self.stream = None;
                return Ok(None);
            }
        };
        self.id += 1;
        Ok(Some(RawFrame {
            resolution: self.info.resolution,
            channels: self.info.channels,
            counts: self.spec.sensor().pixels(counts),
            exposure: self.exposure[1],
            id: self.id,
            started,
        }))
    }

    fn restart(&mut self) -> Result<()> {
        self.stream = None;
        (self.device, self.layout) = ready(&self.spec)?;
        self.configure(self.exposure[0]).map(|_| ())
    }
}
