//! The writer of `.glb` files. The loader reads the same numbers, to the last bit.
//!
//! glTF states a camera by an angle and a matrix, and the place of a picture by an angle and a scale. Where the loader would round them
//! differently, the extras have the exact numbers as well (`krylux_exact`). The loader uses these unless another program has changed what
//! they stand for.

use glam::{Affine2, DVec3, Vec2, Vec3};
use serde_json::{Map, Value, json};

use super::cameras::{Exact, frame};
use super::extensions::UNLABELLED;
use super::{assemble_chunks, textures};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::scene::camera::tan_half;
use crate::scene::triangle::unit;
use crate::scene::{AlphaMode, Camera, EditableScene, Lens, Material, Mesh, Texture, TextureRef, Wrap};

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

/// The bytes of the `.glb` file, which are the same on every machine. The scene has been checked.
pub(in crate::scene) fn write(scene: &EditableScene) -> Result<Vec<u8>> {
    // Textures are in the order of their first use, as the loader lists them.
    let (mut materials, mut textures) = (scene.materials.clone(), Vec::new());
    for (_, slot) in materials.iter_mut().flat_map(Material::texture_slots) {
        let Some(TextureRef { texture, .. }) = slot else { continue };
        let place = textures.iter().position(|of| of == texture);
        if place.is_none() {
            textures.push(*texture);
        }
        // The number of textures is far below 2³².
        *texture = place.unwrap_or(textures.len() - 1) as u32;
    }
    let textures: Vec<&Texture> =
        textures.iter().filter_map(|&texture| scene.textures.get(texture as usize)).collect();
    let pictures = textures.iter().map(|texture| png(texture)).collect::<Result<Vec<_>>>()?;
    let file = file(scene, &materials, (&textures, &pictures));
    if u32::try_from(file.len()).is_err() {
        let fault = format!("its file would have {} bytes", file.len());
        return Err(
            Error::option("scene", fault).help("a .glb file has less than 4 GiB: simplify the meshes")
        );
    }
    Ok(file)
}

/// Works like [`write()`], for a small scene whose materials have no textures.
pub(in crate::scene) fn write_without_pictures(scene: &EditableScene) -> Vec<u8> {
    file(scene, &scene.materials, (&[], &[]))
}

fn png(texture: &Texture) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, texture.width, texture.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let written =
        encoder.write_header().and_then(|mut writer| writer.write_image_data(texture.texels.as_flattened()));
    written.map_err(|error| {
        let fault = format!("it has {}x{} pixels ({error})", texture.width, texture.height);
        Error::option(&texture.name, fault).help("give a texel for each pixel")
    })?;
    Ok(file)
}

fn file(
    scene: &EditableScene,
    materials: &[Material],
    (textures, pictures): (&[&Texture], &[Vec<u8>]),
) -> Vec<u8> {
    let mut binary = Binary::default();
    let (mut nodes, mut meshes) = (Vec::new(), Vec::new());
    // The meshes of one region are the primitives of one node, unless regions are labels, which several nodes may share.
    let alike = |a: &Mesh, b: &Mesh| !scene.regions_are_labels && a.region == b.region;
    for (index, run) in scene.meshes.chunk_by(alike).enumerate() {
        let region = scene.regions.get(run[0].region as usize);
        let name = region.filter(|_| !scene.regions_are_labels).unwrap_or(&run[0].name);
        let primitives: Vec<Value> = run.iter().map(|mesh| binary.primitive(mesh)).collect();
        meshes.push(json!({ "name": name, "primitives": primitives }));
        let mut node = json!({ "name": name, "mesh": index });
        if let Some(label) = region.filter(|name| scene.regions_are_labels && *name != UNLABELLED) {
            let label = label.parse::<u64>().map_or_else(|_| json!(label), |number| json!(number));
            node["extras"] = json!({ "region": label });
        }
        nodes.push(node);
    }
    let projector = scene.projector.as_ref().map(|camera| (camera, Some(scene.projector_resolution)));
    let endpoints: Vec<_> = scene.camera.iter().map(|camera| (camera, None)).chain(projector).collect();
    nodes.extend(
        endpoints.iter().enumerate().map(|(index, (camera, role))| camera_node(camera, index, *role)),
    );
    let mut used = Vec::from(["KHR_materials_specular"]);
    let materials: Vec<Value> = materials.iter().map(|of| material(of, &mut used)).collect();
    let images: Vec<Value> = pictures.iter().map(|png| binary.image(png)).collect();
    let mut document = json!({
        "asset": { "version": "2.0", "generator": "krylux" },
        "scene": 0,
        "scenes": [{ "name": scene.name, "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes.len() }],
        "extensionsUsed": used,
    });
    if !endpoints.is_empty() {
        document["cameras"] =
            endpoints.iter().map(|(camera, role)| perspective(camera, role.is_some())).collect();
    }
    if !images.is_empty() {
        document["samplers"] = textures.iter().map(|texture| sampler(texture)).collect();
        document["textures"] =
            (0..images.len()).map(|index| json!({ "source": index, "sampler": index })).collect();
        document["images"] = json!(images);
    }
    assemble_chunks(document.to_string().into_bytes(), binary.bytes)
}

/// The binary chunk while it is built, with its buffer views and accessors.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    fn primitive(&mut self, mesh: &Mesh) -> Value {
        let count = mesh.vertices.len();
        let [low, high] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let low = mesh.vertices.iter().copied().fold(low, Vec3::min);
        let high = mesh.vertices.iter().copied().fold(high, Vec3::max);
        let position = self.floats(bytemuck::cast_slice(&mesh.vertices), "VEC3", count);
        self.accessors[position]["min"] = json!(low.to_array());
        self.accessors[position]["max"] = json!(high.to_array());
        let mut attributes = json!({ "POSITION": position });
        let indices = self.indices(mesh);
        if !mesh.normals.is_empty() {
            let normals: Vec<Vec3> = mesh.normals.iter().map(|normal| unit(normal.as_dvec3())).collect();
            attributes["NORMAL"] = json!(self.floats(bytemuck::cast_slice(&normals), "VEC3", count));
        }
        for (set, texcoords) in mesh.texcoords.iter().enumerate().filter(|(_, of)| !of.is_empty()) {
            let accessor = self.floats(bytemuck::cast_slice(texcoords), "VEC2", count);
            attributes[format!("TEXCOORD_{set}")] = json!(accessor);
        }
        if !mesh.colors.is_empty() {
            let bytes = mesh.colors.as_flattened().iter().flat_map(|channel| channel.to_le_bytes());
            let accessor = json!({ "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4", "count": count });
            attributes["COLOR_0"] = json!(self.accessor(bytes, accessor));
        }
        json!({ "attributes": attributes, "indices": indices, "material": mesh.material })
    }

    fn floats(&mut self, values: &[f32], kind: &str, count: usize) -> usize {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.accessor(bytes, json!({ "componentType": FLOAT, "type": kind, "count": count }))
    }

    /// Indices are `u16` if they fit, otherwise `u32`.
    fn indices(&mut self, mesh: &Mesh) -> usize {
        let all = || mesh.faces.as_flattened().iter();
        let accessor =
            |kind: u32| json!({ "componentType": kind, "type": "SCALAR", "count": 3 * mesh.faces.len() });
        // The format reserves the largest index of each integer type for primitive restart.
        if mesh.vertices.len() < usize::from(u16::MAX) {
            self.accessor(all().flat_map(|&index| (index as u16).to_le_bytes()), accessor(UNSIGNED_SHORT))
        } else {
            self.accessor(all().flat_map(|index| index.to_le_bytes()), accessor(UNSIGNED_INT))
        }
    }

    fn image(&mut self, png: &[u8]) -> Value {
        json!({ "mimeType": "image/png", "bufferView": self.view(png.iter().copied()) })
    }

    /// Adds `accessor` for these bytes. Returns its index.
    fn accessor(&mut self, bytes: impl Iterator<Item = u8>, mut accessor: Value) -> usize {
        accessor["bufferView"] = json!(self.view(bytes));
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: impl Iterator<Item = u8>) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
        self.views.len() - 1
    }
}

/// The power of two that divides an emission without rounding, to the factors up to 1 that the format allows.
fn strength(of: &Material) -> f32 {
    let exponent = of.emission.max_element().max(1.0).log2().ceil() as i32;
    2_f32.powi(exponent.min(127))
}

/// The keys of textures, and the textures, if there are any.
type Slots<'a> = &'a [(&'a str, &'a Option<TextureRef>)];

fn extensions(of: &Material, used: &mut Vec<&'static str>) -> Map<String, Value> {
    let mut specular = json!({ "specularFactor": of.specular });
    if of.specular_color != Vec3::ONE {
        specular["specularColorFactor"] = json!(of.specular_color.to_array());
    }
    let mut volume = json!({ "thicknessFactor": 1.0 });
    if let Some(of) = of.volume {
        volume["attenuationColor"] = json!(of.attenuation_color.to_array());
        if of.attenuation_distance.is_finite() {
            volume["attenuationDistance"] = json!(of.attenuation_distance);
        }
    }
    let strength = strength(of);
    let diffuse = json!({
        "diffuseTransmissionFactor": of.diffuse_transmission,
        "diffuseTransmissionColorFactor": of.diffuse_transmission_color.to_array(),
    });
    let is_diffuse = of.diffuse_transmission != 0.0 || of.diffuse_transmission_color != Vec3::ONE;
    let of_specular =
        [("specularTexture", &of.specular_texture), ("specularColorTexture", &of.specular_color_texture)];
    let of_diffuse = [
        ("diffuseTransmissionTexture", &of.diffuse_transmission_texture),
        ("diffuseTransmissionColorTexture", &of.diffuse_transmission_color_texture),
    ];
    // The name, whether the factors need it, the factors, and the textures, which need it as well.
    let all: [(_, bool, Value, Slots<'_>); 6] = [
        ("KHR_materials_specular", true, specular, &of_specular),
        ("KHR_materials_ior", of.ior != 1.5, json!({ "ior": of.ior }), &[]),
        ("KHR_materials_emissive_strength", strength > 1.0, json!({ "emissiveStrength": strength }), &[]),
        ("KHR_materials_volume", of.volume.is_some(), volume, &[]),
        (
            "KHR_materials_transmission",
            of.transmission != 0.0,
            json!({ "transmissionFactor": of.transmission }),
            &[("transmissionTexture", &of.transmission_texture)],
        ),
        ("KHR_materials_diffuse_transmission", is_diffuse, diffuse, &of_diffuse),
    ];
    let mut extensions = Map::new();
    for (name, is_used, mut value, textures) in all {
        if is_used || textures.iter().any(|(_, texture)| texture.is_some()) {
            textures.iter().for_each(|(key, texture)| put(&mut value, key, texture, used));
            extensions.insert(name.into(), value);
            note(used, name);
        }
    }
    extensions
}

fn material(of: &Material, used: &mut Vec<&'static str>) -> Value {
    let [red, green, blue] = of.base_color.to_array();
    let mut surface = json!({
        "baseColorFactor": [red, green, blue, of.opacity],
        "metallicFactor": of.metallic,
        "roughnessFactor": of.roughness,
    });
    put(&mut surface, "baseColorTexture", &of.base_color_texture, used);
    put(&mut surface, "metallicRoughnessTexture", &of.metallic_roughness_texture, used);
    let mut value = json!({
        "name": of.name,
        "pbrMetallicRoughness": surface,
        "doubleSided": of.double_sided,
        "extensions": extensions(of, used),
    });
    put(&mut value, "normalTexture", &of.normal_texture, used);
    if of.normal_texture.is_some() {
        value["normalTexture"]["scale"] = json!(of.normal_scale);
    }
    put(&mut value, "emissiveTexture", &of.emission_texture, used);
    if of.emission != Vec3::ZERO {
        value["emissiveFactor"] = json!((of.emission / strength(of)).to_array());
    }
    match of.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Blend => value["alphaMode"] = json!("BLEND"),
        AlphaMode::Mask { cutoff } => {
            value["alphaMode"] = json!("MASK");
            value["alphaCutoff"] = json!(cutoff);
        }
    }
    value
}

fn note(used: &mut Vec<&'static str>, name: &'static str) {
    if !used.contains(&name) {
        used.push(name);
    }
}

/// Adds a reference to a texture, if there is one.
fn put(to: &mut Value, key: &str, texture: &Option<TextureRef>, used: &mut Vec<&'static str>) {
    let Some(TextureRef { texture, set, transform }) = texture else { return };
    let mut value = json!({ "index": texture, "texCoord": set });
    if *transform != Affine2::IDENTITY {
        let [x, y, offset] = [transform.x_axis, transform.y_axis, transform.translation];
        let rotation = (-x.y).atan2(x.x);
        let scale = Vec2::new(x.length(), y.dot(Vec2::new(rotation.sin(), rotation.cos())));
        note(used, textures::TRANSFORM);
        let stated = json!({ "offset": offset.to_array(), "rotation": rotation, "scale": scale.to_array() });
        value["extensions"] = json!({ textures::TRANSFORM: stated });
        if textures::transform(scale, rotation, offset) != *transform {
            value["extras"] = json!({ "krylux_exact": transform.to_cols_array() });
        }
    }
    to[key] = value;
}

fn sampler(texture: &Texture) -> Value {
    let wrap = |wrap| match wrap {
        Wrap::Repeat => 10497,
        Wrap::MirroredRepeat => 33648,
        Wrap::ClampToEdge => 33071,
    };
    let [u, v] = texture.wrap.map(wrap);
    json!({ "magFilter": if texture.linear { 9729 } else { 9728 }, "wrapS": u, "wrapT": v })
}

/// The angle that states a field of view, rounded to single precision, so that it is the same on every machine.
fn angle(camera: &Camera) -> f32 {
    (2.0 * f64::from(camera.tan_half_fov).atan()) as f32
}

fn perspective(camera: &Camera, is_projector: bool) -> Value {
    // The format requires a near plane.
    let mut perspective = json!({ "yfov": angle(camera), "znear": 0.001 });
    if let Some(aspect) = camera.aspect {
        perspective["aspectRatio"] = json!(aspect);
    }
    let name = if is_projector { "projector" } else { "rig" };
    json!({ "name": name, "type": "perspective", "perspective": perspective })
}

/// The node of a camera, or of a projector with the resolution in `role`. Its pose is a matrix instead of a quaternion, so that axes such as
/// −Y are read back exactly.
fn camera_node(camera: &Camera, index: usize, role: Option<Option<Resolution>>) -> Value {
    let Camera { right, up, forward, position, tan_half_fov, lens, .. } = camera;
    let columns = [right.extend(0.0), up.extend(0.0), -forward.extend(0.0), position.extend(1.0)];
    let matrix: Vec<f32> =
        columns.iter().flat_map(|column| column.to_array()).map(|value| value + 0.0).collect();
    let mut node = json!({ "name": camera.name, "camera": index, "matrix": matrix });
    let mut extras = Map::new();
    if let Some(resolution) = role {
        extras.insert("krylux".into(), json!("projector"));
        if let Some(Resolution { width, height }) = resolution {
            extras.insert("resolution".into(), json!([width, height]));
        }
    }
    if *lens != Lens::PINHOLE && lens.radius > 0.0 {
        extras.insert("aperture_radius".into(), json!(lens.radius));
        extras.insert("focus_distance".into(), json!(lens.focus));
    }
    let axis = |axis: &Vec3| axis.as_dvec3().normalize_or_zero() + DVec3::ZERO;
    let read = frame(axis(right), axis(&-*forward)).map(|axis| axis.as_vec3());
    if read != [*right, *up, *forward] || tan_half(f64::from(angle(camera))) != Some(*tan_half_fov) {
        let exact = Exact { axes: [*right, *up, *forward], tan_half_fov: *tan_half_fov };
        extras.insert("krylux_exact".into(), json!(exact));
    }
    if !extras.is_empty() {
        node["extras"] = extras.into();
    }
    node
}
