//! The paper's figures.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::lab::{RunFolder, RunOptions, SharedObserver};
use krylux::operator::Product;
use krylux::paper::{self, BenchOptions, Content, Figure, Gallery, Panel, Plot, Reproduced, Rig, Strip};
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::Fields;
use crate::settings::one_of;
use crate::watch::Watcher;
use crate::work;

/// Figures that were made, kept until they are saved.
#[pyclass(frozen, module = "krylux._krylux", name = "Figures")]
pub(crate) struct Figures {
    made: Vec<Reproduced>,
    quick: bool,
    log: Py<PyAny>,
}

#[pymethods]
impl Figures {
    /// Writes the page and its pictures into a folder. Returns the folder.
    #[pyo3(signature = (folder, overwrite))]
    fn save(&self, py: Python<'_>, folder: Option<PathBuf>, overwrite: bool) -> PyResult<PathBuf> {
        let observer = SharedObserver(Arc::new(Watcher::new(None, self.log.clone_ref(py))));
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

/// What is asked of the figures.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct FiguresQuestion {
    /// By name; all where there are none.
    figures: Vec<String>,
    rig: String,
    quick: bool,
    adapter: Option<String>,
    progress: Option<Py<PyAny>>,
    log: Py<PyAny>,
}

/// Makes figures of the paper again.
#[pyfunction]
pub(crate) fn reproduce<'py>(
    py: Python<'py>,
    question: FiguresQuestion,
) -> PyResult<(Bound<'py, PyDict>, Figures)> {
    let FiguresQuestion { figures, rig, quick, adapter, progress, log } = question;
    let names = Figure::ALL.map(|figure| (figure.name(), figure));
    let asked = figures.iter().map(|name| one_of(py, "figures", name, &names));
    let asked = asked.collect::<PyResult<Vec<Figure>>>()?;
    let wanted = Figure::ALL.into_iter().filter(|figure| asked.is_empty() || asked.contains(figure));
    let wanted: Vec<Figure> = wanted.collect();
    let rigs: [(&str, &[Rig]); 3] =
        [("ideal", &[Rig::Ideal]), ("virtual", &[Rig::Virtual]), ("both", &[Rig::Ideal, Rig::Virtual])];
    let rigs = one_of(py, "rig", &rig, &rigs)?;
    let observer = SharedObserver(Arc::new(Watcher::new(progress, log.clone_ref(py))));
    let made = work::detached(py, || {
        let benches =
            rigs.iter().map(|&rig| BenchOptions { rig, quick, adapter: adapter.clone(), team: None });
        paper::reproduce_all(&wanted, benches, &observer, &mut |_| Ok(()))
    })?;
    let gallery = Gallery { made: &made, quick };
    let fields = Fields::new(py);
    fields.put("status", gallery.verdict().sentence)?.record("summary", &gallery.summary())?;
    let all = made.iter().map(|one| figure_fields(py, one)).collect::<PyResult<Vec<_>>>()?;
    fields.put("figures", all)?.put("quick", quick)?;
    Ok((fields.0, Figures { made, quick, log }))
}

fn figure_fields<'py>(py: Python<'py>, made: &Reproduced) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    fields.put("name", made.figure.name())?.put("title", made.figure.title())?;
    fields.put("statement", made.figure.statement())?.put("rig", made.rig.name())?;
    fields.put("setting", made.setting.clone())?.put("photos", made.photos)?;
    fields.put("seconds", made.seconds)?.put("met", made.is_met())?;
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
        Content::Labels(labels) => fields.raster("values", labels.clone(), size)?,
        Content::Signed(values) | Content::Amounts(values) | Content::Light { values, .. } => {
            fields.raster("values", values.clone(), size)?
        }
    };
    fields.put("kind", kind)?.put("white", white)?.put("caption", &panel.caption)?;
    Ok(fields.0)
}

/// Lines: each an array of two columns.
fn plot_fields<'py>(py: Python<'py>, plot: &Plot) -> PyResult<Bound<'py, PyDict>> {
    let lines = PyList::empty(py);
    for line in &plot.lines.series {
        let points: Vec<f64> = line.points.iter().flat_map(|&(x, y)| [x, y]).collect();
        let points = Array2::from_shape_vec((line.points.len(), 2), points);
        let points = points.map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?;
        lines.append((&line.name, points.into_pyarray(py)))?;
    }
    let fields = Fields::new(py);
    fields.put("caption", &plot.caption)?.put("x_label", &plot.lines.x_label)?;
    fields.put("y_label", &plot.lines.y_label)?.put("logarithmic", plot.lines.logarithmic)?;
    fields.put("lines", lines)?.put("marks", plot.lines.marks.clone())?;
    Ok(fields.0)
}

/// The photos of a run in order, with their patterns.
fn strip_fields<'py>(py: Python<'py>, strip: &Strip) -> PyResult<Bound<'py, PyDict>> {
    let side = |of: fn(&Product) -> &Vec<f64>| -> Vec<Vec<f64>> {
        strip.photos.iter().map(|product| of(product).clone()).collect()
    };
    let fields = Fields::new(py);
    fields.put("caption", &strip.caption)?;
    fields.stack("patterns", &side(|product| &product.from), strip.resolution)?;
    fields.stack("photos", &side(|product| &product.to), strip.resolution)?;
    Ok(fields.0)
}
