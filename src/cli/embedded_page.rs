//! A painting page as one file, which contains the matrix and needs no server.

use std::path::Path;

use serde_json::{Value, json};

use super::console::Console;
use crate::error::Result;
use crate::io::name::Name;
use crate::lab::text::percent;
use crate::paint::Canvas;
use crate::paint::page::{EmbedOptions, Embedded};

/// The size limit of a page beside a report. It equals the default of `--max-size`.
pub(super) const MAX_BYTES: usize = 32 << 20;

/// Writes a page as one file, and reports its size and the error of its photos.
pub(super) fn write(
    file: &Path,
    canvas: &mut Canvas<'_>,
    options: &EmbedOptions,
    console: &Console,
) -> Result<Value> {
    let page = Embedded::new(canvas, options)?;
    page.write(file)?;
    let mebibytes = page.bytes() as f64 / f64::from(1 << 20);
    let error = percent(page.error);
    console.say(format_args!(
        "paint     {}, {mebibytes:.1} MiB; its photos are within {error} % of the matrix in memory",
        file.display()
    ))?;
    if page.kept < 1.0 {
        console.note(format_args!(
            "note: the page would be larger than --max-size allows: it holds {} % of the matrix's entries, chosen by chance so that photos stay right on average",
            percent(page.kept)
        ));
    }
    Ok(json!({
        "file": Name::from(file),
        "bytes": page.bytes(),
        "relative_error": page.error,
        "kept_entries": page.kept,
    }))
}
