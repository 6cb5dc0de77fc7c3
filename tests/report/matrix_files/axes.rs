//! Dense arrays of four and five axes.

use krylux::image::Resolution;
use krylux::io::sparse::Pictures;

use super::{dense, read, refusal};
use crate::matrix_support::{MATS, doubles, matlab};

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Colours, the camera's rows and columns, and the projector's.
const LENGTHS: [usize; 5] = [3, 2, 5, 4, 2];

/// A value for each place, all different.
fn value(place: [usize; 5]) -> f64 {
    place.iter().zip(LENGTHS).fold(0, |value, (&at, length)| value * length + at) as f64 + 1.0
}

/// The shape and the values of an array with these axes of [`LENGTHS`]. The last axis runs fastest.
fn array(axes: &[usize]) -> (Vec<usize>, Vec<f64>) {
    let shape: Vec<usize> = axes.iter().map(|&axis| LENGTHS[axis]).collect();
    let values = (0..shape.iter().product::<usize>()).map(|index| {
        let (mut place, mut rest) = ([0; 5], index);
        for &axis in axes.iter().rev() {
            place[axis] = rest % LENGTHS[axis];
            rest /= LENGTHS[axis];
        }
        value(place)
    });
    let values = values.collect();
    (shape, values)
}

/// The matrix of one colour: rows are pixels of the camera, and columns are pixels of the projector.
fn matrix(color: usize) -> Vec<f64> {
    let [_, height, width, rows, columns] = LENGTHS;
    let row = |pixel: usize| {
        (0..rows * columns).map(move |column| {
            value([color, pixel / width, pixel % width, column / columns, column % columns])
        })
    };
    (0..height * width).flat_map(row).collect()
}

fn pictures() -> Pictures {
    let [_, height, width, rows, columns] = LENGTHS;
    Pictures { camera: Resolution::new(width, height), projector: Resolution::new(columns, rows) }
}

#[test]
fn an_array_of_four_axes_is_a_matrix_of_known_pictures() -> Outcome {
    let (shape, values) = array(&[1, 2, 3, 4]);
    let mut files = vec![("a.npy", doubles(&shape, &values))];
    // In the order of MATLAB the first axis runs fastest.
    let (_, reversed) = array(&[4, 3, 2, 1]);
    files.extend(MATS.map(|mat| ("a.mat", mat.file(&[mat.dense("T", &shape, matlab::DOUBLE, &reversed)]))));
    for (name, bytes) in files {
        let file = read(name, &bytes)?;
        assert_eq!(file.pictures, Some(pictures()), "{name}");
        assert_eq!(file.channels.len(), 1, "{name}");
        assert_eq!(dense(&file.channels[0]), matrix(0), "{name}");
    }
    Ok(())
}

#[test]
fn colours_may_be_the_first_the_third_or_the_last_of_five_axes() -> Outcome {
    for axes in [[0, 1, 2, 3, 4], [1, 2, 0, 3, 4], [1, 2, 3, 4, 0]] {
        let (shape, values) = array(&axes);
        let file = read("a.npy", &doubles(&shape, &values))?;
        assert_eq!(file.pictures, Some(pictures()), "{axes:?}");
        let found: Vec<_> = file.channels.iter().map(dense).collect();
        assert_eq!(found, [0, 1, 2].map(matrix), "{axes:?}");
    }
    Ok(())
}

#[test]
fn shapes_that_do_not_say_which_axis_is_which_are_refused() {
    let [sizes, axes] = ["--size and --projector-size", "H×W×h×w×3"];
    for (shape, fault, help) in [
        (vec![3, 2, 3, 2, 2], "its shape is 3×2×3×2×2, and 2 of the first", sizes),
        (vec![3, 2, 3, 2, 3], "and 3 of the first", sizes),
        (vec![2, 3, 2, 3, 2], "its shape is 2×3×2×3×2, and 0 of the first", sizes),
        (vec![2, 3, 2], "its shape is 2×3×2, which is no matrix", axes),
        (vec![6], "its shape is 6, which is no matrix", axes),
        (vec![1, 1, 1, 2, 1, 1], "which is no matrix", axes),
    ] {
        let values = vec![1.0; shape.iter().product()];
        let why = refusal("a.npy", &doubles(&shape, &values));
        assert!(why.contains(fault) && why.contains(help), "{shape:?}: {why}");
    }
}

#[test]
fn a_value_that_is_no_number_is_named_by_its_entry() {
    for wrong in [f64::NAN, f64::INFINITY] {
        let why = refusal("a.npy", &doubles(&[2, 2], &[1.0, 0.0, 2.0, wrong]));
        assert!(why.contains(&format!("entry (1, 1) is {wrong}")), "{why}");
    }
}
