//! A camera of Linux's video interface V4L2 (feature `v4l`). This driver has not been tried on hardware. The camera runs freely, so the
//! frames that may have begun too early are discarded before each photo.

use std::io;
use std::time::Duration;

use serde_json::json;
use v4l::buffer::{Flags, Type};
use v4l::control::{Control, Value};
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream;
use v4l::video::Capture;
use v4l::{Device, Format, FourCC};

use super::cameras::{CameraKind, V4lFormat, V4lSpec};
use super::hardware::{in_use, is_busy};
use super::v4l_set_up::{FrameLayout, VideoDevice, counts, set_exposure, set_up};
use super::{AttachedCamera, Camera, CameraInfo, RawFrame, WallClock, camera_fault};
use crate::error::Result;

/// The number of frames that the driver buffers. After a pause, the buffers hold frames from before the pause.
const BUFFERS: u32 = 2;

/// An open camera of Linux's video interface.
pub struct V4l {
    info: CameraInfo,
    spec: V4lSpec,
    clock: WallClock,
    device: Device,
    layout: FrameLayout,
    /// The stream of frames. `None`: the stream has not been started, or an error has ended it.
    stream: Option<Stream<'static>>,
    /// The requested exposure, and the exposure that was set, in seconds.
    exposure: [f64; 2],
    id: u64,
}

impl V4l {
    /// Opens the camera. The times of frames are read from `clock`, and their numbers begin at `after + 1`.
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

    /// Discards frames that may have begun too early, and returns the counts of the next frame. `None`: the frame is damaged.
    fn next(&mut self) -> io::Result<Option<Vec<u16>>> {
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
        let FrameLayout { size, stride, .. } = self.layout;
        Ok(counts(self.spec.pixel_format, size, stride, bytes))
    }
}

fn ready(spec: &V4lSpec) -> Result<(Device, FrameLayout)> {
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
        // The frames that began before this time are discarded.
        let started = self.clock.seconds();
        let counts = match self.next() {
            Ok(Some(counts)) => counts,
            Ok(None) => return Ok(None),
            Err(why) if is_busy(&why) => return Err(in_use(&self.spec.device)),
            // The frame is late, or the camera failed. The next capture starts a new stream, and the next restart opens the device again.
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

/// Lists the computer's video devices that capture images.
pub(crate) fn video_devices() -> Vec<AttachedCamera> {
    // Without this folder, there are no video devices.
    let entries = std::fs::read_dir("/sys/class/video4linux").into_iter().flatten().flatten();
    let mut found: Vec<(String, String, Vec<&str>)> = entries
        .filter_map(|entry| {
            let device = format!("/dev/{}", entry.file_name().to_string_lossy());
            let name = std::fs::read_to_string(entry.path().join("name")).unwrap_or_default();
            let codes = Device::with_path(&device).ok()?.formats().ok()?;
            // A device without a format does not capture images.
            let known = V4lFormat::ALL.iter().filter(|format| codes.contains(&format.code()));
            (!codes.is_empty())
                .then(|| (device, name.trim().into(), known.map(|format| format.key()).collect()))
        })
        .collect();
    found.sort();
    let camera = |(device, name, formats): (String, String, Vec<&str>)| {
        let known = match formats.as_slice() {
            [] => "no format that krylux reads".into(),
            _ => format!("pixel_format {}", formats.join(", ")),
        };
        let line = format!("{device}: {name}, {known}");
        let facts = json!({ "device": device, "name": name, "formats": formats });
        AttachedCamera::new(CameraKind::V4l, Some(device), line, facts)
    };
    found.into_iter().map(camera).collect()
}

impl VideoDevice for Device {
    fn formats(&self) -> io::Result<Vec<[u8; 4]>> {
        Ok(self.enum_formats()?.into_iter().map(|format| format.fourcc.repr).collect())
    }

    fn set_layout(&mut self, code: [u8; 4], [width, height]: [usize; 2]) -> io::Result<FrameLayout> {
        let set = self.set_format(&Format::new(width as u32, height as u32, FourCC::new(&code)))?;
        let size = [set.width as usize, set.height as usize];
        Ok(FrameLayout { code: set.fourcc.repr, size, stride: set.stride as usize })
    }

    fn control(&self, id: u32) -> io::Result<i64> {
        match Device::control(self, id)?.value {
            Value::Integer(value) => Ok(value),
            Value::Boolean(value) => Ok(value.into()),
            _ => Err(io::Error::other("the control is no number")),
        }
    }

    fn set_control(&mut self, id: u32, value: i64) -> io::Result<()> {
        Device::set_control(self, Control { id, value: Value::Integer(value) })
    }
}
