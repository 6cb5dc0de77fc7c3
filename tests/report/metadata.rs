//! Pictures mean what their metadata say. The expected values are computed here, from the definitions of the formats.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, IntegerBounds, Layer, LayerAttributes, Text, Vec2,
    WritableImage,
};
use krylux::image::{Image, Resolution};
use krylux::io::picture;
use proptest::prelude::*;
use tempfile::TempDir;

/// A picture of samples in [0, 1], given as integers of 16 bits.
#[derive(Clone, Debug)]
struct Levels {
    width: usize,
    height: usize,
    channels: usize,
    levels: Vec<u16>,
}

fn levels() -> impl Strategy<Value = Levels> {
    (1..6_usize, 1..6_usize, prop::sample::select(vec![1, 3])).prop_flat_map(|(width, height, channels)| {
        prop::collection::vec(any::<u16>(), width * height * channels).prop_map(move |levels| Levels {
            width,
            height,
            channels,
            levels,
        })
    })
}

impl Levels {
    fn eight_bits(&self) -> Vec<u8> {
        self.levels.iter().map(|level| level.to_be_bytes()[0]).collect()
    }

    fn sixteen_bits(&self) -> Vec<u8> {
        self.levels.iter().flat_map(|level| level.to_be_bytes()).collect()
    }

    fn encoded(&self) -> Vec<f64> {
        self.levels.iter().map(|&level| f64::from(level) / 65535.0).collect()
    }

    /// Positive numbers of any size.
    fn floats(&self) -> Vec<f32> {
        self.levels.iter().map(|&level| f32::from(level) * 0.37 + 0.001).collect()
    }

    fn color(&self) -> png::ColorType {
        if self.channels == 3 { png::ColorType::Rgb } else { png::ColorType::Grayscale }
    }

    /// A PNG file of 16 bits with these chunks before the pixels.
    fn png(&self, chunks: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_color(self.color());
        encoder.set_depth(png::BitDepth::Sixteen);
        let mut writer = encoder.write_header().expect("the header is valid");
        for (name, data) in chunks {
            writer.write_chunk(png::chunk::ChunkType(**name), data).expect("memory can be written");
        }
        writer.write_image_data(&self.sixteen_bits()).expect("the pixels are complete");
        writer.finish().expect("memory can be written");
        file
    }

    /// The samples in the order in which `place` fetches pixels for a picture of size `shown`: from (x, y) to column and row.
    fn fetched<T: Copy>(
        &self,
        all: &[T],
        shown: (usize, usize),
        place: impl Fn(usize, usize) -> (usize, usize),
    ) -> Vec<T> {
        let mut found = Vec::new();
        for y in 0..shown.1 {
            for x in 0..shown.0 {
                let (column, row) = place(x, y);
                let at = self.channels * (row * self.width + column);
                found.extend_from_slice(&all[at..at + self.channels]);
            }
        }
        found
    }

    /// The samples after each of the eight orientations, by the words of the Exif specification: where the first row and the first column lie.
    fn turned<T: Copy>(&self, all: &[T], orientation: u8) -> (Resolution, Vec<T>) {
        let (width, height) = (self.width, self.height);
        let (right, below) = (width - 1, height - 1);
        let turned = (height, width);
        let (shown, samples) = match orientation {
            // The first row at the top, the first column at the right.
            2 => ((width, height), self.fetched(all, (width, height), |x, y| (right - x, y))),
            // At the bottom, and at the right.
            3 => ((width, height), self.fetched(all, (width, height), |x, y| (right - x, below - y))),
            // At the bottom, and at the left.
            4 => ((width, height), self.fetched(all, (width, height), |x, y| (x, below - y))),
            // The first row at the left, the first column at the top.
            5 => (turned, self.fetched(all, turned, |x, y| (y, x))),
            // At the right, and at the top.
            6 => (turned, self.fetched(all, turned, |x, y| (y, below - x))),
            // At the right, and at the bottom.
            7 => (turned, self.fetched(all, turned, |x, y| (right - y, below - x))),
            // At the left, and at the bottom.
            8 => (turned, self.fetched(all, turned, |x, y| (right - y, x))),
            _ => ((width, height), all.to_vec()),
        };
        (Resolution::new(shown.0, shown.1), samples)
    }
}

/// Reads the bytes as a file of this name. A file that states its size must state the one that is read.
fn read(name: &str, bytes: &[u8]) -> Result<Image, String> {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, bytes).expect("the temporary folder can be written");
    let image = picture::read(&path).map_err(|error| error.to_string())?;
    let stated = picture::stated_sizes(&path).map_err(|error| error.to_string())?;
    assert!(stated.is_empty() || stated.contains(&image.resolution()), "{stated:?}");
    Ok(image)
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    read(name, bytes).expect_err("it must be refused")
}

/// Linear values from sRGB (IEC 61966-2-1).
fn srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Samples are computed in single precision: a few roundings of 6e-8, of which a power function enlarges one.
fn assert_near(found: &[f32], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (&found, &expected) in found.iter().zip(expected) {
        assert!(
            (f64::from(found) - expected).abs() <= 2e-6 * expected.abs() + 1e-7,
            "{found} is not {expected}"
        );
    }
}

fn chunk_of_gamma(gamma: f64) -> (&'static [u8; 4], Vec<u8>) {
    (b"gAMA", ((gamma * 100_000.0).round() as u32).to_be_bytes().to_vec())
}

/// White, red, green and blue, in this order.
fn chunk_of_primaries(primaries: [f64; 8]) -> (&'static [u8; 4], Vec<u8>) {
    (b"cHRM", primaries.iter().flat_map(|of| ((of * 100_000.0).round() as u32).to_be_bytes()).collect())
}

const SRGB_PRIMARIES: [f64; 8] = [0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06];
const ADOBE_PRIMARIES: [f64; 8] = [0.3127, 0.329, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06];

/// Exif data with an orientation and, through two directories, an interoperability index.
fn exif(orientation: u8, index: &[u8; 4], little: bool) -> Vec<u8> {
    let short = |number: u16| if little { number.to_le_bytes() } else { number.to_be_bytes() };
    let long = |number: u32| if little { number.to_le_bytes() } else { number.to_be_bytes() };
    let entry = |tag: u16, kind: u16, count: u32, value: &[u8]| {
        let mut bytes = [&short(tag)[..], &short(kind), &long(count), value].concat();
        bytes.resize(12, 0);
        bytes
    };
    let directory =
        |entries: &[Vec<u8>]| [&short(entries.len() as u16)[..], &entries.concat(), &long(0)].concat();
    let start = [if little { b"II" } else { b"MM" }, &short(42)[..], &long(8)].concat();
    // A directory of two entries has 30 bytes, and one of one entry 18.
    let first =
        directory(&[entry(0x112, 3, 1, &short(u16::from(orientation))), entry(0x8769, 4, 1, &long(38))]);
    let second = directory(&[entry(0xa005, 4, 1, &long(56))]);
    let third = directory(&[entry(1, 2, 4, index)]);
    [start, first, second, third].concat()
}

/// A colour profile. Its curve is the data of a tag, and the primaries are XYZ under D50.
fn profile(space: &[u8; 4], curve: &[u8], primaries: [[f64; 3]; 3]) -> Vec<u8> {
    let name = b"desc\0\0\0\0\0\0\0\x0bA test name\0";
    let fixed = |number: f64| ((number * 65536.0).round() as i32).to_be_bytes();
    let xyz = |of: [f64; 3]| [b"XYZ \0\0\0\0".to_vec(), of.map(fixed).concat()].concat();
    let mut data = vec![0; 128];
    data[16..20].copy_from_slice(space);
    data[20..24].copy_from_slice(b"XYZ ");
    data[36..40].copy_from_slice(b"acsp");
    let mut tags: Vec<(&[u8; 4], Vec<u8>)> = vec![(b"desc", name.to_vec())];
    if space == b"GRAY" {
        tags.push((b"kTRC", curve.to_vec()));
    } else {
        tags.extend([b"rXYZ", b"gXYZ", b"bXYZ"].into_iter().zip(primaries.map(xyz)));
        tags.extend([b"rTRC", b"gTRC", b"bTRC"].map(|name| (name, curve.to_vec())));
    }
    let mut body = Vec::new();
    let start = 132 + 12 * tags.len();
    data.extend((tags.len() as u32).to_be_bytes());
    for (name, tag) in &tags {
        data.extend_from_slice(*name);
        data.extend(((start + body.len()) as u32).to_be_bytes());
        data.extend((tag.len() as u32).to_be_bytes());
        body.extend_from_slice(tag);
    }
    [data, body].concat()
}

const SRGB_XYZ: [[f64; 3]; 3] =
    [[0.43607, 0.22249, 0.01392], [0.38515, 0.71687, 0.09708], [0.14307, 0.06061, 0.7141]];
const P3_XYZ: [[f64; 3]; 3] =
    [[0.51512, 0.2412, -0.00105], [0.29198, 0.69225, 0.04189], [0.1571, 0.06657, 0.78407]];

fn para(kind: u16, numbers: &[f64]) -> Vec<u8> {
    let numbers = numbers.iter().flat_map(|number| ((number * 65536.0).round() as i32).to_be_bytes());
    [&b"para\0\0\0\0"[..], &kind.to_be_bytes(), &[0; 2]].concat().into_iter().chain(numbers).collect()
}

fn curv(levels: &[u16]) -> Vec<u8> {
    let start = [&b"curv\0\0\0\0"[..], &(levels.len() as u32).to_be_bytes()].concat();
    start.into_iter().chain(levels.iter().flat_map(|level| level.to_be_bytes())).collect()
}

fn iccp(profile: &[u8]) -> (&'static [u8; 4], Vec<u8>) {
    let mut packed = flate2_stored(profile);
    packed.splice(0..0, *b"name\0\0");
    (b"iCCP", packed)
}

/// A zlib stream of one stored block.
fn flate2_stored(bytes: &[u8]) -> Vec<u8> {
    let length = bytes.len() as u16;
    let (mut low, mut high) = (1_u32, 0_u32);
    for &byte in bytes {
        low = (low + u32::from(byte)) % 65521;
        high = (high + low) % 65521;
    }
    let sum = (high << 16 | low).to_be_bytes();
    [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes(), bytes, &sum].concat()
}

/// A JPEG file with segments after its start.
fn jpeg(picture: &Levels, segments: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let color =
        if picture.channels == 3 { image::ExtendedColorType::Rgb8 } else { image::ExtendedColorType::L8 };
    let (width, height) = (picture.width as u32, picture.height as u32);
    let format = image::ImageFormat::Jpeg;
    image::write_buffer_with_format(&mut file, &picture.eight_bits(), width, height, color, format)
        .expect("JPEG holds it");
    let mut file = file.into_inner();
    for (marker, data) in segments.iter().rev() {
        let segment = [&[0xff, *marker][..], &(data.len() as u16 + 2).to_be_bytes(), data].concat();
        file.splice(2..2, segment);
    }
    file
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn pngs_are_decoded_by_the_first_of_their_statements(
        picture in levels(), gamma in 0.3..1.2_f64, has in prop::array::uniform4(any::<bool>()),
        transfer in prop::sample::select(vec![1_u8, 4, 8, 13]), exponent in 1.0..2.6_f64, adobe in any::<bool>(),
    ) {
        let [cicp, icc, srgb_chunk, gama] = has;
        // A profile's exponent is stated in steps of 1/65536, and the chunk's in steps of 1e-5.
        let (gamma, exponent) = ((gamma * 1e5).round() / 1e5, (exponent * 65536.0).round() / 65536.0);
        let mut chunks = Vec::new();
        if cicp { chunks.push((b"cICP", vec![1, transfer, 0, 1])); }
        if icc {
            let space = if picture.channels == 3 { b"RGB " } else { b"GRAY" };
            chunks.push(iccp(&profile(space, &para(0, &[exponent]), SRGB_XYZ)));
        }
        if srgb_chunk { chunks.push((b"sRGB", vec![0])); }
        if gama { chunks.push(chunk_of_gamma(gamma)); }
        let primaries = if adobe { ADOBE_PRIMARIES } else { SRGB_PRIMARIES };
        chunks.push(chunk_of_primaries(primaries));
        let file = picture.png(&chunks);
        if adobe && picture.channels == 3 && !(cicp || icc || srgb_chunk) {
            prop_assert!(refusal("a.png", &file).contains("green (0.210, 0.710)"));
            return Ok(());
        }
        let decode = |x: f64| match (cicp, icc, srgb_chunk, gama) {
            (true, ..) => match transfer {
                // The inverse of BT.709's V = 1.099 L^0.45 - 0.099 for L >= 0.018, and V = 4.5 L below.
                1 if x < 0.08124286 => x / 4.5,
                1 => ((x + 0.0992968268) / 1.0992968268).powf(1.0 / 0.45),
                4 => x.powf(2.2),
                8 => x,
                _ => srgb(x),
            },
            (_, true, ..) => x.powf(exponent),
            (_, _, false, true) => x.powf(1.0 / gamma),
            _ => srgb(x),
        };
        let expected: Vec<f64> = picture.encoded().into_iter().map(decode).collect();
        let image = read("a.png", &file).expect("it is honoured");
        assert_near(image.samples(), &expected);
    }

    #[test]
    fn every_curve_of_a_profile_is_followed(picture in levels(), kind in 0..7_usize, in_jpeg in any::<bool>()) {
        let encoded: Vec<f64> = match in_jpeg {
            // JPEG changes values; those of the same file without the profile are taken back to sRGB.
            true => read("a.jpg", &jpeg(&picture, &[])).expect("it is plain").samples().iter()
                .map(|&linear| f64::from(linear)).map(|x| if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }).collect(),
            false => picture.encoded(),
        };
        // Numbers of a profile that binary fractions hold exactly.
        let (g, a, b, c, d, e, f) = (2.25, 0.875, 0.125, 0.0625, 0.25, 0.03125, 0.015625);
        let power = move |x: f64| (a * x + b).powf(g);
        type Decode = Box<dyn Fn(f64) -> f64>;
        let (curve, decode): (Vec<u8>, Decode) = match kind {
            0 => (curv(&[]), Box::new(|x| x)),
            1 => (curv(&[0x0180]), Box::new(|x| x.powf(1.5))),
            // A table of three: straight lines from 0 to 0.25 to 1.
            2 => (curv(&[0, 16384, 65535]), Box::new(|x| {
                let middle = 16384.0 / 65535.0;
                if x < 0.5 { 2.0 * x * middle } else { middle + (2.0 * x - 1.0) * (1.0 - middle) }
            })),
            // Above -b/a always.
            3 => (para(1, &[g, a, b]), Box::new(power)),
            4 => (para(2, &[g, a, -b, e]), Box::new(move |x| if x >= b / a { (a * x - b).powf(g) + e } else { e })),
            5 => (para(3, &[g, a, b, c, d]), Box::new(move |x| if x >= d { power(x) } else { c * x })),
            _ => (para(4, &[g, a, b, c, d, e, f]), Box::new(move |x| if x >= d { power(x) + e } else { c * x + f })),
        };
        let space = if picture.channels == 3 { b"RGB " } else { b"GRAY" };
        let profile = profile(space, &curve, SRGB_XYZ);
        let image = match in_jpeg {
            true => read("a.jpg", &jpeg(&picture, &[(0xe2, [b"ICC_PROFILE\0\x01\x01", profile.as_slice()].concat())])),
            false => read("a.png", &picture.png(&[iccp(&profile)])),
        }.expect("it is honoured");
        // Around the limit of a piece, rounding may choose the other one.
        for (&x, &found) in encoded.iter().zip(image.samples()) {
            let near = [x - 1e-6, x, x + 1e-6].iter().any(|&x| (decode(x.max(0.0)) - f64::from(found)).abs() < 1e-5);
            prop_assert!(near, "{x} becomes {found}, not {}", decode(x));
        }
    }

    #[test]
    fn every_orientation_is_honoured(picture in levels(), orientation in 0..10_u8, little in any::<bool>()) {
        let data = exif(orientation, b"R98\0", little);
        let (size, expected) = picture.turned(&picture.encoded(), orientation);
        let image = read("a.png", &picture.png(&[(b"eXIf", data.clone())])).expect("it is honoured");
        prop_assert_eq!(image.resolution(), size);
        assert_near(image.samples(), &expected.into_iter().map(srgb).collect::<Vec<_>>());

        let plain = read("a.jpg", &jpeg(&picture, &[])).expect("it is plain");
        let (size, expected) = picture.turned(plain.samples(), orientation);
        let image = read("a.jpg", &jpeg(&picture, &[(0xe1, [b"Exif\0\0", data.as_slice()].concat())]));
        let image = image.expect("it is honoured");
        prop_assert_eq!((image.resolution(), image.samples()), (size, expected.as_slice()));
    }

    #[test]
    fn an_exr_is_what_its_display_window_shows(
        picture in levels(), corner in (-9..9_i32, -9..9_i32), display in (-9..9_i32, -9..9_i32, 1..9_usize, 1..9_usize),
    ) {
        let (left, top, width, height) = display;
        let values = picture.floats();
        let names = if picture.channels == 3 { ["B", "G", "R"].as_slice() } else { &["Y"] };
        let channels = names.iter().enumerate().map(|(at, name)| {
            let plane = values.iter().skip(picture.channels - 1 - at).step_by(picture.channels).copied().collect();
            AnyChannel::new(Text::from(*name), FlatSamples::F32(plane))
        });
        let attributes = LayerAttributes { layer_position: Vec2(corner.0, corner.1), ..Default::default() };
        let channels = AnyChannels::sort(channels.collect());
        let layer = Layer::new((picture.width, picture.height), attributes, Encoding::FAST_LOSSLESS, channels);
        let mut file = exr::prelude::Image::from_layer(layer);
        file.attributes.display_window = IntegerBounds::new((left, top), (width, height));
        let mut bytes = Cursor::new(Vec::new());
        file.write().to_buffered(&mut bytes).expect("the file is valid");

        let image = read("a.exr", bytes.get_ref()).expect("it is honoured");
        prop_assert_eq!(image.resolution(), Resolution::new(width, height));
        for (at, &found) in image.samples().iter().enumerate() {
            let (pixel, channel) = (at / picture.channels, at % picture.channels);
            let x = (pixel % width) as i32 + left - corner.0;
            let y = (pixel / width) as i32 + top - corner.1;
            let inside = (0..picture.width as i32).contains(&x) && (0..picture.height as i32).contains(&y);
            let stored = (y * picture.width as i32 + x) * picture.channels as i32 + channel as i32;
            prop_assert_eq!(found, if inside { values[stored as usize] } else { 0.0 });
        }
    }

    #[test]
    fn netpbm_files_keep_their_precision(picture in levels(), maximum in 1..=65535_u16, text in any::<bool>()) {
        let levels: Vec<u16> = picture.levels.iter().map(|level| level % maximum + u16::from(level % 2 == 1)).collect();
        let kind = match (picture.channels, text) { (1, true) => 2, (1, false) => 5, (_, true) => 3, _ => 6 };
        let mut file = format!("P{kind} # a comment 7\n# 9\n{} {}\n{maximum}\n", picture.width, picture.height).into_bytes();
        for level in &levels {
            match text {
                true => file.extend(format!("{level}\n").bytes()),
                false if maximum < 256 => file.push(*level as u8),
                false => file.extend(level.to_be_bytes()),
            }
        }
        let image = read("a.pnm", &file).expect("it is whole");
        prop_assert_eq!(image.channels(), picture.channels);
        let expected: Vec<f64> = levels.iter().map(|&level| srgb(f64::from(level) / f64::from(maximum))).collect();
        assert_near(image.samples(), &expected);
        if !text {
            prop_assert!(refusal("a.pnm", &file[..file.len() - 1]).contains("truncated"));
        }
    }

    #[test]
    fn pfm_files_are_stored_from_below(picture in levels(), little in any::<bool>()) {
        let kind = if picture.channels == 3 { "PF" } else { "Pf" };
        let scale = if little { "-1.0" } else { "1" };
        let mut file = format!("{kind}\n{} {}\n{scale}\n", picture.width, picture.height).into_bytes();
        let row = picture.width * picture.channels;
        let values = picture.floats();
        for value in values.chunks(row).rev().flatten() {
            file.extend(if little { value.to_le_bytes() } else { value.to_be_bytes() });
        }
        let image = read("a.pfm", &file).expect("it is whole");
        prop_assert_eq!((image.resolution(), image.samples()), (Resolution::new(picture.width, picture.height), values.as_slice()));
    }

    #[test]
    fn radiance_files_tell_orientation_and_exposure(
        width in 1..20_usize, height in 1..6_usize, orientation in 1..=8_u8, exposure in 0.1..10.0_f64,
        bytes in prop::collection::vec(any::<[u8; 4]>(), 120), packed in any::<bool>(), repeat in 1..4_usize,
    ) {
        // Red of 255 is neither a run of the old kind nor the mark of the new one; pixels repeat for the sake of runs.
        let pixels: Vec<[u8; 4]> = (0..width * height).map(|at| bytes[at / repeat]).map(|of| [of[0] | 3, of[1], of[2], 100 + of[3] % 50]).collect();
        let signs = ["-Y +X", "-Y -X", "+Y -X", "+Y +X", "+X -Y", "-X -Y", "-X +Y", "+X +Y"][usize::from(orientation) - 1];
        let (slow, fast) = signs.split_once(' ').expect("it has two words");
        let header = format!(
            "#?RADIANCE\n\tEXPOSURE=7\nEXPOSURE={exposure}\nCOLORCORR= 1 2 0.5\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n{slow} {height} {fast} {width}\n"
        );
        let mut file = header.into_bytes();
        for row in pixels.chunks(width) {
            if packed && width >= 8 {
                file.extend([2, 2, 0, width as u8]);
                for component in 0..4 {
                    let mut at = 0;
                    while at < width {
                        let run = row[at..].iter().take_while(|pixel| pixel[component] == row[at][component]).count();
                        match run {
                            1 => file.extend([1, row[at][component]]),
                            _ => file.extend([128 + run as u8, row[at][component]]),
                        }
                        at += run;
                    }
                }
            } else {
                for same in row.chunk_by(|one, other| packed && one == other) {
                    file.extend(same[0]);
                    if same.len() > 1 { file.extend([1, 1, 1, same.len() as u8 - 1]); }
                }
            }
        }
        let picture = Levels { width, height, channels: 3, levels: Vec::new() };
        let values: Vec<f64> = pixels.iter().flat_map(|&[red, green, blue, exponent]| {
            let scale = 2.0_f64.powi(i32::from(exponent) - 136) / (2.0 * exposure);
            [f64::from(red) * scale, f64::from(green) * scale / 2.0, f64::from(blue) * scale / 0.5]
        }).collect();
        let (size, expected) = picture.turned(&values, orientation);
        let image = read("a.hdr", &file).expect("it is whole");
        prop_assert_eq!(image.resolution(), size);
        for (&found, &expected) in image.samples().iter().zip(&expected) {
            // One rounding to single precision.
            prop_assert!((f64::from(found) - expected).abs() <= 6e-8 * expected, "{} is not {}", found, expected);
        }
    }
}

#[cfg(feature = "pictures")]
mod tiffs {
    use tiff::encoder::colortype::{self, ColorType};
    use tiff::encoder::{TiffEncoder, TiffValue};
    use tiff::tags::Tag;

    use super::*;

    /// A TIFF file with an orientation and, if there is one, a profile.
    fn file<C: ColorType>(
        picture: &Levels,
        samples: &[C::Inner],
        orientation: u8,
        profile: Option<&[u8]>,
    ) -> Vec<u8>
    where
        [C::Inner]: TiffValue,
    {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).expect("memory can be written");
        let mut image =
            encoder.new_image::<C>(picture.width as u32, picture.height as u32).expect("it has pixels");
        image.encoder().write_tag(Tag::Orientation, u16::from(orientation)).expect("memory can be written");
        if let Some(profile) = profile {
            image.encoder().write_tag(Tag::IccProfile, profile).expect("memory can be written");
        }
        image.write_data(samples).expect("the pixels are complete");
        bytes.into_inner()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn tiff_files_keep_their_precision(picture in levels(), orientation in 1..=8_u8, depth in 0..3_u8, profiled in any::<bool>()) {
            let space = if picture.channels == 3 { b"RGB " } else { b"GRAY" };
            let curve = if depth == 2 { para(0, &[1.0]) } else { para(0, &[1.5]) };
            let profile = profile(space, &curve, SRGB_XYZ);
            let profile = profiled.then_some(profile.as_slice());
            let (eight, floats) = (picture.eight_bits(), picture.floats());
            let bytes = match (depth, picture.channels) {
                (0, 1) => file::<colortype::Gray8>(&picture, &eight, orientation, profile),
                (0, _) => file::<colortype::RGB8>(&picture, &eight, orientation, profile),
                (1, 1) => file::<colortype::Gray16>(&picture, &picture.levels, orientation, profile),
                (1, _) => file::<colortype::RGB16>(&picture, &picture.levels, orientation, profile),
                (_, 1) => file::<colortype::Gray32Float>(&picture, &floats, orientation, profile),
                _ => file::<colortype::RGB32Float>(&picture, &floats, orientation, profile),
            };
            let decode = |x: f64| if profiled { x.powf(1.5) } else { srgb(x) };
            let values: Vec<f64> = match depth {
                0 => eight.iter().map(|&level| decode(f64::from(level) / 255.0)).collect(),
                1 => picture.encoded().into_iter().map(decode).collect(),
                _ => floats.iter().map(|&value| f64::from(value)).collect(),
            };
            let (size, expected) = picture.turned(&values, orientation);
            let image = read("a.tif", &bytes).expect("it is honoured");
            prop_assert_eq!((image.resolution(), image.channels()), (size, picture.channels));
            assert_near(image.samples(), &expected);
        }
    }

    /// A TIFF file of big-endian numbers: the pixels, then the tags in SHORT (3) or LONG (4).
    fn by_hand(pixels: &[u8; 8], tags: &[(u16, u16, &[u32])]) -> Vec<u8> {
        let mut file = [&b"MM\0*\0\0\0\x10"[..], pixels, &(tags.len() as u16).to_be_bytes()].concat();
        let mut beyond = Vec::new();
        for &(tag, kind, values) in tags {
            let value = |&value: &u32| {
                if kind == 3 { (value as u16).to_be_bytes().to_vec() } else { value.to_be_bytes().to_vec() }
            };
            let mut values_as_bytes = values.iter().flat_map(value).collect::<Vec<u8>>();
            if values_as_bytes.len() > 4 {
                let place = 16 + 2 + 12 * tags.len() + 4 + beyond.len();
                beyond.extend(std::mem::replace(&mut values_as_bytes, (place as u32).to_be_bytes().to_vec()));
            }
            values_as_bytes.resize(4, 0);
            let count = (values.len() as u32).to_be_bytes();
            file.extend([&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count, &values_as_bytes].concat());
        }
        [file, vec![0; 4], beyond].concat()
    }

    #[test]
    fn planes_and_negatives_of_tiff_files_become_pictures() {
        let size: [(u16, u16, &[u32]); 2] = [(256, 4, &[2]), (257, 4, &[1])];
        let planar = by_hand(
            &[10, 20, 30, 40, 50, 60, 0, 0],
            &[
                &size[..],
                &[
                    (258, 3, &[8, 8, 8]),
                    (259, 3, &[1]),
                    (262, 3, &[2]),
                    (273, 4, &[8, 10, 12]),
                    (277, 3, &[3]),
                    (278, 4, &[1]),
                    (279, 4, &[2, 2, 2]),
                    (284, 3, &[2]),
                ],
            ]
            .concat(),
        );
        let image = read("a.tif", &planar).expect("it is whole");
        assert_near(image.samples(), &[10.0, 30.0, 50.0, 20.0, 40.0, 60.0].map(|level| srgb(level / 255.0)));
        let negative = by_hand(
            &[10, 255, 0, 0, 0, 0, 0, 0],
            &[
                &size[..],
                &[
                    (258, 3, &[8]),
                    (259, 3, &[1]),
                    (262, 3, &[0]),
                    (273, 4, &[8]),
                    (277, 3, &[1]),
                    (278, 4, &[1]),
                    (279, 4, &[2]),
                ],
            ]
            .concat(),
        );
        let image = read("a.tif", &negative).expect("it is whole");
        assert_near(image.samples(), &[245.0, 0.0].map(|level| srgb(level / 255.0)));
    }

    #[test]
    fn a_tiff_that_has_no_one_meaning_is_refused() {
        let picture = Levels { width: 2, height: 1, channels: 1, levels: vec![3, 4] };
        let curved = profile(b"GRAY", &para(0, &[2.2]), SRGB_XYZ);
        let floats = file::<colortype::Gray32Float>(&picture, &picture.floats(), 1, Some(&curved));
        assert!(refusal("a.tif", &floats).contains("not linear"));
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).expect("memory can be written");
        for _ in 0..2 {
            encoder.write_image::<colortype::Gray16>(2, 1, &picture.levels).expect("memory can be written");
        }
        assert!(refusal("a.tif", bytes.get_ref()).contains("several pictures"));
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).expect("memory can be written");
        encoder.write_image::<colortype::CMYK8>(1, 1, &[1, 2, 3, 4]).expect("memory can be written");
        assert!(refusal("a.tif", bytes.get_ref()).contains("CMYK"));
    }
}

#[test]
fn statements_that_cannot_be_honoured_are_refused_by_name() {
    let picture = Levels { width: 2, height: 1, channels: 3, levels: vec![1, 2, 3, 4, 5, 6] };
    let icc = |space, curve: &[u8], primaries| picture.png(&[iccp(&profile(space, curve, primaries))]);
    let adobe = exif(1, b"R03\0", true);
    let mut two_curves = profile(b"RGB ", &para(0, &[2.2]), SRGB_XYZ);
    // The last tag of the file is the curve of blue.
    let end = two_curves.len() - 1;
    two_curves[end] ^= 0x40;
    for (name, file, what) in [
        ("a.png", picture.png(&[(b"cICP", vec![1, 16, 0, 1])]), "PQ"),
        ("a.png", picture.png(&[(b"cICP", vec![1, 18, 0, 1])]), "HLG"),
        ("a.png", picture.png(&[(b"cICP", vec![1, 13, 0, 0])]), "narrow range"),
        ("a.png", picture.png(&[(b"cICP", vec![9, 13, 0, 1])]), "primaries 9"),
        ("a.png", icc(b"RGB ", &para(0, &[2.2]), P3_XYZ), "\"A test name\" has other primaries"),
        ("a.png", icc(b"CMYK", &[], SRGB_XYZ), "is for CMYK pictures"),
        ("a.png", icc(b"RGB ", b"what", SRGB_XYZ), "has a curve that cannot be read"),
        ("a.png", picture.png(&[iccp(&two_curves)]), "a curve of its own for each channel"),
        ("a.png", picture.png(&[(b"eXIf", adobe.clone())]), "Adobe RGB"),
        (
            "a.png",
            picture.png(&[(
                b"pHYs",
                [1_u32.to_be_bytes(), 2_u32.to_be_bytes()].concat().into_iter().chain([0]).collect(),
            )]),
            "not square",
        ),
        ("a.jpg", jpeg(&picture, &[(0xe1, [b"Exif\0\0", adobe.as_slice()].concat())]), "Adobe RGB"),
        ("a.pfm", b"Pf 1 1 -2.5\n\0\0\0\0".to_vec(), "its scale is 2.5"),
        ("a.pnm", b"P4 1 1\n\0".to_vec(), "P4"),
        ("a.pgm", b"P2 1 1 9\n10".to_vec(), "greater than 9"),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n\0\0\0\0".to_vec(), "xyze"),
        ("a.hdr", b"#?RGBE\nPIXASPECT=2\n\n-Y 1 +X 1\n\0\0\0\0".to_vec(), "not square"),
        (
            "a.hdr",
            b"#?RGBE\nPRIMARIES=.7 .3 .2 .7 .1 .1 .33 .33\n\n-Y 1 +X 1\n\0\0\0\0".to_vec(),
            "red (0.700, 0.300)",
        ),
        ("a.hdr", b"#?RGBE\nGAMMA=2.2\n\n-Y 1 +X 1\n\0\0\0\0".to_vec(), "GAMMA=2.2"),
        ("a.hdr", b"#?RGBE\n\n-Z 1 +X 1\n\0\0\0\0".to_vec(), "-Z 1 +X 1"),
        ("a.hdr", b"#?RGBE\n\n-Y 1 +X 2\n\x09\0\0\x80\x01\x01\x01\x02".to_vec(), "malformed"),
    ] {
        let refused = refusal(name, &file);
        assert!(refused.contains(what), "{what}: {refused}");
    }
}

#[test]
fn a_jpeg_that_stores_rgb_is_not_converted() {
    // A picture of one colour, stored as luminance and chroma; Adobe's segment declares that they are red, green and blue.
    let [red, green, blue] = [180.0, 100.0, 60.0_f64];
    let levels = [180_u16, 100, 60].map(|level| level << 8).repeat(64);
    let picture = Levels { width: 8, height: 8, channels: 3, levels };
    let image = read("a.jpg", &jpeg(&picture, &[(0xee, b"Adobe\0\x64\0\0\0\0\0".to_vec())]));
    // ITU-T T.871.
    let luminance = 0.299 * red + 0.587 * green + 0.114 * blue;
    let expected = [luminance, 128.0 + (blue - luminance) / 1.772, 128.0 + (red - luminance) / 1.402];
    let image = image.expect("it is honoured");
    for (&found, stored) in image.samples().iter().zip(expected.into_iter().cycle()) {
        // At the quality of 75, the mean level of a block is stored in steps of 8/8 or 9/8: half a step, and two roundings, are less than 2.
        let [least, most] = [stored - 2.0, stored + 2.0].map(|level| srgb(level / 255.0));
        assert!((least..most).contains(&f64::from(found)), "{found} is not in {least} to {most}");
    }
}

#[test]
fn ink_is_refused() {
    // The header alone of a JPEG file of four components, with tables of ones.
    let mut file = vec![0xff, 0xd8, 0xff, 0xee, 0, 14];
    file.extend(b"Adobe\0\x64\0\0\0\0\x02");
    file.extend([0xff, 0xdb, 0, 67, 0]);
    file.extend([1; 64]);
    file.extend([0xff, 0xc0, 0, 20, 8, 0, 8, 0, 8, 4]);
    file.extend([1_u8, 2, 3, 4].into_iter().flat_map(|component| [component, 0x11, 0]));
    file.extend([0xff, 0xda, 0, 14, 4]);
    file.extend([1_u8, 2, 3, 4].into_iter().flat_map(|component| [component, 0]));
    file.extend([0, 63, 0]);
    assert!(refusal("a.jpg", &file).contains("CMYK"));
}

#[test]
fn an_exr_of_other_primaries_or_pixels_is_refused() {
    let write = |change: &dyn Fn(&mut exr::prelude::ImageAttributes, &mut LayerAttributes),
                 names: &[&str]| {
        let channels =
            names.iter().map(|name| AnyChannel::new(Text::from(*name), FlatSamples::F32(vec![0.5])));
        let (encoding, channels) = (Encoding::FAST_LOSSLESS, AnyChannels::sort(channels.collect()));
        let mut file = exr::prelude::Image::from_layer(Layer::new(
            (1, 1),
            LayerAttributes::default(),
            encoding,
            channels,
        ));
        change(&mut file.attributes, &mut file.layer_data.attributes);
        let mut bytes = Cursor::new(Vec::new());
        file.write().to_buffered(&mut bytes).expect("the file is valid");
        bytes.into_inner()
    };
    let primaries = |[red, green, blue, white]: [(f32, f32); 4]| {
        let point = |(x, y)| Vec2(x, y);
        exr::meta::attribute::Chromaticities {
            red: point(red),
            green: point(green),
            blue: point(blue),
            white: point(white),
        }
    };
    let rec709 = [(0.64, 0.33), (0.3, 0.6), (0.15, 0.06), (0.3127, 0.329)];
    let aces = [(0.713, 0.293), (0.165, 0.83), (0.128, 0.044), (0.32168, 0.33767)];
    let honoured = write(&|image, _| image.chromaticities = Some(primaries(rec709)), &["R", "G", "B"]);
    assert_eq!(read("a.exr", &honoured).map(|image| image.channels()), Ok(3));
    let refused = write(&|image, _| image.chromaticities = Some(primaries(aces)), &["R", "G", "B"]);
    assert!(refusal("a.exr", &refused).contains("red (0.713, 0.293)"));
    let refused = write(&|image, _| image.pixel_aspect = 2.0, &["Y"]);
    assert!(refusal("a.exr", &refused).contains("not square"));
    let refused = write(&|_, _| {}, &["Y", "RY", "BY"]);
    assert!(refusal("a.exr", &refused).contains("luminance and chroma"));
    let space = exr::meta::attribute::AttributeValue::Text(Text::from("lin_ap1_scene"));
    let refused =
        write(&|_, layer| drop(layer.other.insert(Text::from("colorInteropID"), space.clone())), &["Y"]);
    assert!(refusal("a.exr", &refused).contains("lin_ap1_scene"));
}

#[test]
fn what_is_written_is_read() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let image = Image::filled(Resolution::new(3, 2), 3, 0.4);
    for name in ["a.npy", "a.exr"] {
        let path: &Path = &folder.path().join(name);
        picture::write(path, &image).expect("the temporary folder can be written");
        assert!(picture::read(path).is_ok_and(|found| found == image), "{name}");
    }
}
