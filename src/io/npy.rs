//! Reads and writes NumPy's `.npy` files. Arrays of any real type can be read.

use std::io::{self, Write};
use std::path::Path;

use npyz::{DType, Endianness, NpyFile, Order, TypeChar, TypeStr, WriterBuilder};

use super::atomic;
use crate::error::{Error, Result};
use crate::file;
use crate::image::{Image, Resolution};

/// The maximum length of a header in bytes, as in NumPy. Headers of plain arrays are much shorter.
const MAX_HEADER_BYTES: usize = 10_000;

/// An array from a file. Values are in C order (the last index runs fastest) and converted to `f64`.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// The length of each dimension; empty for a scalar.
    pub shape: Vec<usize>,
    /// The values. Their number is the product of `shape`.
    pub values: Vec<f64>,
}

/// Writes an array of `shape` (for example `[k, h, w]`). The values are in C order and keep their type.
///
/// # Errors
/// [`Error::Dimension`] if the number of values is not the product of `shape`; [`Error::Write`].
pub fn write_npy<T: npyz::AutoSerialize>(path: &Path, shape: &[usize], values: &[T]) -> Result<()> {
    let expected: usize = shape.iter().product();
    if expected != values.len() {
        return Err(Error::dimension(
            "values of an array",
            format!("{} = {expected}", describe_shape(shape)),
            values.len(),
        ));
    }
    atomic::write_with(path, |file| write_array(file, shape, values))
}

/// Writes an image as `f32`, `H×W` (luma) or `H×W×3` (RGB).
pub fn write_image(path: &Path, image: &Image) -> Result<()> {
    let Resolution { width, height } = image.resolution();
    let shape = [height, width, image.channels()];
    let dimensions = if image.channels() == 1 { 2 } else { 3 };
    write_npy(path, &shape[..dimensions], image.samples())
}

/// Writes the bytes of an `.npy` file to `writer`. The number of `values` must be the product of `shape`.
fn write_array<T: npyz::AutoSerialize>(writer: impl Write, shape: &[usize], values: &[T]) -> io::Result<()> {
    let shape: Vec<u64> = shape.iter().map(|&length| length as u64).collect();
    let mut array = npyz::WriteOptions::<T>::new().default_dtype().shape(&shape).writer(writer).begin_nd()?;
    for value in values {
        array.push(value)?;
    }
    array.finish()
}

/// Reads an array of a real type (`f2 f4 f8`, `i1`–`i8`, `u1`–`u8`, `bool`), in either byte order, in C or Fortran order. The values of
/// `bool` become 0 and 1. NaN and infinities are accepted; [`picture::require_finite`](super::picture::require_finite) rejects them.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] if the file is not in `.npy` format, is truncated, has additional bytes at its end, or contains
/// anything but a plain array of real numbers.
pub fn read_npy(path: &Path) -> Result<Array> {
    let bytes = file::read(path)?;
    parse(&bytes).map_err(|fault| unusable(path, fault))
}

/// Reads an image, `H×W` (luma) or `H×W×3` (RGB), as [`read_npy`] does. The values are rounded to `f32`.
///
/// # Errors
/// The errors of [`read_npy`]; also [`Error::Data`] for any other shape, an empty image, or a finite value that is too large for `f32`.
pub fn read_image(path: &Path) -> Result<Image> {
    let Array { shape, values } = read_npy(path)?;
    let (height, width, channels) = match *shape.as_slice() {
        [height, width] => (height, width, 1),
        [height, width, channels @ (1 | 3)] => (height, width, channels),
        _ => {
            return Err(unusable(
                path,
                format!("its shape is {}, but an image is H×W or H×W×3", describe_shape(&shape)),
            ));
        }
    };
    if values.is_empty() {
        return Err(unusable(path, format!("an image of {height} rows and {width} columns is empty")));
    }
    if let Some(at) = values.iter().position(|&value| value.is_finite() && (value as f32).is_infinite()) {
        return Err(unusable(path, format!("value {:e} at index {at} is beyond 32-bit floats", values[at])));
    }
    Image::new(Resolution::new(width, height), channels, values.iter().map(|&value| value as f32).collect())
}

pub(super) fn parse(bytes: &[u8]) -> std::result::Result<Array, String> {
    require_plain_header(bytes)?;
    let file = NpyFile::new(bytes).map_err(|error| format!("its header is malformed: {error}"))?;
    let DType::Plain(number) = file.dtype() else {
        return Err("it holds structured records, not numbers".into());
    };
    let decode = decoder(&number)?;
    let shape: Vec<usize> = file.shape().iter().map(|&length| length as usize).collect();
    let order = file.order();
    let size = number.num_bytes().unwrap_or(1);
    let data = file.into_inner();
    let count: usize = shape.iter().product();
    // `require_plain_header` limits the product of the lengths, so it does not overflow. The comparison then limits it by the length of the
    // file.
    if count.checked_mul(size) != Some(data.len()) {
        return Err(format!(
            "a {} array of {number} takes {} bytes, but the file holds {}",
            describe_shape(&shape),
            count as u128 * size as u128,
            data.len()
        ));
    }
    let mut stored: Vec<f64> = Vec::new();
    stored.try_reserve_exact(count).map_err(|error| format!("its {count} values: {error}"))?;
    stored.extend(data.chunks_exact(size).map(decode));
    let values = match order {
        Order::C => stored,
        Order::Fortran => from_fortran_order(&shape, &stored),
    };
    Ok(Array { shape, values })
}

/// The values of an `.npy` file whose numbers have the type `T`. The error text is a sentence about the fault.
pub(crate) fn parse_as<T: npyz::Deserialize>(bytes: &[u8]) -> std::result::Result<Vec<T>, String> {
    require_plain_header(bytes)?;
    let file = NpyFile::new(bytes).map_err(|error| format!("its header is malformed: {error}"))?;
    file.into_vec().map_err(|error| error.to_string())
}

/// Checks the header before the crate `npyz` parses it. Without this check, a malicious header could make `npyz` recurse as deeply as
/// brackets nest, allocate as much memory as the header states, and multiply lengths without overflow checks.
fn require_plain_header(bytes: &[u8]) -> std::result::Result<(), String> {
    if bytes.len() < 12 || !bytes.starts_with(b"\x93NUMPY") {
        return Err("it does not start as an .npy file does".into());
    }
    let (start, length) = match bytes[6] {
        1 => (10, usize::from(u16::from_le_bytes([bytes[8], bytes[9]]))),
        _ => (12, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize),
    };
    if length > MAX_HEADER_BYTES {
        return Err(format!("its header claims {length} bytes; that of a plain array has about 120"));
    }
    let text = bytes.get(start..start + length).ok_or("it is cut off within its header")?;
    if text.iter().filter(|byte| b"([{".contains(byte)).count() > 2 {
        return Err("it holds structured records, not numbers".into());
    }
    let mut elements: u64 = 1;
    let shape = text.split(|byte| b"([".contains(byte)).nth(1).unwrap_or_default();
    for digits in shape.split(|byte| !byte.is_ascii_digit()).filter(|digits| !digits.is_empty()) {
        let length: u64 =
            std::str::from_utf8(digits).ok().and_then(|text| text.parse().ok()).unwrap_or(u64::MAX);
        // A length of zero counts as 1 here, so that the product of the other lengths is also bounded.
        elements = elements
            .checked_mul(length.max(1))
            .filter(|&count| count < 1 << 48)
            .ok_or("its shape is too large")?;
    }
    Ok(())
}

/// A function that converts the bytes of one number to `f64`. It must get exactly the bytes of one number of its type.
type Decode = fn(&[u8]) -> f64;

/// The function that decodes numbers of this type. The error text says that the type is not supported.
fn decoder(number: &TypeStr) -> std::result::Result<Decode, String> {
    macro_rules! from_bytes {
        ($type:ty) => {
            if number.endianness() == Endianness::Big {
                |bytes| bytes.try_into().map_or(f64::NAN, |exact| <$type>::from_be_bytes(exact) as f64)
            } else {
                |bytes| bytes.try_into().map_or(f64::NAN, |exact| <$type>::from_le_bytes(exact) as f64)
            }
        };
    }
    Ok(match (number.type_char(), number.size_field()) {
        (TypeChar::Float, 2) if number.endianness() == Endianness::Big => {
            |bytes| bytes.try_into().map_or(f64::NAN, |exact| half(u16::from_be_bytes(exact)))
        }
        (TypeChar::Float, 2) => {
            |bytes| bytes.try_into().map_or(f64::NAN, |exact| half(u16::from_le_bytes(exact)))
        }
        (TypeChar::Float, 4) => from_bytes!(f32),
        (TypeChar::Float, 8) => from_bytes!(f64),
        (TypeChar::Int, 1) => from_bytes!(i8),
        (TypeChar::Int, 2) => from_bytes!(i16),
        (TypeChar::Int, 4) => from_bytes!(i32),
        (TypeChar::Int, 8) => from_bytes!(i64),
        (TypeChar::Uint, 1) => from_bytes!(u8),
        (TypeChar::Uint, 2) => from_bytes!(u16),
        (TypeChar::Uint, 4) => from_bytes!(u32),
        (TypeChar::Uint, 8) => from_bytes!(u64),
        (TypeChar::Bool, 1) => |bytes| f64::from(u8::from(bytes != [0])),
        _ => return Err(format!("its type is {number}, but real numbers are wanted (f4, f8, u1, bool, …)")),
    })
}

fn half(bits: u16) -> f64 {
    ::exr::prelude::f16::from_bits(bits).to_f64()
}

/// Reorders values from Fortran order (the first index runs fastest) to C order (the last index runs fastest).
pub(super) fn from_fortran_order(shape: &[usize], stored: &[f64]) -> Vec<f64> {
    let strides: Vec<usize> = shape
        .iter()
        .scan(1, |stride, &length| {
            let this = *stride;
            *stride *= length;
            Some(this)
        })
        .collect();
    (0..stored.len())
        .map(|index| {
            let mut rest = index;
            let mut offset = 0;
            for (&length, &stride) in shape.iter().zip(&strides).rev() {
                offset += rest % length * stride;
                rest /= length;
            }
            stored[offset]
        })
        .collect()
}

/// A shape as text, such as `128×96×3`.
fn describe_shape(shape: &[usize]) -> String {
    if shape.is_empty() {
        return "scalar".into();
    }
    shape.iter().map(usize::to_string).collect::<Vec<_>>().join("×")
}

fn unusable(path: &Path, fault: String) -> Error {
    Error::data(path, fault)
        .help("write it with numpy.save, as an array of real numbers of shape H×W or H×W×3")
}
