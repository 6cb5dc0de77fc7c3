//! Buffers, their views and URIs, and accessors. An accessor is a typed, strided array in a view, and is checked when it is opened.

use std::path::PathBuf;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf_json as json;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::validation::Checked;

use super::extensions::MESHOPT;
use super::{Document, object_name};
use crate::error::Result;
use crate::scene::source;

pub(super) fn load(document: &mut Document) -> Result<()> {
    let unread = unread(&document.root);
    for (index, is_unread) in unread.into_iter().enumerate() {
        let buffer = &document.root.buffers[index];
        let what = object_name("buffer", index, buffer.name.as_ref());
        let expected = buffer.byte_length.0;
        // The views of a fallback buffer are decompressed from another buffer.
        if cfg!(feature = "compressed") && is_fallback(buffer) {
            document.buffers.push(Vec::new());
            continue;
        }
        let bytes = match buffer.uri.clone() {
            Some(uri) => read_uri(document, &what, &uri)?,
            None if index == 0 && document.chunk.is_some() => document.chunk.take().unwrap_or_default(),
            None if cfg!(feature = "compressed") && is_unread => {
                document.buffers.push(Vec::new());
                continue;
            }
            None => {
                return Err(document
                    .fault(format!("{what} has neither a URI nor a binary chunk in the file"))
                    .help("the file is incomplete: export it again"));
            }
        };
        if (bytes.len() as u64) < expected {
            return Err(document
                .fault(format!("{what} should have {expected} bytes, but there are {}", bytes.len()))
                .help("the file or its buffer is cut short: copy or export it again"));
        }
        document.buffers.push(bytes);
    }
    Ok(())
}

/// The bytes of a buffer view, and its stride in bytes if stated. `what` names the object that uses the view.
pub(super) fn view<'a>(
    document: &'a Document,
    what: &str,
    view: json::Index<json::buffer::View>,
) -> Result<(&'a [u8], Option<usize>)> {
    let index = view.value();
    let view = document.referred(&document.root.buffer_views, what, "buffer view", index)?;
    let user = format!("buffer view {index}");
    let buffer = document.referred(&document.buffers, &user, "buffer", view.buffer.value())?;
    let start = view.byte_offset.map_or(0, |offset| offset.0);
    let range = usize::try_from(start)
        .ok()
        .zip(start.checked_add(view.byte_length.0).and_then(|end| usize::try_from(end).ok()))
        .and_then(|(start, end)| buffer.get(start..end));
    let Some(bytes) = range else {
        return Err(document.damaged(format!(
            "buffer view {index} ({} bytes at {start}) ends outside buffer {} ({} bytes)",
            view.byte_length.0,
            view.buffer.value(),
            buffer.len()
        )));
    };
    Ok((bytes, view.byte_stride.map(|stride| stride.0)))
}

/// Whether a buffer is marked as a fallback, which may have no data. Its views are decompressed from another buffer.
fn is_fallback(buffer: &json::Buffer) -> bool {
    let extensions = buffer.extensions.as_ref().map(|extensions| &extensions.others);
    let is_fallback = |name: &&str| {
        let extension = extensions.and_then(|extensions| extensions.get(*name));
        extension.and_then(|extension| extension.get("fallback")) == Some(&json::Value::Bool(true))
    };
    MESHOPT.iter().any(is_fallback)
}

/// For each buffer, whether it has views and all of these are compressed. Such a buffer is not read, even if not marked as a fallback.
fn unread(root: &json::Root) -> Vec<bool> {
    let mut views = vec![[0_usize; 2]; root.buffers.len()];
    for view in &root.buffer_views {
        if let Some([compressed, plain]) = views.get_mut(view.buffer.value()) {
            *(if compression(view).is_some() { compressed } else { plain }) += 1;
        }
    }
    views.into_iter().map(|[compressed, plain]| compressed > 0 && plain == 0).collect()
}

pub(super) fn compression(view: &json::buffer::View) -> Option<&json::Value> {
    let others = &view.extensions.as_ref()?.others;
    MESHOPT.iter().find_map(|name| others.get(*name))
}

/// Base64 with or without padding, because exporters differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Reads the bytes that a URI refers to. `what` names the object that uses the URI, such as `buffer 0`. The bytes of a file are added to
/// the document's hash. The bytes of a data URI are part of the scene file, which is already hashed.
pub(super) fn read_uri(document: &mut Document, what: &str, uri: &str) -> Result<Vec<u8>> {
    // The scheme is case-insensitive.
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        return decode_data(document, what, &uri[5..]);
    }
    let path = resolve(document, what, uri)?;
    document.file.read_other(what, &path)
}

/// Decodes a data URI, given without its scheme.
fn decode_data(document: &Document, what: &str, data: &str) -> Result<Vec<u8>> {
    let Some((header, content)) = data.split_once(',') else {
        return Err(document
            .fault(format!("{what}: its data URI has no comma before the data"))
            .help("export the scene again"));
    };
    if !header.to_ascii_lowercase().ends_with(";base64") {
        return Err(document
            .fault(format!("{what}: its data URI is not base64"))
            .help("export the scene with base64 data, as separate files, or as .glb"));
    }
    BASE64.decode(content).map_err(|error| {
        document.fault(format!("{what}: its base64 data is damaged: {error}")).help("export the scene again")
    })
}

/// The end of a sentence whose subject is a file that is missing or not next to the scene. `None` for a URI that cannot be decoded, which
/// is another error.
pub(super) fn absence(document: &Document, uri: &str) -> Option<&'static str> {
    let is_data = uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"));
    let decoded = percent_decode(uri).filter(|_| !is_data && !uri.is_empty())?;
    match source::next_to(&document.file.path, uri)
        .and_then(|_| source::next_to(&document.file.path, &decoded))
    {
        Ok(path) => source::is_missing(&path).then_some("is missing"),
        Err(_) => Some("is not read, since it is not next to the scene"),
    }
}

/// The path of a relative URI: percent-decoded and relative to the scene's folder.
fn resolve(document: &Document, what: &str, uri: &str) -> Result<PathBuf> {
    let help = "put the file next to the scene and refer to it by a relative path, or export as .glb";
    if uri.is_empty() {
        return Err(document.fault(format!("{what}: its URI is empty")).help(help));
    }
    let decoded = percent_decode(uri).ok_or_else(|| {
        document.fault(format!("{what}: `{uri}` is not a valid URI (percent-encoding or UTF-8)")).help(help)
    })?;
    // Both forms are checked: a scheme is recognized only before decoding, and an encoded absolute path only after decoding.
    source::next_to(&document.file.path, uri)
        .and_then(|_| source::next_to(&document.file.path, &decoded))
        .map_err(|fault| {
            document
                .fault(format!("{what}: `{uri}` is {fault}; only files next to the scene are read"))
                .help(help)
        })
}

/// Decodes percent-encoding. `None` if a `%` is not followed by two hexadecimal digits, or if the result is not UTF-8 or contains NUL.
fn percent_decode(text: &str) -> Option<String> {
    let mut decoded = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(byte) = bytes.next() {
        if byte == b'%' {
            let high = char::from(bytes.next()?).to_digit(16)?;
            let low = char::from(bytes.next()?).to_digit(16)?;
            decoded.push((high * 16 + low) as u8);
        } else {
            decoded.push(byte);
        }
    }
    String::from_utf8(decoded).ok().filter(|text| !text.contains('\0'))
}

/// A checked accessor, whose `count` elements all lie inside its bytes.
#[derive(Clone, Copy)]
pub(super) struct OpenAccessor<'a> {
    /// The elements; `None` if all of them are zero.
    base: Option<Elements<'a>>,
    /// Elements that replace some of the base elements.
    sparse: Option<Sparse<'a>>,
    component: ComponentType,
    normalized: bool,
    pub count: usize,
}

#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Elements<'a> {
    fn at(&self, index: usize) -> Option<&'a [u8]> {
        self.bytes.get(index.checked_mul(self.stride)?..)
    }
}

/// Replacements of elements. Their indices are strictly increasing.
#[derive(Clone, Copy)]
struct Sparse<'a> {
    indices: Elements<'a>,
    component: ComponentType,
    values: Elements<'a>,
    count: usize,
}

impl Sparse<'_> {
    /// The index of the element that replacement `position` replaces.
    fn index(&self, position: usize) -> Option<u32> {
        integer(self.indices.at(position)?, self.component)
    }

    /// The position of the replacement for element `index`. Binary search avoids a dense copy, whose size a malicious file could choose.
    fn find(&self, index: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            match (self.index(middle)? as usize).cmp(&index) {
                std::cmp::Ordering::Less => low = middle + 1,
                std::cmp::Ordering::Equal => return Some(middle),
                std::cmp::Ordering::Greater => high = middle,
            }
        }
        None
    }
}

const HELP: &str = "the file is damaged or not glTF 2.0: export it again";

/// Opens an accessor that must have this shape and one of these component types. `what` names the object that uses the accessor, such as
/// `mesh 0, primitive 1: POSITION`.
pub(super) fn open_accessor<'a>(
    document: &'a Document,
    what: &str,
    accessor: json::Index<json::Accessor>,
    shape: Type,
    components: &[ComponentType],
) -> Result<OpenAccessor<'a>> {
    let index = accessor.value();
    let Some(accessor) = document.root.accessors.get(index) else {
        return Err(document
            .fault(format!("{what} refers to accessor {index}, which does not exist"))
            .help(HELP));
    };
    let component = match accessor.component_type {
        Checked::Valid(component) if components.contains(&component.0) => component.0,
        Checked::Valid(component) => {
            return Err(document
                .fault(format!(
                    "{what} has components of type {:?}; expected one of {components:?}",
                    component.0
                ))
                .help(HELP));
        }
        Checked::Invalid => {
            return Err(document.fault(format!("accessor {index} has an unknown component type")).help(HELP));
        }
    };
    if accessor.type_ != Checked::Valid(shape) {
        return Err(document.fault(format!("{what} (accessor {index}) is not of type {shape:?}")).help(HELP));
    }
    let element = component.size() * shape.multiplicity();
    let count = accessor.count.0;
    let base = match accessor.buffer_view {
        Some(view) => {
            let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
            Some(elements(document, &format!("accessor {index}"), view, offset, element, count)?)
        }
        // The specification defines elements without data as zero.
        None => None,
    };
    let Ok(count) = usize::try_from(count) else {
        return Err(document.fault(format!("accessor {index} has {count} elements")).help(HELP));
    };
    let sparse = accessor.sparse.as_ref().map(|sparse| open_sparse(document, index, sparse, element, count));
    Ok(OpenAccessor { base, sparse: sparse.transpose()?, component, normalized: accessor.normalized, count })
}

/// Opens the sparse part of accessor number `accessor`, which has `base_count` elements of `element` bytes.
fn open_sparse<'a>(
    document: &'a Document,
    accessor: usize,
    source: &json::accessor::sparse::Sparse,
    element: usize,
    base_count: usize,
) -> Result<Sparse<'a>> {
    let component = match source.indices.component_type {
        Checked::Valid(component) => component.0,
        Checked::Invalid => {
            let fault = format!("accessor {accessor}: its sparse indices have an unknown component type");
            return Err(document.fault(fault).help(HELP));
        }
    };
    let (indices, values) = (&source.indices, &source.values);
    let what = format!("accessor {accessor}, sparse indices");
    let offset = indices.byte_offset.0;
    let count = source.count.0;
    let indices = elements(document, &what, indices.buffer_view, offset, component.size(), count)?;
    let what = format!("accessor {accessor}, sparse values");
    let values = elements(document, &what, values.buffer_view, values.byte_offset.0, element, count)?;
    // The cast is exact, because the length of the buffer view bounds the count.
    let sparse = Sparse { indices, component, values, count: count as usize };
    // The indices are checked only once, because a mesh that is placed a million times is opened a million times.
    if !document.checked_sparse.borrow_mut().insert(accessor) {
        return Ok(sparse);
    }
    let mut last = None;
    for position in 0..sparse.count {
        let index = sparse.index(position);
        if index <= last || index.is_none_or(|index| index as usize >= base_count) {
            return Err(document
                .fault(format!("accessor {accessor}: its sparse indices do not increase below {base_count}"))
                .help(HELP));
        }
        last = index;
    }
    Ok(sparse)
}

/// Finds `count` elements of `element` bytes each in a buffer view, and checks that all of them lie inside. `what` names them in errors.
fn elements<'a>(
    document: &'a Document,
    what: &str,
    view: json::Index<json::buffer::View>,
    offset: u64,
    element: usize,
    count: u64,
) -> Result<Elements<'a>> {
    let (view, stride) = self::view(document, what, view)?;
    let stride = stride.unwrap_or(element);
    if stride < element {
        return Err(document
            .fault(format!("{what} has elements of {element} bytes in a buffer view of stride {stride}"))
            .help(HELP));
    }
    // Checked arithmetic is used, because a malicious count or offset must not wrap around.
    let end = match count.checked_sub(1) {
        None => Some(offset),
        Some(last) => last
            .checked_mul(stride as u64)
            .and_then(|bytes| bytes.checked_add(element as u64))
            .and_then(|bytes| bytes.checked_add(offset)),
    };
    let bytes = end
        .filter(|&end| end <= view.len() as u64)
        .and_then(|_| usize::try_from(offset).ok())
        .and_then(|offset| view.get(offset..));
    match bytes {
        Some(bytes) => Ok(Elements { bytes, stride }),
        None => Err(document.fault(format!(
                "{what} ({count} elements of {element} bytes, stride {stride}, at {offset}) ends outside its buffer \
                 view ({} bytes)",
                view.len()
            )).help(HELP)),
    }
}

fn integer(bytes: &[u8], component: ComponentType) -> Option<u32> {
    match component {
        ComponentType::U8 => bytes.first().map(|&byte| u32::from(byte)),
        ComponentType::U16 => bytes.first_chunk().map(|&word| u32::from(u16::from_le_bytes(word))),
        ComponentType::U32 => bytes.first_chunk().map(|&word| u32::from_le_bytes(word)),
        _ => None,
    }
}

impl OpenAccessor<'_> {
    /// The bytes that begin with element `index`. `Some(None)` if the element is zero, `None` if the index is past the end.
    fn bytes(&self, index: usize) -> Option<Option<&[u8]>> {
        if index >= self.count {
            return None;
        }
        if let Some(sparse) = &self.sparse
            && let Some(position) = sparse.find(index)
        {
            return sparse.values.at(position).map(Some);
        }
        match &self.base {
            None => Some(None),
            Some(base) => base.at(index).map(Some),
        }
    }

    /// Element `index` of an array of vectors, or `None` past the end. Integers are converted to floats as `KHR_mesh_quantization` defines.
    pub(super) fn vector<const N: usize>(&self, index: usize) -> Option<[f32; N]> {
        let mut vector = [0.0; N];
        let Some(bytes) = self.bytes(index)? else { return Some(vector) };
        let size = self.component.size();
        for (component, value) in vector.iter_mut().enumerate() {
            *value = self.value(bytes.get(component * size..)?)?;
        }
        Some(vector)
    }

    pub(super) fn integer(&self, index: usize) -> Option<u32> {
        self.integers::<1>(index).map(|[integer]| integer)
    }

    /// Element `index` of an array of vectors of unsigned integers, or `None` past the end.
    pub(super) fn integers<const N: usize>(&self, index: usize) -> Option<[u32; N]> {
        let mut integers = [0; N];
        let Some(bytes) = self.bytes(index)? else { return Some(integers) };
        let size = self.component.size();
        for (component, value) in integers.iter_mut().enumerate() {
            *value = integer(bytes.get(component * size..)?, self.component)?;
        }
        Some(integers)
    }

    fn value(&self, bytes: &[u8]) -> Option<f32> {
        // The lower bound of −1 only affects signed types.
        let (value, maximum) = match self.component {
            ComponentType::F32 => return bytes.first_chunk().map(|&word| f32::from_le_bytes(word)),
            ComponentType::I8 => (f32::from(bytes.first()?.cast_signed()), 127.0),
            ComponentType::U8 => (f32::from(*bytes.first()?), 255.0),
            ComponentType::I16 => (f32::from(i16::from_le_bytes(*bytes.first_chunk()?)), 32767.0),
            ComponentType::U16 => (f32::from(u16::from_le_bytes(*bytes.first_chunk()?)), 65535.0),
            ComponentType::U32 => (u32::from_le_bytes(*bytes.first_chunk()?) as f32, u32::MAX as f32),
        };
        Some(if self.normalized { (value / maximum).max(-1.0) } else { value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_encoding_is_decoded() {
        assert_eq!(percent_decode("my%20scene%C3%A9.bin").as_deref(), Some("my scene\u{e9}.bin"));
        assert_eq!(percent_decode("plain+name.bin").as_deref(), Some("plain+name.bin"));
    }

    #[test]
    fn broken_percent_encoding_is_refused() {
        for text in ["%", "%2", "%zz", "%FF", "a%00b"] {
            assert_eq!(percent_decode(text), None, "{text}");
        }
    }
}
