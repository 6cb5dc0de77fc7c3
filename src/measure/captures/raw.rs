//! Raw files of cameras, read through a program that converts them.

use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::image::Image;
use crate::io::picture;

/// A program that converts raw files. Only these can be named, since a folder of captures may come from strangers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Converter {
    /// dcraw by Dave Coffin.
    Dcraw,
    /// The program of the same options that comes with LibRaw.
    DcrawEmu,
}

impl Converter {
    /// The program, and its options for linear levels of 16 bits in the camera's own colours, written to stdout.
    fn command(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Dcraw => ("dcraw", &["-c", "-4", "-o", "0", "-r", "1", "1", "1", "1"]),
            Self::DcrawEmu => ("dcraw_emu", &["-Z", "-", "-4", "-o", "0", "-r", "1", "1", "1", "1"]),
        }
    }

    /// Converts a file, and reads its levels and the highest level.
    ///
    /// # Errors
    /// [`Error::Data`] naming the file, if the program is not installed, if it fails, or if it writes no picture.
    fn read(self, path: &Path) -> Result<(Image, Option<f32>)> {
        let (program, options) = self.command();
        let converted = tempfile::Builder::new().suffix(".ppm").tempfile();
        let converted = converted.map_err(Error::writing(&std::env::temp_dir()))?;
        let stdout = converted.reopen().map_err(Error::writing(converted.path()))?;
        let output = Command::new(program)
            .args(options)
            .arg(path)
            .stdin(Stdio::null())
            .stdout(stdout)
            .stderr(Stdio::piped())
            .output();
        let output = output.map_err(|error| match error.kind() {
            ErrorKind::NotFound => Error::data(path, format!("the program {program}, which would convert it, is not installed"))
                .help("install it (Debian: dcraw, or libraw-bin for dcraw_emu), or convert the files to 16-bit TIFF or PPM"),
            _ => Error::data(path, format!("{program} cannot be started: {error}")).help("run it by hand to see why"),
        })?;
        let refused =
            |fault: String| Error::data(path, fault).help(format!("run {program} by hand to see why"));
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            return Err(refused(format!(
                "{program} did not convert it: {}",
                said.lines().next().unwrap_or_default()
            )));
        }
        picture::read_levels(converted.path())
            .map_err(|error| refused(format!("what {program} made of it cannot be read: {error}")))
    }
}

/// Reads a picture: its levels, and the highest level that the format can hold. A file that is no picture goes through the converter.
pub(super) fn read(path: &Path, converter: Option<Converter>) -> Result<(Image, Option<f32>)> {
    match converter {
        Some(converter) if !picture::is_known(path) => converter.read(path),
        _ => picture::read_levels(path),
    }
}
