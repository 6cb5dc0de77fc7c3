//! The part of a sensor that is read, and the conversion of its counts to pixels.

use super::mosaic::{Binning, Colour, Tiles};
use crate::image::Resolution;
use crate::rig::CameraInfo;

/// The description of a camera's sensor in a rig file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sensor {
    /// Width and height of the part that is read, in photosites.
    pub(crate) size: [usize; 2],
    /// The offset of that part from the sensor's top left photosite, to the right and down.
    pub(crate) offset: [usize; 2],
    /// Bits of a photosite's count.
    pub(crate) bits: u32,
    /// The colour filters. `None`: the sensor is gray.
    pub(crate) tiles: Option<Tiles>,
    /// How the cells of a colour sensor become pixels.
    pub(crate) colour: Colour,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`.
    pub(crate) saturation: Option<u16>,
}

impl Sensor {
    /// The properties of a camera with this sensor. Its name is `name`, followed by every setting of the sensor that changes counts,
    /// so that photos and calibrations of other settings belong to another camera.
    pub(crate) fn info(&self, name: &str, exposures: [f64; 2]) -> CameraInfo {
        let [[width, height], [x, y]] = [self.size, self.offset];
        let mut name = format!("{name} {width}x{height}+{x}+{y}");
        if let Some(tiles) = self.tiles {
            name.push_str(&format!(" {} binned to {}", tiles.letters(), self.colour.key()));
        }
        if let Some(full) = self.saturation {
            name.push_str(&format!(" full at {full}"));
        }
        let (raster, binning) = (self.raster(), self.binning());
        CameraInfo {
            name,
            resolution: binning.map_or(raster, |binning| binning.resolution(raster)),
            channels: binning.map_or(1, |binning| binning.colour.channels()),
            bits: binning.map_or(self.bits, |binning| binning.bits()),
            exposures,
        }
    }

    fn raster(&self) -> Resolution {
        Resolution::new(self.size[0], self.size[1])
    }

    fn binning(&self) -> Option<Binning> {
        self.tiles.map(|tiles| Binning { tiles, colour: self.colour, bits: self.bits, full: self.full() })
    }

    fn full(&self) -> u16 {
        self.saturation.unwrap_or(self.highest())
    }

    fn highest(&self) -> u16 {
        ((1_u32 << self.bits) - 1) as u16
    }

    /// Converts the counts of all photosites to the pixels of [`Self::info`]'s camera. Saturated pixels get the highest count.
    pub(crate) fn pixels(&self, mut counts: Vec<u16>) -> Vec<u16> {
        if let Some(binning) = self.binning() {
            return binning.bin(self.raster(), &counts);
        }
        let (full, highest) = (self.full(), self.highest());
        counts.iter_mut().filter(|count| **count >= full).for_each(|count| *count = highest);
        counts
    }

    /// Finds a contradiction in the description: what is wrong, and what to do. `None`: there is none.
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

#[cfg(test)]
mod tests {
    use super::*;

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
