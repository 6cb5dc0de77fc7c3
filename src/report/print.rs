//! Pictures as files for people: enlarged, with a title above, and the meaning of the colours below.

use super::html::{Figure, Legend};
use crate::image::Resolution;
use crate::io::raster::Raster;

/// The longer side of a picture has at least this many pixels.
const SIDE: usize = 512;
/// The width and height in pixels of one dot of a letter.
const DOT: usize = 3;
const GAP: usize = 2 * DOT;
const PAPER: [u8; 3] = [0xff; 3];
const INK: [u8; 3] = [0x20; 3];

const LETTERS: &str = "0123456789.,:-+%/()<²ABCDEFGHIJKLMNOPQRSTUVWXYZ";
/// Each letter is five rows of three dots. A row is an octal digit, whose bits are the dots from left to right.
#[rustfmt::skip]
const DOTS: [u16; 47] = [
    0o75557, 0o26227, 0o71747, 0o71717, 0o55711, 0o74717, 0o74757, 0o71222, 0o75757, 0o75717, 0o00002, 0o00024,
    0o02020, 0o00700, 0o02720, 0o51245, 0o11244, 0o24442, 0o21112, 0o12421, 0o61270, 0o25755, 0o65656, 0o34443,
    0o65556, 0o74647, 0o74644, 0o34553, 0o55755, 0o72227, 0o11152, 0o55655, 0o44447, 0o57755, 0o65555, 0o25552,
    0o65644, 0o25563, 0o65655, 0o34216, 0o72222, 0o55557, 0o55552, 0o55775, 0o55255, 0o55222, 0o71247,
];

/// The picture of a figure with its name and its legend.
pub(crate) fn printed(Figure { picture, name, legend, .. }: &Figure) -> Raster {
    let Resolution { width, height } = picture.resolution();
    let picture = picture.enlarged(SIDE.div_ceil(width.max(height).max(1)));
    let width = picture.resolution().width.max(SIDE);
    let mut rows = vec![text(name), picture];
    match legend {
        Legend::None => {}
        Legend::Scale { colors, labels, unit } => {
            let size = Resolution::new(width, 5 * DOT);
            rows[0] = text(&format!("{name} {unit}"));
            let color = |pixel: usize| colors[pixel % width * colors.len() / width];
            rows.push(Raster::from_pixels(size, (0..size.pixels()).map(color)));
            let mut numbers = blank(size);
            for (index, label) in labels.iter().map(|label| text(label)).enumerate() {
                let room = width.saturating_sub(label.resolution().width);
                numbers.paste(&label, room * index / (labels.len() - 1).max(1), 0);
            }
            rows.push(numbers);
        }
        Legend::Swatches(swatches) => {
            let mut left = width;
            for swatch in swatches {
                let label = text(&swatch.text);
                let taken = 8 * DOT + label.resolution().width + 4 * GAP;
                if left + taken > width {
                    rows.push(blank(Resolution::new(width, 5 * DOT)));
                    left = 0;
                }
                let square = Resolution::new(6 * DOT, 5 * DOT);
                let square = Raster::from_pixels(square, std::iter::repeat(swatch.color));
                let row = rows.len() - 1;
                rows[row].paste(&square, left, 0);
                rows[row].paste(&label, left + 8 * DOT, 0);
                left += taken;
            }
        }
    }
    let height: usize = rows.iter().map(|row| row.resolution().height + GAP).sum();
    let mut page = blank(Resolution::new(width + 2 * GAP, height + GAP));
    rows.iter().fold(GAP, |top, row| {
        page.paste(row, GAP, top);
        top + row.resolution().height + GAP
    });
    page
}

fn blank(size: Resolution) -> Raster {
    Raster::from_pixels(size, std::iter::repeat(PAPER))
}

/// A line of text in capitals. A character that is not among the letters is a space.
fn text(text: &str) -> Raster {
    let text = text.to_uppercase().replace('\u{2212}', "-");
    let dots = |letter| LETTERS.chars().position(|of| of == letter).map_or(0, |at| DOTS[at]);
    let letters: Vec<u16> = text.chars().map(dots).collect();
    let size = Resolution::new(4 * letters.len(), 5);
    let color = |pixel: usize| {
        let (x, y) = (pixel % size.width, pixel / size.width);
        // The fourth column of each letter is the space behind it.
        let is_ink = x % 4 < 3 && (letters[x / 4] >> (14 - 3 * y - x % 4)) & 1 == 1;
        if is_ink { INK } else { PAPER }
    };
    Raster::from_pixels(size, (0..size.pixels()).map(color)).enlarged(DOT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::palette::paint_labels;

    #[test]
    fn a_picture_keeps_its_pixels_as_squares_between_a_title_and_a_legend() {
        let (size, labels) = (Resolution::new(4, 2), [0, 0, 1, 1, 2, 2, 3, 3]);
        let picture = paint_labels(size, &labels);
        for (legend, rows) in [(Legend::None, 0), (Legend::signed(0.5), 2), (Legend::of_labels(&labels), 2)] {
            let figure = Figure { picture: picture.clone(), legend, ..Figure::default() }.named("1 I", "");
            let page = printed(&figure);
            let top = 2 * GAP + 5 * DOT;
            assert_eq!(page.resolution(), Resolution::new(524, top + 256 + GAP + rows * (5 * DOT + GAP)));
            for (x, y) in [(0, 0), (3, 1), (2, 0)] {
                let [left, top] = [GAP + 128 * x, top + 128 * y];
                assert_eq!(page.pixel(left, top), picture.pixel(x, y));
                assert_eq!(page.pixel(left + 127, top + 127), picture.pixel(x, y));
            }
            // The digit 1 has its middle column, the letter I its whole upper row.
            let is_ink = |column: usize| page.pixel(GAP + column * DOT, GAP) == INK;
            assert_eq!([0, 1, 2, 4, 8, 9, 10].map(is_ink), [false, true, false, false, true, true, true]);
        }
    }
}
