//! A wall and a thing before it, seen by a camera that may stand beside the projector.

use std::path::Path;

use krylux::io::sparse;
use krylux::sparse::Csr;
use tempfile::TempDir;

pub use crate::program::{command, folder, inside, krylux, text, verdict as summary};

/// Pixels of the projector on a side.
pub const SIDE: usize = 32;

/// Columns and rows of the thing, from the first to the one past the last: a good tenth of the field.
const THING: [[usize; 2]; 2] = [[11, 22], [10, 21]];

/// Of all light that falls into the scene, each pixel gets so much by way of the others.
const INDIRECT: f64 = 0.15;

/// What the camera sees when it stands so many pixels of parallax to the right of the projector, and below it: the thing is seen that
/// much further left and up. What lies behind it for the projector is in its shadow.
pub fn wall(aside: [i32; 2]) -> Csr {
    let within = |x: i32, y: i32| {
        [x, y].iter().zip(THING).all(|(&at, [from, to])| at >= from as i32 && at < to as i32)
    };
    let albedo = |pixel: usize| 0.6 + 0.3 * ((pixel % SIDE) as f64 * 0.9 + (pixel / SIDE) as f64 * 0.4).sin();
    let pixels = SIDE * SIDE;
    let (mut starts, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for pixel in 0..pixels {
        let [x, y] = [(pixel % SIDE) as i32, (pixel / SIDE) as i32];
        let thing = [x + aside[0], y + aside[1]];
        let direct = if within(thing[0], thing[1]) {
            Some(thing[1] as usize * SIDE + thing[0] as usize)
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

/// A rig before it, with noise, and a camera of twice as many pixels; `more` stands in its file's tables by name.
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

/// Red, green and blue of a picture that was written.
pub fn pixels(path: &str) -> (usize, Vec<[u8; 3]>) {
    let picture = image::open(Path::new(path)).expect("it is a whole picture").to_rgb8();
    (picture.width() as usize, picture.pixels().map(|pixel| pixel.0).collect())
}
