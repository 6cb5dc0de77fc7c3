//! TIFF files with one picture, gray or RGB, of 8-bit or 16-bit integers or floating-point numbers.

pub(super) fn is(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(*magic))
}

#[cfg(not(feature = "pictures"))]
pub(super) fn read(_: &[u8], _: usize) -> Result<super::meaning::Stored, String> {
    Err("this build of krylux reads no TIFF: build it with its default features, or convert the picture"
        .into())
}

#[cfg(feature = "pictures")]
pub(super) use reader::read;

#[cfg(feature = "pictures")]
mod reader {
    use std::io::Cursor;

    use tiff::decoder::{Decoder, DecodingResult, Limits};
    use tiff::tags::Tag;
    use tiff::{ColorType, TiffError};

    use crate::image::Resolution;
    use crate::image::codec::Metadata;
    use crate::io::picture::meaning::Stored;

    type File<'a> = Decoder<Cursor<&'a [u8]>>;

    const TRANSFER_FUNCTION: Tag = Tag::Unknown(301);
    const WHITE_POINT: Tag = Tag::Unknown(318);
    const PRIMARIES: Tag = Tag::Unknown(319);

    pub(in super::super) fn read(bytes: &[u8], max_samples: usize) -> Result<Stored, String> {
        let message = |error: TiffError| error.to_string();
        let mut file = Decoder::new(Cursor::new(bytes)).map_err(message)?;
        let mut limits = Limits::default();
        limits.decoding_buffer_size = max_samples.saturating_mul(4);
        limits.intermediate_buffer_size = limits.decoding_buffer_size;
        file = file.with_limits(limits);
        let (width, height) = file.dimensions().map_err(message)?;
        let resolution = Resolution::new(width as usize, height as usize);
        let channels = match file.colortype().map_err(message)? {
            ColorType::Gray(8 | 16 | 32 | 64) => 1,
            ColorType::RGB(8 | 16 | 32 | 64) => 3,
            ColorType::RGBA(8 | 16 | 32 | 64) => 4,
            other => {
                return Err(format!("its pixels are of the kind {other:?}; only gray and RGB can be read"));
            }
        };
        let metadata = metadata(&mut file)?;
        let mut stored = DecodingResult::U8(Vec::new());
        let layout = file.read_image_to_buffer(&mut stored).map_err(message)?;
        let (mut samples, levels) = match stored {
            DecodingResult::U8(levels) => (divided(levels, 255.0), Some(255.0)),
            DecodingResult::U16(levels) => (divided(levels, 65535.0), Some(65535.0)),
            DecodingResult::F16(values) => (divided(values, 1.0), None),
            DecodingResult::F32(values) => (values, None),
            DecodingResult::F64(values) => (values.into_iter().map(|value| value as f32).collect(), None),
            _ => return Err("its samples are signed, or integers of more than 16 bits".into()),
        };
        if samples.len() != resolution.pixels() * channels {
            return Err("it has more channels than a picture".into());
        }
        if layout.planes > 1 {
            let pixels = resolution.pixels();
            samples = (0..pixels).flat_map(|at| samples[at..].iter().step_by(pixels).copied()).collect();
        }
        require_single(&mut file)?;
        Ok(Stored { resolution, channels, samples, levels, metadata })
    }

    fn divided<T: Into<f32>>(samples: Vec<T>, by: f32) -> Vec<f32> {
        samples.into_iter().map(|sample| sample.into() / by).collect()
    }

    fn metadata(file: &mut File<'_>) -> Result<Metadata, String> {
        let mut metadata = Metadata::default();
        let mut ratios = |tag: Tag| {
            let numbers = file.find_tag(tag).ok()??.into_u32_vec().ok()?;
            let pairs = numbers.as_chunks().0.iter();
            Some(pairs.map(|&[above, below]| above as f32 / below as f32).collect::<Vec<f32>>())
        };
        if let (Some([across]), Some([down])) =
            (ratios(Tag::XResolution).as_deref(), ratios(Tag::YResolution).as_deref())
        {
            metadata.pixel_aspect = Some(down / across);
        }
        if let (Some(rgb), Some(white)) = (ratios(PRIMARIES), ratios(WHITE_POINT)) {
            metadata.primaries = [rgb, white].concat().try_into().ok();
        }
        let message = |error: TiffError| error.to_string();
        metadata.orientation = file.find_tag_unsigned(Tag::Orientation).map_err(message)?;
        let profile = file.find_tag(Tag::IccProfile).map_err(message)?;
        metadata.icc = profile.map(|profile| profile.into_u8_vec()).transpose().map_err(message)?;
        if metadata.icc.is_none() && file.find_tag(TRANSFER_FUNCTION).map_err(message)?.is_some() {
            return Err("it has a transfer function of its own".into());
        }
        Ok(metadata)
    }

    /// Refuses files with more pictures than one. Smaller copies, as for previews, do not count.
    fn require_single(file: &mut File<'_>) -> Result<(), String> {
        while file.more_images() {
            file.next_image().map_err(|error| error.to_string())?;
            let kind: Option<u32> =
                file.find_tag_unsigned(Tag::NewSubfileType).map_err(|error| error.to_string())?;
            if kind.unwrap_or(0) & 1 == 0 {
                return Err("it has several pictures; save one of them alone".into());
            }
        }
        Ok(())
    }
}
