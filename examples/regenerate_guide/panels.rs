//! Pictures side by side.

use krylux::image::{Image, Resolution};
use krylux::io::raster;
use krylux::io::raster::Raster;

/// Pixels between two pictures.
const GAP: usize = 8;

/// Pictures of one size in a row, each pixel a square of `factor`.
pub fn row(pictures: &[Raster], factor: usize) -> Raster {
    let enlarged: Vec<Raster> = pictures.iter().map(|picture| picture.enlarged(factor)).collect();
    let width: usize =
        enlarged.iter().map(|of| of.resolution().width + GAP).sum::<usize>().saturating_sub(GAP);
    let height = enlarged.iter().map(|of| of.resolution().height).max().unwrap_or(0);
    let size = Resolution::new(width, height);
    let mut row = Raster::from_pixels(size, std::iter::repeat_n([255; 3], size.pixels()));
    let mut x = 0;
    for picture in &enlarged {
        row.paste(picture, x, 0);
        x += picture.resolution().width + GAP;
    }
    row
}

/// Pictures of one width below one another.
pub fn column(pictures: &[Raster]) -> Raster {
    let width = pictures.iter().map(|of| of.resolution().width).max().unwrap_or(0);
    let height = pictures.iter().map(|of| of.resolution().height + GAP).sum::<usize>().saturating_sub(GAP);
    let size = Resolution::new(width, height);
    let mut column = Raster::from_pixels(size, std::iter::repeat_n([255; 3], size.pixels()));
    let mut y = 0;
    for picture in pictures {
        column.paste(picture, 0, y);
        y += picture.resolution().height + GAP;
    }
    column
}

/// A photo at the exposure that suits it.
pub fn photo(image: &Image) -> Raster {
    raster::develop(image, raster::exposure(image))
}

/// A photo at the exposure of another one, with room for light that the other one does not have.
pub fn photo_like(image: &Image, other: &Image) -> Raster {
    raster::develop(image, 0.7 * raster::exposure(other))
}
