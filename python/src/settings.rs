//! How a source is opened: the arguments of `krylux.open` as settings of krylux.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::image::Resolution;
use krylux::lab::{
    CacheChoice, ChannelChoice, Lab, LabBuilder, OperatorChoice, OperatorSettings, RunOptions, Settings,
    SharedObserver, TraceOverrides, View,
};
use krylux::render::Sampler;
use krylux::sparse::Csr;
use krylux::transport::Backend;
use pyo3::prelude::*;

use crate::devices::ProgramDevices;
use crate::errors;
use crate::matrix;
use crate::watch::Watcher;

/// The number of columns of a matrix, and its data, indices and row starts as SciPy has them.
type Arrays = (usize, Py<PyAny>, Py<PyAny>, Py<PyAny>);

/// The source, and the arguments beside it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Request {
    /// A path; or a name, with one of the next two.
    source: PathBuf,
    /// `(cols, data, indices, indptr)` of a matrix.
    matrix: Option<Arrays>,
    /// The text of a rig file whose devices are Python's.
    rig: Option<String>,
    devices: Option<ProgramDevices>,
    size: Option<(usize, usize)>,
    projector_size: Option<(usize, usize)>,
    spp: Option<u32>,
    max_bounces: Option<u32>,
    seed: Option<u32>,
    sampler: Option<String>,
    russian_roulette: bool,
    channels: String,
    camera: Option<String>,
    camera_file: Option<PathBuf>,
    auto_camera: bool,
    strict: bool,
    allow_programs: bool,
    adapter: Option<String>,
    cache: Option<PathBuf>,
    cached: bool,
    operator: String,
    products: String,
    memory: Option<u64>,
    split_bounces: bool,
    folder: Option<PathBuf>,
    resume: bool,
    overwrite: bool,
    progress: Option<Py<PyAny>>,
    log: Py<PyAny>,
}

impl Request {
    /// The builder of the laboratory.
    pub(crate) fn builder(self, py: Python<'_>) -> PyResult<LabBuilder> {
        let settings = self.settings(py)?;
        let name = self.source.display().to_string();
        let mut builder = match (&self.matrix, self.rig) {
            (Some(matrix), _) => Lab::builder_of_matrix(csr(py, matrix)?, name),
            (None, Some(text)) => Lab::builder_of_rig(&self.source, text),
            (None, None) => Lab::builder(&self.source),
        };
        builder = builder.settings(settings).allow_programs(self.allow_programs);
        if let Some(devices) = self.devices {
            builder = builder.devices(devices.opener());
        }
        let run = RunOptions { folder: self.folder, overwrite: self.overwrite, resume: self.resume };
        if run.folder.is_some() || run.overwrite || run.resume {
            builder = builder.run(run);
        }
        let watcher = Watcher::new(self.progress, self.log);
        Ok(builder.observer(SharedObserver(Arc::new(watcher))))
    }

    fn settings(&self, py: Python<'_>) -> PyResult<Settings> {
        let resolution = |size: Option<(usize, usize)>| size.map(|(w, h)| Resolution::new(w, h));
        Ok(Settings {
            // Processes under MPI are started by the program.
            team: None,
            view: View {
                camera: self.camera.clone(),
                camera_file: self.camera_file.clone(),
                auto_camera: self.auto_camera,
                strict: self.strict,
            },
            trace: TraceOverrides {
                resolution: resolution(self.size),
                projector: resolution(self.projector_size),
                samples: self.spp,
                max_bounces: self.max_bounces,
                seed: self.seed,
                sampler: self.sampler(py)?,
                russian_roulette: self.russian_roulette,
                ..TraceOverrides::default()
            },
            adapter: self.adapter.clone(),
            cache: match (self.cached, &self.cache) {
                (false, _) => CacheChoice::Off,
                (true, Some(folder)) => CacheChoice::Folder(folder.clone()),
                (true, None) => CacheChoice::Default,
            },
            operator: OperatorSettings {
                choice: one_of(
                    py,
                    "operator",
                    &self.operator,
                    &[
                        ("auto", OperatorChoice::Auto),
                        ("replay", OperatorChoice::Replay),
                        ("retrace", OperatorChoice::Retrace),
                    ],
                )?,
                backend: one_of(
                    py,
                    "products",
                    &self.products,
                    &[("auto", Backend::Auto), ("cpu", Backend::Cpu), ("device", Backend::Gpu)],
                )?,
                memory: self.memory,
            },
            channels: one_of(
                py,
                "channels",
                &self.channels,
                &[
                    ("luma", ChannelChoice::Luma),
                    ("rgb", ChannelChoice::Rgb),
                    ("native", ChannelChoice::Native),
                ],
            )?,
            split_bounces: self.split_bounces,
        })
    }

    fn sampler(&self, py: Python<'_>) -> PyResult<Option<Sampler>> {
        let Some(name) = &self.sampler else { return Ok(None) };
        one_of(py, "sampler", name, &[("sobol", Sampler::Sobol), ("independent", Sampler::Independent)])
            .map(Some)
    }
}

/// The choice of this name; `argument` is the one at fault where there is none.
pub(crate) fn one_of<T: Copy>(
    py: Python<'_>,
    argument: &str,
    name: &str,
    choices: &[(&str, T)],
) -> PyResult<T> {
    choices.iter().find(|(known, _)| *known == name).map(|(_, choice)| *choice).ok_or_else(|| {
        let names: Vec<String> = choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        errors::option(
            py,
            argument,
            &format!("there is no \"{name}\""),
            &format!("give {}", names.join(", ")),
        )
    })
}

fn csr(py: Python<'_>, (cols, data, indices, indptr): &Arrays) -> PyResult<Csr> {
    matrix::from_arrays(py, *cols, &data.extract(py)?, &indices.extract(py)?, &indptr.extract(py)?)
}
