//! Composing WGSL: `#import NAME` brings in `shaders/shared/NAME.wgsl` once, before anything that follows.
//!
//! With `KRYLUX_DUMP_WGSL=DIR` in the environment every composed shader is also written to `DIR/NAME.wgsl`.

use crate::error::{Error, Result};

macro_rules! shaders {
    ($($folder:literal / $name:literal),* $(,)?) => {
        /// Every shader source by name: entry points (`trace_paths`) and shared parts (`shared/bsdf`).
        pub const SOURCES: &[(&str, &str)] = &[
            $((
                if $folder.is_empty() { $name } else { concat!($folder, "/", $name) },
                include_str!(concat!("../../shaders/", $folder, "/", $name, ".wgsl")),
            )),*
        ];
    };
}

shaders! {
    "" / "primary_regions",
    "" / "product",
    "" / "trace_paths",
    "" / "trace_photons",
    "shared" / "bsdf",
    "shared" / "bvh",
    "shared" / "corners",
    "shared" / "eye",
    "shared" / "features",
    "shared" / "footprint",
    "shared" / "fresnel",
    "shared" / "lobes",
    "shared" / "medium",
    "shared" / "microfacet",
    "shared" / "parameters",
    "shared" / "photons",
    "shared" / "rng",
    "shared" / "sampler",
    "shared" / "side",
    "shared" / "sight",
    "shared" / "start",
    "shared" / "surface",
    "shared" / "texture",
    "shared" / "visibility",
    "shared" / "warp",
}

/// The whole WGSL of the entry point `name`, imports resolved.
///
/// # Errors
/// [`Error::Device`] naming the shader when it, or what it imports, does not exist or does not validate.
pub fn compose(name: &str) -> Result<String> {
    let source = lookup(name).ok_or_else(|| fault(name, "there is no such shader"))?;
    compose_source(name, source)
}

/// As [`compose`], for WGSL that is not among [`SOURCES`] (tests of single functions).
///
/// # Errors
/// As [`compose`].
pub fn compose_source(name: &str, source: &str) -> Result<String> {
    let mut text = String::new();
    append(name, source, &mut Vec::new(), &mut text)?;
    if let Some(folder) = std::env::var_os("KRYLUX_DUMP_WGSL") {
        let path = std::path::Path::new(&folder).join(format!("{name}.wgsl"));
        std::fs::write(&path, &text).map_err(Error::writing(path))?;
    }
    validate(name, &text)?;
    Ok(text)
}

fn lookup(name: &str) -> Option<&'static str> {
    SOURCES.iter().find(|(known, _)| *known == name).map(|(_, source)| *source)
}

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

/// Parses and validates with naga, so that a mistake is shown with its line, before any driver sees it.
fn validate(name: &str, text: &str) -> Result<naga::Module> {
    let module = naga::front::wgsl::parse_str(text).map_err(|e| fault(name, &e.emit_to_string(text)))?;
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
    validator.validate(&module).map_err(|e| fault(name, &e.emit_to_string(text)))?;
    Ok(module)
}

/// The composed shader `name` as naga sees it, e.g. to compare its layouts with the host's.
///
/// # Errors
/// As [`compose`].
pub fn module(name: &str) -> Result<naga::Module> {
    validate(name, &compose(name)?)
}

fn fault(name: &str, what: &str) -> Error {
    Error::Device {
        fault: format!("shader {name}: {what}"),
        help: "this is a fault in krylux; please report it".into(),
    }
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

    #[test]
    fn an_import_comes_once_and_first() {
        let text = compose_source("twice", "#import rng\n#import rng\nfn f() -> u32 { return 1u; }\n");
        let text = text.unwrap_or_else(|e| unreachable!("{e}"));
        assert_eq!(text.matches("fn pcg4d").count(), 1);
        assert!(text.find("fn pcg4d") < text.find("fn f()"));
    }

    #[test]
    fn a_mistake_is_shown_with_its_line() {
        let error = compose_source("wrong", "fn f() -> u32 { return 1.5; }").map(drop);
        let message = error.map_or_else(|e| e.to_string(), |()| String::new());
        assert!(message.contains("shader wrong") && message.contains("1.5"), "{message}");
    }
}
