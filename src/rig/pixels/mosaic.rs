//! Colour sensors: a mosaic of colour filters in cells of 2×2 photosites.
//!
//! Each cell becomes one pixel, without interpolation. No count contributes to two pixels; therefore the noise of pixels is
//! independent, and each pixel is the same linear function of light. The photo has half the width and height of the sensor.

use serde::Deserialize;

use crate::image::Resolution;

/// The colour filters of a cell: the upper row, then the lower row.
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

/// How the four counts R, G₁, G₂ and B of a cell become a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Colour {
    /// Three channels: 2R, G₁ + G₂, 2B. They have one bit more than a photosite.
    #[default]
    Rgb,
    /// One channel: R + G₁ + G₂ + B, all the light of the cell. It has two bits more than a photosite.
    Luma,
    /// One channel: G₁ + G₂. It has one bit more than a photosite.
    Green,
}

/// The conversion of a colour sensor's cells to pixels.
///
/// A pixel is a sum, not a mean, so that nothing is lost by rounding. A sum of more than 16 bits is halved or quartered, and rounded.
/// If one photosite of a cell is saturated, all channels of the pixel get the highest count, because the excess light may have spilled
/// over into the neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binning {
    /// The colour filters.
    pub tiles: Tiles,
    /// The channels of a pixel.
    pub colour: Colour,
    /// Bits of a photosite's count, 8 to 16.
    pub bits: u32,
    /// The count from which a photosite is saturated.
    pub full: u16,
}

impl Tiles {
    /// The colours in capital letters, e.g. `RGGB`.
    pub fn letters(self) -> &'static str {
        match self {
            Self::Rggb => "RGGB",
            Self::Grbg => "GRBG",
            Self::Gbrg => "GBRG",
            Self::Bggr => "BGGR",
        }
    }

    /// The positions of red, the two greens, and blue in a cell, where 0 and 1 are the upper row, 2 and 3 the lower row.
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
    /// The name in rig files.
    pub fn key(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Luma => "luma",
            Self::Green => "green",
        }
    }

    /// The number of channels of a pixel.
    pub fn channels(self) -> usize {
        if self == Self::Rgb { 3 } else { 1 }
    }

    /// The number of bits that a sum has more than its counts.
    fn more_bits(self) -> u32 {
        if self == Self::Luma { 2 } else { 1 }
    }
}

impl Binning {
    /// Bits of a pixel's count.
    pub fn bits(&self) -> u32 {
        (self.bits + self.colour.more_bits()).min(16)
    }

    /// The size in pixels of a mosaic with this size in photosites. An odd last row or column is dropped.
    pub fn resolution(&self, mosaic: Resolution) -> Resolution {
        Resolution::new(mosaic.width / 2, mosaic.height / 2)
    }

    /// Converts the counts of a mosaic to pixels, row by row, channels interleaved. `counts` has one count for each photosite of
    /// `mosaic`.
    pub fn bin(&self, mosaic: Resolution, counts: &[u16]) -> Vec<u16> {
        debug_assert_eq!(counts.len(), mosaic.pixels());
        let size = self.resolution(mosaic);
        let full = ((1_u32 << self.bits()) - 1) as u16;
        let shift = self.bits + self.colour.more_bits() - self.bits();
        let half = (1_u32 << shift) / 2;
        // The highest count is reserved for saturated cells.
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
    fn each_channel_is_taken_from_the_photosites_of_its_colour() {
        for tiles in ALL {
            // In the order of the letters: red 100, the first green 7, the second 9, blue 1000.
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
    fn cells_keep_their_position_and_odd_edges_are_dropped() {
        let mosaic = Resolution::new(5, 3);
        let counts: Vec<u16> = (0..15).collect();
        let of = binning(Tiles::Rggb, Colour::Luma, 12);
        assert_eq!(of.resolution(mosaic), Resolution::new(2, 1));
        assert_eq!(of.bin(mosaic, &counts), [1 + 5 + 6, 2 + 3 + 7 + 8]);
    }

    #[test]
    fn a_cell_with_one_saturated_photosite_is_saturated_in_all_channels() {
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
                    // A bright cell without a saturated photosite stays below the highest count.
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
