//! Material libraries, read by `tobj`.
//!
//! `tobj` reports errors without line numbers, accepts any number, and panics on a colour with fewer than three numbers. The
//! statements are therefore checked first. `tobj` gets only supported ones, each colour with three numbers, and `Tr` as `d`.

use std::path::Path;

use super::line::{Line, shortened, statements};
use crate::error::Result;
use crate::scene::source::{Warnings, fault};

/// The name of a material whose name is left out.
pub(super) const UNNAMED: &str = "unnamed";

/// The materials of a library in order. Statements unknown to `tobj` are in `unknown_param`: `Tf`, `Pr`, `Pm`, `map_Ke`, `norm`.
pub(super) fn read(path: &Path, text: &str, warnings: &mut Warnings) -> Result<Vec<tobj::Material>> {
    let mut checked = String::new();
    let mut material = None;
    statements(path, text, |line| {
        let statement = match (line.keyword, &material) {
            ("newmtl", _) if line.rest.is_empty() => {
                material = Some(UNNAMED.to_owned());
                Some(format!("newmtl {UNNAMED}"))
            }
            ("newmtl", _) => {
                material = Some(shortened(line.rest));
                Some(format!("newmtl {}", line.rest))
            }
            (_, None) => return Err(line.fault("no `newmtl` comes before it")),
            _ => check(line)?,
        };
        match (statement, &material) {
            (Some(statement), _) => checked.extend([&statement, "\n"]),
            (None, material) => warnings.add(format!(
                "material `{}`: `{}` is not supported and ignored",
                material.as_deref().unwrap_or_default(),
                shortened(line.keyword)
            )),
        }
        Ok(())
    })?;
    let read = tobj::load_mtl_buf(&mut checked.as_bytes());
    let (materials, _) =
        read.map_err(|error| fault(path, error.to_string(), "export the materials again"))?;
    Ok(materials)
}

/// The statement for `tobj`; empty if it has no effect, `None` if it is not supported.
fn check(line: &Line<'_>) -> Result<Option<String>> {
    let keyword = line.keyword;
    Ok(Some(match keyword {
        "Kd" | "Ks" | "Ke" | "Tf" => {
            let [red, green, blue] = color(line)?;
            format!("{keyword} {red} {green} {blue}")
        }
        "Ns" | "Ni" => match line.number()? {
            number if number >= 0.0 => format!("{keyword} {number}"),
            _ => return Err(line.fault(&format!("`{keyword}` is negative"))),
        },
        "d" | "Pr" | "Pm" => format!("{keyword} {}", fraction(line)?),
        // A material without any coverage would not be there: writers such as MeshLab mean full coverage by it.
        "Tr" => match fraction(line)? {
            1.0 => "d 1".into(),
            transparency => format!("d {}", 1.0 - transparency),
        },
        "illum" => match line.number()? {
            model if (0.0..=10.0).contains(&model) && model.fract() == 0.0 => {
                format!("illum {}", model as u8)
            }
            _ => return Err(line.fault("`illum` takes an integer from 0 to 10")),
        },
        "map_Kd" | "map_d" | "map_Ke" | "norm" if line.rest.is_empty() => {
            return Err(line.fault(&format!("`{keyword}` names no picture")));
        }
        "map_Kd" | "map_d" | "map_Ke" | "norm" => format!("{keyword} {}", line.rest),
        // Ambient colour has no counterpart here, and `sharpness` applies to environment maps only.
        "Ka" | "map_Ka" | "sharpness" | "map_aat" => String::new(),
        _ => return Ok(None),
    }))
}

/// A colour `r g b`, or one number for all three channels.
fn color(line: &Line<'_>) -> Result<[f32; 3]> {
    if line.rest.starts_with("spectral") || line.rest.starts_with("xyz") {
        return Err(line.fault("only RGB colours are supported"));
    }
    let color = match *line.numbers()? {
        [all] => [all; 3],
        [red, green, blue] => [red, green, blue],
        _ => return Err(line.fault("a colour is one or three numbers")),
    };
    if color.iter().any(|value| *value < 0.0) {
        return Err(line.fault("a colour is negative"));
    }
    Ok(color)
}

fn fraction(line: &Line<'_>) -> Result<f32> {
    match line.number()? {
        number if (0.0..=1.0).contains(&number) => Ok(number),
        _ => Err(line.fault(&format!("`{}` lies outside 0 to 1", line.keyword))),
    }
}
