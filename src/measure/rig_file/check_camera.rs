//! The validation of a real camera's table in a rig file.

use super::check::{Check, Checked};
use crate::rig::genicam::Settings;
use crate::rig::pixels::Sensor;
use crate::rig::{CameraSpec, Gphoto2Spec, ProgramRig, V4lSpec};

impl Check {
    /// Checks the description of the devices of a program.
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
        match spec {
            CameraSpec::Gige(spec) => {
                // From the least that every network carries to the largest datagram.
                self.range("camera.packet_size", spec.packet_size.unwrap_or(1500).into(), 576.0, 65535.0)?;
                self.vision(&spec.settings())
            }
            CameraSpec::Usb3(spec) => self.vision(&spec.settings()),
            CameraSpec::V4l(spec) => self.v4l(spec),
            CameraSpec::Gphoto2(spec) => self.gphoto2(spec),
        }
    }

    fn sensor(&self, sensor: &Sensor) -> Checked {
        self.range("camera.bits", sensor.bits.into(), 8.0, 16.0)?;
        sensor.size.iter().try_for_each(|&side| self.range("camera.size", side as f64, 1.0, 65535.0))?;
        sensor.offset.iter().try_for_each(|&side| self.range("camera.offset", side as f64, 0.0, 65535.0))?;
        sensor.fault().map_or(Ok(()), |[fault, help]| Err(self.fault(fault, help)))
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

    fn vision(&self, settings: &Settings) -> Checked {
        self.sensor(&settings.sensor)?;
        self.times(settings.exposures, settings.timeout)?;
        self.range("camera.gain", settings.gain.unwrap_or(0.0), -1e6, 1e6)
    }

    fn v4l(&self, spec: &V4lSpec) -> Checked {
        self.sensor(&spec.sensor())?;
        self.times(spec.exposures, spec.timeout)?;
        self.range("camera.skip", spec.skip.into(), 0.0, 100.0)
    }

    fn gphoto2(&self, spec: &Gphoto2Spec) -> Checked {
        self.sensor(&spec.sensor())?;
        self.times(spec.exposures, spec.timeout)?;
        self.range("camera.stops", spec.stops.unwrap_or(1).into(), 1.0, 12.0)?;
        if spec.decoder.first().is_none_or(String::is_empty) {
            return Err(self.fault(
                "camera.decoder is empty",
                "name the program that decodes RAW, with its arguments, or leave it out",
            ));
        }
        Ok(())
    }
}
