//! The arguments of `krylux.open`, as settings for opening a source.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::image::Resolution;
use krylux::lab::{
    CacheChoice, ChannelChoice, Lab, LabBuilder, OperatorChoice, OperatorSettings, RunOptions, Settings,
    SharedObserver, TraceOverrides, View,
};
use krylux::render::Sampler;
use krylux::transport::Backend;
use pyo3::conversion::FromPyObjectOwned;
use pyo3::prelude::*;

use crate::devices::ProgramDevices;
use crate::scene::Scene;
use crate::watch::Watcher;
use crate::{errors, matrix};

/// A dictionary with the source and the other arguments.
#[derive(FromPyObject)]
pub(crate) struct Request(Py<PyAny>);

impl Request {
    /// The builder of the laboratory.
    pub(crate) fn builder(self, py: Python<'_>) -> PyResult<LabBuilder> {
        let asked = self.0.bind(py);
        let source: PathBuf = item(asked, "source")?;
        let scene: Option<Py<Scene>> = item(asked, "scene")?;
        // A matrix, an array, a scene or a rig's text is already in memory, so the source is only a name.
        let name = source.display().to_string();
        let mut builder = if let Some(matrix) = item(asked, "matrix")? {
            Lab::builder_of_matrix(matrix::csr(py, &matrix)?, name)
        } else if let Some(array) = item(asked, "array")? {
            Lab::builder_of_matrix(matrix::dense(&source, &array)?, name)
        } else if let Some(text) = item::<Option<String>>(asked, "rig")? {
            Lab::builder_of_rig(&source, text)
        } else if let Some(scene) = scene {
            Lab::builder_of_editable(scene.get().now())
        } else {
            Lab::builder(&source)
        };
        builder = builder.settings(settings(asked)?).allow_programs(item(asked, "allow_programs")?);
        if let Some(devices) = item::<Option<ProgramDevices>>(asked, "devices")? {
            builder = builder.devices(devices.opener());
        }
        let run = RunOptions {
            folder: item(asked, "folder")?,
            overwrite: item(asked, "overwrite")?,
            resume: item(asked, "resume")?,
        };
        if run.folder.is_some() || run.overwrite || run.resume {
            builder = builder.run(run);
        }
        Ok(builder.observer(SharedObserver(Arc::new(item::<Watcher>(asked, "progress")?))))
    }
}

fn settings(asked: &Bound<'_, PyAny>) -> PyResult<Settings> {
    let samplers = [("sobol", Some(Sampler::Sobol)), ("independent", Some(Sampler::Independent))];
    let operators = [
        ("auto", OperatorChoice::Auto),
        ("replay", OperatorChoice::Replay),
        ("retrace", OperatorChoice::Retrace),
    ];
    let backends = [("auto", Backend::Auto), ("cpu", Backend::Cpu), ("device", Backend::Gpu)];
    let channels =
        [("luma", ChannelChoice::Luma), ("rgb", ChannelChoice::Rgb), ("native", ChannelChoice::Native)];
    let size = |name| Ok::<_, PyErr>(item::<Option<_>>(asked, name)?.map(|(w, h)| Resolution::new(w, h)));
    let sampler = match asked.get_item("sampler")?.is_none() {
        true => None,
        false => chosen(asked, "sampler", &samplers)?,
    };
    Ok(Settings {
        // Python has no team, because only the program starts processes under MPI.
        team: None,
        view: View {
            camera: item(asked, "camera")?,
            camera_file: item(asked, "camera_file")?,
            auto_camera: item(asked, "auto_camera")?,
            strict: item(asked, "strict")?,
        },
        trace: TraceOverrides {
            resolution: size("size")?,
            projector: size("projector_size")?,
            samples: item(asked, "spp")?,
            max_bounces: item(asked, "max_bounces")?,
            seed: item(asked, "seed")?,
            sampler,
            russian_roulette: item(asked, "russian_roulette")?,
            ..TraceOverrides::default()
        },
        adapter: item(asked, "adapter")?,
        cache: match (item(asked, "cached")?, item::<Option<PathBuf>>(asked, "cache")?) {
            (false, _) => CacheChoice::Off,
            (true, Some(folder)) => CacheChoice::Folder(folder),
            (true, None) => CacheChoice::Default,
        },
        operator: OperatorSettings {
            choice: chosen(asked, "operator", &operators)?,
            backend: chosen(asked, "products", &backends)?,
            memory: item(asked, "memory")?,
        },
        channels: chosen(asked, "channels", &channels)?,
        split_bounces: item(asked, "split_bounces")?,
    })
}

/// The value of an argument in a dictionary.
pub(crate) fn item<'py, T: FromPyObjectOwned<'py>>(asked: &Bound<'py, PyAny>, argument: &str) -> PyResult<T> {
    asked.get_item(argument)?.extract().map_err(Into::into)
}

/// The choice that an argument in the dictionary names.
pub(crate) fn chosen<T: Copy>(
    asked: &Bound<'_, PyAny>,
    argument: &str,
    choices: &[(&str, T)],
) -> PyResult<T> {
    one_of(asked.py(), argument, &item::<String>(asked, argument)?, choices)
}

/// The choice with this name. If there is none, the error names `argument`.
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
