//! What concerns the devices of a rig rather than a scene: calibration, alignment, and the check before a session.

use std::ops::ControlFlow;
use std::path::PathBuf;

use krylux::Error;
use krylux::bench::align::{AlignOptions, Alignment, Round, Sight, align};
use krylux::bench::rig_check::{self, RigToCheck};
use krylux::calibrate::{CalibrateOptions, CalibrationReport, MapBy, StructuredLight};
use krylux::lab::{RigSource, RunOptions};
use krylux::rig::Helper;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Fields;
use crate::settings::{Request, one_of};
use crate::work;

/// The rig of a request, whose calibration may not be there yet.
pub(crate) fn rig(py: Python<'_>, request: Request) -> PyResult<RigSource> {
    let builder = request.builder(py)?;
    work::detached(py, || builder.open_uncalibrated_rig())
}

/// Measures the devices of a rig and writes the calibration into a folder.
#[pyfunction]
pub(crate) fn calibrate<'py>(
    py: Python<'py>,
    request: Request,
    takes: u32,
    map: Option<String>,
    run: (Option<PathBuf>, bool, bool),
) -> PyResult<Bound<'py, PyDict>> {
    let (folder, overwrite, resume) = run;
    let options = calibrate_options(py, takes, map)?;
    let rig = rig(py, request)?;
    let folder = folder.unwrap_or_else(|| rig.next_calibration_folder(overwrite || resume));
    let run = RunOptions { folder: Some(folder), overwrite, resume };
    let found = work::detached(py, || rig.calibrate(&options, &run))?;
    let fields = Fields::new(py);
    fields.put("folder", found.folder)?.record("effort", &found.effort)?;
    report_fields(&fields, &found.report)?;
    Ok(fields.0)
}

/// How devices are calibrated.
pub(crate) fn calibrate_options(
    py: Python<'_>,
    takes: u32,
    map: Option<String>,
) -> PyResult<CalibrateOptions> {
    let maps = [("gray-code", MapBy::GrayCode), ("checkerboard", MapBy::Checkerboard)];
    let map = map.map(|name| one_of(py, "map", &name, &maps)).transpose()?;
    Ok(CalibrateOptions { takes, map, ..CalibrateOptions::default() })
}

/// How well the devices are known.
pub(crate) fn report_fields(fields: &Fields<'_>, report: &CalibrationReport) -> PyResult<()> {
    let lines = report.lines().iter().map(|[of, text]| format!("{of:<11}{text}")).collect::<Vec<_>>();
    fields.put("lines", lines)?.record("report", report)?;
    Ok(())
}

/// Measures the uneven brightness of a rig's devices by a matte sheet, and adds it to the rig's calibration.
#[pyfunction]
pub(crate) fn flat_field<'py>(py: Python<'py>, request: Request) -> PyResult<Bound<'py, PyDict>> {
    let builder = request.builder(py)?;
    let (flat, folder) = work::detached(py, || {
        let lab = builder.open()?;
        // Python hands over nothing but rigs.
        lab.rig().ok_or(Error::Interrupted)?.add_flat_field()
    })?;
    let fields = Fields::new(py);
    fields.put("folder", folder)?.put("projector", flat.projector)?.put("camera", flat.camera)?;
    Ok(fields.0)
}

/// Checks a rig before a session.
#[pyfunction]
pub(crate) fn check<'py>(py: Python<'py>, request: Request, folder: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let source = rig(py, request)?;
    let findings = work::detached(py, || {
        let file = source.file.clone();
        let known = source.file.load_calibration().transpose().ok().flatten();
        let mut open = || {
            let mut shots = source.opener()(None)?;
            shots.set_settle(source.file.settle(known.as_ref()));
            Ok(shots)
        };
        let rig = RigToCheck { file: &file, folder: &folder, helper: &Helper::find, open: &mut open };
        rig_check::check(rig, &mut |_| match Python::try_attach(|py| py.check_signals()) {
            Some(Ok(())) => ControlFlow::Continue(()),
            Some(Err(error)) => {
                work::keep(error);
                ControlFlow::Break(())
            }
            None => ControlFlow::Break(()),
        })
    })?;
    let fields = Fields::new(py);
    fields.record("findings", &findings.all)?.put("passed", findings.passed())?;
    fields.put("complete", findings.complete)?.put("status", findings.sentence())?;
    Ok(fields.0)
}

/// Rounds of structured light: whether projector and camera are at one point.
#[pyfunction]
pub(crate) fn align_rounds<'py>(
    py: Python<'py>,
    request: Request,
    rounds: usize,
    question: (usize, f64, Option<f64>),
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let (patterns, asymmetry, exposure) = question;
    let source = rig(py, request)?;
    let options = AlignOptions { patterns, asymmetry, ..AlignOptions::default() };
    let found = work::detached(py, || {
        let known = source.file.load_calibration().transpose().ok().flatten();
        let mut shots = source.opener()(None)?;
        shots.set_settle(source.file.settle(known.as_ref()));
        let exposure = exposure.or(source.file.longest_exposure());
        let response = known.as_ref().map(|known| &known.camera);
        let mut light = StructuredLight::new(shots.as_mut(), response, exposure)?;
        let mut found = Vec::new();
        for _ in 0..rounds {
            if let Some(Err(error)) = Python::try_attach(|py| py.check_signals()) {
                work::keep(error);
                return Err(Error::Interrupted);
            }
            found.push(align(&mut light, &options)?);
        }
        Ok(found)
    })?;
    found.iter().map(|round| round_fields(py, round, &options)).collect()
}

fn round_fields<'py>(py: Python<'py>, round: &Round, options: &AlignOptions) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    match round {
        Round::Lost { fault, help } => {
            fields.put("found", false)?.put("fault", fault)?.put("help", help)?;
        }
        Round::Found(found) => found_fields(&fields, found, options)?,
    }
    Ok(fields.0)
}

fn found_fields(fields: &Fields<'_>, found: &Alignment, options: &AlignOptions) -> PyResult<()> {
    let names = found.sights.iter().map(|sight| match sight {
        Sight::Lit => 0_u8,
        Sight::Shadow => 1,
        Sight::Dark => 2,
        Sight::Outside => 3,
    });
    let sights: Vec<u8> = names.collect();
    let disparity = &found.disparity;
    fields.put("found", true)?.put("aligned", found.is_aligned(options))?;
    fields.put("shadow", found.shadow)?.put("dark", found.dark)?;
    fields.put("disparity", (disparity.median, disparity.upper, disparity.error))?;
    fields.record("offset", &found.stand)?.record("symmetry", &found.symmetry)?;
    fields.put("place", found.stand.as_ref().map(|stand| stand.place()))?;
    let certain = found.stand.as_ref().filter(|stand| stand.is_certain);
    fields.put("remedy", certain.map(|stand| stand.remedy()))?;
    fields.raster("white", found.white.clone(), found.camera)?.raster("sights", sights, found.camera)?;
    Ok(())
}
