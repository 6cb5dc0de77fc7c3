//! The parameters of an editable scene, each with a path such as `sheet.albedo`, `sheet.vertices` or `camera.position`.

use std::slice::from_mut;

use glam::{Vec2, Vec3};

use super::pose::{PARAMETERS, of_camera, set_camera};
use super::{EditableScene, Mesh};
use crate::error::{Error, Result};
use crate::scene::source::MAX_SIDE;
use crate::scene::triangle::unit;
use crate::scene::{AlphaMode, Material, Texture, TextureRef, Volume, Wrap};

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// One number.
    Number(f64),
    /// Several numbers: a colour or a point has the shape `[3]`, vertices `[n, 3]`.
    Numbers {
        /// The lengths of the axes.
        shape: Vec<usize>,
        /// All numbers, the last axis first.
        values: Vec<f32>,
    },
    /// The vertices of each triangle.
    Faces(Vec<[u32; 3]>),
    /// A picture of `texels.len() / width` rows, RGBA, the first row at the top.
    Picture {
        /// Number of columns.
        width: u32,
        /// The texels; as [`Texture::texels`].
        texels: Vec<[u8; 4]>,
    },
    /// Yes or no.
    Flag(bool),
}

impl From<f32> for Value {
    fn from(value: f32) -> Self {
        Self::Number(value.into())
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<Vec3> for Value {
    fn from(value: Vec3) -> Self {
        Self::Numbers { shape: vec![3], values: value.to_array().to_vec() }
    }
}

impl From<bool> for Value {
    fn from(value: bool) -> Self {
        Self::Flag(value)
    }
}

/// The numbers that a factor of a material may have.
#[derive(Clone, Copy)]
enum Range {
    Fraction,
    NotNegative,
    Positive,
    Finite,
    Ior,
}

impl Range {
    fn check(self, value: f32) -> std::result::Result<(), &'static str> {
        let (is_in, expected) = match self {
            Self::Fraction => ((0.0..=1.0).contains(&value), "from 0 to 1"),
            Self::NotNegative => (value.is_finite() && value >= 0.0, "finite and not negative"),
            // An infinite distance means that nothing is absorbed.
            Self::Positive => (value > 0.0, "positive"),
            Self::Finite => (value.is_finite(), "finite"),
            Self::Ior => (value == 0.0 || (value.is_finite() && value >= 1.0), "at least 1, or 0"),
        };
        if is_in { Ok(()) } else { Err(expected) }
    }
}

/// The numbers of a factor: one, or three of a colour.
type Factor = fn(&mut Material) -> &mut [f32];

/// The factors of a material, in the order of the list of parameters.
const FACTORS: [(&str, Range, Factor); 14] = [
    ("albedo", Range::Fraction, |of| of.base_color.as_mut()),
    ("opacity", Range::Fraction, |of| from_mut(&mut of.opacity)),
    ("metallic", Range::Fraction, |of| from_mut(&mut of.metallic)),
    ("roughness", Range::Fraction, |of| from_mut(&mut of.roughness)),
    ("specular", Range::Fraction, |of| from_mut(&mut of.specular)),
    ("specular_color", Range::NotNegative, |of| of.specular_color.as_mut()),
    ("ior", Range::Ior, |of| from_mut(&mut of.ior)),
    ("emission", Range::NotNegative, |of| of.emission.as_mut()),
    ("transmission", Range::Fraction, |of| from_mut(&mut of.transmission)),
    ("diffuse_transmission", Range::Fraction, |of| from_mut(&mut of.diffuse_transmission)),
    ("diffuse_transmission_color", Range::Fraction, |of| of.diffuse_transmission_color.as_mut()),
    ("attenuation_color", Range::Fraction, |of| volume(of).attenuation_color.as_mut()),
    ("attenuation_distance", Range::Positive, |of| from_mut(&mut volume(of).attenuation_distance)),
    ("normal_scale", Range::Finite, |of| from_mut(&mut of.normal_scale)),
];

const DOUBLE_SIDED: &str = "double_sided";
const GEOMETRY: [&str; 5] = ["vertices", "faces", "normals", "uv", "uv_2"];

/// A material without a volume gets a clear one.
fn volume(of: &mut Material) -> &mut Volume {
    of.volume.get_or_insert(Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY })
}

fn factor(name: &str) -> Option<(Range, Factor)> {
    FACTORS.iter().find(|(factor, ..)| *factor == name).map(|&(_, range, numbers)| (range, numbers))
}

/// The place of a picture in a material.
fn slot<'a>(material: &'a mut Material, property: &str) -> Option<&'a mut Option<TextureRef>> {
    material
        .texture_slots()
        .into_iter()
        .find(|(role, _)| texture_name(role) == property)
        .map(|(_, slot)| slot)
}

/// Whether a factor affects the material as it is.
fn has_effect(material: &Material, name: &str) -> bool {
    match name {
        "attenuation_color" | "attenuation_distance" => material.volume.is_some(),
        "normal_scale" => material.normal_texture.is_some(),
        _ => true,
    }
}

/// The name of a texture's parameter, from its role in glTF's terms.
fn texture_name(role: &str) -> String {
    match role {
        "base colour" => "albedo_texture".into(),
        role => format!("{}_texture", role.replace([' ', '-'], "_").replace("colour", "color")),
    }
}

/// The kind of object that a path names, with its index.
enum Object {
    Camera,
    Projector,
    Mesh(usize),
    Material(usize),
}

impl EditableScene {
    /// The paths of all parameters that have a value: of each mesh `vertices`, `faces`, `normals`, `uv` and `uv_2`; of each material its
    /// factors and pictures; of `camera` and `projector` `position`, `forward`, `up`, `vertical_fov` (in degrees), `aperture_radius` and
    /// `focus_distance`.
    pub fn parameters(&self) -> Vec<String> {
        let meshes = self.meshes.iter().map(|of| (of.name.as_str(), GEOMETRY.map(str::to_owned).to_vec()));
        let materials = self.materials.iter().map(|of| (of.name.as_str(), properties(of)));
        // Those that the scene does not have have no values.
        let cameras = ["camera", "projector"].map(|name| (name, PARAMETERS.map(str::to_owned).to_vec()));
        meshes
            .chain(materials)
            .chain(cameras)
            .flat_map(|(name, properties)| properties.into_iter().map(move |of| format!("{name}.{of}")))
            .filter(|path| self.get(path).is_ok())
            .collect()
    }

    /// The value of a parameter.
    ///
    /// # Errors
    /// [`Error::Option`] naming the path, if there is no such parameter or it has no value.
    pub fn get(&self, path: &str) -> Result<Value> {
        let (object, property) = self.find(path)?;
        let found = match object {
            Object::Camera => self.camera.as_ref().and_then(|camera| of_camera(camera, property)),
            Object::Projector => self.projector.as_ref().and_then(|camera| of_camera(camera, property)),
            Object::Mesh(index) => of_mesh(&self.meshes[index], property),
            Object::Material(index) => self.of_material(&self.materials[index], property),
        };
        found.ok_or_else(|| Error::option(path, "it has no value").help("set it first"))
    }

    /// Sets a parameter. A number sets all three channels of a colour. Numbers are rounded to single precision. Whether arrays of one mesh fit
    /// together is checked when the scene is opened or saved, so they can be set one by one. Opacity below 1 makes an opaque surface blend.
    ///
    /// # Errors
    /// [`Error::Option`] naming the path: there is no such parameter, or the value has another shape or another range.
    pub fn set(&mut self, path: &str, value: impl Into<Value>) -> Result<()> {
        let (object, property) = self.find(path)?;
        let property = property.to_owned();
        let fault = |(fault, help): Fault| Error::option(path, fault).help(help);
        match (object, value.into()) {
            (Object::Mesh(index), value) => {
                set_mesh(&mut self.meshes[index], &property, value).map_err(fault)
            }
            (Object::Material(index), Value::Picture { width, texels }) => {
                self.set_picture(index, &property, (width, texels)).map_err(fault)
            }
            (Object::Material(index), value) => {
                set_material(&mut self.materials[index], &property, value).map_err(fault)
            }
            (object, value) => {
                let is_camera = matches!(object, Object::Camera);
                let camera = if is_camera { &mut self.camera } else { &mut self.projector };
                let Some(camera) = camera else {
                    return Err(fault(("the scene has none".into(), "place it first".into())));
                };
                set_camera(camera, &property, value).map_err(fault)
            }
        }
    }

    /// The object and the property that a path names. The error names the most similar paths.
    fn find<'a>(&self, path: &'a str) -> Result<(Object, &'a str)> {
        let (name, property) = path.rsplit_once('.').unwrap_or((path, ""));
        let mesh = || self.meshes.iter().position(|mesh| mesh.name == name).map(Object::Mesh);
        let material = || self.materials.iter().position(|of| of.name == name).map(Object::Material);
        let is_texture = |property| slot(&mut Material::default(), property).is_some();
        let object = match property {
            _ if name == "camera" && PARAMETERS.contains(&property) => Some(Object::Camera),
            _ if name == "projector" && PARAMETERS.contains(&property) => Some(Object::Projector),
            _ if GEOMETRY.contains(&property) => mesh(),
            _ if factor(property).is_some() || property == DOUBLE_SIDED || is_texture(property) => material(),
            _ => None,
        };
        object.map(|object| (object, property)).ok_or_else(|| {
            let mut paths = self.parameters();
            paths.sort_by_cached_key(|known| strsim::osa_distance(known, path));
            paths.truncate(3);
            let help = format!("the nearest are {}", paths.join(", "));
            Error::option(path, "the scene has no such parameter").help(help)
        })
    }

    fn of_material(&self, material: &Material, property: &str) -> Option<Value> {
        // The tables of slots give places to write to, so a copy is asked.
        let mut material = material.clone();
        if let Some(slot) = slot(&mut material, property) {
            let texture = self.textures.get(slot.as_ref()?.texture as usize)?;
            return Some(Value::Picture { width: texture.width, texels: texture.texels.clone() });
        }
        match property {
            DOUBLE_SIDED => return Some(material.double_sided.into()),
            // An opaque surface ignores its opacity.
            "opacity" if material.alpha_mode == AlphaMode::Opaque => return Some(Value::Number(1.0)),
            _ if !has_effect(&material, property) => return None,
            _ => {}
        }
        let (_, numbers) = factor(property)?;
        match *numbers(&mut material) {
            [x, y, z] => Some(Vec3::new(x, y, z).into()),
            [number, ..] => Some(number.into()),
            [] => None,
        }
    }

    /// Sets a texture. A texture that other materials share stays as it is for them.
    fn set_picture(
        &mut self,
        material: usize,
        property: &str,
        (width, texels): (u32, Vec<[u8; 4]>),
    ) -> std::result::Result<(), Fault> {
        let height = texels.len() / width.max(1) as usize;
        if width == 0
            || height == 0
            || texels.len() != width as usize * height
            || width.max(height as u32) > MAX_SIDE
        {
            let help =
                format!("give an array of shape (h, w, 3) or (h, w, 4), of 1 to {MAX_SIDE} pixels a side");
            return Err((format!("it has {width}×{height} pixels"), help));
        }
        let Some(&mut old) = slot(&mut self.materials[material], property) else {
            return Err(("it is no picture".into(), "give numbers".into()));
        };
        let uses = |index: u32| {
            self.materials.iter().flat_map(Material::textures).filter(|(_, of)| of.texture == index).count()
        };
        let (name, height) = (property.to_owned(), height as u32);
        if let Some((of, texture)) = old.and_then(|of| Some((of, self.textures.get(of.texture as usize)?))) {
            let new = Texture { width, height, texels, ..texture.clone() };
            if uses(of.texture) == 1 {
                self.textures[of.texture as usize] = new;
                return Ok(());
            }
            self.textures.push(new);
        } else {
            let wrap = [Wrap::Repeat; 2];
            self.textures.push(Texture { name, width, height, texels, wrap, linear: true });
        }
        let texture = self.textures.len() as u32 - 1;
        let new = old.map_or(TextureRef::new(texture), |of| TextureRef { texture, ..of });
        slot(&mut self.materials[material], property).into_iter().for_each(|slot| *slot = Some(new));
        Ok(())
    }
}

/// The fault of a value, and the help.
pub(super) type Fault = (String, String);

fn properties(material: &Material) -> Vec<String> {
    let factors = FACTORS.iter().map(|(name, ..)| (*name).to_owned());
    let textures = material.textures().map(|(role, _)| texture_name(role));
    factors.chain([DOUBLE_SIDED.to_owned()]).chain(textures).collect()
}

pub(super) fn shape_fault(shape: &[usize], expected: &str) -> Fault {
    (format!("its shape is {shape:?}"), format!("give {expected}"))
}

/// One number, or three.
pub(super) fn numbers(value: Value, expected: &str) -> std::result::Result<Vec<f32>, Fault> {
    match value {
        Value::Number(number) => Ok(vec![number as f32]),
        Value::Numbers { shape, values } if shape == [values.len()] => Ok(values),
        Value::Numbers { shape, .. } => Err(shape_fault(&shape, expected)),
        _ => Err(("it is no number".into(), format!("give {expected}"))),
    }
}

fn set_material(material: &mut Material, property: &str, value: Value) -> std::result::Result<(), Fault> {
    if property == DOUBLE_SIDED {
        let Value::Flag(flag) = value else {
            return Err(("it is not yes or no".into(), "give true or false".into()));
        };
        material.double_sided = flag;
        return Ok(());
    }
    let Some((range, slots)) = factor(property) else {
        return Err((
            "it is no picture".into(),
            "give an array of shape (h, w, 3) or (h, w, 4), uint8".into(),
        ));
    };
    let is_color = slots(&mut material.clone()).len() == 3;
    let expected = if is_color { "a number, or three of a colour" } else { "a number" };
    let values = numbers(value, expected)?;
    for &value in &values {
        range
            .check(value)
            .map_err(|range| (format!("it is {value}"), format!("give {expected}, {range}")))?;
    }
    if property == "opacity"
        && values.iter().any(|&opacity| opacity < 1.0)
        && material.alpha_mode == AlphaMode::Opaque
    {
        material.alpha_mode = AlphaMode::Blend;
    }
    let slot = slots(material);
    match values[..] {
        [number] => slot.fill(number),
        _ if values.len() == slot.len() => slot.copy_from_slice(&values),
        _ => return Err(shape_fault(&[values.len()], expected)),
    }
    Ok(())
}

fn of_mesh(mesh: &Mesh, property: &str) -> Option<Value> {
    let rows = |width: usize, values: &[f32]| {
        let shape = vec![values.len() / width, width];
        (!values.is_empty()).then(|| Value::Numbers { shape, values: values.to_vec() })
    };
    match property {
        "vertices" => rows(3, bytemuck::cast_slice(&mesh.vertices)),
        "normals" => rows(3, bytemuck::cast_slice(&mesh.normals)),
        "uv" => rows(2, bytemuck::cast_slice(&mesh.texcoords[0])),
        "uv_2" => rows(2, bytemuck::cast_slice(&mesh.texcoords[1])),
        _ => Some(Value::Faces(mesh.faces.clone())),
    }
}

fn set_mesh(mesh: &mut Mesh, property: &str, value: Value) -> std::result::Result<(), Fault> {
    let width = if property.starts_with("uv") { 2 } else { 3 };
    let (shape, values) = match value {
        Value::Faces(faces) if property == "faces" => {
            mesh.faces = faces;
            return Ok(());
        }
        Value::Numbers { shape, values } if property != "faces" => (shape, values),
        _ => {
            return Err(("it is no array of numbers".into(), format!("give an array of shape (n, {width})")));
        }
    };
    if shape.len() != 2 || shape[1] != width || shape[0] * width != values.len() {
        return Err(shape_fault(&shape, &format!("an array of shape (n, {width})")));
    }
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        let what = format!("row {} has a value of {}", at / width, values[at]);
        return Err((what, "give finite numbers".into()));
    }
    let pairs = || values.as_chunks::<2>().0.iter().map(|&pair| Vec2::from_array(pair)).collect();
    let points =
        || -> Vec<Vec3> { values.as_chunks::<3>().0.iter().map(|&point| Vec3::from_array(point)).collect() };
    match property {
        "vertices" => mesh.vertices = points(),
        "normals" => mesh.normals = points().into_iter().map(|normal| unit(normal.as_dvec3())).collect(),
        "uv" => mesh.texcoords[0] = pairs(),
        _ => mesh.texcoords[1] = pairs(),
    }
    Ok(())
}
