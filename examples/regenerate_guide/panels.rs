//! Pictures side by side.

use krylux::image::{Image, Resolution};
use krylux::io::raster;
use krylux::io::raster::Raster;

/// Pixels between two pictures.
const GAP: usize = 8;

/// Rows of pictures below one another, each pixel a square of `factor`.
pub fn grid(rows: &[&[Raster]], factor: usize) -> Raster {
    let sizes = rows.iter().map(|row| {
        let widths = row.iter().map(|picture| picture.resolution().width * factor + GAP);
        let height = row.iter().map(|picture| picture.resolution().height * factor).max().unwrap_or(0);
        [widths.sum::<usize>().saturating_sub(GAP), height + GAP]
    });
    let sizes: Vec<[usize; 2]> = sizes.collect();
    let width = sizes.iter().map(|size| size[0]).max().unwrap_or(0);
    let height = sizes.iter().map(|size| size[1]).sum::<usize>().saturating_sub(GAP);
    let size = Resolution::new(width, height);
    let mut grid = Raster::from_pixels(size, std::iter::repeat_n([255; 3], size.pixels()));
    let mut y = 0;
    for (row, [_, height]) in rows.iter().zip(sizes) {
        let mut x = 0;
        for picture in *row {
            grid.paste(&picture.enlarged(factor), x, y);
            x += picture.resolution().width * factor + GAP;
        }
        y += height;
    }
    grid
}

/// A photo at the exposure that suits it.
pub fn photo(image: &Image) -> Raster {
    raster::develop(image, raster::exposure(image))
}

/// A photo at the exposure of another one, with room for light that the other one does not have.
pub fn photo_like(image: &Image, other: &Image) -> Raster {
    raster::develop(image, 0.7 * raster::exposure(other))
}
