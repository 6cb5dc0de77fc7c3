//! Accessors: typed, strided arrays inside buffer views, checked once and then read element by element.

use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

use super::{Document, buffers, extensions};
use crate::error::Result;

/// A checked accessor: every element up to `count` lies inside `bytes`.
#[derive(Clone, Copy)]
pub(super) struct Array<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: ComponentType,
    normalized: bool,
    /// Number of elements.
    pub count: usize,
}

/// Opens an accessor of shape `shape` whose components are among `components`. `what` names its user, as in
/// `mesh 0, primitive 1: POSITION`.
pub(super) fn open<'a>(
    document: &'a Document,
    what: &str,
    accessor: json::Index<json::Accessor>,
    shape: Type,
    components: &[ComponentType],
) -> Result<Array<'a>> {
    let help = "the file is damaged or not glTF 2.0: export it again";
    let index = accessor.value();
    let Some(accessor) = document.root.accessors.get(index) else {
        return Err(document.fault(format!("{what} refers to accessor {index}, which does not exist"), help));
    };
    if accessor.sparse.is_some() {
        return Err(document.fault(
            format!("{what} is a sparse accessor (accessor {index}), which is not supported"),
            "export the scene without sparse accessors",
        ));
    }
    let component = match accessor.component_type {
        Checked::Valid(component) if components.contains(&component.0) => component.0,
        Checked::Valid(component) => {
            return Err(document.fault(
                format!("{what} has components of type {:?}; expected one of {components:?}", component.0),
                help,
            ));
        }
        Checked::Invalid => {
            return Err(document.fault(format!("accessor {index} has an unknown component type"), help));
        }
    };
    if accessor.type_ != Checked::Valid(shape) {
        return Err(document.fault(format!("{what} (accessor {index}) is not of type {shape:?}"), help));
    }
    let Some(view_index) = accessor.buffer_view else {
        return Err(match extensions::compression(document) {
            Some(name) => document.fault(
                format!("{what} has no data of its own: the file is compressed with {name}"),
                extensions::advice(name),
            ),
            None => document.fault(format!("{what} has no data: accessor {index} has no buffer view"), help),
        });
    };
    let (view, stride) = buffers::view(document, &format!("accessor {index}"), view_index)?;
    let element = component.size() * shape.multiplicity();
    let stride = stride.unwrap_or(element);
    if stride < element {
        return Err(document.fault(
            format!("accessor {index} has elements of {element} bytes in a buffer view of stride {stride}"),
            help,
        ));
    }
    let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
    let count = accessor.count.0;
    // All in u64 with checks: a hostile count or offset must not wrap around.
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
    let Some(bytes) = bytes else {
        return Err(document.fault(
            format!(
                "accessor {index} ({count} elements of {element} bytes, stride {stride}, at {offset}) ends outside \
                 its buffer view ({} bytes)",
                view.len()
            ),
            help,
        ));
    };
    // It fits: the view's length bounds it.
    let count = count as usize;
    Ok(Array { bytes, stride, component, normalized: accessor.normalized, count })
}

impl Array<'_> {
    /// Element `index` of a float or quantized vector, as `KHR_mesh_quantization` defines its value. `None` past the
    /// end.
    pub(super) fn vector<const N: usize>(&self, index: usize) -> Option<[f32; N]> {
        if index >= self.count {
            return None;
        }
        let size = self.component.size();
        let start = index * self.stride;
        let mut vector = [0.0; N];
        for (component, value) in vector.iter_mut().enumerate() {
            *value = self.component_at(start + component * size)?;
        }
        Some(vector)
    }

    /// Element `index` of an array of unsigned integers. `None` past the end.
    pub(super) fn integer(&self, index: usize) -> Option<u32> {
        if index >= self.count {
            return None;
        }
        let bytes = self.bytes.get(index * self.stride..)?;
        match self.component {
            ComponentType::U8 => bytes.first().map(|&byte| u32::from(byte)),
            ComponentType::U16 => bytes.first_chunk().map(|&word| u32::from(u16::from_le_bytes(word))),
            ComponentType::U32 => bytes.first_chunk().map(|&word| u32::from_le_bytes(word)),
            _ => None,
        }
    }

    fn component_at(&self, at: usize) -> Option<f32> {
        let bytes = self.bytes.get(at..)?;
        // Unsigned types have no negative values for the lower bound to act on.
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
