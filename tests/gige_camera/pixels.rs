//! Pixel formats: their codes (EMVA, GenICam Pixel Format Values), and the packing of counts.

/// The camera's pixel formats. Bits 16 to 23 of a code are the number of bits of a pixel.
const OFFERED: [(&str, u32); 25] = [
    ("Mono8", 0x0108_0001),
    ("Mono10", 0x0110_0003),
    ("Mono10Packed", 0x010C_0004),
    ("Mono10p", 0x010A_0046),
    ("Mono12", 0x0110_0005),
    ("Mono12Packed", 0x010C_0006),
    ("Mono12p", 0x010C_0047),
    ("Mono16", 0x0110_0007),
    ("BayerRG8", 0x0108_0009),
    ("BayerRG10p", 0x010A_0058),
    ("BayerRG12", 0x0110_0011),
    ("BayerRG12Packed", 0x010C_002B),
    ("BayerRG12p", 0x010C_0059),
    ("BayerRG16", 0x0110_002F),
    ("BayerGR8", 0x0108_0008),
    ("BayerGR12", 0x0110_0010),
    ("BayerGR12Packed", 0x010C_002A),
    ("BayerGR12p", 0x010C_0057),
    ("BayerGB12", 0x0110_0012),
    ("BayerGB12Packed", 0x010C_002C),
    ("BayerGB12p", 0x010C_0055),
    ("BayerGB16", 0x0110_0030),
    ("BayerBG12", 0x0110_0013),
    ("BayerBG12Packed", 0x010C_002D),
    ("BayerBG12p", 0x010C_0053),
];

fn name(code: u32) -> Option<&'static str> {
    OFFERED.iter().find(|(_, offered)| *offered == code).map(|(name, _)| *name)
}

pub fn is_offered(code: u32) -> bool {
    name(code).is_some()
}

/// The code of the gray format with this number of bits.
pub fn gray(bits: u32) -> u32 {
    let name = format!("Mono{}", if bits > 12 { 16 } else { bits });
    OFFERED.iter().find(|(offered, _)| **offered == name).expect("cameras count to 8, 10, 12 or 16 bits").1
}

/// The entries of the pixel formats in the camera's description.
pub fn entries() -> String {
    let entry = |(name, code): &(&str, u32)| {
        format!("<EnumEntry Name=\"{name}\"><Value>0x{code:08X}</Value></EnumEntry>\n    ")
    };
    OFFERED.iter().map(entry).collect()
}

/// The number of bytes of this number of pixels.
pub fn bytes(code: u32, pixels: u32) -> u32 {
    (pixels * (code >> 16 & 0xFF)).div_ceil(8)
}

/// Packs counts of `bits` bits into this format; low bits that do not fit are dropped.
pub fn pack(code: u32, bits: u32, counts: &[u16]) -> Vec<u8> {
    let name = name(code).expect("only what is offered is set");
    let digits: String = name.chars().filter(char::is_ascii_digit).collect();
    let room: u32 = digits.parse().expect("names say their bits");
    let counts = counts.iter().map(|&count| {
        let count = u32::from(count);
        if room >= bits { count << (room - bits) } else { count >> (bits - room) }
    });
    if name.ends_with("Packed") {
        return in_pairs(&counts.collect::<Vec<_>>(), room);
    }
    let taken = if name.ends_with('p') { room } else { code >> 16 & 0xFF };
    one_after_another(counts, taken)
}

/// Packs counts without gaps from bit 0 of byte 0 on, each in `taken` bits.
fn one_after_another(counts: impl Iterator<Item = u32>, taken: u32) -> Vec<u8> {
    let (mut bytes, mut waiting, mut held) = (Vec::new(), 0_u64, 0);
    for count in counts {
        waiting |= u64::from(count) << held;
        held += taken;
        while held >= 8 {
            bytes.push(waiting as u8);
            waiting >>= 8;
            held -= 8;
        }
    }
    if held > 0 {
        bytes.push(waiting as u8);
    }
    bytes
}

/// Packs pairs of counts into three bytes: the high bits in the outer bytes, the low bits in the middle byte, the first count's in the
/// lower half.
fn in_pairs(counts: &[u32], room: u32) -> Vec<u8> {
    let (low, mask) = (room - 8, (1 << (room - 8)) - 1);
    let mut bytes = Vec::new();
    for pair in counts.chunks(2) {
        bytes.push((pair[0] >> low) as u8);
        match pair {
            [first, second] => {
                bytes.push((first & mask | (second & mask) << 4) as u8);
                bytes.push((second >> low) as u8);
            }
            _ => bytes.push((pair[0] & mask) as u8),
        }
    }
    bytes
}
