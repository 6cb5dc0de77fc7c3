//! The conversion of photosite counts to pixels, for the part of a sensor that is read and for colour filters in cells of 2×2.
//!
//! Each cell becomes one pixel, without interpolation. No count contributes to two pixels. Therefore the noise of pixels is independent,
//! and each pixel is the same linear function of light. The photo has half the width and height of the sensor.

use serde::Deserialize;

use super::CameraInfo;
use crate::image::Resolution;

/// The colour filters of a cell: the upper row first, then the lower row.
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

/// The conversion of a cell's four counts R, G₁, G₂ and B to a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Colour {
    /// Three channels: 2R, G₁ + G₂, 2B. The channels have one bit more than a photosite.
    #[default]
    Rgb,
    /// One channel with all the light of the cell: R + G₁ + G₂ + B. It has two bits more than a photosite.
    Luma,
    /// One channel: G₁ + G₂. It has one bit more than a photosite.
    Green,
}

impl Tiles {
    /// All arrangements of a cell's filters.
    pub(crate) const ALL: [Self; 4] = [Self::Rggb, Self::Grbg, Self::Gbrg, Self::Bggr];

    /// The colours in capital letters, for example `RGGB`, and the positions of red, the two greens, and blue in a cell. Positions 0 and 1
    /// are in the upper row, 2 and 3 in the lower row.
    fn cell(self) -> (&'static str, [usize; 4]) {
        match self {
            Self::Rggb => ("RGGB", [0, 1, 2, 3]),
            Self::Grbg => ("GRBG", [1, 0, 3, 2]),
            Self::Gbrg => ("GBRG", [2, 0, 3, 1]),
            Self::Bggr => ("BGGR", [3, 1, 2, 0]),
        }
    }

    /// The colours in capital letters, for example `RGGB`.
    pub fn letters(self) -> &'static str {
        self.cell().0
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

    fn more_bits(self) -> u32 {
        if self == Self::Luma { 2 } else { 1 }
    }
}

/// The description of a camera's sensor in a rig file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sensor {
    /// Width and height of the part that is read, in photosites.
    pub(crate) size: [usize; 2],
    pub(crate) offset: [usize; 2],
    pub(crate) bits: u32,
    pub(crate) tiles: Option<Tiles>,
    /// The conversion of a colour sensor's cells to pixels.
    pub(crate) colour: Colour,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`.
    pub(crate) saturation: Option<u16>,
}

impl Sensor {
    /// The properties of a camera with this sensor. The camera's name is `name`, followed by every setting of the sensor that changes
    /// counts. Photos and calibrations with other settings therefore belong to another camera.
    pub(crate) fn info(&self, name: &str, exposures: [f64; 2]) -> CameraInfo {
        let [[width, height], [x, y]] = [self.size, self.offset];
        let mut name = format!("{name} {width}x{height}+{x}+{y}");
        if let Some(tiles) = self.tiles {
            name.push_str(&format!(" {} binned to {}", tiles.letters(), self.colour.key()));
        }
        if let Some(full) = self.saturation {
            name.push_str(&format!(" full at {full}"));
        }
        CameraInfo {
            name,
            resolution: self.resolution(),
            channels: self.tiles.map_or(1, |_| self.colour.channels()),
            bits: self.pixel_bits(),
            exposures,
        }
    }

    /// The size in pixels. The last row or column of a colour sensor is dropped if the number of rows or columns is odd.
    fn resolution(&self) -> Resolution {
        let cell = if self.tiles.is_some() { 2 } else { 1 };
        Resolution::new(self.size[0] / cell, self.size[1] / cell)
    }

    /// Bits of a pixel's count.
    fn pixel_bits(&self) -> u32 {
        self.tiles.map_or(self.bits, |_| (self.bits + self.colour.more_bits()).min(16))
    }

    fn full(&self) -> u16 {
        self.saturation.unwrap_or(self.highest())
    }

    fn highest(&self) -> u16 {
        ((1_u32 << self.bits) - 1) as u16
    }

    /// Converts the counts of all photosites to the pixels that [`Self::info`] describes, row by row with interleaved channels. Saturated
    /// pixels get the highest count.
    ///
    /// A pixel of a colour sensor is a sum over a cell, not a mean, so that rounding loses no light. Only a sum of more than 16 bits is
    /// halved or quartered, and rounded. If one photosite of a cell is saturated, all channels get the highest count, because the excess
    /// light may have spilled over to the neighbours.
    pub(crate) fn pixels(&self, mut counts: Vec<u16>) -> Vec<u16> {
        let Some(tiles) = self.tiles else {
            let (full, highest) = (self.full(), self.highest());
            counts.iter_mut().filter(|count| **count >= full).for_each(|count| *count = highest);
            return counts;
        };
        debug_assert_eq!(counts.len(), self.size[0] * self.size[1]);
        let (size, width) = (self.resolution(), self.size[0]);
        let full = ((1_u32 << self.pixel_bits()) - 1) as u16;
        let shift = self.bits + self.colour.more_bits() - self.pixel_bits();
        let half = (1_u32 << shift) / 2;
        // The highest count is reserved for saturated cells.
        let scaled = |sum: u32| (((sum + half) >> shift) as u16).min(full - 1);
        let mut pixels = Vec::with_capacity(size.pixels() * self.colour.channels());
        for y in 0..size.height {
            let (above, below) = (2 * y * width, (2 * y + 1) * width);
            for x in (0..2 * size.width).step_by(2) {
                let cell = [above + x, above + x + 1, below + x, below + x + 1].map(|at| counts[at]);
                if cell.iter().any(|&count| count >= self.full()) {
                    pixels.extend(std::iter::repeat_n(full, self.colour.channels()));
                    continue;
                }
                let [red, green, other, blue] = tiles.cell().1.map(|place| u32::from(cell[place]));
                match self.colour {
                    Colour::Rgb => pixels.extend([2 * red, green + other, 2 * blue].map(scaled)),
                    Colour::Luma => pixels.push(scaled(red + green + other + blue)),
                    Colour::Green => pixels.push(scaled(green + other)),
                }
            }
        }
        pixels
    }

    /// Finds a contradiction in the description, and returns the fault and the remedy. `None`: there is no contradiction.
    pub(crate) fn fault(&self) -> Option<[String; 2]> {
        let fault = |fault: String, help: String| Some([fault, help]);
        for (key, [a, b]) in [("size", self.size), ("offset", self.offset)] {
            if self.tiles.is_some() && (a % 2 == 1 || b % 2 == 1) {
                return fault(
                    format!("camera.{key} is [{a}, {b}], which cuts the 2x2 cells of a colour sensor"),
                    "give even numbers".into(),
                );
            }
        }
        if self.tiles.is_none() && self.colour != Colour::default() {
            return fault(
                format!("camera.colour is \"{}\", but the camera is gray", self.colour.key()),
                "leave it out, or describe a colour camera (pixel_format = \"bayerrg12\", or tiles = \"rggb\")".into(),
            );
        }
        if self.saturation.is_some_and(|full| full == 0 || full > self.highest()) {
            return fault(
                format!("camera.saturation is {}", self.full()),
                format!("give 1 to {}, the counts of {} bits", self.highest(), self.bits),
            );
        }
        None
    }
}

impl CameraInfo {
    /// The same camera with this gain in its name.
    pub(crate) fn with_gain(mut self, gain: Option<impl std::fmt::Display>) -> Self {
        if let Some(gain) = gain {
            self.name.push_str(&format!(" gain {gain}"));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A sensor of one cell.
    fn binning(tiles: Tiles, colour: Colour, bits: u32) -> Sensor {
        Sensor { size: [2, 2], offset: [0, 0], bits, tiles: Some(tiles), colour, saturation: None }
    }

    #[test]
    fn each_channel_is_taken_from_the_photosites_of_its_colour() {
        for tiles in Tiles::ALL {
            // The counts in the order of the letters are 100 for red, 7 for the first green, 9 for the second, and 1000 for blue.
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
            assert_eq!(binning(tiles, Colour::Rgb, 12).pixels(cell.clone()), [200, 16, 2000], "{tiles:?}");
            assert_eq!(binning(tiles, Colour::Luma, 12).pixels(cell.clone()), [1116], "{tiles:?}");
            assert_eq!(binning(tiles, Colour::Green, 12).pixels(cell.clone()), [16], "{tiles:?}");
        }
    }

    #[test]
    fn cells_keep_their_position_and_odd_edges_are_dropped() {
        let counts: Vec<u16> = (0..15).collect();
        let of = Sensor { size: [5, 3], ..binning(Tiles::Rggb, Colour::Luma, 12) };
        assert_eq!(of.resolution(), Resolution::new(2, 1));
        assert_eq!(of.pixels(counts), [1 + 5 + 6, 2 + 3 + 7 + 8]);
    }

    #[test]
    fn a_cell_with_one_saturated_photosite_is_saturated_in_all_channels() {
        for tiles in Tiles::ALL {
            for colour in [Colour::Rgb, Colour::Luma, Colour::Green] {
                for bits in [8, 12, 14, 16] {
                    let of = binning(tiles, colour, bits);
                    let top = ((1_u32 << of.pixel_bits()) - 1) as u16;
                    for place in 0..4 {
                        let mut cell = [0; 4];
                        cell[place] = of.full();
                        let pixel = of.pixels(cell.to_vec());
                        assert!(pixel.iter().all(|&count| count == top), "{of:?}: {pixel:?}");
                    }
                    // A bright cell without a saturated photosite stays below the highest count.
                    let bright = of.pixels(vec![of.full() - 1; 4]);
                    assert!(bright.iter().all(|&count| count < top), "{of:?}: {bright:?}");
                }
            }
        }
        let early = Sensor { saturation: Some(3000), ..binning(Tiles::Rggb, Colour::Rgb, 12) };
        assert_eq!(early.pixels(vec![3000, 0, 0, 0]), [8191; 3]);
        assert_eq!(early.pixels(vec![2999, 0, 0, 0]), [5998, 0, 0]);
    }

    proptest! {
        #[test]
        fn up_to_14_bits_nothing_is_lost_and_pixels_share_no_count(
            counts in prop::collection::vec(0_u16..16383, 24),
            changed in 0_usize..24,
        ) {
            let of = Sensor { size: [6, 4], ..binning(Tiles::Gbrg, Colour::Luma, 14) };
            let before = of.pixels(counts.clone());
            prop_assert_eq!(
                before.iter().map(|&count| u64::from(count)).sum::<u64>(),
                counts.iter().map(|&count| u64::from(count)).sum::<u64>()
            );
            let mut other = counts.clone();
            other[changed] = 16382 - other[changed];
            let after = of.pixels(other);
            let cell = changed / 6 / 2 * 3 + changed % 6 / 2;
            for (pixel, (before, after)) in before.iter().zip(&after).enumerate() {
                prop_assert!(pixel == cell || before == after);
            }
        }
    }

    const GRAY: Sensor =
        Sensor { size: [4, 2], offset: [2, 0], bits: 12, tiles: None, colour: Colour::Rgb, saturation: None };

    #[test]
    fn a_gray_sensors_counts_stay_and_saturated_ones_have_all_bits_set() {
        let info = GRAY.info("it", [0.1, 1.0]);
        assert_eq!((info.name.as_str(), info.channels, info.bits), ("it 4x2+2+0", 1, 12));
        assert_eq!(GRAY.pixels(vec![0, 4094, 4095, 7]), [0, 4094, 4095, 7]);
        let early = Sensor { saturation: Some(3000), ..GRAY };
        assert_eq!(early.pixels(vec![2999, 3000, 3500]), [2999, 4095, 4095]);
        assert_eq!(early.info("it", [0.1, 1.0]).name, "it 4x2+2+0 full at 3000");
    }

    #[test]
    fn a_colour_sensor_has_half_the_size_and_its_name_says_how_it_is_binned() {
        let colour = Sensor { tiles: Some(Tiles::Rggb), ..GRAY };
        let info = colour.info("it", [0.1, 1.0]);
        assert_eq!(info.name, "it 4x2+2+0 RGGB binned to rgb");
        assert_eq!((info.resolution, info.channels, info.bits), (Resolution::new(2, 1), 3, 13));
        assert_eq!(colour.pixels(vec![1, 2, 3, 4, 5, 6, 7, 8]), [2, 7, 12, 6, 11, 16]);
    }

    #[test]
    fn contradictions_are_named() {
        let refused = |sensor: Sensor| sensor.fault().expect("it is refused").join("; ");
        let colour = Sensor { tiles: Some(Tiles::Rggb), ..GRAY };
        assert_eq!((GRAY.fault(), colour.fault()), (None, None));
        assert!(refused(Sensor { offset: [1, 0], ..colour }).contains("camera.offset is [1, 0], which cuts"));
        assert!(refused(Sensor { size: [4, 3], ..colour }).contains("give even numbers"));
        assert!(
            refused(Sensor { colour: Colour::Luma, ..GRAY }).contains("\"luma\", but the camera is gray")
        );
        assert!(refused(Sensor { saturation: Some(5000), ..GRAY }).contains("give 1 to 4095"));
    }
}
