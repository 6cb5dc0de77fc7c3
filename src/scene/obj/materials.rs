//! Conversion of `.mtl` entries to materials.
//!
//! The format has no physical definition, so krylux interprets it as follows. Colours are linear, and pictures are sRGB.
//!
//! | `.mtl` | material |
//! |---|---|
//! | no material, or a material that no existing library defines | matte, 0.8 |
//! | a map whose picture is missing or has a format that is not read | the material without the map |
//! | a picture or library at an absolute path | the file with the same name next to the scene |
//! | `Kd`, `map_Kd` | base colour; with `Kd` 0, a `map_Kd` has its full colours, because it would otherwise be black |
//! | `Ks` with `illum` 2 or more (or no `illum`) | coat with reflectance `2 Ks ((n−1)/(n+1))²` at normal incidence: `Ks` 0.5 is plastic of `n` = 1.5, as exporters write it |
//! | `Ks` with `Kd` 0 | metal with base colour `Ks` |
//! | `Ns` | microfacet width `α = √(2/(Ns+2))` |
//! | `Pr`, `Pm` | roughness and metallic, which replace the values above |
//! | `Ni` above 1 | index of refraction; 1.5 otherwise |
//! | `Kd xyz` and other colours with `xyz` | CIE XYZ, whose white is D65, as linear sRGB; a colour `spectral` is ignored with a warning |
//! | `d` (also `-halo`), `Tr`, `map_d` | coverage; `Tr` 1 is full coverage, because the surface would otherwise be invisible |
//! | `illum` 4, 6, 7, 9 with `Tf`, or with `d` 1 | solid smooth glass (an object's surface is closed), tinted by `Tf` at each crossing |
//! | `Ke`, `map_Ke` | emission |
//! | `norm` | normal map |

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{Mat3, Vec3};
use indexmap::IndexSet;

use super::maps::Maps;
use super::statements::{Checked, Line, UNNAMED, shortened, statements};
use crate::error::Result;
use crate::scene::source::{self, SceneFile};
use crate::scene::{AlphaMode, Material, Texture, Volume};

pub(super) struct ObjMaterials {
    pub list: Vec<Material>,
    pub textures: Vec<Texture>,
    /// The index into `list` for each index into [`Checked::materials`].
    index_of: Vec<u32>,
    /// The index of the default material, for faces without a material or with an undefined material.
    matte: u32,
    /// Copies of materials without their textures, for faces without texture coordinates.
    bare: HashMap<u32, u32>,
}

impl ObjMaterials {
    pub(super) fn of(&self, face: Option<u32>) -> u32 {
        face.and_then(|face| self.index_of.get(face as usize).copied()).unwrap_or(self.matte)
    }

    /// The material `material` without its textures, with a warning. If the scene is read strictly, this is an error.
    pub(super) fn without_textures(&mut self, material: u32, file: &mut SceneFile) -> Result<u32> {
        if let Some(&bare) = self.bare.get(&material) {
            return Ok(bare);
        }
        let mut bare = self.list[material as usize].clone();
        file.tolerate(
            format!("faces of material `{}` have no texture coordinates, but it has a texture", bare.name),
            "they are shown without it",
            "unwrap the mesh, or remove the texture from the material",
        )?;
        bare.retain_textures(|_| false);
        self.list.push(bare);
        let index = self.list.len() as u32 - 1;
        self.bare.insert(material, index);
        Ok(index)
    }
}

fn without_comment(name: &str) -> &str {
    name.find(" #").or_else(|| name.find("\t#")).map_or(name, |end| name[..end].trim_end())
}

/// Reads the libraries of the file and converts the entries that its faces use.
pub(super) fn load(checked: &Checked, file: &mut SceneFile) -> Result<ObjMaterials> {
    let mut found: HashMap<String, MtlEntry> = HashMap::new();
    for library in libraries(&checked.libraries, file)? {
        if !file.strict && source::is_missing(&library) {
            file.warn(format!("the material library {} is missing", library.display()));
            continue;
        }
        let bytes = file.read_other("mtllib", &library)?;
        for entry in entries(&library, &source::text(&bytes), file)? {
            // A number sign may begin a comment, or be a part of the name.
            let plain = without_comment(&entry.name);
            if plain != entry.name {
                found.entry(plain.to_owned()).or_insert_with(|| entry.clone());
            }
            found.insert(entry.name.clone(), entry);
        }
    }
    let mut maps = Maps::default();
    let mut list = Vec::new();
    let mut indices = Vec::new();
    for name in &checked.materials {
        let entry = found.get(name).or_else(|| found.get(without_comment(name)));
        indices.push(entry.map(|_| list.len() as u32));
        match entry {
            Some(entry) => list.push(convert(entry, &mut maps, file)?),
            None => file.warn(format!("material `{name}` is in no library; its faces are matte")),
        }
    }
    let matte = list.len() as u32;
    list.push(Material { name: "matte".into(), base_color: Vec3::splat(0.8), ..Material::default() });
    let index_of = indices.into_iter().map(|index| index.unwrap_or(matte)).collect();
    Ok(ObjMaterials { list, textures: maps.textures, index_of, matte, bare: HashMap::new() })
}

/// Finds the library files. A name may contain spaces, a line may have several names, and a comment may follow.
fn libraries(lines: &IndexSet<String>, scene: &SceneFile) -> Result<IndexSet<PathBuf>> {
    let mut files = IndexSet::new();
    let mut count = 0;
    let resolve = |name: &str| {
        scene.resolve(name).map_err(|what| {
            let name = name.replace('\\', "/");
            scene
                .fault(format!("mtllib: `{name}` is {what}; only files next to the scene are read"))
                .help("put the library next to the scene and refer to it by a relative path")
        })
    };
    for line in lines {
        let whole = resolve(line)?;
        if whole.is_file() || !line.contains(char::is_whitespace) {
            files.insert(whole);
            count += 1;
        } else {
            // Some exporters write a backslash before each space of a name.
            let line = without_comment(line).replace("\\ ", " ");
            for name in names(&line, |name| resolve(name).is_ok_and(|file| file.is_file())) {
                files.insert(resolve(name)?);
                count += 1;
            }
        }
        if count > MAX_LIBRARIES {
            let what = format!("more than {MAX_LIBRARIES} names of material libraries");
            return Err(scene.fault(what).help("join them into one library"));
        }
    }
    Ok(files)
}

/// The largest number of library names in a file. Each library may be a large file, and the search for a library tries many names.
const MAX_LIBRARIES: usize = 256;

/// The largest number of words of a line that may form one name with spaces.
const MAX_WORDS: usize = 64;

/// Splits a line into names. A name is the longest sequence of words that names a file. If there is no such sequence, the name ends at the
/// first `.mtl`. The list has at most one name more than [`MAX_LIBRARIES`].
fn names(line: &str, is_file: impl Fn(&str) -> bool) -> Vec<&str> {
    let words: Vec<[usize; 2]> = line
        .split_whitespace()
        .map(|word| {
            let start = word.as_ptr() as usize - line.as_ptr() as usize;
            [start, start + word.len()]
        })
        .collect();
    let mut names = Vec::new();
    let mut first = 0;
    while first < words.len() && names.len() <= MAX_LIBRARIES {
        let name = |last: usize| &line[words[first][0]..words[last][1]];
        let end = words.len().min(first + MAX_WORDS);
        let ends_well = |last: &usize| name(*last).to_ascii_lowercase().ends_with(".mtl");
        let last = (first..end).rev().find(|&last| is_file(name(last)));
        let last = last.or_else(|| (first..end).find(ends_well)).unwrap_or(end - 1);
        names.push(name(last));
        first = last + 1;
    }
    names
}

/// The supported statements of a material, by their keywords.
#[derive(Clone, Default)]
struct MtlEntry {
    name: String,
    colors: HashMap<String, Vec3>,
    /// The numeric statements. `Tr` is stored as `d`.
    numbers: HashMap<String, f32>,
    maps: HashMap<String, String>,
}

fn entries(path: &Path, text: &str, file: &mut SceneFile) -> Result<Vec<MtlEntry>> {
    let mut entries: Vec<MtlEntry> = Vec::new();
    statements(path, text, |line| {
        if line.keyword == "newmtl" {
            let name = if line.rest.is_empty() { UNNAMED } else { line.rest };
            entries.push(MtlEntry { name: name.to_owned(), ..MtlEntry::default() });
            return Ok(());
        }
        let Some(entry) = entries.last_mut() else {
            return Err(line.fault("no `newmtl` comes before it"));
        };
        if !entry.state(line)? {
            let spectral = if is_spectral(line) { " spectral" } else { "" };
            let (name, keyword) = (shortened(&entry.name), shortened(line.keyword));
            let what = format!("material `{name}`: `{keyword}{spectral}` is not supported and ignored");
            file.warn_once(&what, format!("{what} ({})", line.place()));
        }
        Ok(())
    })?;
    Ok(entries)
}

impl MtlEntry {
    /// Stores a statement. Returns whether it is supported.
    fn state(&mut self, line: &Line<'_>) -> Result<bool> {
        let keyword = line.keyword;
        let (keyword, number) = match keyword {
            "Kd" | "Ks" | "Ke" | "Tf" if is_spectral(line) => return Ok(false),
            "Kd" | "Ks" | "Ke" | "Tf" => {
                self.colors.insert(keyword.to_owned(), color(line)?);
                return Ok(true);
            }
            "map_Kd" | "map_d" | "map_Ke" | "norm" if line.rest.is_empty() => {
                return Err(line.fault(format!("`{keyword}` names no picture")));
            }
            "map_Kd" | "map_d" | "map_Ke" | "norm" => {
                self.maps.insert(keyword.to_owned(), line.rest.to_owned());
                return Ok(true);
            }
            "Ns" | "Ni" => (keyword, not_negative(line)?),
            "Pr" | "Pm" => (keyword, fraction(line)?),
            // With `-halo`, the number is the coverage of a surface at normal incidence.
            "d" => ("d", fraction(&line.after("-halo").unwrap_or(*line))?),
            // A material without any coverage would be invisible. Exporters such as MeshLab write a `Tr` of 1 for full coverage.
            "Tr" => match fraction(line)? {
                1.0 => ("d", 1.0),
                transparency => ("d", 1.0 - transparency),
            },
            "illum" => match line.number()? {
                model if (0.0..=10.0).contains(&model) && model.fract() == 0.0 => (keyword, model),
                _ => return Err(line.fault("`illum` takes an integer from 0 to 10")),
            },
            // Ambient colour is not supported, and `sharpness` applies to environment maps only.
            "Ka" | "map_Ka" | "sharpness" | "map_aat" => return Ok(true),
            _ => return Ok(false),
        };
        self.numbers.insert(keyword.to_owned(), number);
        Ok(true)
    }
}

fn is_spectral(line: &Line<'_>) -> bool {
    line.words().next() == Some("spectral")
}

/// The matrix from CIE XYZ to linear sRGB (IEC 61966-2-1), with white D65.
const XYZ_TO_RGB: Mat3 =
    Mat3::from_cols_array(&[3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415, 1.0570]);

/// Reads a colour: `r g b`, `xyz x y z`, or one number for all three channels. Negative sRGB components of an `xyz` colour become 0.
fn color(line: &Line<'_>) -> Result<Vec3> {
    let xyz = line.after("xyz");
    let line = xyz.as_ref().unwrap_or(line);
    let color = match *line.numbers()? {
        [all] => Vec3::splat(all),
        [red, green, blue] => Vec3::new(red, green, blue),
        _ => return Err(line.fault("a colour is one or three numbers")),
    };
    if color.min_element() < 0.0 {
        return Err(line.fault("a colour is negative"));
    }
    Ok(if xyz.is_some() { (XYZ_TO_RGB * color).max(Vec3::ZERO) } else { color })
}

fn not_negative(line: &Line<'_>) -> Result<f32> {
    match line.number()? {
        number if number >= 0.0 => Ok(number),
        _ => Err(line.fault(format!("`{}` is negative", line.keyword))),
    }
}

fn fraction(line: &Line<'_>) -> Result<f32> {
    match line.number()? {
        number if (0.0..=1.0).contains(&number) => Ok(number),
        _ => Err(line.fault(format!("`{}` lies outside 0 to 1", line.keyword))),
    }
}

fn convert(entry: &MtlEntry, maps: &mut Maps, file: &mut SceneFile) -> Result<Material> {
    let color = |keyword: &str| entry.colors.get(keyword).copied();
    let clamped = |keyword: &str| color(keyword).map(|color| color.min(Vec3::ONE));
    let number = |keyword: &str| entry.numbers.get(keyword).copied();
    let map = |keyword: &str| entry.maps.get(keyword).map(String::as_str);
    let (metallic, model) = (number("Pm"), number("illum").map(|model| model as u8));
    let diffuse = clamped("Kd").unwrap_or(Vec3::splat(0.8));
    // A black base colour would hide the picture. Exporters expect the picture's full colours in this case.
    let diffuse = if map("map_Kd").is_some() && diffuse == Vec3::ZERO { Vec3::ONE } else { diffuse };
    let shiny = model.is_none_or(|model| model >= 2);
    let specular = clamped("Ks").filter(|_| shiny).unwrap_or(Vec3::ZERO);
    let opacity = number("d").unwrap_or(1.0);
    let glass = matches!(model, Some(4 | 6 | 7 | 9))
        && (color("Tf").is_some() || (opacity == 1.0 && map("map_d").is_none()));
    let metal = !glass
        && metallic.is_none()
        && diffuse.max_element() < 0.01
        && specular.max_element() > 0.1
        && map("map_Kd").is_none();
    let roughness = match (number("Pr"), number("Ns")) {
        (Some(roughness), _) => roughness,
        _ if glass => 0.0,
        // Roughness is the square root of the microfacet width `α`.
        (None, Some(exponent)) => (2.0 / (exponent + 2.0)).sqrt().sqrt(),
        // Illumination models from 3 on trace reflections.
        (None, None) => f32::from(u8::from(model.is_none_or(|model| model < 3))),
    };
    let mut material = Material {
        name: entry.name.clone(),
        base_color: diffuse,
        roughness,
        metallic: metallic.unwrap_or(0.0),
        // Exporters write an index of 1 if they do not know the index.
        ior: number("Ni").filter(|ior| *ior > 1.0).unwrap_or(1.5),
        emission: color("Ke").unwrap_or(Vec3::ZERO),
        ..Material::default()
    };
    if glass {
        material.base_color = clamped("Tf").unwrap_or(Vec3::ONE);
        material.specular = 1.0;
        material.transmission = 1.0;
        material.ior = number("Ni").filter(|ior| *ior >= 1.0).unwrap_or(1.5);
        material.volume = Some(Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY });
    } else if metal {
        material.base_color = specular;
        material.metallic = 1.0;
    } else if specular != Vec3::ZERO || metallic.is_some() {
        material.specular = 1.0;
        material.specular_color = if metallic.is_some() { Vec3::ONE } else { 2.0 * specular };
    }
    if !glass && (opacity < 1.0 || map("map_d").is_some()) {
        material.opacity = opacity;
        material.alpha_mode = AlphaMode::Blend;
    }
    let [base, dissolve] = ["map_Kd", "map_d"].map(|keyword| map(keyword).filter(|_| !glass));
    material.base_color_texture = maps.texture(&entry.name, [base, dissolve], file)?;
    material.emission_texture = maps.texture(&entry.name, [map("map_Ke"), None], file)?;
    material.normal_texture = maps.texture(&entry.name, [map("norm"), None], file)?;
    Ok(material)
}
