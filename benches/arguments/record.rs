//! The tables of the guide: `--record` writes what a benchmark prints to `guide/recorded/NAME.md`, which the guide includes.

/// Markdown that is printed line by line, and kept for the guide where that is asked for.
pub struct Record {
    name: &'static str,
    text: String,
}

impl Record {
    /// A record that begins with this line, as `guide/recorded/NAME.md`.
    pub fn new(name: &'static str, line: &str) -> Self {
        let mut record = Self { name, text: String::new() };
        record.line(&format!("krylux {}, {line}", env!("CARGO_PKG_VERSION")));
        record
    }

    /// Begins a table with these columns.
    pub fn columns(&mut self, columns: &[&str]) {
        self.line("");
        self.row(columns);
        self.line(&format!("|{}", "---|".repeat(columns.len())));
    }

    /// Adds a row.
    pub fn row(&mut self, cells: &[impl AsRef<str>]) {
        let cells: Vec<&str> = cells.iter().map(AsRef::as_ref).collect();
        self.line(&format!("| {} |", cells.join(" | ")));
    }

    fn line(&mut self, line: &str) {
        println!("{line}");
        self.text += line;
        self.text.push('\n');
    }

    /// Writes the file where the arguments have `--record`.
    pub fn finish(self) -> std::io::Result<()> {
        if !std::env::args().any(|argument| argument == "--record") {
            return Ok(());
        }
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/guide/recorded");
        std::fs::write(format!("{folder}/{}.md", self.name), self.text)
    }
}
