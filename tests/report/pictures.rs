//! PNG files and the pictures made for people.

use image::ExtendedColorType;
use krylux::Error;
use krylux::image::{Image, Resolution};
use krylux::io::picture::{self, read};
use krylux::io::raster::{self, Raster};
use tempfile::TempDir;

type Outcome = Result<(), Box<dyn std::error::Error>>;

#[test]
fn a_png_pattern_is_decoded_from_srgb() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("pattern.png");
    let size = Resolution::new(256, 1);
    Raster::from_pixels(size, (0..=255).map(|level| [level, 255 - level, 128])).write_png(&path)?;
    let linear = read(&path)?;
    assert_eq!((linear.resolution(), linear.channels()), (size, 3));
    // The definition's own fixed points: black, white, and 128 ↦ 0.2158605.
    assert_eq!(linear.samples()[..2], [0.0, 1.0]);
    approx::assert_abs_diff_eq!(linear.samples()[2], 0.215_860_5, epsilon = 1e-6);
    let again = raster::develop(&linear, 1.0);
    assert_eq!(again.pixel(77, 0), [77, 178, 128]);
    again.write_png(&folder.path().join("again.png"))?;
    assert_eq!(std::fs::read(folder.path().join("again.png"))?, std::fs::read(&path)?);
    Ok(())
}

#[test]
fn gray_and_sixteen_bit_files_keep_their_precision() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("deep.png");
    let levels: Vec<u16> = (0..64_u16).map(|level| level * 1040 + 3).collect();
    let bytes: Vec<u8> = levels.iter().flat_map(|level| level.to_ne_bytes()).collect();
    image::save_buffer(&path, &bytes, 8, 8, ExtendedColorType::L16)?;
    let linear = read(&path)?;
    assert_eq!(linear.channels(), 1);
    for (sample, level) in linear.samples().iter().zip(levels) {
        assert_eq!(*sample, raster::decode_srgb(f32::from(level) / 65535.0));
    }
    Ok(())
}

#[test]
fn transparency_is_refused_unless_it_is_none() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("alpha.png");
    image::save_buffer(&path, &[10, 20, 30, 255], 1, 1, ExtendedColorType::Rgba8)?;
    assert_eq!(read(&path)?.channels(), 3);
    image::save_buffer(&path, &[10, 20, 30, 254], 1, 1, ExtendedColorType::Rgba8)?;
    assert!(read(&path).is_err_and(|error| error.to_string().contains("transparent")));
    Ok(())
}

#[test]
fn mutilated_pngs_are_errors_or_images() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("victim.png");
    picture::write(&path, &Image::filled(Resolution::new(9, 7), 3, 0.3))?;
    let whole = std::fs::read(&path)?;
    for length in 0..whole.len() {
        std::fs::write(&path, &whole[..length])?;
        // The end marker, the last twelve bytes, may be missing without harm.
        assert!(length + 12 >= whole.len() || matches!(read(&path), Err(Error::Data { .. })), "{length}");
    }
    for at in 0..whole.len() {
        for change in [0x01, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= change;
            std::fs::write(&path, &bytes)?;
            let _ = read(&path);
        }
    }
    Ok(())
}

#[test]
fn enlarging_repeats_pixels() -> Outcome {
    let small = Raster::from_pixels(Resolution::new(2, 1), [[1, 2, 3], [4, 5, 6]]);
    let large = small.enlarged(3);
    assert_eq!(large.resolution(), Resolution::new(6, 3));
    assert_eq!([large.pixel(2, 2), large.pixel(3, 0)], [[1, 2, 3], [4, 5, 6]]);
    assert!(Raster::from_pixels(Resolution::new(0, 4), []).encode_png().is_err());
    Ok(())
}

#[test]
fn a_picture_is_pasted_as_far_as_it_is_inside() {
    let small = Raster::from_pixels(Resolution::new(2, 2), [[1; 3], [2; 3], [3; 3], [4; 3]]);
    // Beside a row is not in the next one.
    assert_eq!([small.pixel(1, 0), small.pixel(2, 0), small.pixel(0, 2)], [[2; 3], [0; 3], [0; 3]]);
    for (x, y, expected) in [
        (0, 1, [[0, 0, 0], [1, 2, 0], [3, 4, 0]]),
        (2, 2, [[0, 0, 0], [0, 0, 0], [0, 0, 1]]),
        (1, 0, [[0, 1, 2], [0, 3, 4], [0, 0, 0]]),
        (3, 0, [[0; 3]; 3]),
        (0, 7, [[0; 3]; 3]),
    ] {
        let mut large = Raster::black(Resolution::new(3, 3));
        large.paste(&small, x, y);
        let levels = [0, 1, 2].map(|y| [0, 1, 2].map(|x| large.pixel(x, y)[0]));
        assert_eq!(levels, expected, "at {x}, {y}");
    }
}

#[test]
fn the_size_of_a_picture_is_checked_before_it_is_decoded() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("forged.jpg");
    image::save_buffer(&path, &[128; 64], 8, 8, ExtendedColorType::L8)?;
    let whole = std::fs::read(&path)?;
    let frame = whole.windows(2).position(|marker| marker == [0xff, 0xc0]).ok_or("no frame header")?;
    let message = |size: Resolution| {
        let refused = picture::read_sized(&path, size, "the projector");
        refused.map_or_else(|error| error.to_string(), |image| image.resolution().to_string())
    };
    assert_eq!(message(Resolution::new(8, 8)), "8x8");
    // The first size is below the limit of any picture: only that another one is wanted speaks against it.
    for (height, width) in [(8000_u16, 8000_u16), (65535, 65535)] {
        let mut forged = whole.clone();
        forged[frame + 5..frame + 7].copy_from_slice(&height.to_be_bytes());
        forged[frame + 7..frame + 9].copy_from_slice(&width.to_be_bytes());
        std::fs::write(&path, forged)?;
        let expected = format!("it has {width}x{height} pixels, but the projector has 8x8");
        let found = message(Resolution::new(8, 8));
        assert!(found.contains(&expected), "{found}");
    }
    Ok(())
}
