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
    ($($(#[$of:meta])? $name:ident),* $(,)?) => {
        /// The format in which a camera sends counts. Rig files use lower case, such as `mono12p`; the spelling of the convention is
        /// accepted too.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the convention's names are the documentation")]
        pub enum PixelFormat {
            $($(#[$of])? $name,)*
        }

        const ALL: &[PixelFormat] = &[$(PixelFormat::$name),*];

        impl PixelFormat {
            /// The name in the Pixel Format Naming Convention, which cameras use.
            pub fn name(self) -> &'static str {
                match self { $(Self::$name => stringify!($name),)* }
            }
        }
    };
}

formats! {
    Mono8, Mono10, Mono10p, Mono10Packed, #[default] Mono12, Mono12p, Mono12Packed, Mono14, Mono16,
    BayerRG8, BayerRG10, BayerRG10p, BayerRG10Packed, BayerRG12, BayerRG12p, BayerRG12Packed, BayerRG16,
    BayerGR8, BayerGR10, BayerGR10p, BayerGR10Packed, BayerGR12, BayerGR12p, BayerGR12Packed, BayerGR16,
    BayerGB8, BayerGB10, BayerGB10p, BayerGB10Packed, BayerGB12, BayerGB12p, BayerGB12Packed, BayerGB16,
    BayerBG8, BayerBG10, BayerBG10p, BayerBG10Packed, BayerBG12, BayerBG12p, BayerBG12Packed, BayerBG16,
}

impl PixelFormat {
    /// The name in rig files.
    pub fn key(self) -> String {
        self.name().to_lowercase()
    }

    /// Bits of a count: the only number in the format's name.
    pub fn bits(self) -> u32 {
        self.name().chars().filter_map(|letter| letter.to_digit(10)).fold(0, |bits, digit| 10 * bits + digit)
    }

    /// The colour filters before the sensor. The first two letters after `Bayer` are the first row (PFNC 2.4, 3.1.7). `None`: the sensor is
    /// gray.
    pub fn tiles(self) -> Option<Tiles> {
        let row = self.name().strip_prefix("Bayer")?;
        Tiles::ALL.into_iter().find(|tiles| row.starts_with(&tiles.letters()[..2]))
    }
}

impl<'de> Deserialize<'de> for PixelFormat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let known = ALL.iter().find(|format| format.name().eq_ignore_ascii_case(&name));
        known.copied().ok_or_else(|| {
            let keys: Vec<String> = ALL.iter().map(|format| format!("`{}`", format.key())).collect();
            D::Error::custom(format!("unknown variant `{name}`, expected one of {}", keys.join(", ")))
        })
    }
}

#[cfg(any(feature = "gige", feature = "usb3"))]
impl PixelFormat {
    /// Unpacks a frame of `width` by `height` photosites to counts, row by row. A row begins `stride` bytes after the previous row (`None`:
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

#[cfg(any(feature = "gige", feature = "usb3"))]
#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn counts(format: PixelFormat, width: u32, bytes: &[u8]) -> Vec<u16> {
        format.counts([width, 1], None, bytes).expect("there are enough bytes")
    }

    #[test]
    fn bytes_are_unpacked_as_the_conventions_say() {
        use PixelFormat as F;
        // The values were computed by hand from PFNC 2.4: 6.1.1 (whole bytes), and figures 6-8 and 6-9 (`p`). The values for `Packed`
        // follow the layout of GigE Vision 2.0 in the documentation of camera makers.
        for (format, bytes, expected) in [
            (F::Mono8, &[0x00, 0xFF, 0x07][..], &[0, 255, 7][..]),
            (F::Mono10, &[0xFF, 0x03, 0x01, 0x02], &[1023, 0x201]),
            (F::Mono12, &[0xFF, 0x0F, 0x01, 0x00], &[4095, 1]),
            (F::Mono14, &[0xFF, 0x3F, 0x34, 0x12], &[16383, 0x1234]),
            (F::Mono16, &[0xFF, 0xFF, 0x34, 0x12], &[65535, 0x1234]),
            // 0xABC takes the byte BC and the lower half A of the second byte. 0x123 takes the upper half 3 and the byte 12: BC 3A 12.
            (F::Mono12p, &[0xBC, 0x3A, 0x12], &[0xABC, 0x123]),
            // The outer bytes AB and 12 are high bits. The byte between them has the low bits: C in its lower half, 3 in its upper half.
            (F::Mono12Packed, &[0xAB, 0x3C, 0x12], &[0xABC, 0x123]),
            // 0x3FF, 0x000, 0x2AA and 0x155 take ten bits each, from bit 0 on. As one number of 40 bits, with the last count first, they
            // are 0101010101 1010101010 0000000000 1111111111.
            (F::Mono10p, &[0xFF, 0x03, 0xA0, 0x6A, 0x55], &[0x3FF, 0x000, 0x2AA, 0x155]),
            // 0x2AB has the high bits 0xAA and the low bits 0b11; 0x155 has 0x55 and 0b01. The low bits are at bits 1-0 and 5-4.
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
