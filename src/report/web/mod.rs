//! The scripts of pages: plain JavaScript modules, joined into one script, because a page opened from a file cannot load other files.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;

/// A module: the name and the text of its file.
pub type Module = (&'static str, &'static str);

/// Numbers as text.
pub const FORMAT: Module = ("format.js", include_str!("format.js"));
/// Values as colours.
pub const COLOR: Module = ("color.js", include_str!("color.js"));
/// Zoom and pan.
pub const VIEW: Module = ("view.js", include_str!("view.js"));
/// Pictures with exact values.
pub const PICTURE: Module = ("picture.js", include_str!("picture.js"));
/// Files of NumPy.
pub const NUMPY: Module = ("numpy.js", include_str!("numpy.js"));

/// Exact values of pictures, and bytes from text.
pub const VALUES: Module = ("values.js", include_str!("values.js"));

/// Joins modules into one script without imports. Each module has a separate scope, and must be listed after the modules that it imports.
/// Imports and exports are statements of one line each: `import { a, b } from "./file.js";` and `export function`, `class` or `const`.
pub fn bundle(modules: &[Module]) -> String {
    let mut script = String::from("\"use strict\";\nconst modules = {};\n");
    for (file, text) in modules {
        let mut exports = Vec::new();
        script += &format!("// {file}\nmodules[{file:?}] = (() => {{\n");
        for line in text.lines() {
            if let Some((names, from)) =
                line.strip_prefix("import ").and_then(|rest| rest.split_once(" from "))
            {
                let from = from.trim_matches(|c| c == '"' || c == ';');
                let from = from.rsplit_once('/').map_or(from, |(_, name)| name);
                script += &format!("const {names} = modules[{from:?}];\n");
            } else {
                let line = match line.strip_prefix("export ") {
                    Some(declared) => {
                        exports.extend(name_of(declared));
                        declared
                    }
                    None => line,
                };
                script += line;
                script.push('\n');
            }
        }
        script += &format!("return {{ {} }};\n}})();\n", exports.join(", "));
    }
    // A closing tag would end the script wherever it occurs, so it is escaped.
    script.replace("</script", "<\\/script")
}

/// The name that `function NAME(…`, `async function NAME(…`, `class NAME {` or `const NAME =` declares.
fn name_of(declared: &str) -> Option<&str> {
    let declared = declared.strip_prefix("async ").unwrap_or(declared);
    let declared = declared.strip_prefix("function").map_or(declared, |rest| rest.trim_start_matches('*'));
    let declared = declared.trim_start();
    let declared =
        ["class ", "const "].iter().find_map(|keyword| declared.strip_prefix(keyword)).unwrap_or(declared);
    declared.split(|c: char| !c.is_alphanumeric() && c != '_').find(|word| !word.is_empty())
}

/// The level of compression for floats. Most of their bits are noise: the default level takes up to half as long again, and saves 1 %.
pub(crate) const OF_FLOATS: Compression = Compression::new(2);

/// Bytes as text for a page: deflated (zlib), in base64.
pub(crate) fn deflated(bytes: &[u8], level: Compression) -> String {
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len()), level);
    // Writing to memory cannot fail.
    let packed = encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default();
    STANDARD.encode(packed)
}

/// JSON as the content of a script element. No part of it can end the element.
pub fn embedded_json(value: &impl serde::Serialize) -> String {
    // The conversion to JSON fails only for a map whose keys are not strings.
    serde_json::to_string(value).unwrap_or_default().replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_are_joined_with_scopes_of_their_own() {
        let first: Module = ("a.js", "const hidden = 1;\nexport function one() {\n  return hidden;\n}\n");
        let second: Module = (
            "b.js",
            "import { one } from \"../x/a.js\";\nexport class Two {}\nexport async function three() {}\n",
        );
        let script = bundle(&[first, second]);
        assert!(script.contains("return { one };") && script.contains("return { Two, three };"));
        assert!(script.contains("const { one } = modules[\"a.js\"];"));
        assert!(!script.contains("import ") && !script.contains("export "));
    }

    #[test]
    fn nothing_in_json_ends_its_element() {
        let text = embedded_json(&serde_json::json!({ "name": "</script><b>" }));
        assert_eq!(text, r#"{"name":"\u003c/script>\u003cb>"}"#);
    }
}
