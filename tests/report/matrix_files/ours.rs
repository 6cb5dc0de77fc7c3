//! Files that krylux writes, sets of colours, and sizes that are given beside a file.

use std::path::Path;

use krylux::Error;
use krylux::image::Resolution;
use krylux::io::sparse::{
    self, Beside, COLORS, MatrixFile, Pictures, ProductNoise, read_file, with_suffix, write_channel,
};
use krylux::sparse::Csr;
use tempfile::TempDir;

use super::dense;

type Outcome = Result<(), Box<dyn std::error::Error>>;

const CAMERA: Resolution = Resolution { width: 3, height: 2 };
const PROJECTOR: Resolution = Resolution { width: 4, height: 2 };
const NOISE: ProductNoise = ProductNoise { full: 0.1, direct: 1.0 / 3.0, global: 0.0 };

/// A matrix of this many rows and columns with empty rows. Most of its values need all digits.
fn matrix(rows: usize, cols: usize, seed: usize) -> Csr {
    let (mut starts, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in 0..rows {
        for column in
            (0..cols).filter(|column| row % 4 != 1 && !(row * 7 + column * 5 + seed).is_multiple_of(3))
        {
            columns.push(column as u32);
            weights.push((row * cols + column + seed + 1) as f64 / 5.0 - 2.1);
        }
        starts.push(columns.len());
    }
    Csr::new(cols, starts, columns, weights).expect("it is well formed")
}

/// A symmetric matrix.
fn symmetric(side: usize, seed: usize) -> Csr {
    let half = matrix(side, side, seed);
    Csr::sum(&[(1.0, &half), (1.0, &half.transposed())]).expect("both have one shape")
}

fn one(matrix: &Csr) -> MatrixFile {
    MatrixFile::from(matrix.clone())
}

#[test]
fn what_krylux_writes_it_reads_back_exactly() -> Outcome {
    let folder = TempDir::new()?;
    let empty = |side: usize| Csr::new(side, vec![0; side + 1], Vec::new(), Vec::new());
    let apart = Some(Pictures { camera: CAMERA, projector: PROJECTOR });
    let coaxial = Some(Pictures { camera: CAMERA, projector: CAMERA });
    for (matrix, direct, pictures) in [
        (matrix(6, 8, 1), matrix(6, 8, 2), apart),
        (symmetric(6, 1), symmetric(6, 2), coaxial),
        (symmetric(6, 1), matrix(6, 6, 2), coaxial),
        (symmetric(6, 1), empty(6)?, coaxial),
    ] {
        for kept in 0..8 {
            let beside = Beside {
                direct: (kept & 1 != 0).then_some(&direct),
                pictures: pictures.filter(|_| kept & 2 != 0),
                noise: (kept & 4 != 0).then_some(NOISE),
            };
            let expected = MatrixFile {
                direct: beside.direct.into_iter().cloned().collect(),
                pictures: beside.pictures,
                noise: beside.noise,
                ..one(&matrix)
            };
            for name in ["a.npz", "a.mtx"] {
                let path = folder.path().join(name);
                write_channel(&path, &matrix, &beside)?;
                assert_eq!(read_file(&path)?, expected, "{name} with {beside:?}");
            }
        }
    }
    Ok(())
}

/// Other programs skip what krylux adds, so the matrix has to be whole without it.
#[test]
fn a_symmetric_matrix_with_direct_light_of_another_symmetry_is_written_whole() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("a.mtx");
    let [matrix, direct] = [symmetric(6, 1), matrix(6, 6, 2)];
    write_channel(&path, &matrix, &Beside { direct: Some(&direct), ..Beside::default() })?;
    let text = std::fs::read_to_string(&path)?;
    assert!(text.starts_with("%%MatrixMarket matrix coordinate real general\n"), "{text}");
    let others: String =
        text.lines().filter(|line| !line.starts_with("% krylux:")).map(|line| format!("{line}\n")).collect();
    std::fs::write(&path, others)?;
    assert_eq!(read_file(&path)?, one(&matrix));
    Ok(())
}

#[test]
fn damaged_comments_of_krylux_are_named_by_their_line() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("a.mtx");
    for (comment, fault) in [
        ("camera_shape 2 x", "line 2: a comment of krylux is damaged"),
        ("camera_shape 2 3", "do not fit 6 rows and 8 columns"),
        ("noise 1 2", "line 2: a comment of krylux is damaged"),
        ("noise 1 2 -3", "line 2: a comment of krylux is damaged"),
        ("direct 7 1 1e0", "line 2: a comment of krylux is damaged"),
        ("directly 1 1 1e0", "line 2: a comment of krylux is damaged"),
    ] {
        let header = "%%MatrixMarket matrix coordinate real general";
        std::fs::write(&path, format!("{header}\n% krylux: {comment}\n6 8 1\n1 1 2\n"))?;
        let why = read_file(&path).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(why.contains(fault), "{comment}: {why}");
    }
    Ok(())
}

#[test]
fn sizes_that_fit_become_pictures() -> Outcome {
    let name = Path::new("a.npz");
    let file = one(&matrix(6, 8, 1));
    assert_eq!(file.clone().sized(name, None, None)?, file);
    let expected =
        MatrixFile { pictures: Some(Pictures { camera: CAMERA, projector: PROJECTOR }), ..file.clone() };
    let sized = file.sized(name, Some(CAMERA), Some(PROJECTOR))?;
    assert_eq!(sized, expected);
    // The sizes that a file states may be given again.
    for (camera, projector) in
        [(Some(CAMERA), None), (None, Some(PROJECTOR)), (Some(CAMERA), Some(PROJECTOR))]
    {
        assert_eq!(sized.clone().sized(name, camera, projector)?, expected);
    }
    // One size is that of both pictures.
    let coaxial = Some(Pictures { camera: CAMERA, projector: CAMERA });
    for (camera, projector) in [(Some(CAMERA), None), (None, Some(CAMERA))] {
        assert_eq!(one(&matrix(6, 6, 1)).sized(name, camera, projector)?.pictures, coaxial);
    }
    Ok(())
}

#[test]
fn sizes_that_do_not_fit_are_refused_by_the_name_of_their_option() -> Outcome {
    let name = Path::new("a.npz");
    let file = one(&matrix(6, 8, 1));
    let known = file.clone().sized(name, Some(CAMERA), Some(PROJECTOR))?;
    let other = Resolution::new(2, 2);
    for (file, camera, projector, option, fault) in [
        (&file, Some(other), Some(PROJECTOR), "--size", "2x2 has 4 pixels, but a.npz has 6 rows"),
        (&file, Some(CAMERA), Some(other), "--projector-size", "2x2 has 4 pixels, but a.npz has 8 columns"),
        // The size of one picture alone is that of both.
        (&file, Some(CAMERA), None, "--projector-size", "3x2 has 6 pixels, but a.npz has 8 columns"),
        (&file, None, Some(PROJECTOR), "--size", "4x2 has 8 pixels, but a.npz has 6 rows"),
        // As many pixels, but other pictures.
        (&known, Some(Resolution::new(2, 3)), None, "--size", "but a.npz states 3x2"),
        (&known, None, Some(Resolution::new(8, 1)), "--projector-size", "but a.npz states 4x2"),
    ] {
        let refused = file.clone().sized(name, camera, projector).expect_err("a size does not fit");
        let Error::Option { option: named, fault: why, .. } = &refused else { return Err(refused.into()) };
        assert!(named == option && why.contains(fault), "{refused}");
    }
    Ok(())
}

#[test]
fn three_rows_for_each_pixel_are_three_colours() -> Outcome {
    let [whole, direct] = [1, 2].map(|seed| matrix(18, 8, seed));
    let file = MatrixFile { direct: vec![direct.clone()], ..one(&whole) };
    let file = file.sized(Path::new("a.npz"), Some(CAMERA), Some(PROJECTOR))?;
    assert_eq!(file.pictures, Some(Pictures { camera: CAMERA, projector: PROJECTOR }));
    for (colors, interleaved) in [(&file.channels, &whole), (&file.direct, &direct)] {
        assert_eq!(colors.len(), 3);
        let rows: Vec<Vec<f64>> = dense(interleaved).chunks(8).map(<[f64]>::to_vec).collect();
        for (color, matrix) in colors.iter().enumerate() {
            let expected: Vec<f64> = (0..6).flat_map(|pixel| rows[3 * pixel + color].clone()).collect();
            assert_eq!(dense(matrix), expected, "colour {color}");
        }
    }
    Ok(())
}

/// Writes a set of colours, and returns the name of the whole.
fn write_colors(
    folder: &TempDir,
    name: &str,
    colors: &[(Csr, Beside<'_>)],
) -> krylux::Result<std::path::PathBuf> {
    let path = folder.path().join(name);
    for ((matrix, beside), suffix) in colors.iter().zip(COLORS) {
        write_channel(&with_suffix(&path, suffix), matrix, beside)?;
    }
    Ok(path)
}

#[test]
fn three_files_of_colours_are_read_as_one_matrix() -> Outcome {
    let pictures = Some(Pictures { camera: CAMERA, projector: PROJECTOR });
    let [channels, direct] = [0, 10].map(|first| [1, 2, 3].map(|seed| matrix(6, 8, first + seed)));
    let beside = |color: usize| Beside { direct: Some(&direct[color]), pictures, noise: Some(NOISE) };
    let colors = [0, 1, 2].map(|color| (channels[color].clone(), beside(color)));
    let expected =
        MatrixFile { channels: channels.to_vec(), direct: direct.to_vec(), pictures, noise: Some(NOISE) };
    for name in ["A.npz", "A.mtx"] {
        let folder = TempDir::new()?;
        let path = write_colors(&folder, name, &colors)?;
        assert_eq!(read_file(&path)?, expected, "{name}");
        assert!(sparse::read(&path).is_err(), "{name} in colour is no single matrix");
        let files = COLORS.map(|suffix| with_suffix(&path, suffix));
        assert_eq!(sparse::files_of(&path), files, "{name}");

        // Direct light of some colours only is not that of the matrix.
        write_channel(&files[1], &channels[1], &Beside { direct: None, ..beside(1) })?;
        assert_eq!(read_file(&path)?, MatrixFile { direct: Vec::new(), ..expected.clone() }, "{name}");
        // A colour without the pictures of the others does not fit them.
        write_channel(&files[1], &channels[1], &Beside { pictures: None, ..beside(1) })?;
        let why = read_file(&path).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(why.contains("does not fit the other colours") && why.contains("A.g."), "{why}");
        write_channel(&files[1], &matrix(5, 8, 1), &Beside::default())?;
        assert!(matches!(read_file(&path), Err(Error::Data { .. })), "{name}: another shape");

        // A file of that very name comes first.
        write_channel(&path, &channels[2], &Beside::default())?;
        assert_eq!(read_file(&path)?, one(&channels[2]), "{name}");
        std::fs::remove_file(&path)?;
        std::fs::remove_file(&files[2])?;
        assert!(matches!(read_file(&path), Err(Error::Read { .. })), "{name}: a colour is missing");
    }
    Ok(())
}

#[test]
fn suffixes_stand_before_the_whole_extension() {
    for (name, expected) in [
        ("a/matrix.npz", "a/matrix.r.npz"),
        ("a.b/matrix.mtx.gz", "a.b/matrix.r.mtx.gz"),
        ("one.two.mat", "one.two.r.mat"),
    ] {
        assert_eq!(with_suffix(Path::new(name), ".r"), Path::new(expected));
    }
}
