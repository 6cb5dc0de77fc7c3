//! A wall and a plate in front of it, seen by a camera that may be beside the projector.

use std::path::Path;

use krylux::io::sparse;
use krylux::sparse::Csr;
use tempfile::TempDir;

pub use crate::program::{command, folder, inside, krylux, text, verdict as summary};

/// Pixels of the projector on a side.
pub const SIDE: usize = 32;

/// The columns and rows of the plate, from the first to the one past the last: more than a tenth of the
/// field.
const PLATE: [[usize; 2]; 2] = [[11, 22], [10, 21]];

/// Each pixel receives this share of all light of the scene by way of the other pixels.
const INDIRECT: f64 = 0.15;

/// The transport matrix for a camera with this parallax in pixels, to the right of the projector and below
/// it. The camera sees the plate displaced by as much to the left and up. What the plate hides from the
/// projector is in shadow.
pub fn wall(aside: [i32; 2]) -> Csr {
    let within = |x: i32, y: i32| {
        [x, y].iter().zip(PLATE).all(|(&at, [from, to])| at >= from as i32 && at < to as i32)
    };
    let albedo = |pixel: usize| 0.6 + 0.3 * ((pixel % SIDE) as f64 * 0.9 + (pixel / SIDE) as f64 * 0.4).sin();
    let pixels = SIDE * SIDE;
    let (mut starts, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for pixel in 0..pixels {
        let [x, y] = [(pixel % SIDE) as i32, (pixel / SIDE) as i32];
        let plate = [x + aside[0], y + aside[1]];
        let direct = if within(plate[0], plate[1]) {
            Some(plate[1] as usize * SIDE + plate[0] as usize)
        } else {
            (!within(x, y)).then_some(pixel)
        };
        for column in 0..pixels {
            columns.push(column as u32);
            let straight = if direct == Some(column) { 1.0 } else { 0.0 };
            weights.push(albedo(pixel) * (straight + INDIRECT / pixels as f64));
        }
        starts.push(columns.len());
    }
    Csr::new(pixels, starts, columns, weights).expect("well formed")
}

/// A virtual rig in front of it, with noise, and a camera with twice as many pixels on a side. `more` are
/// additional lines of its file, by table.
pub fn rig(folder: &TempDir, aside: [i32; 2], more: &[(&str, &str)]) -> String {
    sparse::write(&folder.path().join("wall.npz"), &wall(aside)).expect("the folder can be written");
    let of = |table: &str| -> String {
        more.iter().filter(|(name, _)| *name == table).map(|(_, line)| format!("{line}\n")).collect()
    };
    let file = format!(
        "kind = \"virtual\"\n{}[scene]\nmatrix = \"wall.npz\"\nsize = [{SIDE}, {SIDE}]\n\
         [projector]\nbits = 8\ngamma = 2.2\n{}[camera]\nsize = [64, 64]\nbits = 12\nblack_level = 40\n\
         full_well = 30000\nshot_noise = true\nread_noise = 6\n{}[faults]\n{}[measurement]\n{}",
        of(""),
        of("projector"),
        of("camera"),
        of("faults"),
        of("measurement")
    );
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, file).expect("the folder can be written");
    path.display().to_string()
}

/// The width of a picture, and its pixels as red, green and blue.
pub fn pixels(path: &str) -> (usize, Vec<[u8; 3]>) {
    let picture = image::open(Path::new(path)).expect("it is a whole picture").to_rgb8();
    (picture.width() as usize, picture.pixels().map(|pixel| pixel.0).collect())
}
