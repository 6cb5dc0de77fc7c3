//! Matrix files of other programs and of krylux: each form holds the same matrix, and no damage brings the reader down.

mod axes;
mod cases;
mod ours;
mod refused;

use krylux::io::sparse::{self, MatrixFile};
use krylux::sparse::Csr;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;
use tempfile::TempDir;

use crate::matrix_support::{
    Entries, MATS, SYMMETRIES, Symmetry, doubles, matlab, mtx_array, mtx_coordinates, npz, packed_text,
    scipy_files,
};

/// What is read from a file of this name and these bytes.
fn read(name: &str, bytes: &[u8]) -> krylux::Result<MatrixFile> {
    read_in(&TempDir::new().expect("a temporary folder can be made"), name, bytes)
}

fn read_in(folder: &TempDir, name: &str, bytes: &[u8]) -> krylux::Result<MatrixFile> {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("the folder can be written");
    sparse::read_file(&path)
}

/// Why a file of this name and these bytes is not read; empty if it is.
fn refusal(name: &str, bytes: &[u8]) -> String {
    read(name, bytes).map_or_else(|error| error.to_string(), |_| String::new())
}

/// All values of a matrix, row by row.
fn dense(matrix: &Csr) -> Vec<f64> {
    let mut values = vec![0.0; matrix.rows() * matrix.cols()];
    for (row, column, value) in matrix.entries() {
        values[row * matrix.cols() + column] = value;
    }
    values
}

/// Small matrices, also with rows that are empty, entries of zero, and entries that repeat a position.
fn entries() -> impl Strategy<Value = Entries> {
    (2..7_usize, 2..7_usize).prop_flat_map(|(rows, cols)| {
        let entry = (0..rows, 0..cols, -9..10_i32);
        prop::collection::vec(entry, 0..24).prop_map(move |entries| Entries { rows, cols, entries })
    })
}

/// Checks that a file holds this matrix and nothing else. Sums of small integers are exact, so values are compared exactly.
fn holds(name: &str, bytes: &[u8], expected: &Entries) -> Result<(), TestCaseError> {
    let file = read(name, bytes).map_err(|error| TestCaseError::fail(format!("{name}: {error}")))?;
    prop_assert_eq!((file.channels.len(), file.direct.len()), (1, 0), "{}", name);
    prop_assert_eq!((file.pictures, file.noise), (None, None), "{}", name);
    let matrix = &file.channels[0];
    prop_assert_eq!([matrix.rows(), matrix.cols()], [expected.rows, expected.cols], "{}", name);
    prop_assert_eq!(dense(matrix), expected.dense(), "{}", name);
    prop_assert!(!matrix.weights().contains(&0.0), "{}: zeros are kept", name);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn archives_of_scipy_and_numpy_hold_the_same_matrix(matrix in entries(), is_packed in any::<bool>()) {
        for (format, bytes) in scipy_files(&matrix, is_packed) {
            holds(&format!("{format}.npz"), &bytes, &matrix)?;
        }
        // An array of one axis beside the matrix is no second matrix.
        let array = doubles(&[matrix.rows, matrix.cols], &matrix.dense());
        holds("dense.npy", &array, &matrix)?;
        let members = [("T", array), ("axis", doubles(&[2], &[1.0, 2.0]))];
        holds("dense.npz", &npz(&members, is_packed), &matrix)?;
    }

    #[test]
    fn all_forms_of_matrix_market_hold_the_same_matrix(matrix in entries()) {
        for symmetry in SYMMETRIES {
            let listed = matrix.listed(symmetry);
            let whole = listed.mirrored(symmetry);
            for field in ["real", "integer"] {
                let [coordinates, array] = [mtx_coordinates, mtx_array].map(|write| write(&listed, field, symmetry));
                holds("coordinates.mtx", coordinates.as_bytes(), &whole)?;
                holds("array.mtx", array.as_bytes(), &whole)?;
                holds("coordinates.mtx.gz", &packed_text(&coordinates), &whole)?;
                holds("array.MTX.GZ", &packed_text(&array), &whole)?;
            }
            if symmetry != Symmetry::Skew {
                let ones = listed.with_ones();
                let text = mtx_coordinates(&ones, "pattern", symmetry);
                holds("pattern.mtx", text.as_bytes(), &ones.mirrored(symmetry))?;
            }
        }
    }

    #[test]
    fn files_of_matlab_hold_the_same_matrix(matrix in entries()) {
        let shape = [matrix.rows, matrix.cols];
        for mat in MATS {
            // MATLAB stores whole numbers in fewer bytes where they fit. Sums of these entries need up to two.
            for kind in [matlab::INT16, matlab::DOUBLE] {
                let variable = mat.dense("T", &shape, kind, &matrix.by_columns());
                holds("dense.mat", &mat.file(&[variable]), &matrix)?;
            }
            // A name of more than four letters does not stand in the tag of its element.
            holds("sparse.mat", &mat.file(&[mat.sparse("transport", &matrix)]), &matrix)?;
        }
    }
}

#[test]
fn variables_that_are_no_matrices_are_passed_over() -> krylux::Result<()> {
    let matrix = Entries { rows: 2, cols: 3, entries: vec![(0, 2, 4), (1, 0, -3), (1, 0, 1)] };
    for mat in MATS {
        let text =
            [mat.head(matlab::CHAR_CLASS, &[2, 2], "note"), mat.element(4, &[65, 0, 66, 0, 67, 0, 68, 0])];
        let file = mat.file(&[
            mat.dense("size", &[1, 2], matlab::INT8, &[8.0, 6.0]),
            text.concat(),
            mat.sparse("T", &matrix),
            mat.dense("scale", &[1, 1], matlab::DOUBLE, &[0.5]),
        ]);
        assert_eq!(dense(&read("a.mat", &file)?.channels[0]), matrix.dense(), "{mat:?}");
    }
    Ok(())
}
