//! Buffers and buffer views.

use gltf_json as json;

use super::{Document, meshopt, object_name, uri};
use crate::error::{Error, Result};

/// Reads every buffer of the file.
pub(super) fn load(document: &mut Document) -> Result<()> {
    let unread = meshopt::unread(&document.root);
    for (index, is_unread) in unread.into_iter().enumerate() {
        let buffer = &document.root.buffers[index];
        let what = object_name("buffer", index, buffer.name.as_ref());
        let expected = buffer.byte_length.0;
        // Its views are decompressed from another buffer.
        if meshopt::is_fallback(buffer) {
            document.buffers.push(Vec::new());
            continue;
        }
        let bytes = match buffer.uri.clone() {
            Some(uri) => uri::read(document, &what, &uri)?,
            None if index == 0 && document.chunk.is_some() => document.chunk.take().unwrap_or_default(),
            None if is_unread => {
                document.buffers.push(Vec::new());
                continue;
            }
            None => return Err(missing(document, &what)),
        };
        if (bytes.len() as u64) < expected {
            return Err(document.fault(
                format!("{what} should have {expected} bytes, but there are {}", bytes.len()),
                "the file or its buffer is cut short: copy or export it again",
            ));
        }
        document.buffers.push(bytes);
    }
    Ok(())
}

/// The error about a buffer without data.
fn missing(document: &Document, what: &str) -> Error {
    document.fault(
        format!("{what} has neither a URI nor a binary chunk in the file"),
        "the file is incomplete: export it again",
    )
}

/// The bytes of a buffer view, and its stride in bytes if it states one. `what` names the object that uses
/// it.
pub(super) fn view<'a>(
    document: &'a Document,
    what: &str,
    view: json::Index<json::buffer::View>,
) -> Result<(&'a [u8], Option<usize>)> {
    let help = "the file is damaged: export it again";
    let index = view.value();
    let Some(view) = document.root.buffer_views.get(index) else {
        return Err(
            document.fault(format!("{what} refers to buffer view {index}, which does not exist"), help)
        );
    };
    let Some(buffer) = document.buffers.get(view.buffer.value()) else {
        let buffer = view.buffer.value();
        return Err(document
            .fault(format!("buffer view {index} refers to buffer {buffer}, which does not exist"), help));
    };
    let start = view.byte_offset.map_or(0, |offset| offset.0);
    let range = usize::try_from(start)
        .ok()
        .zip(start.checked_add(view.byte_length.0).and_then(|end| usize::try_from(end).ok()))
        .and_then(|(start, end)| buffer.get(start..end));
    let Some(bytes) = range else {
        return Err(document.fault(
            format!(
                "buffer view {index} ({} bytes at {start}) ends outside buffer {} ({} bytes)",
                view.byte_length.0,
                view.buffer.value(),
                buffer.len()
            ),
            help,
        ));
    };
    Ok((bytes, view.byte_stride.map(|stride| stride.0)))
}
