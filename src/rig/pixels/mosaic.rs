//! A colour sensor: a mosaic of filters, two by two, each photosite behind one of them.
//!
//! Each cell of 2×2 photosites becomes one pixel, and nothing is interpolated: no count enters two pixels, so the noise of each
//! pixel is its own, and the photo is the same linear function of light everywhere. Half the size is the price.

use serde::Deserialize;

use crate::image::Resolution;

/// The colours of a cell: its upper row, then its lower one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tiles {
    /// Red and green over green and blue.
    Rggb,
    /// Green and red over blue and green.
    Grbg,
    /// Green and blue over red and green.
    Gbrg,
    /// Blue and green over green and red.
    Bggr,
}

/// What becomes of a cell's four counts R, G₁, G₂ and B.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Colour {
    /// Three channels: 2R, G₁ + G₂, 2B; one bit more than a photosite has.
    #[default]
    Rgb,
    /// One channel: R + G₁ + G₂ + B, all the light that the cell saw; two bits more.
    Luma,
    /// One channel: G₁ + G₂; one bit more.
    Green,
}

/// How cells become pixels.
///
/// A sum, not a mean: so no half of a count is lost. Where it takes more than 16 bits it is halved, or quartered, and rounded.
/// A cell of which one photosite is full is full in all channels, at the highest count of all: the light that it gave away may be in its
/// neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binning {
    /// The filters.
    pub tiles: Tiles,
    /// What is wanted of them.
    pub colour: Colour,
    /// Bits of a photosite's count, 8 to 16.
    pub bits: u32,
    /// A photosite that counts so much is full.
    pub full: u16,
}

impl Tiles {
    /// The colours in capitals, as in `RGGB`.
    pub fn letters(self) -> &'static str {
        match self {
            Self::Rggb => "RGGB",
            Self::Grbg => "GRBG",
            Self::Gbrg => "GBRG",
            Self::Bggr => "BGGR",
        }
    }

    /// Places in a cell (0 and 1 above, 2 and 3 below) of red, the two greens, and blue.
    fn places(self) -> [usize; 4] {
        match self {
            Self::Rggb => [0, 1, 2, 3],
            Self::Grbg => [1, 0, 3, 2],
            Self::Gbrg => [2, 0, 3, 1],
            Self::Bggr => [3, 1, 2, 0],
        }
    }
}

impl Colour {
    /// As rig files call it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Luma => "luma",
            Self::Green => "green",
        }
    }

    /// Channels of a pixel.
    pub fn channels(self) -> usize {
        if self == Self::Rgb { 3 } else { 1 }
    }

    /// Bits that a sum has more than its counts.
    fn more_bits(self) -> u32 {
        if self == Self::Luma { 2 } else { 1 }
    }
}

impl Binning {
    /// Bits of a pixel's count.
    pub fn bits(&self) -> u32 {
        (self.bits + self.colour.more_bits()).min(16)
    }

    /// Pixels of a mosaic of so many photosites; an odd row or column is left over.
    pub fn resolution(&self, mosaic: Resolution) -> Resolution {
        Resolution::new(mosaic.width / 2, mosaic.height / 2)
    }

    /// The pixels of a mosaic's counts, row by row, channels interleaved. `counts` must fill `mosaic`.
    pub fn bin(&self, mosaic: Resolution, counts: &[u16]) -> Vec<u16> {
        debug_assert_eq!(counts.len(), mosaic.pixels());
        let size = self.resolution(mosaic);
        let full = ((1_u32 << self.bits()) - 1) as u16;
        let shift = self.bits + self.colour.more_bits() - self.bits();
        let half = (1_u32 << shift) / 2;
        // What is not full stays below what is.
        let scaled = |sum: u32| (((sum + half) >> shift) as u16).min(full - 1);
        let mut pixels = Vec::with_capacity(size.pixels() * self.colour.channels());
        for y in 0..size.height {
            let (above, below) = (2 * y * mosaic.width, (2 * y + 1) * mosaic.width);
            for x in (0..2 * size.width).step_by(2) {
                let cell = [above + x, above + x + 1, below + x, below + x + 1].map(|at| counts[at]);
                if cell.iter().any(|&count| count >= self.full) {
                    pixels.extend(std::iter::repeat_n(full, self.colour.channels()));
                    continue;
                }
                let [red, green, other, blue] = self.tiles.places().map(|place| u32::from(cell[place]));
                match self.colour {
                    Colour::Rgb => pixels.extend([2 * red, green + other, 2 * blue].map(scaled)),
                    Colour::Luma => pixels.push(scaled(red + green + other + blue)),
                    Colour::Green => pixels.push(scaled(green + other)),
                }
            }
        }
        pixels
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn binning(tiles: Tiles, colour: Colour, bits: u32) -> Binning {
        Binning { tiles, colour, bits, full: ((1_u32 << bits) - 1) as u16 }
    }

    const CELL: Resolution = Resolution { width: 2, height: 2 };
    const ALL: [Tiles; 4] = [Tiles::Rggb, Tiles::Grbg, Tiles::Gbrg, Tiles::Bggr];

    #[test]
    fn each_colour_is_taken_from_behind_its_filter() {
        for tiles in ALL {
            // As the letters stand: red 100, the first green 7, the second 9, blue 1000.
            let mut greens = [7, 9].into_iter();
            let cell: Vec<u16> = tiles
                .letters()
                .chars()
                .map(|letter| match letter {
                    'R' => 100,
                    'B' => 1000,
                    _ => greens.next().expect("a cell has two greens"),
                })
                .collect();
            assert_eq!(binning(tiles, Colour::Rgb, 12).bin(CELL, &cell), [200, 16, 2000], "{tiles:?}");
            assert_eq!(binning(tiles, Colour::Luma, 12).bin(CELL, &cell), [1116], "{tiles:?}");
            assert_eq!(binning(tiles, Colour::Green, 12).bin(CELL, &cell), [16], "{tiles:?}");
        }
    }

    #[test]
    fn cells_stay_where_they_are_and_odd_edges_are_left_over() {
        let mosaic = Resolution::new(5, 3);
        let counts: Vec<u16> = (0..15).collect();
        let of = binning(Tiles::Rggb, Colour::Luma, 12);
        assert_eq!(of.resolution(mosaic), Resolution::new(2, 1));
        assert_eq!(of.bin(mosaic, &counts), [1 + 5 + 6, 2 + 3 + 7 + 8]);
    }

    #[test]
    fn a_cell_with_one_full_photosite_is_full_in_all_channels() {
        for tiles in ALL {
            for colour in [Colour::Rgb, Colour::Luma, Colour::Green] {
                for bits in [8, 12, 14, 16] {
                    let of = binning(tiles, colour, bits);
                    let top = ((1_u32 << of.bits()) - 1) as u16;
                    for place in 0..4 {
                        let mut cell = [0; 4];
                        cell[place] = of.full;
                        let pixel = of.bin(CELL, &cell);
                        assert!(pixel.iter().all(|&count| count == top), "{of:?}: {pixel:?}");
                    }
                    // And one of which none is full is not, however bright.
                    let bright = of.bin(CELL, &[of.full - 1; 4]);
                    assert!(bright.iter().all(|&count| count < top), "{of:?}: {bright:?}");
                }
            }
        }
        let early = Binning { full: 3000, ..binning(Tiles::Rggb, Colour::Rgb, 12) };
        assert_eq!(early.bin(CELL, &[3000, 0, 0, 0]), [8191; 3]);
        assert_eq!(early.bin(CELL, &[2999, 0, 0, 0]), [5998, 0, 0]);
    }

    proptest! {
        #[test]
        fn up_to_14_bits_nothing_is_lost_and_pixels_share_no_count(
            counts in prop::collection::vec(0_u16..16383, 24),
            changed in 0_usize..24,
        ) {
            let (mosaic, of) = (Resolution::new(6, 4), binning(Tiles::Gbrg, Colour::Luma, 14));
            let before = of.bin(mosaic, &counts);
            prop_assert_eq!(
                before.iter().map(|&count| u64::from(count)).sum::<u64>(),
                counts.iter().map(|&count| u64::from(count)).sum::<u64>()
            );
            let mut other = counts.clone();
            other[changed] = 16382 - other[changed];
            let after = of.bin(mosaic, &other);
            let cell = changed / 6 / 2 * 3 + changed % 6 / 2;
            for (pixel, (before, after)) in before.iter().zip(&after).enumerate() {
                prop_assert!(pixel == cell || before == after);
            }
        }
    }
}
