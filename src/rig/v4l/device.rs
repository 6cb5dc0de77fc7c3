//! Access to Linux's video interface through the crate `v4l`.

use std::io::Error as Refusal;

use v4l::control::{Control, Value};
use v4l::video::Capture;
use v4l::{Device, Format, FourCC};

use super::V4lFormat;
use super::set_up::{Layout, VideoDevice};

/// A video device that may be a camera.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FoundVideoDevice {
    /// The device file; `device` in a rig file.
    pub device: String,
    /// The driver's name of the device.
    pub name: String,
    /// The formats that krylux supports; `pixel_format` in a rig file.
    pub formats: Vec<&'static str>,
}

/// Lists the computer's video devices that capture images.
pub fn video_devices() -> Vec<FoundVideoDevice> {
    // Without the folder there are no video devices.
    let entries = std::fs::read_dir("/sys/class/video4linux").into_iter().flatten().flatten();
    let mut found: Vec<FoundVideoDevice> = entries
        .filter_map(|entry| {
            let device = format!("/dev/{}", entry.file_name().to_string_lossy());
            let name = std::fs::read_to_string(entry.path().join("name")).unwrap_or_default();
            let codes = Device::with_path(&device).ok()?.formats().ok()?;
            // A device without any format captures no images.
            let known = V4lFormat::ALL.iter().filter(|format| codes.contains(&format.code()));
            let formats = known.map(|format| format.key()).collect();
            (!codes.is_empty()).then(|| FoundVideoDevice { device, name: name.trim().into(), formats })
        })
        .collect();
    found.sort_by(|a, b| a.device.cmp(&b.device));
    found
}

impl VideoDevice for Device {
    fn formats(&self) -> Result<Vec<[u8; 4]>, Refusal> {
        Ok(self.enum_formats()?.into_iter().map(|format| format.fourcc.repr).collect())
    }

    fn set_layout(&mut self, code: [u8; 4], [width, height]: [usize; 2]) -> Result<Layout, Refusal> {
        let set = self.set_format(&Format::new(width as u32, height as u32, FourCC::new(&code)))?;
        let size = [set.width as usize, set.height as usize];
        Ok(Layout { code: set.fourcc.repr, size, stride: set.stride as usize })
    }

    fn control(&self, id: u32) -> Result<i64, Refusal> {
        match Device::control(self, id)?.value {
            Value::Integer(value) => Ok(value),
            Value::Boolean(value) => Ok(value.into()),
            _ => Err(Refusal::other("the control is no number")),
        }
    }

    fn set_control(&mut self, id: u32, value: i64) -> Result<(), Refusal> {
        Device::set_control(self, Control { id, value: Value::Integer(value) })
    }
}
