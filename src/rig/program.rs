//! A rig with devices of another program, for example a camera behind its maker's library.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::{CameraInfo, Devices, ProjectorInfo, Stamp, number};
use crate::error::{Error, Result};
use crate::image::Resolution;

/// A description of a program's devices, from a rig file with `kind = "program"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProgramRig {
    /// The projector.
    pub projector: ProgramProjector,
    /// The camera.
    pub camera: ProgramCamera,
}

/// A description of a program's projector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramProjector {
    /// The projector's name, which is part of every photo's key in a journal.
    #[serde(default = "projector_name")]
    pub name: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// 1 (gray) or 3.
    #[serde(default = "number::<1, _>")]
    pub channels: usize,
    /// Bits of a level, 1 to 16.
    #[serde(default = "number::<8, _>")]
    pub bits: u32,
    /// Seconds from one refresh to the next. 0: the projector shows steadily.
    #[serde(default)]
    pub frame_time: f64,
}

/// A description of a program's camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramCamera {
    /// The camera's name, which is part of every photo's key in a journal.
    #[serde(default = "camera_name")]
    pub name: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// 1 (mono) or 3.
    #[serde(default = "number::<1, _>")]
    pub channels: usize,
    /// Bits of a count, 1 to 16.
    #[serde(default = "number::<8, _>")]
    pub bits: u32,
    /// The shortest and the longest exposure in seconds.
    pub exposures: [f64; 2],
}

fn projector_name() -> String {
    "projector".into()
}

fn camera_name() -> String {
    "camera".into()
}

impl ProgramRig {
    /// The projector's properties.
    pub fn projector_info(&self) -> ProjectorInfo {
        let ProgramProjector { name, size: [width, height], channels, bits, frame_time } =
            self.projector.clone();
        ProjectorInfo { name, resolution: Resolution::new(width, height), channels, bits, frame_time }
    }

    /// The camera's properties.
    pub fn camera_info(&self) -> CameraInfo {
        let ProgramCamera { name, size: [width, height], channels, bits, exposures } = self.camera.clone();
        CameraInfo { name, resolution: Resolution::new(width, height), channels, bits, exposures }
    }
}

/// Opens the devices of a program. Copies open the same devices.
#[derive(Clone)]
pub struct DeviceOpener(Arc<Mutex<OpenDevices>>);

type OpenDevices = dyn FnMut(Option<Stamp>) -> Result<Devices> + Send;

impl DeviceOpener {
    /// An opener that calls `open` with the last frame of an earlier session. Time and frame numbers continue after that frame.
    pub fn new(open: impl FnMut(Option<Stamp>) -> Result<Devices> + Send + 'static) -> Self {
        Self(Arc::new(Mutex::new(open)))
    }

    /// Opens the devices.
    pub fn open(&self, after: Option<Stamp>) -> Result<Devices> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (*open)(after)
    }

    pub(crate) fn missing() -> Error {
        Error::rig("rig", "its devices are those of a program, which has not handed them over")
            .help("open the rig by that program, or ask the folder of one of its runs")
    }
}

impl fmt::Debug for DeviceOpener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("DeviceOpener")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_gives_the_properties_of_both_devices() {
        let text = "[projector]\nsize = [8, 6]\n[camera]\nname = \"mine\"\nsize = [16, 12]\nbits = 12\nexposures = [1e-4, 1.0]\n";
        let rig: ProgramRig = toml::from_str(text).unwrap_or_else(|error| unreachable!("{error}"));
        let (projector, camera) = (rig.projector_info(), rig.camera_info());
        assert_eq!(
            (projector.name.as_str(), projector.resolution, projector.bits),
            ("projector", Resolution::new(8, 6), 8)
        );
        assert_eq!(
            (camera.name.as_str(), camera.resolution, camera.bits),
            ("mine", Resolution::new(16, 12), 12)
        );
        assert_eq!((projector.channels, camera.channels, camera.exposures), (1, 1, [1e-4, 1.0]));
    }

    #[test]
    fn errors_of_the_program_come_out_of_its_opener() {
        let opener = DeviceOpener::new(|_| Err(DeviceOpener::missing()));
        let said = opener.clone().open(None).err().map(|error| error.to_string());
        assert!(said.is_some_and(|said| said.contains("not handed them over")));
    }
}
