//! `.npy` and `.exr`: what is written comes back bit for bit, and malformed files are errors that name themselves.

use std::path::Path;

use krylux::Error;
use krylux::image::{Image, Resolution};
use krylux::io::{exr, npy, picture};
use tempfile::TempDir;

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Values whose last bits would not survive half floats, a detour by text, or a tone curve.
fn demanding(resolution: Resolution, channels: usize) -> Image {
    let count = resolution.pixels() * channels;
    let mut samples: Vec<f32> = (0..count).map(|i| (i as f32 - 7.3).powi(3) * 1.000_000_1e-9 / 3.0).collect();
    let edges = [-0.0, f32::MIN_POSITIVE, 1e-45, f32::MAX, -f32::EPSILON];
    for (sample, edge) in samples.iter_mut().zip(edges) {
        *sample = edge;
    }
    Image::new(resolution, channels, samples).unwrap_or_else(|error| unreachable!("{error}"))
}

fn bits(image: &Image) -> Vec<u32> {
    image.samples().iter().map(|sample| sample.to_bits()).collect()
}

/// An `.npy` file as NumPy writes it, from its header's dictionary and its payload.
fn npy_bytes(dictionary: &str, payload: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((dictionary.len() as u16).to_le_bytes());
    bytes.extend(dictionary.as_bytes());
    bytes.extend(payload);
    bytes
}

fn header(descr: &str, fortran: bool, shape: &str) -> String {
    let fortran = if fortran { "True" } else { "False" };
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
}

fn read_array(folder: &Path, bytes: &[u8]) -> krylux::Result<npy::Array> {
    let path = folder.join("array.npy");
    std::fs::write(&path, bytes).map_err(Error::writing(&path))?;
    npy::read_npy(&path)
}

#[test]
fn images_survive_npy_and_exr_bit_for_bit() -> Outcome {
    let folder = TempDir::new()?;
    for channels in [1, 3] {
        let image = demanding(Resolution::new(37, 19), channels);
        for name in ["image.npy", "image.exr"] {
            let path = folder.path().join(name);
            picture::write(&path, &image)?;
            let back = picture::read(&path)?;
            assert_eq!(back.resolution(), image.resolution(), "{name}");
            assert_eq!(bits(&back), bits(&image), "{name}");
            let first = std::fs::read(&path)?;
            picture::write(&path, &image)?;
            assert_eq!(std::fs::read(&path)?, first, "{name} is not repeatable");
        }
    }
    Ok(())
}

#[test]
fn exr_layers_are_found_by_name() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("layers.exr");
    let (photo, degree) = (demanding(Resolution::new(8, 5), 3), demanding(Resolution::new(8, 5), 1));
    exr::write_exr(&path, &[("photo", &photo), ("degree", &degree)])?;
    assert_eq!(bits(&exr::read_exr(&path, Some("photo"))?), bits(&photo));
    assert_eq!(bits(&exr::read_exr(&path, Some("degree"))?), bits(&degree));
    let ambiguous = exr::read_exr(&path, None).err().ok_or("two layers, and none was asked for")?;
    assert!(ambiguous.to_string().contains("\"degree\", \"photo\""), "{ambiguous}");
    let smaller = demanding(Resolution::new(7, 5), 1);
    assert!(matches!(
        exr::write_exr(&path, &[("photo", &photo), ("other", &smaller)]),
        Err(Error::Dimension { .. })
    ));
    assert!(matches!(
        exr::write_exr(&path, &[("twice", &degree), ("twice", &degree)]),
        Err(Error::Dimension { .. })
    ));
    assert!(exr::write_exr(&path, &[("grün", &degree)]).is_err());
    assert!(exr::write_exr(&path, &[]).is_err());
    let none = Image::filled(Resolution::new(0, 5), 1, 0.0);
    let error = exr::write_exr(&path, &[("", &none)]).err().ok_or("it has no pixel")?.to_string();
    assert!(error.contains("one or more with pixels"), "{error}");
    // The only layer needs no name.
    exr::write_exr(&path, &[("degree", &degree)])?;
    assert_eq!(bits(&exr::read_exr(&path, None)?), bits(&degree));
    Ok(())
}

#[test]
fn arrays_of_every_kind_survive_npy() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("array.npy");
    npy::write_npy(&path, &[2, 3, 2], &(0..12).map(|i| f64::from(i) / 7.0).collect::<Vec<_>>())?;
    let back = npy::read_npy(&path)?;
    assert_eq!(back.shape, [2, 3, 2]);
    assert_eq!(back.values[11].to_bits(), (11.0_f64 / 7.0).to_bits());
    npy::write_npy(&path, &[3], &[0_u8, 7, 255])?;
    assert_eq!(npy::read_npy(&path)?.values, [0.0, 7.0, 255.0]);
    npy::write_npy(&path, &[2, 1], &[i32::MIN, -1])?;
    assert_eq!(npy::read_npy(&path)?.values, [-2_147_483_648.0, -1.0]);
    npy::write_npy::<f32>(&path, &[0, 4], &[])?;
    assert_eq!(npy::read_npy(&path)?.shape, [0, 4]);
    assert!(matches!(npy::write_npy(&path, &[3], &[0_u8]), Err(Error::Dimension { .. })));
    Ok(())
}

#[test]
fn every_real_type_is_read_in_either_byte_order() -> Outcome {
    let folder = TempDir::new()?;
    let cases: [(&str, &[u8], [f64; 2]); 9] = [
        ("<f2", &[0x00, 0x3c, 0x00, 0xc1], [1.0, -2.5]),
        (">f2", &[0x3c, 0x00, 0xc1, 0x00], [1.0, -2.5]),
        (">f4", &[0x3f, 0x80, 0, 0, 0xc0, 0x20, 0, 0], [1.0, -2.5]),
        ("<i2", &[1, 0, 0xfe, 0xff], [1.0, -2.0]),
        (">u2", &[1, 0, 0xff, 0xff], [256.0, 65535.0]),
        ("|i1", &[1, 0xff], [1.0, -1.0]),
        ("|u1", &[1, 0xff], [1.0, 255.0]),
        ("|b1", &[0, 1], [0.0, 1.0]),
        ("<i8", &[1, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255], [1.0, -1.0]),
    ];
    for (descr, payload, expected) in cases {
        let array = read_array(folder.path(), &npy_bytes(&header(descr, false, "(1, 2)"), payload))?;
        assert_eq!(array.shape, [1, 2], "{descr}");
        assert_eq!(array.values, expected, "{descr}");
    }
    Ok(())
}

#[test]
fn fortran_order_becomes_c_order() -> Outcome {
    let folder = TempDir::new()?;
    // numpy.asfortranarray(numpy.arange(24).reshape(2, 3, 4)) stores 0, 12, 4, 16, 8, 20, 1, …
    let stored: Vec<u8> = (0..24).map(|at| (at % 2 * 12 + at / 2 % 3 * 4 + at / 6) as u8).collect();
    let array = read_array(folder.path(), &npy_bytes(&header("|u1", true, "(2, 3, 4)"), &stored))?;
    assert_eq!(array.values, (0..24).map(f64::from).collect::<Vec<_>>());
    Ok(())
}

#[test]
fn errors_name_the_file_and_what_is_wrong() -> Outcome {
    let folder = TempDir::new()?;
    let deep = format!("{{'descr': {}", "[".repeat(5000));
    let cases = [
        (b"not an array".to_vec(), "does not start"),
        (npy_bytes(&header("<c8", false, "(1,)"), &[0; 8]), "its type is <c8"),
        (npy_bytes(&header("|O", false, "(1,)"), &[0; 8]), "its type is |O"),
        (npy_bytes(&header("<f4", false, "(2, 3)"), &[0; 23]), "a 2×3 array of <f4 takes 24 bytes"),
        (npy_bytes(&header("<f4", false, "(2, 3)"), &[0; 25]), "the file holds 25"),
        (npy_bytes(&header("<f4", false, "(4294967296, 4294967296)"), &[]), "too large"),
        (npy_bytes(&header("<f4", false, "(0, 99999999999999999999)"), &[]), "too large"),
        (
            npy_bytes("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,), }", &[0; 4]),
            "structured",
        ),
        (npy_bytes(&deep, &[]), "structured"),
        // Eleven bytes are none of a header, twelve are its beginning.
        (b"\x93NUMPY\x01\x00\x09\x00{".to_vec(), "does not start"),
        (b"\x93NUMPY\x01\x00\x09\x00{'".to_vec(), "cut off within its header"),
        (npy_bytes("{'descr': '<f4'}", &[]), "malformed"),
    ];
    for (bytes, fault) in cases {
        let error = read_array(folder.path(), &bytes).err().ok_or(fault)?.to_string();
        assert!(error.contains("array.npy") && error.contains(fault), "{fault}: {error}");
    }
    let path = folder.path().join("stack.npy");
    npy::write_npy(&path, &[5, 4, 2], &[0.0_f32; 40])?;
    let error = npy::read_image(&path).err().ok_or("two channels")?.to_string();
    assert!(error.contains("5×4×2") && error.contains("H×W×3"), "{error}");
    assert!(matches!(npy::read_npy(&folder.path().join("absent.npy")), Err(Error::Read { .. })));
    assert!(matches!(picture::read(Path::new("pattern.gif")), Err(Error::Data { .. })));
    Ok(())
}

#[test]
fn patterns_with_nan_or_infinity_are_refused_by_pixel() -> Outcome {
    let folder = TempDir::new()?;
    for name in ["pattern.npy", "pattern.exr"] {
        let path = folder.path().join(name);
        let mut image = Image::filled(Resolution::new(4, 3), 3, 0.5);
        image.samples_mut()[3 * (4 + 2) + 1] = f32::NAN;
        picture::write(&path, &image)?;
        let error = picture::read(&path).err().ok_or("NaN passed")?.to_string();
        assert!(error.contains(name) && error.contains("pixel (2, 1) is NaN"), "{error}");
    }
    let path = folder.path().join("beyond.npy");
    npy::write_npy(&path, &[1, 1], &[1e300_f64])?;
    assert!(npy::read_image(&path).is_err());
    Ok(())
}

/// Every truncation, and a few thousand single-byte changes: an error or an image, never a panic that escapes.
#[test]
fn mutilated_files_never_panic() -> Outcome {
    let folder = TempDir::new()?;
    for name in ["victim.npy", "victim.exr"] {
        let path = folder.path().join(name);
        picture::write(&path, &demanding(Resolution::new(6, 5), 3))?;
        let whole = std::fs::read(&path)?;
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length])?;
            if picture::read(&path).is_ok() {
                assert!(name.ends_with("exr"), "{name} cut to {length} bytes was read");
            }
        }
        for at in 0..whole.len() {
            for change in [0x01, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] ^= change;
                std::fs::write(&path, &bytes)?;
                let _ = picture::read(&path);
            }
        }
    }
    Ok(())
}

/// The samples of channels `R`, `G` and `B` by the crate `exr` alone, which knows the channels by their names.
fn by_another_reader(path: &Path) -> Result<[Vec<f32>; 3], Box<dyn std::error::Error>> {
    use ::exr::prelude::{ReadChannels, ReadLayers, read};
    let picture = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let layer = picture.all_attributes().from_file(path)?.layer_data;
    let plane = |name: &str| {
        let channel = layer.channel_data.list.iter().find(|channel| channel.name.to_string() == name);
        channel.map(|channel| channel.sample_data.values_as_f32().collect::<Vec<f32>>())
    };
    Ok([plane("R"), plane("G"), plane("B")].map(Option::unwrap_or_default))
}

#[test]
fn exr_channels_have_the_names_of_their_colours_for_other_programs() -> Outcome {
    let folder = TempDir::new()?;
    let resolution = Resolution::new(3, 2);
    let colored = Image::new(resolution, 3, (0..18).map(|at| at as f32).collect())?;
    let ours = folder.path().join("ours.exr");
    exr::write_exr(&ours, &[("", &colored)])?;
    let expected =
        [0, 1, 2].map(|channel| (0..6).map(|pixel| (3 * pixel + channel) as f32).collect::<Vec<f32>>());
    assert_eq!(by_another_reader(&ours)?, expected);

    let foreign = folder.path().join("foreign.exr");
    ::exr::prelude::write_rgb_file(&foreign, 3, 2, |x, y| {
        let first = (3 * (3 * y + x)) as f32;
        (first, first + 1.0, first + 2.0)
    })?;
    assert_eq!(by_another_reader(&foreign)?, expected);
    assert_eq!(exr::read_exr(&foreign, None)?, colored);
    Ok(())
}
