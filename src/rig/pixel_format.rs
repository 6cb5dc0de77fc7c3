//! Pixel formats: the number of bits of a count, the packing of counts into bytes, and the colour filters.
//!
//! The names follow EMVA's Pixel Format Naming Convention (PFNC 2.4). The crate `viva-pfnc` unpacks bytes to counts:
//!
//! | suffix | layout | source |
//! |---|---|---|
//! | none | a count in 8 or 16 bits, low byte first, upper bits zero | PFNC 6.1.1 |
//! | `p` | counts without gaps, from bit 0 of byte 0 on | PFNC 6.3.1 |
//! | `Packed` | two counts in three bytes: high bits of the first, low bits of both, high bits of the second | GigE Vision 2.0 |

use serde::de::{Deserialize, Deserializer, Error};

use super::sensor::Tiles;

macro_rules! formats {
    ($($(#[$of:meta])? $name:ident $key:literal $bits:literal $tiles:expr;)*) => {
        /// The format in which a camera sends counts. Rig files use lower case, such as `mono12p`, but the convention's spelling is
        /// accepted too.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the convention's names are the documentation")]
        pub enum PixelFormat {
            $($(#[$of])? $name,)*
        }

        const ALL: &[PixelFormat] = &[$(PixelFormat::$name),*];
        const KEYS: &[&str] = &[$($key),*];

        impl PixelFormat {
            /// The name in the convention, which cameras use.
            pub fn name(self) -> &'static str {
                match self { $(Self::$name => stringify!($name),)* }
            }

            /// The name in rig files.
            pub fn key(self) -> &'static str {
                match self { $(Self::$name => $key,)* }
            }

            /// Bits of a count.
            pub fn bits(self) -> u32 {
                match self { $(Self::$name => $bits,)* }
            }

            /// The colour filters before the sensor. `None`: the sensor is gray.
            pub fn tiles(self) -> Option<Tiles> {
                match self { $(Self::$name => $tiles,)* }
            }
        }
    };
}

formats! {
    Mono8 "mono8" 8 None;
    Mono10 "mono10" 10 None;
    Mono10p "mono10p" 10 None;
    Mono10Packed "mono10packed" 10 None;
    #[default] Mono12 "mono12" 12 None;
    Mono12p "mono12p" 12 None;
    Mono12Packed "mono12packed" 12 None;
    Mono14 "mono14" 14 None;
    Mono16 "mono16" 16 None;
    BayerRG8 "bayerrg8" 8 Some(Tiles::Rggb);
    BayerRG10 "bayerrg10" 10 Some(Tiles::Rggb);
    BayerRG10p "bayerrg10p" 10 Some(Tiles::Rggb);
    BayerRG10Packed "bayerrg10packed" 10 Some(Tiles::Rggb);
    BayerRG12 "bayerrg12" 12 Some(Tiles::Rggb);
    BayerRG12p "bayerrg12p" 12 Some(Tiles::Rggb);
    BayerRG12Packed "bayerrg12packed" 12 Some(Tiles::Rggb);
    BayerRG16 "bayerrg16" 16 Some(Tiles::Rggb);
    BayerGR8 "bayergr8" 8 Some(Tiles::Grbg);
    BayerGR10 "bayergr10" 10 Some(Tiles::Grbg);
    BayerGR10p "bayergr10p" 10 Some(Tiles::Grbg);
    BayerGR10Packed "bayergr10packed" 10 Some(Tiles::Grbg);
    BayerGR12 "bayergr12" 12 Some(Tiles::Grbg);
    BayerGR12p "bayergr12p" 12 Some(Tiles::Grbg);
    BayerGR12Packed "bayergr12packed" 12 Some(Tiles::Grbg);
    BayerGR16 "bayergr16" 16 Some(Tiles::Grbg);
    BayerGB8 "bayergb8" 8 Some(Tiles::Gbrg);
    BayerGB10 "bayergb10" 10 Some(Tiles::Gbrg);
    BayerGB10p "bayergb10p" 10 Some(Tiles::Gbrg);
    BayerGB10Packed "bayergb10packed" 10 Some(Tiles::Gbrg);
    BayerGB12 "bayergb12" 12 Some(Tiles::Gbrg);
    BayerGB12p "bayergb12p" 12 Some(Tiles::Gbrg);
    BayerGB12Packed "bayergb12packed" 12 Some(Tiles::Gbrg);
    BayerGB16 "bayergb16" 16 Some(Tiles::Gbrg);
    BayerBG8 "bayerbg8" 8 Some(Tiles::Bggr);
    BayerBG10 "bayerbg10" 10 Some(Tiles::Bggr);
    BayerBG10p "bayerbg10p" 10 Some(Tiles::Bggr);
    BayerBG10Packed "bayerbg10packed" 10 Some(Tiles::Bggr);
    BayerBG12 "bayerbg12" 12 Some(Tiles::Bggr);
    BayerBG12p "bayerbg12p" 12 Some(Tiles::Bggr);
    BayerBG12Packed "bayerbg12packed" 12 Some(Tiles::Bggr);
    BayerBG16 "bayerbg16" 16 Some(Tiles::Bggr);
}

impl<'de> Deserialize<'de> for PixelFormat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let known = ALL.iter().find(|format| format.key().eq_ignore_ascii_case(&name));
        known.copied().ok_or_else(|| D::Error::unknown_variant(&name, KEYS))
    }
}

#[cfg(any(feature = "gige", feature = "usb3"))]
impl PixelFormat {
    /// Unpacks a frame of `width` by `height` photosites to counts, row by row. A row begins `stride` bytes after the previous one (`None`:
    /// without a gap). The result is `None` if there are too few bytes.
    pub(crate) fn counts(
        self,
        [width, height]: [u32; 2],
        stride: Option<usize>,
        bytes: &[u8],
    ) -> Option<Vec<u16>> {
        let format = viva_genicam::pfnc::PixelFormat::from_name(self.name());
        viva_genicam::pfnc::convert::unpack_u16(format, width, height, stride, bytes).ok()
    }
}

#[cfg(test)]
mod tests {
    #![cfg(any(feature = "gige", feature = "usb3"))]

    use super::*;
    use proptest::prelude::*;

    fn counts(format: PixelFormat, width: u32, bytes: &[u8]) -> Vec<u16> {
        format.counts([width, 1], None, bytes).expect("there are enough bytes")
    }

    #[test]
    fn bytes_are_unpacked_as_the_conventions_say() {
        use PixelFormat as F;
        // The values were computed by hand from PFNC 2.4: 6.1.1 (whole bytes), and figures 6-8 and 6-9 (`p`). For `Packed` they follow the
        // layout of GigE Vision 2.0 in the documentation of camera makers.
        for (format, bytes, expected) in [
            (F::Mono8, &[0x00, 0xFF, 0x07][..], &[0, 255, 7][..]),
            (F::Mono10, &[0xFF, 0x03, 0x01, 0x02], &[1023, 0x201]),
            (F::Mono12, &[0xFF, 0x0F, 0x01, 0x00], &[4095, 1]),
            (F::Mono14, &[0xFF, 0x3F, 0x34, 0x12], &[16383, 0x1234]),
            (F::Mono16, &[0xFF, 0xFF, 0x34, 0x12], &[65535, 0x1234]),
            // 0xABC is stored as BC, A; 0x123 continues with 3 in the upper half of the second byte: BC 3A 12.
            (F::Mono12p, &[0xBC, 0x3A, 0x12], &[0xABC, 0x123]),
            // The high bytes AB and 12 are outside, and the low halves C and 3 between them, the first in the lower half: AB 3C 12.
            (F::Mono12Packed, &[0xAB, 0x3C, 0x12], &[0xABC, 0x123]),
            // Ten bits each of 0x3FF, 0x000, 0x2AA and 0x155, from bit 0 on. As one number of 40 bits, they are 0101010101 1010101010
            // 0000000000 1111111111.
            (F::Mono10p, &[0xFF, 0x03, 0xA0, 0x6A, 0x55], &[0x3FF, 0x000, 0x2AA, 0x155]),
            // 0x2AB = AA high, 11 low; 0x155 = 55 high, 01 low. The low bits are at bits 1-0 and 5-4.
            (F::Mono10Packed, &[0xAA, 0x13, 0x55], &[0x2AB, 0x155]),
            (F::BayerRG12p, &[0xBC, 0x3A, 0x12], &[0xABC, 0x123]),
            (F::BayerGB12Packed, &[0xAB, 0x3C, 0x12], &[0xABC, 0x123]),
            (F::BayerBG16, &[0x34, 0x12], &[0x1234]),
        ] {
            assert_eq!(counts(format, expected.len() as u32, bytes), expected, "{format:?}");
        }
    }

    #[test]
    fn too_few_bytes_are_refused_and_rows_may_be_padded() {
        assert_eq!(PixelFormat::Mono12p.counts([4, 1], None, &[0; 5]), None);
        let padded = [0xBC, 0x3A, 0x12, 0xEE, 0x23, 0xC1, 0xAB, 0xEE];
        let found = PixelFormat::Mono12p.counts([2, 2], Some(4), &padded);
        assert_eq!(found.as_deref(), Some(&[0xABC, 0x123, 0x123, 0xABC][..]));
    }

    #[test]
    fn every_format_is_known_by_its_name_and_by_its_key() {
        for format in ALL {
            assert_eq!(format.key(), format.name().to_lowercase());
            let of_pfnc = viva_genicam::pfnc::PixelFormat::from_name(format.name());
            assert_eq!(of_pfnc.name(), Some(format.name()), "{format:?}");
            // The first two letters after "Bayer" are the first row (PFNC 2.4, 3.1.7).
            let row = format.name().strip_prefix("Bayer").map(|rest| rest[..2].to_lowercase());
            let tiles = format.tiles().map(|tiles| tiles.letters()[..2].to_lowercase());
            assert_eq!(row, tiles, "{format:?}");
        }
    }

    /// Packs counts of `bits` bits without gaps, from bit 0 on.
    fn pack_lsb(counts: &[u16], bits: u32) -> Vec<u8> {
        let mut bytes = vec![0; (counts.len() * bits as usize).div_ceil(8)];
        for (index, count) in counts.iter().enumerate() {
            for bit in 0..bits as usize {
                let at = index * bits as usize + bit;
                bytes[at / 8] |= ((count >> bit & 1) as u8) << (at % 8);
            }
        }
        bytes
    }

    fn pack_pairs(counts: &[u16], bits: u32) -> Vec<u8> {
        let low = bits - 8;
        let pairs = counts.chunks(2).map(|pair| [pair[0], pair.get(1).copied().unwrap_or(0)]);
        let mask = (1 << low) - 1;
        pairs
            .flat_map(|[a, b]| [(a >> low) as u8, (a & mask | (b & mask) << 4) as u8, (b >> low) as u8])
            .collect()
    }

    proptest! {
        #[test]
        fn packed_counts_are_unpacked(counts in prop::collection::vec(any::<u16>(), 1..40)) {
            use PixelFormat as F;
            let width = counts.len() as u32;
            let of = |bits: u32| -> Vec<u16> { counts.iter().map(|count| count >> (16 - bits)).collect() };
            let whole = |bits: u32| -> Vec<u8> { of(bits).iter().flat_map(|count| count.to_le_bytes()).collect() };
            for (format, bytes) in [
                (F::Mono8, of(8).iter().map(|&count| count as u8).collect()),
                (F::Mono10, whole(10)),
                (F::BayerGR12, whole(12)),
                (F::Mono14, whole(14)),
                (F::BayerBG16, whole(16)),
                (F::Mono10p, pack_lsb(&of(10), 10)),
                (F::BayerRG12p, pack_lsb(&of(12), 12)),
                (F::BayerGB10Packed, pack_pairs(&of(10), 10)),
                (F::Mono12Packed, pack_pairs(&of(12), 12)),
            ] {
                let found = format.counts([width, 1], None, &bytes);
                prop_assert_eq!(found, Some(of(format.bits())), "{:?}", format);
            }
        }
    }
}
