//! A small picture in a terminal: two pixels in each character, the upper half and the lower half of a block.

use std::fmt::Write;

use crate::image::Resolution;
use crate::io::raster::Raster;

/// Columns of a picture in the terminal.
const COLUMNS: usize = 48;

/// The size of a picture with this ratio of width to height: two rows of pixels in a line of characters, which are twice as high as wide.
pub(super) fn size(aspect: f32) -> Resolution {
    let rows = (COLUMNS as f32 / aspect).round().clamp(2.0, 2.0 * COLUMNS as f32) as usize;
    Resolution::new(COLUMNS, rows.next_multiple_of(2))
}

/// The characters, with 24-bit colours as most terminals know them.
pub(super) fn half_blocks(picture: &Raster) -> String {
    let size = picture.resolution();
    let mut text = String::new();
    for row in (0..size.height).step_by(2) {
        for column in 0..size.width {
            let [red, green, blue] = picture.pixel(column, row);
            let [below_red, below_green, below_blue] = match row + 1 < size.height {
                true => picture.pixel(column, row + 1),
                false => [0; 3],
            };
            // Writing to a string does not fail.
            let _ = write!(
                text,
                "\u{1b}[38;2;{red};{green};{blue};48;2;{below_red};{below_green};{below_blue}m▀"
            );
        }
        text.push_str("\u{1b}[0m\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_character_has_the_colours_of_two_pixels() {
        let pixels = [[255, 0, 0], [0, 255, 0], [1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]];
        let text = half_blocks(&Raster::from_pixels(Resolution::new(2, 3), pixels));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "\u{1b}[38;2;255;0;0;48;2;1;2;3m▀\u{1b}[38;2;0;255;0;48;2;4;5;6m▀\u{1b}[0m");
        assert_eq!(lines[1], "\u{1b}[38;2;7;8;9;48;2;0;0;0m▀\u{1b}[38;2;10;11;12;48;2;0;0;0m▀\u{1b}[0m");
        assert_eq!(lines.len(), 2);
    }

    #[test]
    fn pictures_keep_their_shape() {
        assert_eq!(size(1.0), Resolution::new(48, 48));
        assert_eq!(size(16.0 / 9.0), Resolution::new(48, 28));
        assert_eq!(size(1e9), Resolution::new(48, 2));
        assert_eq!(size(1e-9), Resolution::new(48, 96));
    }
}
