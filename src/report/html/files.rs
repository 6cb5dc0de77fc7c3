//! The files of a run, with the page's links to them and the lines that read them with NumPy.

/// A file of the run's folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileLink {
    /// The name, relative to the page.
    pub name: String,
    /// The content, such as `10 × 128 × 128, float64`; may be empty.
    pub about: String,
}

impl FileLink {
    /// A link to a file.
    pub fn new(name: impl Into<String>, about: impl Into<String>) -> Self {
        Self { name: name.into(), about: about.into() }
    }

    pub(super) fn address(&self) -> String {
        address(&self.name)
    }
}

/// A relative path as an address. Each byte of a special character is written as `%` and its code.
pub(super) fn address(path: &str) -> String {
    path.bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' | b'~' => {
                char::from(byte).to_string()
            }
            byte => format!("%{byte:02X}"),
        })
        .collect()
}

pub(super) fn numpy(files: &[FileLink]) -> String {
    let arrays: Vec<&FileLink> = files.iter().filter(|file| file.name.ends_with(".npy")).collect();
    if arrays.is_empty() {
        return String::new();
    }
    let mut lines = vec!["import json".to_owned(), "import numpy as np".to_owned(), String::new()];
    for file in arrays {
        let name = variable(file.name.trim_end_matches(".npy"));
        let about = if file.about.is_empty() { String::new() } else { format!("  # {}", file.about) };
        lines.push(format!("{name} = np.load(\"{}\"){about}", file.name));
    }
    if files.iter().any(|file| file.name == "run.json") {
        lines.push("run = json.load(open(\"run.json\"))".to_owned());
    }
    lines.join("\n")
}

/// A valid Python name.
fn variable(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_digit()) { format!("_{plain}") } else { plain }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_loaded_by_names_that_python_takes() {
        let files = ["labels-2.npy", "white.png", "3d/model.npy", "run.json"]
            .map(|name| FileLink::new(name, "2 × 2"));
        let lines = numpy(&files);
        assert!(
            lines.contains("labels_2 = np.load(\"labels-2.npy\")  # 2 × 2\n_3d_model = np.load("),
            "{lines}"
        );
        assert!(!lines.contains("png") && lines.ends_with("run = json.load(open(\"run.json\"))"));
        assert_eq!(numpy(&files[1..2]), "");
    }

    #[test]
    fn addresses_hold_no_letters_that_mean_something_else() {
        assert_eq!(address("a b/ü#1.npy"), "a%20b/%C3%BC%231.npy");
    }
}
