//! OpenEXR files with one part, 32-bit floats and run-length compression. Channel names have the name of the layer as a prefix (`photo.R`,
//! `photo.Y`).
//!
//! Half floats are never written. They have 11 significant bits, and their rounding would add noise to Krylov vectors.

use std::io::Cursor;
use std::path::Path;

use ::exr::math::Vec2;
use ::exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Layer, LayerAttributes, LineOrder,
    MetaData, ReadChannels, ReadLayers, Text, WritableImage,
};

use super::atomic;
use super::picture::meaning;
use crate::error::{Error, Result};
use crate::file;
use crate::image::{Image, Resolution};
use crate::machine;

/// The maximum number of samples in a file, over all channels: 8192² pixels in four channels.
const MAX_SAMPLES: usize = 1 << 28;

/// The bytes of memory for each sample while a file is decoded: in the decoder, in a plane, and in the image.
const BYTES_OF_SAMPLE: usize = 12;

/// Writes images of one size as the layers of one file. The channels of an RGB image are `NAME.R`, `NAME.G` and `NAME.B`, and a luma image
/// has `NAME.Y`. If the name is empty, the channels are `R`, `G`, `B` or `Y`, which every viewer shows by default.
///
/// # Errors
/// [`Error::Dimension`] if there is no layer or no pixel, if the sizes differ, or if a name is used twice or is not ASCII;
/// [`Error::Write`].
pub fn write_exr(path: &Path, layers: &[(&str, &Image)]) -> Result<()> {
    let bytes = encode(layers)?;
    let written = bytes.map_err(|error| Error::writing(path)(std::io::Error::other(error)))?;
    atomic::write_bytes(path, &written)
}

/// The bytes of a file with these layers. The outer error concerns the layers, and the inner error the encoder.
fn encode(layers: &[(&str, &Image)]) -> Result<std::result::Result<Vec<u8>, ::exr::error::Error>> {
    let Some(resolution) = layers.first().map(|(_, image)| image.resolution()).filter(|r| r.pixels() > 0)
    else {
        return Err(Error::dimension("layers of an EXR file", "one or more with pixels", "none"));
    };
    let mut channels: Vec<AnyChannel<FlatSamples>> = Vec::new();
    for &(name, image) in layers {
        if image.resolution() != resolution {
            return Err(Error::dimension("layers of an EXR file", resolution, image.resolution()));
        }
        for (channel, &suffix) in suffixes(image.channels()).iter().enumerate() {
            let full = if name.is_empty() { suffix.to_string() } else { format!("{name}.{suffix}") };
            let text = Text::new_or_none(&full)
                .filter(|text| full.is_ascii() && !channels.iter().any(|c| c.name == *text));
            let Some(text) = text else {
                return Err(Error::dimension("channel names of an EXR file", "ASCII, each once", full));
            };
            let samples = image.samples().iter().skip(channel).step_by(image.channels()).copied().collect();
            channels.push(AnyChannel::new(text, FlatSamples::F32(samples)));
        }
    }
    let encoding = Encoding {
        // The lower bits of light are noise. ZIP would save up to a tenth of the bytes, and take most of the time of a run's files.
        compression: Compression::RLE,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let picture = ::exr::prelude::Image::from_layer(Layer::new(
        (resolution.width, resolution.height),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(channels.into()),
    ));
    let mut file = Cursor::new(Vec::new());
    Ok(picture.write().to_buffered(&mut file).map(|()| file.into_inner()))
}

/// Reads one layer, as the display window shows it: pixels outside the layer's data window are black. It is RGB if it has the channels `R`,
/// `G` and `B`, and luma from the channel `Y` otherwise. Half floats and integers are converted to `f32`.
///
/// `layer` is the prefix of the channel names, or the name of a part. If it is `None`, the channels without a prefix are read, or the only
/// layer in the file.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] if the file is malformed, if its primaries are not those of Rec. 709, if its pixels are not square, if
/// it has luminance with chroma, or if it has no such layer, where the message lists the layers.
pub fn read_exr(path: &Path, layer: Option<&str>) -> Result<Image> {
    let bytes = file::read(path)?;
    let unusable = |fault| unusable(path, fault);
    let mut found = decode(&bytes).map_err(unusable)?;
    let chosen = match layer {
        Some(name) => found.iter().position(|(there, _)| there == name),
        None if found.len() == 1 => Some(0),
        None => found.iter().position(|(there, _)| there.is_empty()),
    };
    let Some(chosen) = chosen else {
        let names: Vec<_> = found.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let wanted = layer.map_or("bare R, G, B or Y channels".into(), |name| format!("layer \"{name}\""));
        return Err(unusable(match names.as_slice() {
            [] => "it has no channels named R, G, B or Y".into(),
            names => format!("it has no {wanted}, but the layers {}", names.join(", ")),
        }));
    };
    Ok(found.swap_remove(chosen).1)
}

/// The size of the display window, in which every layer is shown. No pixels are decoded.
pub(super) fn sizes(path: &Path) -> Result<Vec<Resolution>> {
    let bytes = file::read(path)?;
    let header = || MetaData::read_from_buffered(bytes.as_slice(), false).map_err(|error| error.to_string());
    let meta = machine::unless_panics(header).unwrap_or_else(|| Err("it is malformed".into()));
    let headers = meta.map_err(|fault| unusable(path, fault))?.headers;
    Ok(headers.iter().map(|of| shown(&of.shared_attributes.display_window)).collect())
}

fn shown(window: &IntegerBounds) -> Resolution {
    Resolution::new(window.size.width(), window.size.height())
}

fn unusable(path: &Path, fault: String) -> Error {
    Error::data(path, fault)
        .help("give an EXR file with channels R, G and B in Rec. 709, or Y, bare or in a layer")
}

fn decode(bytes: &[u8]) -> std::result::Result<Vec<(String, Image)>, String> {
    // The decoders of the crate `exr` may panic. Catching a panic is safe here, because the closure owns everything that it modifies.
    machine::unless_panics(|| decode_unguarded(bytes)).unwrap_or_else(|| Err("it is malformed".into()))
}

/// Works like [`decode`], but a damaged file may cause a panic.
fn decode_unguarded(bytes: &[u8]) -> std::result::Result<Vec<(String, Image)>, String> {
    let meta = MetaData::read_from_buffered(bytes, false).map_err(|error| error.to_string())?;
    let samples = meta.headers.iter().try_fold(0_usize, |sum, header| {
        let window = header.shared_attributes.display_window.size;
        let area = |size: Vec2<usize>| size.width().checked_mul(size.height());
        let each = area(header.layer_size)?.max(area(window)?);
        sum.checked_add(each.checked_mul(header.channels.list.len())?)
    });
    if samples.is_none_or(|count| count > MAX_SAMPLES) {
        return Err("it claims more than 2^28 samples".into());
    }
    let needed = samples.unwrap_or(0) as u64 * BYTES_OF_SAMPLE as u64;
    if needed > machine::memory() / 2 {
        return Err(format!("it takes {} MiB to decode, more than half of the memory", needed >> 20));
    }
    let picture = ::exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;

    let window = picture.attributes.display_window;
    if shown(&window).pixels() == 0 {
        return Err("its display window is empty".into());
    }
    meaning::require_square(Some(picture.attributes.pixel_aspect))?;
    if let Some(Chromaticities { red, green, blue, white }) = picture.attributes.chromaticities {
        let stated = [red, green, blue, white].map(|Vec2(x, y)| [x, y]);
        meaning::require_rec709(stated.as_flattened().try_into().unwrap_or(&meaning::REC709))?;
    }
    let mut found = Vec::new();
    for part in &picture.layer_data {
        let resolution = Resolution::new(part.size.width(), part.size.height());
        let corner = |of: Vec2<i32>| [i64::from(of.x()), i64::from(of.y())];
        let ([x, y], [left, above]) = (corner(part.attributes.layer_position), corner(window.position));
        if let Some(AttributeValue::Text(space)) = part.attributes.other.get(&Text::from("colorInteropID"))
            && !["lin_rec709", "data", "unknown"].iter().any(|known| space.to_string().starts_with(known))
        {
            return Err(format!("its colorInteropID is {:?}, not lin_rec709_scene", space.to_string()));
        }
        if part.channel_data.list.iter().any(|channel| channel.name.to_string().ends_with("RY")) {
            return Err("it has luminance and chroma (Y, RY and BY) instead of R, G and B".into());
        }
        let part_name = part.attributes.layer_name.as_ref().map(Text::to_string).unwrap_or_default();
        let channels: Vec<(String, &FlatSamples)> = part
            .channel_data
            .list
            .iter()
            .filter(|channel| channel.sampling == ::exr::math::Vec2(1, 1))
            .map(|channel| (channel.name.to_string(), &channel.sample_data))
            .collect();
        let mut prefixes: Vec<&str> =
            channels.iter().map(|(name, _)| name.rsplit_once('.').map_or("", |(before, _)| before)).collect();
        prefixes.sort_unstable();
        prefixes.dedup();
        for prefix in prefixes {
            if let Some(image) = assemble(&channels, prefix, resolution) {
                let image = placed(image, shown(&window), (x - left, y - above));
                let name = [part_name.as_str(), prefix].into_iter().filter(|name| !name.is_empty());
                found.push((name.collect::<Vec<_>>().join("."), image));
            }
        }
    }
    Ok(found)
}

/// The part of an image inside a window of size `shown`, in which the image has its top left corner at `offset`; black elsewhere.
fn placed(image: Image, shown: Resolution, (left, above): (i64, i64)) -> Image {
    if image.resolution() == shown && (left, above) == (0, 0) {
        return image;
    }
    let (size, channels) = (image.resolution(), image.channels());
    let mut placed = Image::filled(shown, channels, 0.0);
    // The rows or columns of the window that the image covers. No length of memory is too large for `i64`.
    let covered = |offset: i64, length: usize, of: usize| {
        let within = |at: i64| at.clamp(0, of as i64) as usize;
        within(offset)..within(offset + length as i64)
    };
    let columns = covered(left, size.width, shown.width);
    for y in covered(above, size.height, shown.height).filter(|_| !columns.is_empty()) {
        let row = (y as i64 - above) as usize * size.width;
        let from = channels * (row + (columns.start as i64 - left) as usize);
        let to = channels * (y * shown.width + columns.start);
        let length = channels * columns.len();
        placed.samples_mut()[to..to + length].copy_from_slice(&image.samples()[from..from + length]);
    }
    placed
}

/// The image of the channels `prefix.R`, `prefix.G`, `prefix.B`, or of `prefix.Y`; `None` if the file has neither.
fn assemble(channels: &[(String, &FlatSamples)], prefix: &str, resolution: Resolution) -> Option<Image> {
    let plane = |suffix: &str| {
        let full = if prefix.is_empty() { suffix.to_string() } else { format!("{prefix}.{suffix}") };
        let (_, samples) = channels.iter().find(|(name, _)| *name == full)?;
        Some(samples.values_as_f32().collect::<Vec<f32>>())
    };
    [3, 1].into_iter().find_map(|count| {
        let planes: Vec<Vec<f32>> =
            suffixes(count).iter().map(|suffix| plane(suffix)).collect::<Option<_>>()?;
        if planes.iter().any(|samples| samples.len() != resolution.pixels()) {
            return None;
        }
        let interleaved =
            (0..resolution.pixels()).flat_map(|pixel| planes.iter().map(move |plane| plane[pixel]));
        Image::new(resolution, count, interleaved.collect()).ok()
    })
}

fn suffixes(channels: usize) -> &'static [&'static str] {
    if channels == 3 { &["R", "G", "B"] } else { &["Y"] }
}
