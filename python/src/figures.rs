//! Pictures from files and their comparison, and the paper's figures.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::analysis::similarity::{data_range, similarity};
use krylux::io::picture;
use krylux::lab::{RunFolder, RunOptions, SharedObserver};
use krylux::operator::Product;
use krylux::paper::{self, BenchOptions, Content, Figure, Gallery, Panel, Plot, Reproduced, Rig, Strip};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{self, Fields, shaped};
use crate::settings::one_of;
use crate::watch::Watcher;
use crate::work;

/// Reproduced figures, kept until they are saved.
#[pyclass(frozen, module = "krylux._krylux", name = "Figures")]
pub(crate) struct Figures {
    made: Vec<Reproduced>,
    quick: bool,
}

#[pymethods]
impl Figures {
    /// Writes the page and its pictures into a folder. Returns the folder.
    fn save(&self, py: Python<'_>, folder: Option<PathBuf>, overwrite: bool) -> PyResult<PathBuf> {
        let observer = SharedObserver(Arc::new(Watcher::new(py, None)?));
        work::detached(py, || {
            let options = RunOptions { folder, overwrite, resume: false };
            let mut run = RunFolder::create(&options, "reproduce", None, &observer)?;
            let gallery = Gallery { made: &self.made, quick: self.quick };
            let written = gallery.write_into(&mut run);
            let closed = match &written {
                Ok(_) => run.close(Ok(&gallery.verdict().sentence)),
                Err(error) => run.close(Err(error)),
            };
            written.and(closed).map(|()| run.path.clone())
        })
    }
}

/// Reproduces figures of the paper: the named figures, or all figures if no name is given.
#[pyfunction]
pub(crate) fn reproduce<'py>(
    py: Python<'py>,
    figures: Vec<String>,
    rig: &str,
    quick: bool,
    adapter: Option<String>,
    progress: Watcher,
) -> PyResult<(Bound<'py, PyDict>, Figures)> {
    let names = Figure::ALL.map(|figure| (figure.name(), figure));
    let asked = figures.iter().map(|name| one_of(py, "figures", name, &names));
    let asked = asked.collect::<PyResult<Vec<Figure>>>()?;
    let wanted = Figure::ALL.into_iter().filter(|figure| asked.is_empty() || asked.contains(figure));
    let wanted: Vec<Figure> = wanted.collect();
    let rigs: [(&str, &[Rig]); 3] =
        [("ideal", &[Rig::Ideal]), ("virtual", &[Rig::Virtual]), ("both", &[Rig::Ideal, Rig::Virtual])];
    let rigs = one_of(py, "rig", rig, &rigs)?;
    let observer = SharedObserver(Arc::new(progress));
    let made = work::detached(py, || {
        let benches =
            rigs.iter().map(|&rig| BenchOptions { rig, quick, adapter: adapter.clone(), team: None });
        paper::reproduce_all(&wanted, benches, &observer, &mut |_| Ok(()))
    })?;
    let gallery = Gallery { made: &made, quick };
    let fields = Fields::new(py);
    fields.put("status", gallery.verdict().sentence)?.record("summary", &gallery.summary())?;
    let all = made.iter().map(|one| figure_fields(py, one)).collect::<PyResult<Vec<_>>>()?;
    fields.put("figures", all)?;
    Ok((fields.0, Figures { made, quick }))
}

fn figure_fields<'py>(py: Python<'py>, made: &Reproduced) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    fields.put("name", made.figure.name())?.put("title", made.figure.title())?;
    fields.put("statement", made.figure.statement())?;
    let panels = PyDict::new(py);
    for panel in &made.panels {
        panels.set_item(&panel.name, panel_fields(py, panel)?)?;
    }
    let plots = made.plots.iter().map(|plot| plot_fields(py, plot)).collect::<PyResult<Vec<_>>>()?;
    let strips = made.strips.iter().map(|strip| strip_fields(py, strip)).collect::<PyResult<Vec<_>>>()?;
    fields.put("panels", panels)?.put("plots", plots)?.put("strips", strips)?;
    Ok(fields.0)
}

/// A picture: its kind, its values, and its caption.
fn panel_fields<'py>(py: Python<'py>, panel: &Panel) -> PyResult<Bound<'py, PyDict>> {
    let (fields, size) = (Fields::new(py), panel.resolution);
    let (kind, white) = match &panel.content {
        Content::Labels(_) => ("labels", None),
        Content::Signed(_) => ("signed", None),
        Content::Amounts(_) => ("amounts", None),
        Content::Light { white, .. } => ("light", *white),
    };
    match &panel.content {
        Content::Labels(labels) => fields.raster("values", labels.clone(), size, 1)?,
        Content::Signed(values) | Content::Amounts(values) | Content::Light { values, .. } => {
            fields.raster("values", values.clone(), size, 1)?
        }
    };
    fields.put("kind", kind)?.put("white", white)?.put("caption", &panel.caption)?;
    Ok(fields.0)
}

/// The lines of a plot, each as an array of two columns.
fn plot_fields<'py>(py: Python<'py>, plot: &Plot) -> PyResult<Bound<'py, PyDict>> {
    let lines = PyList::empty(py);
    for line in &plot.lines.series {
        let points = line.points.iter().flat_map(|&(x, y)| [x, y]).collect();
        lines.append((&line.name, shaped::<f64>(py, &[line.points.len(), 2], points)?))?;
    }
    let fields = Fields::new(py);
    fields.put("caption", &plot.caption)?.put("x_label", &plot.lines.x_label)?;
    fields.put("y_label", &plot.lines.y_label)?.put("logarithmic", plot.lines.logarithmic)?;
    fields.put("lines", lines)?.put("marks", plot.lines.marks.clone())?;
    Ok(fields.0)
}

/// The photos of a run in order, each with its pattern.
fn strip_fields<'py>(py: Python<'py>, strip: &Strip) -> PyResult<Bound<'py, PyDict>> {
    let shape = [strip.photos.len(), strip.resolution.height, strip.resolution.width];
    let side = |of: fn(&Product) -> &Vec<f64>| {
        shaped(py, &shape, strip.photos.iter().flat_map(of).copied().collect())
    };
    let fields = Fields::new(py);
    fields.put("caption", &strip.caption)?;
    fields.put("patterns", side(|product| &product.from)?)?.put("photos", side(|product| &product.to)?)?;
    Ok(fields.0)
}

/// The picture in a file.
#[pyfunction]
pub(crate) fn read_picture(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    arrays::array(py, &work::detached(py, || picture::read(&path))?)
}

/// The similarity of two pictures of the same shape.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    image: PyReadonlyArrayDyn<'py, f32>,
    reference: PyReadonlyArrayDyn<'py, f32>,
    range: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (image, reference) = (arrays::image(&image)?, arrays::image(&reference)?);
    let range = range.unwrap_or_else(|| data_range(&reference));
    let found = work::detached(py, || similarity(&image, &reference, range))?;
    let fields = Fields::new(py);
    fields.put("rmse", found.rmse)?.put("relative_rmse", found.relative_rmse)?;
    fields.put("largest", found.largest)?.put("psnr", found.psnr)?;
    fields.put("ssim", found.ssim)?.put("range", found.range)?;
    Ok(fields.0)
}
