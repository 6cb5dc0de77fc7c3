//! Material libraries, as they stand in the file.

use std::path::Path;

use glam::Vec3;

use super::line::{Line, shortened, statements};
use crate::error::Result;
use crate::scene::source::Warnings;

/// A material of an `.mtl` file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Entry {
    pub name: String,
    pub diffuse: Option<Vec3>,
    pub specular: Option<Vec3>,
    pub emission: Option<Vec3>,
    /// `Tf`.
    pub filter: Option<Vec3>,
    /// `Ns`.
    pub exponent: Option<f32>,
    /// `Ni`.
    pub ior: Option<f32>,
    /// `d`, or 1 − `Tr`.
    pub dissolve: Option<f32>,
    /// `illum`.
    pub model: Option<u32>,
    /// `Pr`.
    pub roughness: Option<f32>,
    /// `Pm`.
    pub metallic: Option<f32>,
    /// `map_Kd`, with its options.
    pub diffuse_map: Option<String>,
    /// `map_d`.
    pub dissolve_map: Option<String>,
    /// `map_Ke`.
    pub emission_map: Option<String>,
    /// `norm`.
    pub normal_map: Option<String>,
}

/// The materials of a library in its order.
pub(super) fn parse(path: &Path, text: &str, warnings: &mut Warnings) -> Result<Vec<Entry>> {
    let mut entries: Vec<Entry> = Vec::new();
    statements(path, text, |line| {
        if line.keyword == "newmtl" {
            entries.push(Entry { name: line.rest.into(), ..Entry::default() });
            return Ok(());
        }
        match entries.last_mut() {
            Some(entry) => entry.set(line, warnings),
            None => Err(line.fault("no `newmtl` comes before it")),
        }
    })?;
    Ok(entries)
}

impl Entry {
    fn set(&mut self, line: &Line<'_>, warnings: &mut Warnings) -> Result<()> {
        match line.keyword {
            "Kd" => self.diffuse = Some(color(line)?),
            "Ks" => self.specular = Some(color(line)?),
            "Ke" => self.emission = Some(color(line)?),
            "Tf" => self.filter = Some(color(line)?),
            "Ns" => self.exponent = Some(not_negative(line)?),
            "Ni" => self.ior = Some(not_negative(line)?),
            "d" => self.dissolve = Some(fraction(line)?),
            "Tr" => self.dissolve = Some(1.0 - fraction(line)?),
            "Pr" => self.roughness = Some(fraction(line)?),
            "Pm" => self.metallic = Some(fraction(line)?),
            "illum" => {
                let model = line.number()?;
                if !(0.0..=10.0).contains(&model) || model.fract() != 0.0 {
                    return Err(line.fault("`illum` takes an integer from 0 to 10"));
                }
                self.model = Some(model as u32);
            }
            "map_Kd" => self.diffuse_map = Some(map(line)?),
            "map_d" => self.dissolve_map = Some(map(line)?),
            "map_Ke" => self.emission_map = Some(map(line)?),
            "norm" => self.normal_map = Some(map(line)?),
            // Ambient light is not made up here, and a reflection's sharpness belongs to environment maps.
            "Ka" | "map_Ka" | "sharpness" | "map_aat" => {}
            other => warnings.add(format!(
                "material `{}`: `{}` is not supported and ignored",
                shortened(&self.name),
                shortened(other)
            )),
        }
        Ok(())
    }
}

/// `r g b`, or one number for all three.
fn color(line: &Line<'_>) -> Result<Vec3> {
    if line.rest.starts_with("spectral") || line.rest.starts_with("xyz") {
        return Err(line.fault("only RGB colours are supported"));
    }
    let color = match line.numbers()?.as_slice() {
        [all] => Vec3::splat(*all),
        [red, green, blue] => Vec3::new(*red, *green, *blue),
        _ => return Err(line.fault("a colour is one or three numbers")),
    };
    if color.min_element() < 0.0 {
        return Err(line.fault("a colour is negative"));
    }
    Ok(color)
}

fn not_negative(line: &Line<'_>) -> Result<f32> {
    match line.number()? {
        number if number >= 0.0 => Ok(number),
        _ => Err(line.fault(&format!("`{}` is negative", line.keyword))),
    }
}

fn fraction(line: &Line<'_>) -> Result<f32> {
    match line.number()? {
        number if (0.0..=1.0).contains(&number) => Ok(number),
        _ => Err(line.fault(&format!("`{}` lies outside 0 to 1", line.keyword))),
    }
}

fn map(line: &Line<'_>) -> Result<String> {
    if line.rest.is_empty() {
        return Err(line.fault(&format!("`{}` names no picture", line.keyword)));
    }
    Ok(line.rest.into())
}
