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

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ExtendedColorType, ImageFormat};

    use super::*;

    const BYTES: [u8; 48] = {
        let mut bytes = [0; 48];
        let mut at = 0;
        while at < bytes.len() {
            bytes[at] = (at * 37 % 256) as u8;
            at += 1;
        }
        bytes
    };

    fn agrees(format: Format, file: &[u8], what: &str) {
        let other: DynamicImage = image::load_from_memory(file).expect("it is a whole picture");
        let size = format.size(file).expect("it has a size");
        assert_eq!((size, Format::of(file)), ((other.width(), other.height()), Some(format)), "{what}");
        let decode = || format.decode(file, 1 << 20).expect("it is a whole picture");
        let rgba: Vec<[u8; 4]> = other.to_rgba8().pixels().map(|pixel| pixel.0).collect();
        assert_eq!(decode().into_rgba8(), rgba, "{what}");
        let deep = match decode().channels {
            1 => other.to_luma16().into_raw(),
            2 => other.to_luma_alpha16().into_raw(),
            3 => other.to_rgb16().into_raw(),
            _ => other.to_rgba16().into_raw(),
        };
        let ours = decode();
        assert_eq!(
            (ours.has_color(), ours.has_alpha()),
            (other.color().has_color(), other.color().has_alpha())
        );
        assert_eq!(ours.into_sixteen_bits(), deep, "{what}");
        assert!(format.decode(file, 5).is_err(), "more than five bytes: {what}");
    }

    #[test]
    fn pixels_are_those_of_an_independent_reader() {
        for color in [
            ExtendedColorType::L8,
            ExtendedColorType::La8,
            ExtendedColorType::Rgb8,
            ExtendedColorType::Rgba8,
            ExtendedColorType::L16,
            ExtendedColorType::La16,
            ExtendedColorType::Rgb16,
            ExtendedColorType::Rgba16,
        ] {
            let width = 48 * 8 / u32::from(color.bits_per_pixel()) / 2;
            let mut file = Cursor::new(Vec::new());
            image::write_buffer_with_format(&mut file, &BYTES, width, 2, color, ImageFormat::Png)
                .expect("PNG holds any of these");
            agrees(Format::Png, file.get_ref(), &format!("{color:?}"));
        }
        for (color, width) in [(ExtendedColorType::L8, 24), (ExtendedColorType::Rgb8, 8)] {
            let mut file = Cursor::new(Vec::new());
            image::write_buffer_with_format(&mut file, &BYTES, width, 2, color, ImageFormat::Jpeg)
                .expect("JPEG holds either");
            agrees(Format::Jpeg, file.get_ref(), &format!("{color:?}"));
        }
    }

    #[test]
    fn mutilated_files_are_errors_or_pictures() {
        let mut jpeg = Cursor::new(Vec::new());
        image::write_buffer_with_format(&mut jpeg, &BYTES, 8, 2, ExtendedColorType::Rgb8, ImageFormat::Jpeg)
            .expect("JPEG holds any RGB picture");
        let whole = jpeg.into_inner();
        assert_eq!(Format::of(b"GIF89a"), None);
        assert!(Format::Jpeg.decode(&whole[..20], 1 << 20).is_err());
        for at in 0..whole.len() {
            let _ = Format::Jpeg.decode(&whole[..at], 1 << 20);
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            let _ = Format::Jpeg.decode(&bytes, 1 << 20);
        }
    }
}
