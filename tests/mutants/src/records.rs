//! Files of records, one in a line, so that what is known outlives a run that is stopped.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::Fallible;

/// All records of a file; an empty list if there is no file. A line that was cut short by the end of a run is skipped.
pub fn read<T: DeserializeOwned>(file: &Path) -> Fallible<Vec<T>> {
    let opened = match File::open(file) {
        Err(why) if why.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        opened => opened?,
    };
    let lines: Result<Vec<String>, _> = BufReader::new(opened).lines().collect();
    Ok(lines?.iter().filter_map(|line| serde_json::from_str(line).ok()).collect())
}

/// Appends a record in one write.
pub fn append<T: Serialize>(file: &Path, record: &T) -> Fallible<()> {
    let line = format!("{}\n", serde_json::to_string(record)?);
    Ok(OpenOptions::new().append(true).create(true).open(file)?.write_all(line.as_bytes())?)
}
