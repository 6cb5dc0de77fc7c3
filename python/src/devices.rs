//! Cameras and projectors written in Python, behind the traits of krylux's rigs.

use krylux::Error;
use krylux::rig::{
    Camera, CameraInfo, DeviceOpener, Devices, Frame, ProgramRig, Projector, ProjectorInfo, RawFrame, Shown,
    Stamp, WallClock,
};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::work;

/// Devices of Python, with what the rig file says of them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ProgramDevices {
    projector: Py<PyAny>,
    camera: Py<PyAny>,
    /// Both descriptions as JSON.
    description: String,
}

/// A device of Python that failed; its exception comes out in place of this.
fn failed(device: &str, error: PyErr) -> Error {
    let fault = error.to_string();
    work::keep(error);
    let help = "see the exception that its Python code raised";
    Error::rig(device, fault).help(help)
}

/// The interpreter ends.
fn gone(device: &str) -> Error {
    let (fault, help) = ("the interpreter ends", "take photos before the program ends");
    Error::rig(device, fault).help(help)
}

impl ProgramDevices {
    /// Opens the devices whenever krylux asks for them. They are the same objects each time.
    pub(crate) fn opener(self) -> DeviceOpener {
        DeviceOpener::new(move |after: Option<Stamp>| {
            let described: ProgramRig = serde_json::from_str(&self.description)
                .map_err(|error| Error::Numerical(format!("the description of the devices: {error}")))?;
            let clock = WallClock::starting_at(after.map_or(0.0, |stamp| stamp.time));
            let opened = Python::try_attach(|py| {
                let projector = PythonProjector {
                    device: self.projector.clone_ref(py),
                    info: described.projector_info(),
                    clock,
                };
                let camera = PythonCamera {
                    device: self.camera.clone_ref(py),
                    info: described.camera_info(),
                    clock,
                    exposure: 0.0,
                    id: after.map_or(0, |stamp| stamp.id),
                };
                Devices::new(projector, camera, clock)
            });
            opened.ok_or_else(|| gone("rig"))
        })
    }
}

/// `show(levels)`.
struct PythonProjector {
    device: Py<PyAny>,
    info: ProjectorInfo,
    clock: WallClock,
}

impl Projector for PythonProjector {
    fn info(&self) -> &ProjectorInfo {
        &self.info
    }

    fn show(&mut self, frame: &Frame) -> krylux::Result<Shown> {
        self.info.check(frame)?;
        let size = frame.resolution();
        let shown = Python::try_attach(|py| -> PyResult<()> {
            let shape = (size.height, size.width, frame.channels());
            let levels = Array3::from_shape_vec(shape, frame.levels().to_vec())
                .map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?;
            let levels = match frame.channels() {
                1 => levels.remove_axis(numpy::ndarray::Axis(2)).into_pyarray(py).into_any(),
                _ => levels.into_pyarray(py).into_any(),
            };
            py.check_signals()?;
            self.device.call_method1(py, "show", (levels,)).map(|_| ())
        });
        shown.ok_or_else(|| gone("projector"))?.map_err(|error| failed("projector", error))?;
        Ok(Shown { at: self.clock.seconds() })
    }
}

/// `configure(exposure)` and `capture()`, as the Python side wraps them.
struct PythonCamera {
    device: Py<PyAny>,
    info: CameraInfo,
    clock: WallClock,
    exposure: f64,
    id: u64,
}

impl Camera for PythonCamera {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> krylux::Result<f64> {
        self.info.check_exposure(exposure)?;
        let set = Python::try_attach(|py| -> PyResult<f64> {
            let set: Option<f64> = self.device.call_method1(py, "configure", (exposure,))?.extract(py)?;
            Ok(set.unwrap_or(exposure))
        });
        self.exposure = set.ok_or_else(|| gone("camera"))?.map_err(|error| failed("camera", error))?;
        Ok(self.exposure)
    }

    fn capture(&mut self) -> krylux::Result<Option<RawFrame>> {
        let (called, info) = (self.clock.seconds(), &self.info);
        let taken = Python::try_attach(|py| -> PyResult<Option<(Vec<u16>, f64)>> {
            py.check_signals()?;
            let answer = self.device.call_method0(py, "capture")?;
            // The counts, and how many seconds ago their exposure began, where the camera says so.
            let counts: Option<(PyReadonlyArray1<'_, u16>, Option<f64>)> = answer.extract(py)?;
            let Some((counts, age)) = counts else { return Ok(None) };
            // Any other frame was triggered by this call.
            let started = age.map_or(called, |age| self.clock.seconds() - age);
            Ok(Some((counts.as_slice()?.to_vec(), started)))
        });
        let taken = taken.ok_or_else(|| gone("camera"))?.map_err(|error| failed("camera", error))?;
        let Some((counts, started)) = taken else { return Ok(None) };
        self.id += 1;
        Ok(Some(RawFrame {
            resolution: info.resolution,
            channels: info.channels,
            counts,
            exposure: self.exposure,
            id: self.id,
            started,
        }))
    }

    fn restart(&mut self) -> krylux::Result<()> {
        let done = Python::try_attach(|py| -> PyResult<()> {
            match self.device.getattr(py, "restart") {
                Ok(restart) => restart.call0(py).map(|_| ()),
                Err(_) => Ok(()),
            }
        });
        done.ok_or_else(|| gone("camera"))?.map_err(|error| failed("camera", error))
    }
}
