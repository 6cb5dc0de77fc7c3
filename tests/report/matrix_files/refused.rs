//! Files that are refused, and damaged ones.

use tempfile::TempDir;

use super::{read, read_in, refusal};
use crate::matrix_support::{
    Entries, MATS, Mat, Symmetry, doubles, matlab, mtx_coordinates, npy, npz, packed_text, scipy_files,
};

fn matrix() -> Entries {
    Entries { rows: 3, cols: 2, entries: vec![(0, 1, 5), (2, 0, -7), (2, 1, 1), (2, 1, 2)] }
}

/// Every file of the matrix, with its name.
fn files() -> Vec<(String, Vec<u8>)> {
    let matrix = matrix();
    let mut files = Vec::new();
    for is_packed in [false, true] {
        let formats = scipy_files(&matrix, is_packed).into_iter();
        files.extend(formats.map(|(format, bytes)| (format!("{format}.npz"), bytes)));
    }
    files.push(("dense.npz".into(), npz(&[("T", doubles(&[3, 2], &matrix.dense()))], false)));
    for mat in MATS {
        let dense = mat.dense("T", &[3, 2], matlab::DOUBLE, &matrix.by_columns());
        files.push(("dense.mat".into(), mat.file(&[dense])));
        files.push(("sparse.mat".into(), mat.file(&[mat.sparse("T", &matrix)])));
    }
    let text = mtx_coordinates(&matrix, "integer", Symmetry::General);
    files.push(("packed.mtx.gz".into(), packed_text(&text)));
    files
}

#[test]
fn a_file_that_is_cut_off_anywhere_is_an_error() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    for (name, whole) in files() {
        assert!(read(&name, &whole).is_ok(), "{name}");
        for cut in 0..whole.len() {
            assert!(
                read_in(&folder, &name, &whole[..cut]).is_err(),
                "{name} cut at {cut} of {}",
                whole.len()
            );
        }
    }
}

/// Damage to padding or a name may go unseen. It must not bring anything down.
#[test]
fn a_file_with_a_changed_byte_never_panics() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    for (name, whole) in files() {
        for at in 0..whole.len() {
            for change in [0x01, 0xff] {
                let mut damaged = whole.clone();
                damaged[at] ^= change;
                let _ = read_in(&folder, &name, &damaged);
            }
        }
    }
}

/// A variable without values may state any lengths, and their product may be more than a machine can count.
#[test]
fn lengths_of_an_empty_variable_are_not_multiplied() {
    let most = i32::MAX as usize;
    for mat in MATS {
        for shape in [[0, most, most, most], [most, 0, most, most], [most, most, most, 0]] {
            let empty = mat.dense("T", &shape, matlab::DOUBLE, &[]);
            assert!(read("a.mat", &mat.file(&[empty])).is_err(), "{shape:?} in {mat:?}");
        }
    }
}

#[test]
fn a_file_of_matlab_7_3_is_refused_with_both_ways_out() {
    let mut bytes = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec();
    bytes.resize(512, b' ');
    bytes.extend(b"\x89HDF\r\n\x1a\n");
    let why = refusal("T.mat", &bytes);
    for part in ["MATLAB 7.3", "HDF5", "'-v7'", "h5py.File", "numpy.save", "T.npy"] {
        assert!(why.contains(part), "{part}: {why}");
    }
    let why = refusal("T.mat", b"# not of MATLAB at all");
    assert!(why.contains("it is not a file of MATLAB 5 to 7"), "{why}");
}

#[test]
fn two_matrices_in_one_file_are_refused_by_their_names() {
    let square = [1.0, 2.0, 3.0, 4.0];
    for mat in MATS {
        let [first, second] = ["near", "far"].map(|name| mat.dense(name, &[2, 2], matlab::DOUBLE, &square));
        let why = refusal("a.mat", &mat.file(&[first, second]));
        assert!(why.contains("variables `near` and `far`"), "{why}");
    }
    let members = [("near", doubles(&[2, 2], &square)), ("far", doubles(&[2, 2], &square))];
    // The arrays of an archive are looked at in alphabetical order.
    let why = refusal("a.npz", &npz(&members, true));
    assert!(why.contains("arrays `far` and `near`") && why.contains("numpy.save"), "{why}");
}

#[test]
fn files_without_a_matrix_are_refused() {
    let mat = Mat { is_little: true, is_packed: true };
    let row = mat.dense("row", &[1, 5], matlab::INT8, &[1.0; 5]);
    let why = refusal("a.mat", &mat.file(&[row]));
    assert!(why.contains("no variable that is a matrix of real numbers"), "{why}");
    let complex =
        [mat.head(matlab::DOUBLE_CLASS | 0x800, &[2, 2], "T"), mat.numbers(matlab::INT8, &[1.0; 4])];
    let why = refusal("a.mat", &mat.file(&[complex.concat()]));
    assert!(why.contains("no variable that is a matrix of real numbers"), "{why}");
    let why = refusal("a.npz", &npz(&[("row", doubles(&[5], &[1.0; 5]))], false));
    assert!(why.contains("neither a matrix of SciPy nor an array of two axes"), "{why}");
    let why = refusal("a.csv", b"1,2\n3,4\n");
    for part in [".npz", ".npy", ".mtx.gz", ".mat"] {
        assert!(why.contains(part), "{part}: {why}");
    }
}

#[test]
fn indices_outside_of_the_matrix_are_refused() {
    let outside = Entries { rows: 2, cols: 2, entries: vec![(1, 1, 3)] };
    let stated = |rows: usize, cols: usize| Entries { rows, cols, ..outside.clone() };
    for (rows, cols) in [(1, 2), (2, 1)] {
        let matrix = stated(rows, cols);
        let text = mtx_coordinates(&matrix, "real", Symmetry::General);
        let why = refusal("a.mtx", text.as_bytes());
        assert!(why.contains("line 5: expected row, column"), "{why}");
        let array = |values: &[f64]| doubles(&[values.len()], values);
        let members = [
            ("format", npy("|S3", &[], b"coo")),
            ("shape", array(&[rows as f64, cols as f64])),
            ("row", array(&[1.0])),
            ("col", array(&[1.0])),
            ("data", array(&[3.0])),
        ];
        let why = refusal("a.npz", &npz(&members, false));
        assert!(why.contains("entry (1, 1) lies outside"), "{why}");
    }
    // In a file of MATLAB only the rows are stated by index.
    for mat in MATS {
        let head = mat.head(matlab::SPARSE_CLASS, &[2, 2], "T");
        let parts =
            [[5.0].as_slice(), &[0.0, 1.0, 1.0], &[3.0]].map(|values| mat.numbers(matlab::INT32, values));
        let why = refusal("a.mat", &mat.file(&[[head, parts.concat()].concat()]));
        assert!(why.contains("entry (5, 0) lies outside"), "{why}");
    }
}
