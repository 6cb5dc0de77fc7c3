//! Scenes that Python makes or changes.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use krylux::Error;
use krylux::scene::{EditableScene, LoadOptions, Mesh, Value};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyFloat};

use crate::arrays::shaped;
use crate::settings::item;
use crate::{errors, work};

/// A scene whose parameters can be read and set.
#[pyclass(frozen, module = "krylux._krylux", name = "Scene")]
pub(crate) struct Scene(Mutex<Arc<EditableScene>>);

impl Scene {
    fn of(scene: EditableScene) -> Self {
        Self(Mutex::new(Arc::new(scene)))
    }

    fn lock(&self) -> MutexGuard<'_, Arc<EditableScene>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The scene as it is now. Later changes do not affect it.
    pub(crate) fn now(&self) -> Arc<EditableScene> {
        Arc::clone(&self.lock())
    }

    /// Changes the scene, unless the change fails.
    fn change(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut EditableScene) -> krylux::Result<()>,
    ) -> PyResult<()> {
        let mut changed = self.now();
        change(Arc::make_mut(&mut changed)).map_err(|error| errors::raise(py, &error))?;
        *self.lock() = changed;
        Ok(())
    }
}

#[pymethods]
impl Scene {
    /// A scene without meshes.
    #[new]
    fn new(name: String) -> Self {
        Self::of(EditableScene::new(name))
    }

    /// Loads a scene file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, options: &Bound<'_, PyDict>) -> PyResult<Self> {
        let options = options.as_any();
        let (camera, camera_file): (Option<String>, Option<PathBuf>) =
            (item(options, "camera")?, item(options, "camera_file")?);
        let (auto_camera, strict) = (item(options, "auto_camera")?, item(options, "strict")?);
        let load = || {
            let (camera, camera_file) = (camera.as_deref(), camera_file.as_deref());
            let options = LoadOptions { camera, camera_file, auto_camera, strict, ..LoadOptions::default() };
            EditableScene::load(&path, &options)
        };
        work::detached(py, load).map(Self::of)
    }

    /// The scene from the bytes that `glb` returned.
    #[staticmethod]
    fn of_glb(py: Python<'_>, name: &str, bytes: &[u8]) -> PyResult<Self> {
        work::detached(py, || EditableScene::from_glb(name, bytes)).map(Self::of)
    }

    fn glb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let scene = self.now();
        Ok(PyBytes::new(py, &work::detached(py, || scene.to_glb())?))
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let scene = self.now();
        work::detached(py, || scene.save(&path))
    }

    /// The same scene, which can be changed by itself.
    fn copy(&self) -> Self {
        Self(Mutex::new(self.now()))
    }

    #[getter]
    fn name(&self) -> String {
        self.lock().name.clone()
    }

    /// Adds a mesh with all of its parameters, or nothing.
    fn add_mesh(
        &self,
        py: Python<'_>,
        name: String,
        material: Option<String>,
        parameters: Vec<(String, Bound<'_, PyAny>)>,
    ) -> PyResult<()> {
        let values = parameters.into_iter().map(|(path, value)| Ok((path, parsed(&value)?)));
        let values: Vec<(String, Value)> = values.collect::<PyResult<_>>()?;
        self.change(py, |scene| {
            scene.add_mesh(Mesh::new(name), material.as_deref())?;
            values.into_iter().try_for_each(|(path, value)| scene.set(&path, value))?;
            scene.check()
        })
    }

    /// Places the camera or the projector, which JSON describes.
    fn place(&self, py: Python<'_>, role: &str, json: &str) -> PyResult<()> {
        self.change(py, |scene| scene.place(role, json))
    }

    fn parameters(&self) -> Vec<String> {
        self.lock().parameters()
    }

    fn get<'py>(&self, py: Python<'py>, path: &str) -> PyResult<Bound<'py, PyAny>> {
        let value = self.lock().get(path).map_err(|error| errors::raise(py, &error))?;
        match value {
            Value::Flag(flag) => Ok(flag.into_pyobject(py)?.to_owned().into_any()),
            Value::Number(number) => Ok(number.into_pyobject(py)?.into_any()),
            Value::Numbers { shape, values } => shaped(py, &shape, values),
            Value::Faces(faces) => shaped(py, &[faces.len(), 3], faces.into_flattened()),
            Value::Picture { width, texels } => {
                let width = width as usize;
                shaped(py, &[texels.len() / width, width, 4], texels.into_flattened())
            }
        }
    }

    fn set(&self, py: Python<'_>, path: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let value = parsed(value)?;
        self.change(py, |scene| scene.set(path, value))
    }
}

/// A value that Python has checked: a truth value, indices, texels, or numbers in single precision.
fn parsed(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if let Ok(flag) = value.extract::<bool>() {
        return Ok(Value::Flag(flag));
    }
    if let Ok(number) = value.cast::<PyFloat>() {
        return Ok(Value::Number(number.value()));
    }
    if let Ok(faces) = value.extract::<PyReadonlyArray2<'_, u32>>() {
        return Ok(Value::Faces(faces.as_slice()?.as_chunks().0.to_vec()));
    }
    if let Ok(picture) = value.extract::<PyReadonlyArray3<'_, u8>>() {
        let width = u32::try_from(picture.shape()[1]).map_err(|_| {
            let error = Error::option("texture", "it is too large").help("give a smaller picture");
            errors::raise(value.py(), &error)
        })?;
        return Ok(Value::Picture { width, texels: picture.as_slice()?.as_chunks().0.to_vec() });
    }
    let numbers: PyReadonlyArrayDyn<'_, f32> = value.extract()?;
    Ok(Value::Numbers { shape: numbers.shape().to_vec(), values: numbers.as_slice()?.to_vec() })
}
