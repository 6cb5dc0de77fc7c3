//! Material libraries, read by `tobj`.
//!
//! `tobj` reports errors without line numbers, accepts any number, and panics on a colour with fewer than three numbers. The
//! statements are therefore checked first. `tobj` gets only supported ones, each colour with three numbers, and `Tr` as `d`.

use std::path::Path;

use glam::{Mat3, Vec3};

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
            (None, material) => {
                let spectral = if is_spectral(line) { " spectral" } else { "" };
                let what = format!(
                    "material `{}`: `{}{spectral}` is not supported and ignored",
                    material.as_deref().unwrap_or_default(),
                    shortened(line.keyword)
                );
                warnings.add_once(&what, format!("{what} ({})", line.place()));
            }
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
        "Kd" | "Ks" | "Ke" | "Tf" if is_spectral(line) => return Ok(None),
        "Kd" | "Ks" | "Ke" | "Tf" => {
            let [red, green, blue] = color(line)?;
            format!("{keyword} {red} {green} {blue}")
        }
        "Ns" | "Ni" => match line.number()? {
            number if number >= 0.0 => format!("{keyword} {number}"),
            _ => return Err(line.fault(&format!("`{keyword}` is negative"))),
        },
        // With `-halo`, the number is the coverage of what is seen face on.
        "d" => format!("d {}", fraction(&line.after("-halo").unwrap_or(*line))?),
        "Pr" | "Pm" => format!("{keyword} {}", fraction(line)?),
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

/// Whether a colour is a file of its spectrum.
fn is_spectral(line: &Line<'_>) -> bool {
    line.words().next() == Some("spectral")
}

/// From CIE XYZ to linear sRGB (IEC 61966-2-1), whose white is D65.
const XYZ_TO_RGB: Mat3 =
    Mat3::from_cols_array(&[3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415, 1.0570]);

/// A colour `r g b` or `xyz x y z`, or one number for all three channels. What sRGB cannot show of a colour `xyz` is cut off.
fn color(line: &Line<'_>) -> Result<[f32; 3]> {
    match line.after("xyz") {
        Some(line) => Ok((XYZ_TO_RGB * Vec3::from(three(&line)?)).max(Vec3::ZERO).to_array()),
        None => three(line),
    }
}

/// Three numbers, or one for all three.
fn three(line: &Line<'_>) -> Result<[f32; 3]> {
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
