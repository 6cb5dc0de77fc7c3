//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: buffer views that are decompressed before anything reads them.

use gltf_json as json;
use meshoptimizer_rs::{Limits, Workspace, codec};
use serde::Deserialize;

use super::Document;
use crate::error::Result;

/// The names of the extension, which have the same members.
pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The largest number of bytes that the views of one file have together when they are decompressed. A limit is needed because a few
/// kilobytes can stand for any number of equal vertices.
const MAX_BYTES: usize = 1 << 30;

/// The extension of a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default = "none")]
    filter: String,
}

fn none() -> String {
    "NONE".into()
}

/// Whether a buffer is marked as one that only stands in for views that are decompressed from another one, and may lack data.
pub(super) fn is_fallback(buffer: &json::Buffer) -> bool {
    let extensions = buffer.extensions.as_ref().map(|extensions| &extensions.others);
    let is_fallback = |name: &&str| {
        let extension = extensions.and_then(|extensions| extensions.get(*name));
        extension.and_then(|extension| extension.get("fallback")) == Some(&json::Value::Bool(true))
    };
    NAMES.iter().any(is_fallback)
}

/// For each buffer, whether there are views of it and all of them are compressed, so that the buffer itself is not read. Some exporters do
/// not mark it.
pub(super) fn unread(root: &json::Root) -> Vec<bool> {
    let mut views = vec![[0_usize; 2]; root.buffers.len()];
    for view in &root.buffer_views {
        if let Some([compressed, plain]) = views.get_mut(view.buffer.value()) {
            *(if extension(view).is_some() { compressed } else { plain }) += 1;
        }
    }
    views.into_iter().map(|[compressed, plain]| compressed > 0 && plain == 0).collect()
}

/// The extension of a buffer view.
fn extension(view: &json::buffer::View) -> Option<&json::Value> {
    let others = &view.extensions.as_ref()?.others;
    NAMES.iter().find_map(|name| others.get(*name))
}

/// Decompresses every compressed buffer view into a new buffer, to which the view then refers.
pub(super) fn decompress(document: &mut Document) -> Result<()> {
    let mut workspace = Workspace::new(Limits { max_bytes: MAX_BYTES, ..Limits::default() });
    let mut total = 0_usize;
    for index in 0..document.root.buffer_views.len() {
        let Some(value) = extension(&document.root.buffer_views[index]).cloned() else { continue };
        let bytes = parse(value)
            .and_then(|compressed| {
                total = total.saturating_add(compressed.count.saturating_mul(compressed.byte_stride));
                if total > MAX_BYTES {
                    return Err(format!("the views have more than {MAX_BYTES} bytes"));
                }
                decoded(document, &compressed, &mut workspace)
            })
            .map_err(|why| {
                document.fault(
                    format!("buffer view {index} cannot be decompressed (meshopt): {why}"),
                    "the file is damaged or too large: export it again, or without mesh compression",
                )
            })?;
        let buffer = document.add_buffer(bytes);
        let view = &mut document.root.buffer_views[index];
        view.byte_length = document.buffers[buffer.value()].len().into();
        (view.buffer, view.byte_offset) = (buffer, None);
    }
    Ok(())
}

fn parse(value: json::Value) -> std::result::Result<Compressed, String> {
    serde_json::from_value(value).map_err(|error| error.to_string())
}

/// The bytes that a view stands for.
fn decoded(
    document: &Document,
    of: &Compressed,
    workspace: &mut Workspace,
) -> std::result::Result<Vec<u8>, String> {
    let end = of.byte_offset.checked_add(of.byte_length);
    let source = document.buffers.get(of.buffer).zip(end).and_then(|(all, end)| all.get(of.byte_offset..end));
    let source = source.ok_or_else(|| format!("its data end outside buffer {}", of.buffer))?;
    let (count, stride) = (of.count, of.byte_stride);
    let message = |error: meshoptimizer_rs::Error| error.to_string();
    let mut bytes = match of.mode.as_str() {
        "ATTRIBUTES" => codec::decode_vertex_buffer(count, stride, source, workspace),
        "TRIANGLES" => codec::decode_index_buffer(count, stride, source, workspace),
        "INDICES" => codec::decode_index_sequence(count, stride, source, workspace),
        other => return Err(format!("its mode is {other}")),
    }
    .map_err(message)?;
    let data = &mut bytes;
    match of.filter.as_str() {
        "NONE" => Ok(()),
        "OCTAHEDRAL" => codec::decode_filter_oct(data, count, stride, workspace),
        "QUATERNION" => codec::decode_filter_quat(data, count, stride, workspace),
        "EXPONENTIAL" => codec::decode_filter_exp(data, count, stride, workspace),
        "COLOR" => codec::decode_filter_color(data, count, stride, workspace),
        other => return Err(format!("its filter is {other}")),
    }
    .map_err(message)?;
    Ok(bytes)
}
