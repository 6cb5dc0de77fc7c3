//! Decoding of PNG and JPEG files.
//!
//! The decoders are called directly: the crates that offer many formats behind one interface also bring colour
//! management, which nothing here needs and which takes longer to compile than both decoders together.

use std::io::Cursor;

use png::{BitDepth, ColorType, Transformations};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// A file format that can be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Png,
    Jpeg,
}

/// A decoded picture, row by row from the top left.
pub(crate) struct Decoded {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel: gray, gray and alpha, RGB, or RGBA.
    pub channels: usize,
    samples: Samples,
}

/// The samples of all pixels, interleaved, in the precision of the file.
enum Samples {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

impl Format {
    /// The format that the first bytes of a file announce.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            Some(Self::Png)
        } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
            Some(Self::Jpeg)
        } else {
            None
        }
    }

    /// Reads width and height, in pixels, without decoding the pixels.
    ///
    /// # Errors
    /// The decoder's own words when the file is malformed.
    pub(crate) fn size(self, bytes: &[u8]) -> Result<(u32, u32), String> {
        match self {
            Self::Png => {
                let mut decoder = png::Decoder::new(Cursor::new(bytes));
                let info = decoder.read_header_info().map_err(|error| error.to_string())?;
                Ok((info.width, info.height))
            }
            Self::Jpeg => jpeg_size(&open_jpeg(bytes, ColorSpace::RGB)?),
        }
    }

    /// Decodes the picture. A header that asks for more than `most_bytes` of pixels is refused before any memory is
    /// reserved for them.
    ///
    /// # Errors
    /// The decoder's own words when the file is malformed or too large.
    pub(crate) fn decode(self, bytes: &[u8], most_bytes: usize) -> Result<Decoded, String> {
        match self {
            Self::Png => decode_png(bytes, most_bytes),
            Self::Jpeg => decode_jpeg(bytes, most_bytes),
        }
    }
}

impl Decoded {
    /// Whether pixels have red, green and blue rather than gray alone.
    pub(crate) fn has_color(&self) -> bool {
        self.channels >= 3
    }

    /// Whether a pixel's last sample is its opacity.
    pub(crate) fn has_alpha(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// All samples, interleaved, with 16 bits each; 8-bit samples keep their ratio to full scale.
    pub(crate) fn into_sixteen_bits(self) -> Vec<u16> {
        match self.samples {
            Samples::Eight(samples) => samples.into_iter().map(|sample| u16::from(sample) * 257).collect(),
            Samples::Sixteen(samples) => samples,
        }
    }

    /// All pixels as RGBA with 8 bits a sample, rounded to nearest; opaque where the file has no alpha.
    pub(crate) fn into_rgba8(self) -> Vec<[u8; 4]> {
        let samples = match self.samples {
            Samples::Eight(samples) => samples,
            Samples::Sixteen(samples) => samples
                .into_iter()
                .map(|sample| u8::try_from((u32::from(sample) + 128) / 257).unwrap_or(u8::MAX))
                .collect(),
        };
        let pixel = |samples: &[u8]| match *samples {
            [gray] => [gray, gray, gray, u8::MAX],
            [gray, alpha] => [gray, gray, gray, alpha],
            [red, green, blue] => [red, green, blue, u8::MAX],
            [red, green, blue, alpha] => [red, green, blue, alpha],
            _ => [0; 4],
        };
        samples.chunks_exact(self.channels).map(pixel).collect()
    }
}

fn decode_png(bytes: &[u8], most_bytes: usize) -> Result<Decoded, String> {
    let words = |error: png::DecodingError| error.to_string();
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: most_bytes });
    // Palettes, transparent colours and fewer than 8 bits become plain samples; 16 bits stay 16.
    decoder.set_transformations(Transformations::EXPAND);
    // Neither is used, and both can be forged.
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let mut reader = decoder.read_info().map_err(words)?;
    let (color, depth) = reader.output_color_type();
    let channels = match color {
        ColorType::Grayscale | ColorType::Indexed => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
    };
    let size = reader.output_buffer_size().filter(|&size| size <= most_bytes);
    let mut buffer = vec![0; size.ok_or("the picture is too large")?];
    reader.next_frame(&mut buffer).map_err(words)?;
    let samples = match depth {
        BitDepth::Sixteen => Samples::Sixteen(
            buffer.as_chunks().0.iter().map(|&big_endian| u16::from_be_bytes(big_endian)).collect(),
        ),
        _ => Samples::Eight(buffer),
    };
    let (width, height) = reader.info().size();
    Ok(Decoded { width, height, channels, samples })
}

fn decode_jpeg(bytes: &[u8], most_bytes: usize) -> Result<Decoded, String> {
    let header = open_jpeg(bytes, ColorSpace::RGB)?;
    let (width, height) = jpeg_size(&header)?;
    let gray = header.input_colorspace() == Some(ColorSpace::Luma);
    let (color, channels) = if gray { (ColorSpace::Luma, 1) } else { (ColorSpace::RGB, 3) };
    // A JPEG file has at most 65,535 pixels a side, so this product cannot overflow.
    if width as usize * height as usize * channels > most_bytes {
        return Err("the picture is too large".into());
    }
    let samples = open_jpeg(bytes, color)?.decode().map_err(|error| error.to_string())?;
    Ok(Decoded { width, height, channels, samples: Samples::Eight(samples) })
}

fn jpeg_size(header: &JpegDecoder<ZCursor<&[u8]>>) -> Result<(u32, u32), String> {
    let info = header.info().ok_or("the header states no size")?;
    Ok((u32::from(info.width), u32::from(info.height)))
}

/// Reads the headers of a JPEG file whose pixels are to be decoded to `color`.
fn open_jpeg(bytes: &[u8], color: ColorSpace) -> Result<JpegDecoder<ZCursor<&[u8]>>, String> {
    // The format alone bounds the sides here, and callers bound the memory. A file that was cut short is decoded as far
    // as it goes, as viewers do.
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(color)
        .set_strict_mode(false)
        .set_max_width(usize::MAX)
        .set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| error.to_string())?;
    Ok(decoder)
}
