//! Decodes picture files.
//!
//! This module calls the decoders of PNG and JPEG directly, because its PNG decoder keeps 16 bits, and its JPEG decoder accepts truncated
//! files. The crate `image` decodes the formats that only textures use. Metadata are read apart from pixels, because only patterns and
//! targets heed them.

use std::io::Cursor;
use std::path::Path;

use png::{BitDepth, ColorType, Transformations};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Png,
    Jpeg,
    /// WebP, BMP, GIF or TGA.
    Other(OtherFormat),
}

/// A format that only textures use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OtherFormat {
    WebP,
    Bmp,
    Gif,
    Tga,
}

pub(crate) struct DecodedImage {
    pub width: u32,
    pub height: u32,
    /// The number of samples per pixel: 1 (gray), 2 (gray and alpha), 3 (RGB) or 4 (RGBA).
    pub channels: usize,
    samples: Samples,
}

/// The interleaved samples of all pixels, in the precision of the file.
enum Samples {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

/// The statements of a file about the meaning of its samples. They do not concern textures, whose meaning the material tells.
#[derive(Default)]
pub(crate) struct Metadata {
    /// The code points of ITU-T H.273 for primaries and transfer characteristics, and whether the range is full.
    pub cicp: Option<(u8, u8, bool)>,
    /// A colour profile.
    pub icc: Option<Vec<u8>>,
    pub srgb: bool,
    /// The exponent of the encoding: 1 is linear.
    pub gamma: Option<f32>,
    /// x and y of red, green, blue and white.
    pub primaries: Option<[f32; 8]>,
    pub exif: Option<Vec<u8>>,
    /// The orientation, as Exif counts it.
    pub orientation: Option<u16>,
    /// The width of a pixel divided by its height.
    pub pixel_aspect: Option<f32>,
}

impl Format {
    /// The format of a file, recognized by the first bytes of the file.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            Some(Self::Png)
        } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
            Some(Self::Jpeg)
        } else if bytes.starts_with(b"GIF8") {
            Some(Self::Other(OtherFormat::Gif))
        } else if bytes.starts_with(b"BM") && bytes.get(6..10) == Some(&[0; 4]) {
            // The letters `BM` alone are not sufficient, so the four reserved bytes must also be zero.
            Some(Self::Other(OtherFormat::Bmp))
        } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
            Some(Self::Other(OtherFormat::WebP))
        } else {
            None
        }
    }

    /// The format of a file whose first bytes do not identify it: TGA, recognized by the name of the file.
    pub(crate) fn of_name(name: &Path) -> Option<Self> {
        let is_tga = name.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tga"));
        is_tga.then_some(Self::Other(OtherFormat::Tga))
    }

    pub(crate) fn size(self, bytes: &[u8]) -> Result<(u32, u32), String> {
        match self {
            Self::Png => {
                let mut decoder = png::Decoder::new(Cursor::new(bytes));
                let info = decoder.read_header_info().map_err(|error| error.to_string())?;
                Ok((info.width, info.height))
            }
            Self::Jpeg => jpeg_size(&open_jpeg(bytes, ColorSpace::RGB)?),
            Self::Other(format) => other::size(format, bytes),
        }
    }

    /// Decodes the picture. If a header states more than `max_bytes` bytes of pixels, the file is refused before memory is allocated.
    pub(crate) fn decode(self, bytes: &[u8], max_bytes: usize) -> Result<DecodedImage, String> {
        match self {
            Self::Png => decode_png(bytes, max_bytes),
            Self::Jpeg => decode_jpeg(bytes, max_bytes),
            Self::Other(format) => other::decode(format, bytes, max_bytes),
        }
    }
}

impl Metadata {
    /// The metadata of a PNG or JPEG file. Other formats have none here.
    pub(crate) fn of(format: Format, bytes: &[u8], max_bytes: usize) -> Result<Self, String> {
        match format {
            Format::Png => Self::of_png(bytes, max_bytes),
            Format::Jpeg => Self::of_jpeg(bytes),
            Format::Other(_) => Ok(Self::default()),
        }
    }

    fn of_png(bytes: &[u8], max_bytes: usize) -> Result<Self, String> {
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: max_bytes });
        decoder.set_ignore_text_chunk(true);
        let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
        // Exif data may follow the pixels. If the end of the file is missing, they are missing too.
        let _ = reader.finish();
        let info = reader.info();
        let primaries = info
            .chrm_chunk
            .map(|of| [of.red, of.green, of.blue, of.white].map(|(x, y)| [x.into_value(), y.into_value()]));
        Ok(Self {
            cicp: info
                .coding_independent_code_points
                .map(|of| (of.color_primaries, of.transfer_function, of.is_video_full_range_image)),
            icc: info.icc_profile.as_deref().map(<[u8]>::to_vec),
            srgb: info.srgb.is_some(),
            gamma: info.gama_chunk.map(|gamma| gamma.into_value()),
            primaries: primaries.and_then(|of| of.as_flattened().try_into().ok()),
            exif: info.exif_metadata.as_deref().map(<[u8]>::to_vec),
            orientation: None,
            pixel_aspect: info.pixel_dims.map(|of| of.yppu as f32 / of.xppu as f32),
        })
    }

    fn of_jpeg(bytes: &[u8]) -> Result<Self, String> {
        let header = open_jpeg(bytes, ColorSpace::RGB)?;
        if header.info().is_some_and(|info| info.components == 4) {
            return Err("its colours are amounts of ink (CMYK); convert it to RGB".into());
        }
        // JFIF states the density in pixels across and down, right at the start.
        let density = bytes.get(6..18).filter(|segment| segment.starts_with(b"JFIF\0"));
        let density = density.map(|of| [8, 10].map(|at| f32::from(u16::from_be_bytes([of[at], of[at + 1]]))));
        Ok(Self {
            icc: header.icc_profile(),
            exif: header.exif().cloned(),
            pixel_aspect: density.map(|[across, down]| down / across),
            ..Self::default()
        })
    }
}

impl DecodedImage {
    /// Whether the file has 8 bits for each sample; 16 otherwise.
    pub(crate) fn is_eight_bits(&self) -> bool {
        matches!(self.samples, Samples::Eight(_))
    }

    /// All samples, interleaved, with 16 bits each. 8-bit samples are scaled by 257, so full scale stays full scale.
    pub(crate) fn into_sixteen_bits(self) -> Vec<u16> {
        match self.samples {
            Samples::Eight(samples) => samples.into_iter().map(|sample| u16::from(sample) * 257).collect(),
            Samples::Sixteen(samples) => samples,
        }
    }

    /// All pixels as RGBA with 8 bits per sample, rounded to nearest. Pixels are opaque if the file has no alpha.
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

fn decode_png(bytes: &[u8], max_bytes: usize) -> Result<DecodedImage, String> {
    let message = |error: png::DecodingError| error.to_string();
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: max_bytes });
    // Palettes, transparent colours and samples of fewer than 8 bits are expanded to 8-bit samples.
    decoder.set_transformations(Transformations::EXPAND);
    // Text and colour profiles are not used. In a malicious file, they may be very large.
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let mut reader = decoder.read_info().map_err(message)?;
    let (color, depth) = reader.output_color_type();
    let channels = match color {
        ColorType::Grayscale | ColorType::Indexed => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
    };
    let size = reader.output_buffer_size().filter(|&size| size <= max_bytes);
    let mut buffer = vec![0; size.ok_or("the picture is too large")?];
    reader.next_frame(&mut buffer).map_err(message)?;
    let samples = match depth {
        BitDepth::Sixteen => Samples::Sixteen(
            buffer.as_chunks().0.iter().map(|&big_endian| u16::from_be_bytes(big_endian)).collect(),
        ),
        _ => Samples::Eight(buffer),
    };
    let (width, height) = reader.info().size();
    Ok(DecodedImage { width, height, channels, samples })
}

fn decode_jpeg(bytes: &[u8], max_bytes: usize) -> Result<DecodedImage, String> {
    let header = open_jpeg(bytes, ColorSpace::RGB)?;
    let (width, height) = jpeg_size(&header)?;
    let gray = header.input_colorspace() == Some(ColorSpace::Luma);
    let (color, channels) = if gray { (ColorSpace::Luma, 1) } else { (ColorSpace::RGB, 3) };
    // A side of a JPEG file has at most 65,535 pixels, so this product cannot overflow.
    if width as usize * height as usize * channels > max_bytes {
        return Err("the picture is too large".into());
    }
    let samples = open_jpeg(bytes, color)?.decode().map_err(|error| error.to_string())?;
    Ok(DecodedImage { width, height, channels, samples: Samples::Eight(samples) })
}

/// The decoders of the formats that only textures use. All have 8-bit samples.
#[cfg(feature = "pictures")]
mod other {
    use std::io::Cursor;

    use image::{DynamicImage, ImageFormat, ImageReader, Limits};

    use super::{DecodedImage, OtherFormat, Samples};

    fn reader(format: OtherFormat, bytes: &[u8]) -> ImageReader<Cursor<&[u8]>> {
        let format = match format {
            OtherFormat::WebP => ImageFormat::WebP,
            OtherFormat::Bmp => ImageFormat::Bmp,
            OtherFormat::Gif => ImageFormat::Gif,
            OtherFormat::Tga => ImageFormat::Tga,
        };
        ImageReader::with_format(Cursor::new(bytes), format)
    }

    pub(super) fn size(format: OtherFormat, bytes: &[u8]) -> Result<(u32, u32), String> {
        reader(format, bytes).into_dimensions().map_err(|error| error.to_string())
    }

    pub(super) fn decode(
        format: OtherFormat,
        bytes: &[u8],
        max_bytes: usize,
    ) -> Result<DecodedImage, String> {
        let mut limits = Limits::default();
        limits.max_alloc = Some(max_bytes as u64);
        let mut reader = reader(format, bytes);
        reader.limits(limits);
        let picture = reader.decode().map_err(|error| error.to_string())?;
        let (width, height) = (picture.width(), picture.height());
        let (channels, samples) = match picture {
            DynamicImage::ImageLuma8(gray) => (1, gray.into_raw()),
            DynamicImage::ImageLumaA8(gray) => (2, gray.into_raw()),
            DynamicImage::ImageRgb8(color) => (3, color.into_raw()),
            other => (4, other.into_rgba8().into_raw()),
        };
        if samples.len() > max_bytes {
            return Err("the picture is too large".into());
        }
        Ok(DecodedImage { width, height, channels, samples: Samples::Eight(samples) })
    }
}

/// Stands in for the decoders in a build without them.
#[cfg(not(feature = "pictures"))]
mod other {
    use super::{DecodedImage, OtherFormat};

    fn left_out(format: OtherFormat) -> String {
        format!(
            "this build of krylux reads no {format:?}: build it with its default features, or convert the picture to PNG"
        )
    }

    pub(super) fn size(format: OtherFormat, _: &[u8]) -> Result<(u32, u32), String> {
        Err(left_out(format))
    }

    pub(super) fn decode(format: OtherFormat, _: &[u8], _: usize) -> Result<DecodedImage, String> {
        Err(left_out(format))
    }
}

fn jpeg_size(header: &JpegDecoder<ZCursor<&[u8]>>) -> Result<(u32, u32), String> {
    let info = header.info().ok_or("the header states no size")?;
    Ok((u32::from(info.width), u32::from(info.height)))
}

fn open_jpeg(bytes: &[u8], color: ColorSpace) -> Result<JpegDecoder<ZCursor<&[u8]>>, String> {
    // The format limits the sides, and the callers limit the memory. A truncated file is decoded as far as possible, as in viewers.
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
        assert_eq!(ours.channels, usize::from(other.color().channel_count()));
        assert_eq!(ours.into_sixteen_bits(), deep, "{what}");
        assert!(format.decode(file, 5).is_err(), "more than five bytes: {what}");
    }

    #[test]
    fn decoded_pixels_equal_those_of_the_image_crate() {
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
    fn textures_in_other_formats_are_decoded() {
        // GIF has a palette, with at most one transparent colour.
        let gif = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [0, 0, 0, 0]];
        let other = [[1, 2, 3, 255], [40, 50, 60, 255], [255, 128, 0, 255], [9, 8, 7, 255]];
        for (format, of, name, texels) in [
            (ImageFormat::WebP, OtherFormat::WebP, "a.webp", other),
            (ImageFormat::Bmp, OtherFormat::Bmp, "a.bmp", other),
            (ImageFormat::Gif, OtherFormat::Gif, "a.gif", gif),
            (ImageFormat::Tga, OtherFormat::Tga, "a.TGA", other),
        ] {
            let mut file = Cursor::new(Vec::new());
            let samples = texels.as_flattened();
            image::write_buffer_with_format(&mut file, samples, 2, 2, ExtendedColorType::Rgba8, format)
                .expect("each holds RGBA");
            let file = file.into_inner();
            let found = Format::of(&file).or_else(|| Format::of_name(Path::new(name)));
            assert_eq!(found, Some(Format::Other(of)), "{name}");
            let found = found.expect("it was just compared");
            assert_eq!(found.size(&file), Ok((2, 2)), "{name}");
            let decoded = found.decode(&file, 1 << 10).expect("it is a whole picture");
            assert_eq!(decoded.into_rgba8(), texels, "{name}");
            assert!(found.decode(&file, 5).is_err(), "more than five bytes: {name}");
        }
    }

    #[test]
    fn damaged_files_give_errors_or_pictures() {
        let mut jpeg = Cursor::new(Vec::new());
        image::write_buffer_with_format(&mut jpeg, &BYTES, 8, 2, ExtendedColorType::Rgb8, ImageFormat::Jpeg)
            .expect("JPEG holds any RGB picture");
        let whole = jpeg.into_inner();
        assert_eq!(Format::of(b"II*\0"), None);
        assert!(Format::Jpeg.decode(&whole[..20], 1 << 20).is_err());
        for at in 0..whole.len() {
            let _ = Format::Jpeg.decode(&whole[..at], 1 << 20);
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            let _ = Format::Jpeg.decode(&bytes, 1 << 20);
        }
    }
}
