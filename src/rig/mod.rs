//! A rig is a projector and a camera. Both exchange integers with this module: levels and counts.
//!
//! A [`Frame`] holds the levels for a projector, and a [`RawFrame`] holds the counts of a camera. Levels and counts are neither linear in
//! light nor calibrated: [`crate::measure`] converts them to light. Hardware and virtual devices implement the same three traits,
//! [`Projector`], [`Camera`] and [`Clock`]. An open rig is a [`Devices`], which may move between threads. The documentation of [`Devices`]
//! has a complete example of a rig with your own devices.
//!
//! | kind of rig | projector | camera |
//! |---|---|---|
//! | [`VirtualRig`] | [`VirtualProjector`] | [`VirtualCamera`] |
//! | [`HardwareRig`] | [`X11Projector`], a monitor of an X server | one of the kinds of [`CameraSpec`] |
//! | [`ProgramRig`], the devices of a program | any [`Projector`] | any [`Camera`] |
//!
//! | kind of camera | requirement |
//! |---|---|
//! | `GigeVision`, on the network | the feature `gige` (default) |
//! | `Usb3Vision`, on USB 3 | the feature `usb3` (default) |
//! | `V4l`, behind Linux's video interface | the feature `v4l` |
//! | [`Gphoto2`], a still camera | the programs `gphoto2` and `dcraw` (or another RAW decoder) |

mod attached;
mod cameras;
mod devices;
mod frame;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod genicam;
#[cfg(feature = "gige")]
mod gige;
mod gphoto2;
mod hardware;
mod pixel_format;
pub(crate) mod sensor;
#[cfg(feature = "usb3")]
mod usb3;
#[cfg(feature = "v4l")]
mod v4l;
#[cfg(any(feature = "v4l", test))]
mod v4l_set_up;
mod virtual_bench;
mod x11;

pub use attached::{Abilities, AttachedCamera, AttachedDevices};
pub use cameras::{CameraKind, CameraSpec, GenicamSpec, V4lFormat, V4lSpec};
pub use devices::{Camera, Clock, Devices, Losses, Projector, Shown, Stamp, Waited, WallClock};
pub use frame::{CameraInfo, Frame, ProjectorInfo, RawFrame};
#[cfg(feature = "gige")]
pub use gige::{GigeVision, gige_camera_abilities};
pub use gphoto2::{Gphoto2, Gphoto2Spec};
pub use hardware::{DeviceOpener, HardwareRig, ProgramCamera, ProgramProjector, ProgramRig};
pub use pixel_format::PixelFormat;
pub use sensor::{Colour, Tiles};
#[cfg(feature = "usb3")]
pub use usb3::{Usb3Vision, usb_camera_abilities};
#[cfg(feature = "v4l")]
pub use v4l::V4l;
pub use virtual_bench::MatteSheet;
pub use virtual_bench::spec::{
    Ambient, Drift, Faults, Response, Splitter, VirtualCamera, VirtualProjector, VirtualRig, VirtualScene,
};
pub use virtual_bench::world::{Iris, Pulse};
pub use x11::helper::{Helper, serve_projector};
#[cfg(feature = "x11")]
pub use x11::monitor::monitors;
#[cfg(not(feature = "x11"))]
pub use x11::monitors;
pub use x11::projector::{ShowTimes, X11Projector};
pub use x11::{MonitorInfo, ProjectorKind, X11Monitor, X11Spec};

/// The error `fault` of the device "camera", with the remedy `help`.
fn camera_fault(fault: impl Into<String>, help: impl Into<String>) -> crate::Error {
    crate::Error::rig("camera", fault).help(help)
}

/// Returns `N`, as the default value of a number in a rig file.
fn number<const N: u8, T: From<u8>>() -> T {
    N.into()
}

/// The hint `; did you mean NAME?`, where NAME is the known name with the fewest edits from `name`, between two `quote`s. The hint is empty
/// if all known names differ so much from `name` that they are probably other words.
pub(crate) fn did_you_mean(name: &str, known: &[impl AsRef<str>], quote: &str) -> String {
    nearest(name, known).map_or_else(String::new, |name| format!("; did you mean {quote}{name}{quote}?"))
}

fn nearest<'a>(name: &str, known: &'a [impl AsRef<str>]) -> Option<&'a str> {
    // A swap of two neighbouring letters counts as one edit.
    let edits = |known: &'a str| (strsim::osa_distance(name, known), known);
    let (edits, known) = known.iter().map(|known| edits(known.as_ref())).min_by_key(|(edits, _)| *edits)?;
    (2 * edits <= name.chars().count().max(known.chars().count()) + 1).then_some(known)
}

#[cfg(test)]
mod tests {
    use super::*;
    use strsim::osa_distance as distance;

    #[test]
    fn a_mistyped_name_is_recognized_but_another_word_is_not() {
        let known = ["gamma", "curve", "black_level", "bits"];
        for (name, expected) in [
            ("gama", Some("gamma")),
            ("gmama", Some("gamma")),
            ("blacklevel", Some("black_level")),
            ("bit", Some("bits")),
            ("temperature", None),
            ("", None),
        ] {
            assert_eq!(nearest(name, &known), expected, "{name}");
        }
        assert_eq!(nearest("anything", &[] as &[&str]), None);
    }

    #[test]
    fn edits_are_counted() {
        let cases = [("saturday", "sunday", 3), ("", "abc", 3), ("ab", "ba", 1), ("same", "same", 0)];
        assert!(cases.iter().all(|(a, b, edits)| distance(a, b) == *edits && distance(b, a) == *edits));
    }
}
