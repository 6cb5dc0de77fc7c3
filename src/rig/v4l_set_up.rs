//! The setup of a video device, and the counts of its frames. Format, exposure and gain follow the rig file, and automatic controls are
//! off. A driver may set another value than requested without an error, so each value is read back. A trait gives access to the device, so
//! that a simulated device can replace it in tests.

use std::io;

use super::camera_fault;
use super::cameras::{V4lFormat, V4lSpec};
use super::hardware::{in_use, is_busy};
use crate::error::Result;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameLayout {
    pub(crate) code: [u8; 4],
    pub(crate) size: [usize; 2],
    pub(crate) stride: usize,
}

pub(crate) trait VideoDevice {
    /// The four-character codes of the supported pixel formats.
    fn formats(&self) -> io::Result<Vec<[u8; 4]>>;

    /// Requests a format and a size, and returns the layout that was set.
    fn set_layout(&mut self, code: [u8; 4], size: [usize; 2]) -> io::Result<FrameLayout>;

    /// Reads a control's value. A missing control is an error.
    fn control(&self, id: u32) -> io::Result<i64>;

    fn set_control(&mut self, id: u32, value: i64) -> io::Result<()>;
}

/// The numbers of controls in the kernel's `v4l2-controls.h`.
pub(crate) mod id {
    pub(crate) const AUTO_WHITE_BALANCE: u32 = 0x0098_090C;
    pub(crate) const AUTO_GAIN: u32 = 0x0098_0912;
    pub(crate) const GAIN: u32 = 0x0098_0913;
    pub(crate) const HUE_AUTO: u32 = 0x0098_0919;
    pub(crate) const BACKLIGHT: u32 = 0x0098_091C;
    pub(crate) const AUTO_BRIGHTNESS: u32 = 0x0098_0920;
    pub(crate) const EXPOSURE_AUTO: u32 = 0x009A_0901;
    pub(crate) const EXPOSURE: u32 = 0x009A_0902;
    pub(crate) const FOCUS_AUTO: u32 = 0x009A_090C;
    pub(crate) const WIDE_DYNAMIC_RANGE: u32 = 0x009A_0915;
    pub(crate) const STABILIZATION: u32 = 0x009A_0916;
}

/// The automatic controls, with the value that switches each control off. For `EXPOSURE_AUTO`, 1 means manual.
const AUTOMATIC: [(u32, &str, i64); 9] = [
    (id::EXPOSURE_AUTO, "the automatic exposure", 1),
    (id::AUTO_GAIN, "the automatic gain", 0),
    (id::AUTO_WHITE_BALANCE, "the automatic white balance", 0),
    (id::HUE_AUTO, "the automatic hue", 0),
    (id::AUTO_BRIGHTNESS, "the automatic brightness", 0),
    (id::BACKLIGHT, "the backlight compensation", 0),
    (id::FOCUS_AUTO, "the automatic focus", 0),
    (id::WIDE_DYNAMIC_RANGE, "the wide dynamic range", 0),
    (id::STABILIZATION, "the image stabilization", 0),
];

/// The number of `EXPOSURE` units per second.
const PER_SECOND: f64 = 1e4;

/// The largest relative difference between the requested exposure and the exposure that was set. It is half a unit at an exposure of five
/// units, and also covers the rounding of drivers.
const NEAR: f64 = 0.1;

pub(crate) fn set_up(device: &mut impl VideoDevice, spec: &V4lSpec) -> Result<FrameLayout> {
    let layout = set_layout(device, spec)?;
    for (id, name, off) in AUTOMATIC {
        // An automatic control that the device does not have counts as off.
        if device.control(id).is_ok_and(|value| value != off) {
            put(device, spec, (id, name), off)?;
        }
    }
    if let Some(gain) = spec.gain {
        put(device, spec, (id::GAIN, "gain"), gain)?;
    }
    // The rig file promises all exposures between the shortest and the longest.
    let [shortest, longest] = spec.exposures;
    set_exposure(device, spec, longest)?;
    set_exposure(device, spec, shortest)?;
    Ok(layout)
}

fn set_layout(device: &mut impl VideoDevice, spec: &V4lSpec) -> Result<FrameLayout> {
    let (code, name) = (spec.pixel_format.code(), &spec.device);
    let failed = |why: io::Error| match is_busy(&why) {
        true => in_use(name),
        false => camera_fault(
            format!("{name} cannot be set up: {why}"),
            "end any other program that uses it; the user must be of the group `video`",
        ),
    };
    let formats = device.formats().map_err(failed)?;
    if !formats.contains(&code) {
        return Err(camera_fault(
            format!("{name} has no pixel format {}", letters(code)),
            format!("give another pixel_format in [camera]; it has {}", known(&formats)),
        ));
    }
    let set = device.set_layout(code, spec.size).map_err(failed)?;
    if (set.code, set.size) != (code, spec.size) {
        let [[width, height], [w, h]] = [spec.size, set.size];
        return Err(camera_fault(
            format!(
                "{name} was asked for {width}x{height} in {}, and set {w}x{h} in {}",
                letters(code),
                letters(set.code)
            ),
            "correct size or pixel_format in [camera]; `v4l2-ctl --list-formats-ext` names what there is",
        ));
    }
    Ok(set)
}

/// Sets the exposure in seconds, and returns the exposure that was really set.
pub(crate) fn set_exposure(device: &mut impl VideoDevice, spec: &V4lSpec, exposure: f64) -> Result<f64> {
    let units = (exposure * PER_SECOND).round().max(1.0) as i64;
    let failed = |why: io::Error| {
        camera_fault(
            format!("{} did not set an exposure of {exposure} s: {why}", spec.device),
            "correct exposures in [camera]; `v4l2-ctl --list-ctrls` names the limits of exposure_time_absolute, in 0.1 ms",
        )
    };
    device.set_control(id::EXPOSURE, units).map_err(failed)?;
    let set = device.control(id::EXPOSURE).map_err(failed)? as f64 / PER_SECOND;
    if (set / exposure - 1.0).abs() <= NEAR {
        return Ok(set);
    }
    Err(camera_fault(
        format!("{} was asked for an exposure of {exposure} s, and set {set} s", spec.device),
        "correct exposures in [camera]: multiples of 0.1 ms, within the camera's limits",
    ))
}

fn put(device: &mut impl VideoDevice, spec: &V4lSpec, (id, name): (u32, &str), value: i64) -> Result<()> {
    let help = "`v4l2-ctl --list-ctrls` names the device's controls and their limits";
    device
        .set_control(id, value)
        .map_err(|why| camera_fault(format!("{} did not set {name} to {value}: {why}", spec.device), help))?;
    match device.control(id) {
        Ok(set) if set == value => Ok(()),
        Ok(set) => Err(camera_fault(
            format!("{} was asked to set {name} to {value}, and set {set}", spec.device),
            help,
        )),
        Err(why) => Err(camera_fault(format!("{} does not tell {name}: {why}", spec.device), help)),
    }
}

fn letters(code: [u8; 4]) -> String {
    String::from_utf8_lossy(&code).trim_end().to_owned()
}

fn known(formats: &[[u8; 4]]) -> String {
    formats.iter().map(|&code| letters(code)).collect::<Vec<_>>().join(", ")
}

/// The counts of a frame of `width` by `height` pixels, row by row. A row begins `stride` bytes after the previous row. `None`: there are
/// too few bytes.
///
/// The layouts follow the kernel's documentation (V4L2_PIX_FMT_GREY, _Y10, _Y12, _Y16, _YUYV). Counts of more than 8 bits take 16 bits, low
/// byte first. In YUYV, every second byte is luma, starting with the first.
pub(crate) fn counts(
    format: V4lFormat,
    [width, height]: [usize; 2],
    stride: usize,
    bytes: &[u8],
) -> Option<Vec<u16>> {
    let taken = width * if format == V4lFormat::Grey { 1 } else { 2 };
    let mut counts = Vec::with_capacity(width * height);
    for row in 0..height {
        // The last row may lack its padding.
        let row = bytes.get(row * stride..row * stride + taken)?;
        match format {
            V4lFormat::Grey => counts.extend(row.iter().map(|&byte| u16::from(byte))),
            V4lFormat::Yuyv => counts.extend(row.as_chunks::<2>().0.iter().map(|[luma, _]| u16::from(*luma))),
            V4lFormat::Y10 | V4lFormat::Y12 | V4lFormat::Y16 => {
                // The driver may leave any values in the unused upper bits.
                let mask = ((1_u32 << format.bits()) - 1) as u16;
                counts.extend(row.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair) & mask));
            }
        }
    }
    Some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{CameraKind, V4lFormat};
    use std::collections::BTreeMap;
    use std::io::ErrorKind;

    /// A simulated device that acts like a driver: it clamps values to their limits, and sizes to the largest size.
    struct SimulatedDevice {
        formats: Vec<[u8; 4]>,
        most: [usize; 2],
        /// Value, minimum and maximum for each control number.
        controls: BTreeMap<u32, [i64; 3]>,
        stubborn: Vec<u32>,
        is_busy: bool,
    }

    impl VideoDevice for SimulatedDevice {
        fn formats(&self) -> io::Result<Vec<[u8; 4]>> {
            Ok(self.formats.clone())
        }

        fn set_layout(&mut self, code: [u8; 4], size: [usize; 2]) -> io::Result<FrameLayout> {
            if self.is_busy {
                return Err(ErrorKind::ResourceBusy.into());
            }
            let size = [size[0].min(self.most[0]), size[1].min(self.most[1])];
            Ok(FrameLayout { code, size, stride: 2 * size[0] })
        }

        fn control(&self, id: u32) -> io::Result<i64> {
            self.controls.get(&id).map(|[value, ..]| *value).ok_or(ErrorKind::InvalidInput.into())
        }

        fn set_control(&mut self, id: u32, value: i64) -> io::Result<()> {
            let stubborn = self.stubborn.contains(&id);
            let [now, least, most] =
                self.controls.get_mut(&id).ok_or(io::Error::from(ErrorKind::InvalidInput))?;
            if !stubborn {
                *now = value.clamp(*least, *most);
            }
            Ok(())
        }
    }

    /// A newly plugged-in webcam, with everything automatic.
    fn webcam() -> SimulatedDevice {
        SimulatedDevice {
            formats: vec![*b"MJPG", *b"YUYV", *b"Y16 "],
            most: [1280, 720],
            controls: BTreeMap::from([
                (id::EXPOSURE_AUTO, [3, 0, 3]),
                (id::EXPOSURE, [250, 3, 2047]),
                (id::AUTO_WHITE_BALANCE, [1, 0, 1]),
                (id::BACKLIGHT, [1, 0, 2]),
                (id::GAIN, [64, 0, 255]),
                (id::FOCUS_AUTO, [1, 0, 1]),
            ]),
            stubborn: Vec::new(),
            is_busy: false,
        }
    }

    fn spec() -> V4lSpec {
        V4lSpec {
            kind: CameraKind::V4l,
            device: "/dev/video0".into(),
            size: [640, 480],
            pixel_format: V4lFormat::Y16,
            saturation: None,
            gain: Some(16),
            exposures: [1e-3, 0.1],
            timeout: 1.0,
            skip: 2,
        }
    }

    #[track_caller]
    fn refused(mut device: SimulatedDevice, spec: &V4lSpec) -> String {
        set_up(&mut device, spec).expect_err("it is refused").to_string()
    }

    #[test]
    fn automatics_are_switched_off_and_values_are_set() {
        let mut device = webcam();
        let layout = set_up(&mut device, &spec()).expect("it can do that");
        assert_eq!(layout, FrameLayout { code: *b"Y16 ", size: [640, 480], stride: 1280 });
        let now = |id| device.control(id).expect("it has it");
        assert_eq!(
            [id::EXPOSURE_AUTO, id::AUTO_WHITE_BALANCE, id::BACKLIGHT, id::FOCUS_AUTO, id::GAIN].map(now),
            [1, 0, 0, 0, 16]
        );
        assert_eq!(now(id::EXPOSURE), 10, "the shortest, in tenths of a millisecond");
        let set = set_exposure(&mut device, &spec(), 0.01234).expect("it can do that");
        assert!((set - 0.0123).abs() < 1e-12, "what was set, not what was asked for: {set}");
        assert_eq!(device.control(id::EXPOSURE).expect("it has it"), 123);
    }

    #[test]
    fn errors_name_the_value_that_a_driver_set_instead() {
        let message = refused(webcam(), &V4lSpec { pixel_format: V4lFormat::Grey, ..spec() });
        assert!(
            message.contains("no pixel format GREY") && message.contains("it has MJPG, YUYV, Y16"),
            "{message}"
        );
        let message = refused(webcam(), &V4lSpec { size: [1920, 720], ..spec() });
        assert!(message.contains("asked for 1920x720 in Y16, and set 1280x720 in Y16"), "{message}");
        let message = refused(webcam(), &V4lSpec { gain: Some(300), ..spec() });
        assert!(message.contains("asked to set gain to 300, and set 255"), "{message}");
        let message = refused(webcam(), &V4lSpec { exposures: [1e-3, 1.0], ..spec() });
        assert!(message.contains("asked for an exposure of 1 s, and set 0.2047 s"), "{message}");
        let message = refused(webcam(), &V4lSpec { exposures: [1e-5, 0.1], ..spec() });
        assert!(message.contains("an exposure of 0.00001 s"), "{message}");
        let stubborn = SimulatedDevice { stubborn: vec![id::EXPOSURE_AUTO], ..webcam() };
        let message = refused(stubborn, &spec());
        assert!(message.contains("the automatic exposure to 1, and set 3"), "{message}");
        let message = refused(SimulatedDevice { is_busy: true, ..webcam() }, &spec());
        assert!(message.contains("/dev/video0 is in use by another program"), "{message}");
        let mut blind = webcam();
        blind.controls.remove(&id::EXPOSURE);
        assert!(refused(blind, &spec()).contains("did not set an exposure"));
        let mut plain = webcam();
        plain.controls.remove(&id::GAIN);
        assert!(refused(plain, &spec()).contains("did not set gain to 16"));
    }

    #[test]
    fn bytes_are_decoded_as_the_kernel_documents() {
        use V4lFormat as F;
        for (format, bytes, expected) in [
            (F::Grey, &[1, 255][..], &[1, 255][..]),
            (F::Y10, &[0xFF, 0x03, 0x01, 0xFE], &[1023, 0x201]),
            (F::Y12, &[0xBC, 0x0A, 0x23, 0xF1], &[0xABC, 0x123]),
            (F::Y16, &[0x34, 0x12, 0xFF, 0xFF], &[0x1234, 65535]),
            // Y₀ U Y₁ V.
            (F::Yuyv, &[10, 128, 20, 130], &[10, 20]),
        ] {
            assert_eq!(counts(format, [2, 1], bytes.len(), bytes).as_deref(), Some(expected), "{format:?}");
        }
    }

    #[test]
    fn rows_may_be_padded_and_a_short_frame_is_refused() {
        let bytes = [1, 2, 99, 3, 4];
        assert_eq!(counts(V4lFormat::Grey, [2, 2], 3, &bytes), Some(vec![1, 2, 3, 4]));
        assert_eq!(counts(V4lFormat::Grey, [2, 2], 3, &bytes[..4]), None);
        assert_eq!(counts(V4lFormat::Y16, [2, 2], 4, &bytes), None);
    }
}
