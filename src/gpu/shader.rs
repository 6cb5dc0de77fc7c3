//! WGSL sources, and their composition: `#import NAME` inserts `shaders/shared/NAME.wgsl`, once per shader.
//!
//! With `KRYLUX_DUMP_WGSL=DIR` in the environment, every composed shader is also written to `DIR/NAME.wgsl`.

use super::fold::fold;
use crate::error::{Error, Result};

macro_rules! shaders {
    ($($folder:literal: $($name:literal)*;)*) => {
        /// Every shader source by name: sources with entry points (`trace_paths`), and shared sources (`shared/bsdf`).
        pub const SOURCES: &[(&str, &str)] = &[$($((
            concat!($folder, $name),
            include_str!(concat!("../../shaders/", $folder, $name, ".wgsl")),
        )),*),*];
    };
}

shaders! {
    "": "assemble_pack" "assemble_parts" "assemble_pixels" "assemble_rows" "assemble_scan" "assemble_scatter" "assemble_squares"
        "assemble_sums" "primary_regions" "product" "trace_paths" "trace_photons" "vectors" "vectors_ahead";
    "shared/": "assembly" "bsdf" "bvh" "connect" "corners" "endpoint" "features" "footprint" "fresnel" "light_buffer" "lobes" "medium"
        "microfacet" "pairs" "parameters" "path" "photons" "reverse" "rng" "sampler" "scan" "sort" "start" "surface" "texture"
        "visibility" "warp";
}

/// The complete WGSL of the entry point `name`, with its imports resolved. If it or an import is missing or invalid, the call fails with
/// [`Error::Device`], which names the shader.
pub fn compose(name: &str) -> Result<String> {
    let source = lookup(name).ok_or_else(|| fault(name, "there is no such shader"))?;
    compose_source(name, source)
}

/// Works like [`compose`], errors included, for WGSL that is not in [`SOURCES`], for example a single function.
pub fn compose_source(name: &str, source: &str) -> Result<String> {
    let text = assemble(name, source)?;
    validate(name, &text)?;
    Ok(text)
}

/// The entry point `name`, with these values for its overrides, and without the code that the values make unreachable. A value without an
/// override is ignored. The module is not validated here; wgpu validates it when it creates a kernel. If the source or an import is missing
/// or cannot be parsed, or if an override has no value, the call fails with [`Error::Device`], which names the shader.
pub(crate) fn kernel(name: &str, constants: &[(&str, f64)]) -> Result<naga::Module> {
    let source = lookup(name).ok_or_else(|| fault(name, "there is no such shader"))?;
    let text = with_constants(name, &assemble(name, source)?, constants)?;
    let mut module = parse(name, &text)?;
    fold(&mut module);
    Ok(module)
}

/// Replaces the overrides in `text` by constants. Each override has a line of its own. With constants in the text, naga does not need the
/// second pass over the module that overrides would need.
fn with_constants(name: &str, text: &str, constants: &[(&str, f64)]) -> Result<String> {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let declared = line.strip_prefix("override ").and_then(|rest| rest.split_once([':', '=']));
        match declared {
            None => out.push_str(line),
            Some((constant, rest)) => {
                let constant = constant.trim();
                let value = constants.iter().find(|(known, _)| *known == constant);
                let (_, value) = value.ok_or_else(|| fault(name, &format!("`{constant}` has no value")))?;
                let ty = rest.split('=').next().unwrap_or_default().trim();
                out.push_str(&match ty {
                    "bool" => format!("const {constant}: bool = {};", *value != 0.0),
                    _ => format!("const {constant}: {ty} = {ty}({value});"),
                });
            }
        }
        out.push('\n');
    }
    Ok(out)
}

/// The text of a shader with its imports resolved. It is also written to a file if `KRYLUX_DUMP_WGSL` is set.
fn assemble(name: &str, source: &str) -> Result<String> {
    let mut text = String::new();
    append(name, source, &mut Vec::new(), &mut text)?;
    if let Some(folder) = std::env::var_os("KRYLUX_DUMP_WGSL") {
        let path = std::path::Path::new(&folder).join(format!("{name}.wgsl"));
        std::fs::write(&path, &text).map_err(Error::writing(path))?;
    }
    Ok(text)
}

fn lookup(name: &str) -> Option<&'static str> {
    SOURCES.iter().find(|(known, _)| *known == name).map(|(_, source)| *source)
}

/// Appends `source` to `text`. Each import that is not in `done` is inserted in place of its `#import` line.
fn append(name: &str, source: &str, done: &mut Vec<String>, text: &mut String) -> Result<()> {
    for line in source.lines() {
        let Some(import) = line.strip_prefix("#import ") else {
            text.push_str(line);
            text.push('\n');
            continue;
        };
        let import = format!("shared/{}", import.trim());
        if !done.contains(&import) {
            let shared = lookup(&import)
                .ok_or_else(|| fault(name, &format!("imports `{import}`, which does not exist")))?;
            done.push(import.clone());
            append(&import, shared, done, text)?;
        }
    }
    Ok(())
}

/// Parses and validates a shader with naga, so that errors name the line, and drivers never see an invalid shader.
fn validate(name: &str, text: &str) -> Result<naga::Module> {
    let module = parse(name, text)?;
    validated(text, &module).map_err(|what| fault(name, &what))?;
    Ok(module)
}

/// Validates `module`. The error text refers to the lines of `text`.
fn validated(text: &str, module: &naga::Module) -> std::result::Result<(), String> {
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
    validator.validate(module).map(drop).map_err(|e| e.emit_to_string(text))
}

fn parse(name: &str, text: &str) -> Result<naga::Module> {
    naga::front::wgsl::parse_str(text).map_err(|e| fault(name, &e.emit_to_string(text)))
}

/// The composed shader `name` as a naga module, for comparing its layouts with those of the host. Fails like [`compose`].
pub fn module(name: &str) -> Result<naga::Module> {
    validate(name, &compose(name)?)
}

fn fault(name: &str, what: &str) -> Error {
    Error::device(format!("shader {name}: {what}")).help("this is a fault in krylux; please report it")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_point_composes_and_validates() {
        for (name, _) in SOURCES.iter().filter(|(name, _)| !name.starts_with("shared/")) {
            compose(name).unwrap_or_else(|e| unreachable!("{e}"));
        }
    }

    /// Values for all overrides of `trace_paths`: 1 for the overrides in `on`, and 0 for all others.
    fn constants(on: &[&str]) -> Vec<(&'static str, f64)> {
        let names = lookup("shared/features")
            .unwrap_or_default()
            .lines()
            .filter_map(|line| line.strip_prefix("override ").and_then(|rest| rest.split(':').next()));
        names.map(|name| (name, f64::from(u8::from(on.contains(&name))))).collect()
    }

    #[test]
    fn a_kernel_has_no_code_for_features_that_its_scene_lacks() {
        let functions = |on: &[&str]| -> Vec<String> {
            let module = kernel("trace_paths", &constants(on)).unwrap_or_else(|e| unreachable!("{e}"));
            validated("", &module).unwrap_or_else(|e| unreachable!("{e}"));
            module.functions.iter().filter_map(|(_, function)| function.name.clone()).collect()
        };
        let (matte, all) = (
            functions(&["MATTE"]),
            functions(&["CORNERS", "FACETS", "TRANSMITS", "CHAINS", "PASSABLE", "MEDIA", "LENSES"]),
        );
        let smooth = functions(&["CHAINS"]);
        assert!(!smooth.iter().any(|function| function == "bsdf_facets"), "{smooth:?}");
        for name in ["surface_texture", "photons_gather", "bsdf_facets", "footprint_turn"] {
            assert!(!matte.iter().any(|function| function == name), "{name} in {matte:?}");
            assert!(all.iter().any(|function| function == name), "{name} not in {all:?}");
        }
    }

    #[test]
    fn an_override_without_a_value_is_named() {
        let error = kernel("trace_paths", &constants(&[])[1..]).map(drop);
        let message = error.map_or_else(|e| e.to_string(), |()| String::new());
        assert!(message.contains("`MATTE` has no value"), "{message}");
    }

    #[test]
    fn an_import_is_inserted_once_before_its_use() {
        let text = compose_source("twice", "#import rng\n#import rng\nfn f() -> u32 { return 1u; }\n");
        let text = text.unwrap_or_else(|e| unreachable!("{e}"));
        assert_eq!(text.matches("fn pcg4d").count(), 1);
        assert!(text.find("fn pcg4d") < text.find("fn f()"));
    }

    #[test]
    fn an_error_shows_the_faulty_line() {
        let error = compose_source("wrong", "fn f() -> u32 { return 1.5; }").map(drop);
        let message = error.map_or_else(|e| e.to_string(), |()| String::new());
        assert!(message.contains("shader wrong") && message.contains("1.5"), "{message}");
    }
}
