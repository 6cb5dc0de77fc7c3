//! The live preview of a rig, frame by frame, and the devices that a rig may have.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use krylux::bench::preview::{CountRange, Preview as Running, level_frame};
use krylux::image::{Image, Resolution};
use krylux::measure::{FrameSource, RigFile, RigKind};
use krylux::report::preview::overlay;
use krylux::rig::{AttachedDevices, RawFrame};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Fields};
use crate::bench::rig;
use crate::settings::Request;
use crate::{errors, work};

/// A preview that runs until it is closed.
#[pyclass(frozen, module = "krylux._krylux", name = "Preview")]
pub(crate) struct Preview {
    open: Mutex<Option<Open>>,
    process: u32,
}

struct Open {
    frames: Box<dyn FrameSource>,
    running: Running,
}

impl Drop for Preview {
    fn drop(&mut self) {
        if self.process != std::process::id() {
            // The devices are the parent's: they are neither used nor closed here.
            std::mem::forget(self.open.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        }
    }
}

#[pymethods]
impl Preview {
    /// Opens the devices. A calibration that cannot be used is left aside.
    #[new]
    fn new(
        py: Python<'_>,
        request: Request,
        pattern: Option<PyReadonlyArrayDyn<'_, f32>>,
        exposure: Option<f64>,
    ) -> PyResult<Self> {
        let source = rig(py, request)?;
        let size = source.resolution();
        let image = match &pattern {
            Some(pattern) => arrays::image(pattern)?,
            None => Image::filled(size, 1, 1.0),
        };
        if image.resolution() != size {
            let Resolution { width, height } = size;
            let fault = format!("its pixels are {}, but the projector has {size}", image.resolution());
            let help = format!("give an array of shape ({height}, {width}) or ({height}, {width}, 3)");
            return Err(errors::option(py, "pattern", &fault, &help));
        }
        let open = work::detached(py, || {
            let known = source.file.load_calibration().transpose().ok().flatten();
            let mut frames = source.opener()(None)?;
            frames.set_settle(source.file.settle(known.as_ref()));
            let frame = Arc::new(level_frame(&image, frames.projector())?);
            let exposure = match exposure.or(source.file.longest_exposure()) {
                Some(exposure) => exposure,
                None => Running::white_exposure(frames.as_mut())?.0,
            };
            let range = CountRange::measure(known.as_ref().map(|known| &known.camera), frames.as_mut())?;
            let running = Running::new(frames.as_ref(), frame, exposure, range);
            Ok(Open { frames, running })
        })?;
        Ok(Self { open: Mutex::new(Some(open)), process: std::process::id() })
    }

    /// The next frame with its figures.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        if self.process != std::process::id() {
            return Err(errors::forked(py));
        }
        let taken = work::detached(py, || {
            let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(Open { frames, running }) = open.as_mut() else { return Ok(None) };
            let figures = running.capture(frames.as_mut())?;
            // There is a last frame once one was captured.
            Ok(running.last().cloned().map(|raw| (figures, raw, *running.range())))
        })?;
        let Some((figures, raw, range)) = taken else { return Err(errors::closed(py)) };
        let fields = Fields::new(py);
        let RawFrame { resolution, channels, .. } = raw;
        let picture = overlay(&raw, range.black, range.full, range.limit);
        fields.raster_of("counts", raw.counts.clone(), resolution, channels)?;
        fields.raster_of("picture", picture.bytes().to_vec(), resolution, 3)?;
        fields.put("status", figures.line(&range))?;
        fields.put("range", (range.black, range.limit, range.full))?.record("figures", &figures)?;
        Ok(fields.0)
    }

    /// Closes the devices.
    fn close(&self, py: Python<'_>) {
        if self.process == std::process::id() {
            py.detach(|| drop(self.open.lock().unwrap_or_else(PoisonError::into_inner).take()));
        }
    }
}

/// The monitors and cameras that are attached, and the devices that a virtual rig's file describes.
#[pyfunction]
pub(crate) fn attached<'py>(
    py: Python<'py>,
    file: Option<PathBuf>,
    display: Option<String>,
) -> PyResult<Bound<'py, PyDict>> {
    let (file, found, notes) = work::detached(py, || {
        let file = file.as_deref().map(RigFile::load).transpose()?;
        let hardware = match file.as_ref().map(|file| &file.kind) {
            Some(RigKind::Hardware(rig)) => Some(rig),
            _ => None,
        };
        let mut notes = Vec::new();
        let mut note = |why: &krylux::Error| notes.push(why.to_string());
        let found = AttachedDevices::find(display.as_deref(), hardware, false, &mut note);
        notes.extend(found.cameras.iter().filter_map(|camera| camera.unknown.clone()));
        Ok((file, found, notes))
    })?;
    let fields = Fields::new(py);
    let cameras: Vec<_> = found.cameras.iter().map(|camera| &camera.described).collect();
    fields.record("monitors", &found.monitors)?.record("cameras", &cameras)?.put("notes", notes)?;
    match file.filter(|file| !matches!(file.kind, RigKind::Hardware(_))) {
        None => fields.put("virtual", py.None())?,
        Some(file) => {
            let about = Fields::new(py);
            about.record("projector", &file.kind.projector_info())?;
            about.record("camera", &file.kind.camera_info())?;
            fields.put("virtual", about.0)?
        }
    };
    Ok(fields.0)
}
