//! The validation of a rig file's values. Each error names the file, the key, the valid range and the remedy.

use std::path::PathBuf;

use super::VirtualTables;
use crate::error::Error;
use crate::measure::MeasureOptions;
use crate::rig::{CameraKind, CameraSpec, GenicamSpec, ProgramRig, VirtualCamera, VirtualProjector, X11Spec};

pub(crate) struct FileCheck {
    pub(crate) path: PathBuf,
}

pub(crate) type Checked = Result<(), Error>;

impl FileCheck {
    /// An error of the file.
    pub(crate) fn fault(&self, fault: impl Into<String>, help: impl Into<String>) -> Error {
        Error::data(&self.path, fault).help(help)
    }

    /// The error of the file if `is_wrong`.
    fn refuse(&self, is_wrong: bool, fault: impl Into<String>, help: impl Into<String>) -> Checked {
        if is_wrong { Err(self.fault(fault, help)) } else { Ok(()) }
    }

    /// Checks that `value` lies from `low` to `high`. NaN fails.
    pub(crate) fn range(&self, key: &str, value: f64, low: f64, high: f64) -> Checked {
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(self.fault(format!("{key} is {value}"), format!("give {low} to {high}")))
    }

    fn ranges(&self, table: &str, values: &[(&str, f64, f64, f64)]) -> Checked {
        values
            .iter()
            .try_for_each(|&(key, value, low, high)| self.range(&format!("{table}.{key}"), value, low, high))
    }

    /// Checks a response: a gamma, or a curve from 0 to 1 that never falls.
    fn response(&self, table: &str, gamma: Option<f64>, curve: Option<&[f64]>) -> Checked {
        self.range(&format!("{table}.gamma"), gamma.unwrap_or(1.0), 0.1, 10.0)?;
        let Some(curve) = curve else { return Ok(()) };
        self.refuse(
            gamma.is_some(),
            format!("{table} has both gamma and curve"),
            "give one response: a gamma, or a curve",
        )?;
        let ends = (curve.first(), curve.last());
        self.refuse(
            ends != (Some(&0.0), Some(&1.0)) || !curve.is_sorted(),
            format!("{table}.curve is not a response"),
            "give at least two values, the first 0, the last 1, none less than the one before",
        )
    }

    fn channels(&self, table: &str, channels: usize) -> Checked {
        let fault = format!("{table}.channels is {channels}");
        self.refuse(channels != 1 && channels != 3, fault, "give 1 (gray) or 3 (red, green, blue)")
    }

    /// Checks the devices and the surroundings of a virtual rig.
    pub(super) fn virtual_rig(&self, rig: &VirtualTables) -> Checked {
        self.projector(&rig.projector)?;
        self.camera(&rig.camera, rig.projector.channels)?;
        self.surroundings(rig)
    }

    fn projector(&self, spec: &VirtualProjector) -> Checked {
        self.channels("projector", spec.channels)?;
        self.response("projector", spec.gamma, spec.curve.as_deref())?;
        self.ranges(
            "projector",
            &[
                ("bits", spec.bits.into(), 1.0, 12.0),
                ("black_level", spec.black_level, 0.0, 0.9),
                ("vignetting", spec.vignetting, 0.0, 1.0),
                ("blur", spec.blur, 0.0, 100.0),
                ("latency", spec.latency, 0.0, 60.0),
                ("frame_time", spec.frame_time, 0.0, 60.0),
                ("white_segment", spec.white_segment, 0.0, 10.0),
                ("overscan", spec.overscan, 0.0, 0.5),
                ("iris.dimming", spec.iris.dimming, -1.0, 0.95),
                ("iris.time", spec.iris.time, 0.0, 3600.0),
                ("pulse.period", spec.pulse.period, 0.0, 60.0),
                ("pulse.duty", spec.pulse.duty, 1e-3, 1.0),
            ],
        )?;
        self.refuse(
            spec.white_segment > 0.0 && spec.channels != 3,
            "projector.white_segment adds to what three colours have in common, but the projector has one channel",
            "give the projector channels = 3, or leave white_segment out",
        )?;
        self.refuse(
            spec.pulse.wheel && spec.channels != 3,
            "projector.pulse.wheel shows three colours, but the projector has one channel",
            "give the projector channels = 3, or leave wheel out",
        )?;
        self.refuse(
            spec.pulse.period == 0.0 && (spec.pulse.wheel || spec.pulse.duty < 1.0),
            "projector.pulse has no period",
            "give period in seconds, e.g. pulse = { period = 0.0083, duty = 0.5 }",
        )
    }

    fn camera(&self, spec: &VirtualCamera, projector_channels: usize) -> Checked {
        self.channels("camera", spec.channels)?;
        self.response("camera", spec.gamma, spec.curve.as_deref())?;
        self.range("camera.bits", spec.bits.into(), 8.0, 16.0)?;
        let highest = f64::from((1_u32 << spec.bits) - 1);
        for side in spec.size.unwrap_or([1, 1]) {
            self.range("camera.size", side as f64, 1.0, 16384.0)?;
        }
        let [shortest, longest] = spec.exposures;
        self.ranges(
            "camera",
            &[
                ("black_level", spec.black_level, 0.0, highest / 2.0),
                ("saturation", spec.highest().into(), (spec.black_level + 1.0).ceil(), highest),
                ("full_well", spec.full_well, 1.0, 1e9),
                ("white_fill", spec.white_fill, 1e-6, 1e6),
                ("white_exposure", spec.white_exposure, 1e-9, 1e6),
                ("read_noise", spec.read_noise, 0.0, spec.full_well),
                ("dark_current", spec.dark_current, 0.0, 1e9),
                ("vignetting", spec.vignetting, 0.0, 1.0),
                ("blur", spec.blur, 0.0, 100.0),
                ("rolling_shutter", spec.rolling_shutter, 0.0, 60.0),
                ("exposures[0]", shortest, 1e-9, 1e6),
                ("exposures[1]", longest, shortest, 1e6),
                ("exposure_step", spec.exposure_step, 0.0, longest),
                ("readout", spec.readout, 0.0, 60.0),
                ("timeout", spec.timeout, 0.0, 3600.0),
                ("shift[0]", spec.shift[0], -1e5, 1e5),
                ("shift[1]", spec.shift[1], -1e5, 1e5),
                ("rotation", spec.rotation, -360.0, 360.0),
                ("scale", spec.scale, 0.01, 100.0),
                ("distortion", spec.distortion, -0.3, 10.0),
            ],
        )?;
        if let Some(homography) = spec.homography {
            self.refuse(
                spec.shift != [0.0; 2] || spec.rotation != 0.0 || spec.scale != 1.0,
                "camera has a homography, and shift, rotation or scale as well",
                "give the homography alone, or leave it out",
            )?;
            let [a, b, c] = homography.map(glam::DVec3::from_array);
            self.refuse(
                !a.dot(b.cross(c)).is_normal(),
                "camera.homography cannot be inverted",
                "give the three rows of an invertible matrix, e.g. [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
            )?;
        }
        let Some(matrix) = spec.crosstalk else { return Ok(()) };
        self.refuse(
            (projector_channels, spec.channels) != (3, 3),
            "camera.crosstalk mixes three colours, but projector or camera has one channel",
            "give both channels = 3, or leave it out",
        )?;
        for (at, &entry) in matrix.as_flattened().iter().enumerate() {
            let (row, column) = (at / 3, at % 3);
            // Each camera channel must respond to the projector channel of the same colour.
            let least = if row == column { 1e-6 } else { 0.0 };
            self.range(&format!("camera.crosstalk[{row}][{column}]"), entry, least, 1e3)?;
        }
        Ok(())
    }

    /// Checks the splitter, the ambient light, the drift and the faults.
    fn surroundings(
        &self,
        VirtualTables { splitter, ambient, drift, faults, .. }: &VirtualTables,
    ) -> Checked {
        let chances = [
            ("faults.dropped", faults.dropped, 0.0, 1.0),
            ("faults.repeated", faults.repeated, 0.0, 1.0),
            ("faults.late", faults.late, 0.0, 1.0),
            ("faults.early", faults.early, 0.0, 1.0),
        ];
        let others = [
            ("splitter.ghost", splitter.ghost, 0.0, 1.0),
            ("splitter.ghost_shift[0]", splitter.ghost_shift[0], -1e5, 1e5),
            ("splitter.ghost_shift[1]", splitter.ghost_shift[1], -1e5, 1e5),
            ("splitter.stray", splitter.stray, 0.0, 10.0),
            ("ambient.level", ambient.level, 0.0, 1e6),
            ("ambient.variation", ambient.variation, 0.0, 1.0),
            ("ambient.period", ambient.period, 0.0, 1e9),
            ("drift.per_hour", drift.per_hour, -1e3, 1e3),
            ("drift.swing", drift.swing, 0.0, 1.0),
            ("drift.period", drift.period, 0.0, 1e9),
        ];
        for (key, value, low, high) in others.into_iter().chain(chances) {
            self.range(key, value, low, high)?;
        }
        self.refuse(
            splitter.ghost > 0.0 && splitter.ghost_shift == [0.0; 2],
            format!("splitter.ghost is {}, but splitter.ghost_shift is missing", splitter.ghost),
            "give the displacement of the second image in projector pixels, e.g. ghost_shift = [5.0, 0.0]",
        )?;
        for (table, key, swing, period) in [
            ("ambient", "variation", ambient.variation, ambient.period),
            ("drift", "swing", drift.swing, drift.period),
        ] {
            let fault = format!("{table}.{key} is {swing}, but {table}.period is missing");
            self.refuse(swing > 0.0 && period == 0.0, fault, "give its period in seconds")?;
        }
        let sum: f64 = chances.iter().map(|chance| chance.1).sum();
        self.refuse(
            sum > 1.0,
            format!("the chances of [faults] add up to {sum}"),
            "give dropped, repeated, late and early such that they add up to 1 at most",
        )
    }

    pub(crate) fn x11(&self, spec: &X11Spec) -> Checked {
        self.channels("projector", spec.channels)?;
        for side in spec.size.into_iter().chain(spec.monitor_size.into_iter().flatten()) {
            self.range("projector.size", side as f64, 1.0, 16384.0)?;
        }
        self.ranges(
            "projector",
            &[
                ("magnify", spec.magnify as f64, 1.0, 1024.0),
                ("frame_time", spec.frame_time, 1e-3, 1.0),
                ("settle_frames", spec.settle_frames as f64, 0.0, 1e3),
            ],
        )
    }

    pub(crate) fn measurement(&self, options: &MeasureOptions) -> Checked {
        let fault = options.fault();
        fault.map_or(Ok(()), |[key, found, expected]| {
            Err(self.fault(format!("measurement.{key} is {found}"), format!("give {expected}")))
        })
    }

    pub(crate) fn program(&self, rig: &ProgramRig) -> Checked {
        let (projector, camera) = (&rig.projector, &rig.camera);
        for (table, size, channels, bits) in [
            ("projector", projector.size, projector.channels, projector.bits),
            ("camera", camera.size, camera.channels, camera.bits),
        ] {
            size.iter()
                .try_for_each(|&side| self.range(&format!("{table}.size"), side as f64, 1.0, 65535.0))?;
            self.channels(table, channels)?;
            self.range(&format!("{table}.bits"), bits.into(), 1.0, 16.0)?;
        }
        self.range("projector.frame_time", projector.frame_time, 0.0, 10.0)?;
        self.times(camera.exposures, 0.0)
    }

    pub(crate) fn hardware_camera(&self, spec: &CameraSpec) -> Checked {
        let (sensor, exposures, timeout) = match spec {
            CameraSpec::Genicam(spec) => (spec.sensor(), spec.exposures, spec.timeout),
            CameraSpec::V4l(spec) => (spec.sensor(), spec.exposures, spec.timeout),
            CameraSpec::Gphoto2(spec) => (spec.sensor(), spec.exposures, spec.timeout),
        };
        self.range("camera.bits", sensor.bits.into(), 8.0, 16.0)?;
        sensor.size.iter().try_for_each(|&side| self.range("camera.size", side as f64, 1.0, 65535.0))?;
        sensor.offset.iter().try_for_each(|&side| self.range("camera.offset", side as f64, 0.0, 65535.0))?;
        sensor.fault().map_or(Ok(()), |[fault, help]| Err(self.fault(fault, help)))?;
        self.times(exposures, timeout)?;
        match spec {
            CameraSpec::Genicam(spec) => self.genicam(spec),
            CameraSpec::V4l(spec) => self.range("camera.skip", spec.skip.into(), 0.0, 100.0),
            CameraSpec::Gphoto2(spec) => {
                self.range("camera.stops", spec.stops.unwrap_or(1).into(), 1.0, 12.0)?;
                self.refuse(
                    spec.decoder.first().is_none_or(String::is_empty),
                    "camera.decoder is empty",
                    "name the program that decodes RAW, with its arguments, or leave it out",
                )
            }
        }
    }

    fn genicam(&self, spec: &GenicamSpec) -> Checked {
        let is_gige = spec.kind == CameraKind::Gige;
        self.refuse(
            is_gige && spec.address.is_none(),
            "missing field `address`",
            "give the camera's address, e.g. address = \"192.168.1.20\"; `krylux rig list` names it",
        )?;
        let of_others = [
            ("serial", is_gige && spec.serial.is_some()),
            ("address", !is_gige && spec.address.is_some()),
            ("packet_size", !is_gige && spec.packet_size.is_some()),
        ];
        for (key, is_given) in of_others {
            let fault = format!("unknown key `{key}` for a camera of kind \"{}\"", spec.kind.key());
            self.refuse(is_given, fault, format!("leave out {key}"))?;
        }
        self.range("camera.gain", spec.gain.unwrap_or(0.0), -1e6, 1e6)?;
        // The range goes from the least size that every network carries to the largest datagram.
        self.range("camera.packet_size", spec.packet_size.unwrap_or(1500).into(), 576.0, 65535.0)
    }

    fn times(&self, [shortest, longest]: [f64; 2], timeout: f64) -> Checked {
        self.ranges(
            "camera",
            &[
                ("exposures[0]", shortest, 1e-9, 1e6),
                ("exposures[1]", longest, shortest, 1e6),
                ("timeout", timeout, 0.0, 3600.0),
            ],
        )
    }
}
