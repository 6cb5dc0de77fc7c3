//! An open laboratory: its photos, its matrix, its operators, and the folder of its run.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use krylux::lab::{Lab as Laboratory, RunOptions, SourceKind};
use krylux::measure::RigFile;
use krylux::transport::Part;
use krylux::verbs::pattern::Pattern;
use krylux::verbs::rig::{Calibrate, measured_figures};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{self, Fields, record, shaped};
use crate::matrix::Matrix;
use crate::operator::Operator;
use crate::settings::{Request, one_of};
use crate::verbs::{Answer, attributes_of, request};
use crate::work::Held;
use crate::{errors, work};

/// A laboratory, which can be closed.
#[pyclass(frozen, module = "krylux._krylux", name = "Lab")]
pub(crate) struct Lab {
    lab: Held<Laboratory>,
    /// The number of photos taken one by one, without the products of operators.
    photos: AtomicUsize,
}

/// When Python frees a laboratory, the record of its run is completed, as by closing the laboratory.
impl Drop for Lab {
    fn drop(&mut self) {
        // An error is ignored, since no caller is left. Another thread that works with an operator may need the interpreter's lock.
        let _ = Python::try_attach(|py| work::detached(py, || self.end()));
    }
}

impl Lab {
    fn around(lab: Laboratory) -> Self {
        Self { lab: Held::new(lab), photos: AtomicUsize::new(0) }
    }

    /// Calls `work` with the laboratory, without the interpreter's lock. Only one thread uses the laboratory at a time.
    pub(crate) fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Laboratory) -> krylux::Result<T> + Send,
    ) -> PyResult<T> {
        self.lab.with(py, work)
    }
}

/// The part of the light with this name.
pub(crate) fn part(py: Python<'_>, name: &str) -> PyResult<Part> {
    one_of(py, "part", name, &[("full", Part::Full), ("direct", Part::Direct), ("global", Part::Global)])
}

#[pymethods]
impl Lab {
    /// Opens a source.
    #[new]
    fn new(py: Python<'_>, request: Request) -> PyResult<Self> {
        let builder = request.builder(py)?;
        Ok(Self::around(work::detached(py, || builder.open())?))
    }

    /// The same scene, seen by the virtual devices of a rig file.
    fn through_rig(&self, py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        self.with(py, |lab| lab.through_rig(RigFile::load(&file)?)).map(Self::around)
    }

    /// Begins a run in a folder.
    fn begin_run(&self, py: Python<'_>, folder: PathBuf, resume: bool, overwrite: bool) -> PyResult<()> {
        let options = RunOptions { folder: Some(folder), overwrite, resume };
        self.with(py, |lab| lab.begin_run("run", &options).map(|_| ()))
    }

    /// Measures the rig's devices from captures, and uses this calibration for photos from now on.
    fn calibrate<'py>(
        &self,
        py: Python<'py>,
        asked: BTreeMap<String, String>,
        flat_field: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let options = request::<Calibrate>(py, asked)?.options();
        let report = self.with(py, |lab| {
            let report = lab.calibrate(&options)?;
            if flat_field {
                lab.measure_flat_field()?;
            }
            Ok(report)
        })?;
        attributes_of(py, &measured_figures(&report))
    }

    /// Facts that need no photo: kind, name, the shapes of photos and of patterns, channels, unit and seed.
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let about = self.with(py, |lab| {
            let kind = match lab.kind() {
                SourceKind::Scene => "scene",
                SourceKind::Rig => "rig",
                SourceKind::Run => "run",
                SourceKind::Matrix => "matrix",
            };
            let [photo, pattern] =
                [lab.resolution(), lab.projector_resolution()].map(|size| (size.height, size.width));
            let (channels, unit) = (lab.channels().count(), lab.unit().to_owned());
            Ok((kind, lab.name(), photo, pattern, channels, unit, lab.seed()))
        })?;
        about.into_pyobject(py)
    }

    /// The photo of a pattern. On request, also the standard error of each sample, if the errors are known.
    fn photo<'py>(
        &self,
        py: Python<'py>,
        pattern: PyReadonlyArrayDyn<'py, f32>,
        with_error: bool,
    ) -> PyResult<(Bound<'py, PyAny>, Option<Bound<'py, PyAny>>)> {
        let pattern = arrays::image(&pattern)?;
        let (photo, error) = self.with(py, |lab| match with_error {
            true => lab.photo_with_error(&pattern),
            false => Ok((lab.photo(&pattern)?, None)),
        })?;
        self.photos.fetch_add(1, Ordering::Relaxed);
        Ok((arrays::array(py, &photo)?, error.map(|error| arrays::array(py, &error)).transpose()?))
    }

    /// The pattern that a text names, as on the command line.
    fn pattern<'py>(&self, py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
        let named: Pattern = text.parse().map_err(|fault: String| {
            errors::option(py, "pattern", &fault, "give an array, or name a pattern as the command line does")
        })?;
        let image = self.with(py, |lab| named.image_for(lab))?;
        arrays::array(py, &image)
    }

    /// The photo of an all-ones pattern, or the photo without the projector.
    fn plain<'py>(&self, py: Python<'py>, is_white: bool) -> PyResult<Bound<'py, PyAny>> {
        let photo = self.with(py, |lab| if is_white { lab.white() } else { lab.ambient() })?;
        self.photos.fetch_add(1, Ordering::Relaxed);
        arrays::array(py, &photo)
    }

    /// The region that each pixel of a scene sees.
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (labels, size) = self.with(py, |lab| Ok((lab.labels()?, lab.resolution())))?;
        shaped(py, &arrays::shape(size, 1), labels)
    }

    /// The labels that the scene's author defined, with the names of the regions, if there are any.
    fn truth<'py>(&self, py: Python<'py>) -> PyResult<Option<(Bound<'py, PyAny>, Vec<String>)>> {
        let (truth, size) = self.with(py, |lab| Ok((lab.known_truth()?, lab.resolution())))?;
        truth.map(|of| Ok((shaped(py, &arrays::shape(size, 1), of.labels)?, of.regions))).transpose()
    }

    /// The noise of a traced matrix, if it is known.
    fn noise<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(noise) = self.with(py, Laboratory::noise)? else { return Ok(None) };
        let fields = Fields::new(py);
        fields.image("white", &noise.white)?.put("white_relative", noise.white_relative)?;
        fields.put("operator", noise.operator)?.put("global_", noise.global)?;
        Ok(Some(fields.0))
    }

    /// The expected error of a product with a vector of norm 1, if a matrix was traced.
    fn product_noise(&self, py: Python<'_>, part: &str) -> PyResult<Option<f64>> {
        let part = crate::lab::part(py, part)?;
        self.with(py, |lab| lab.product_noise(part))
    }

    /// Whether the matrix is symmetric, and whether photos cost only computing time.
    fn kind_of_light(&self, py: Python<'_>) -> PyResult<(bool, bool)> {
        self.with(py, |lab| Ok((lab.is_symmetric()?, lab.is_simulated()?)))
    }

    /// The costs of a rig so far; `None` for other sources.
    fn costs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        record(py, &self.with(py, Laboratory::costs)?)
    }

    /// One part and channel of the matrix.
    fn matrix(&self, py: Python<'_>, part: &str, channel: usize) -> PyResult<Matrix> {
        let part = crate::lab::part(py, part)?;
        self.check_channel(py, channel)?;
        self.with(py, |lab| lab.matrix(part, channel)).map(Matrix)
    }

    /// One part and channel of the light transport as an operator.
    fn operator(&self, py: Python<'_>, part: &str, channel: usize) -> PyResult<Operator> {
        let part = crate::lab::part(py, part)?;
        self.check_channel(py, channel)?;
        let mut operators = self.with(py, |lab| lab.operators(part))?;
        Ok(Operator::new(operators.swap_remove(channel)))
    }

    /// Writes an answer into a folder, by default that of the open run. Returns the folder.
    fn save(
        &self,
        py: Python<'_>,
        answer: &Answer,
        folder: Option<PathBuf>,
        overwrite: bool,
    ) -> PyResult<PathBuf> {
        self.with(py, |lab| {
            let open = lab.run().map(|run| run.path.clone());
            match (&folder, open) {
                (None, Some(_)) => {}
                (Some(folder), Some(open)) if *folder == open => {}
                (Some(_), Some(open)) => return Err(in_another_folder(&open)),
                (folder, None) => {
                    let options = RunOptions { folder: folder.clone(), overwrite, resume: false };
                    lab.begin_run(answer.kept().names()[0], &options)?;
                }
            }
            lab.finish(&**answer.kept()).map(|saved| saved.folder)
        })
    }

    /// The findings about an answer, and about the rig whose photos it uses.
    fn findings<'py>(&self, py: Python<'py>, answer: &Answer) -> PyResult<Bound<'py, PyAny>> {
        record(py, &self.with(py, |lab| Ok(lab.findings_of(&**answer.kept())))?)
    }

    /// Compares the photos that an answer predicts with independent photos.
    fn check<'py>(&self, py: Python<'py>, answer: &Answer) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(found) = self.with(py, |lab| answer.kept().verify(lab))? else { return Ok(None) };
        let fields = Fields(record(py, &found.verification)?.cast_into()?);
        if !found.estimates.is_empty() {
            fields.record("of_scene", &found.estimates)?;
        }
        if let Some(residual) = found.residual {
            fields.put("residual", residual)?;
        }
        if let Some([photo, standard_error]) = &found.photo {
            fields.image("observed", photo)?.image("standard_error", standard_error)?;
        }
        Ok(Some(fields.0))
    }

    /// The folder of the open run.
    fn folder(&self, py: Python<'_>) -> PyResult<Option<PathBuf>> {
        self.with(py, |lab| Ok(lab.run().map(|run| run.path.clone())))
    }

    /// Ends the open run, and releases devices and memory. Operators of this laboratory stay valid.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        work::detached(py, || self.end())
    }

    #[getter]
    fn is_closed(&self, py: Python<'_>) -> bool {
        py.detach(|| self.lab.is_taken())
    }
}

impl Lab {
    /// Ends the open run and drops the laboratory. A run without photos, or with a rig that no longer responds, counts as interrupted.
    fn end(&self) -> krylux::Result<()> {
        let Some(mut lab) = self.lab.take() else { return Ok(()) };
        let photos = lab.contact_sheet().len() + self.photos.load(Ordering::Relaxed);
        if lab.run().is_none() {
            return Ok(());
        }
        if photos == 0 || lab.costs().is_err() {
            lab.abort(&krylux::Error::Interrupted);
            return Ok(());
        }
        lab.end_run(photos, "closed")
    }

    fn check_channel(&self, py: Python<'_>, channel: usize) -> PyResult<()> {
        let count = self.with(py, |lab| Ok(lab.channels().count()))?;
        if channel < count {
            return Ok(());
        }
        let help = format!("give a number below {count}, or open the source with channels=\"rgb\"");
        Err(errors::option(py, "channel", &format!("there is no channel {channel}"), &help))
    }
}

/// The error for saving an answer outside the folder of the open run, which holds its photos.
fn in_another_folder(open: &std::path::Path) -> krylux::Error {
    krylux::Error::option("-o", format!("the photos of this laboratory go to {}", open.display()))
        .help("save the answer there, by save() without a folder")
}
