//! The sRGB transfer function (IEC 61966-2-1).

use std::sync::LazyLock;

/// The number of intervals of the table of first guesses. The encoded value changes by less than one byte per
/// interval, even where the curve is steepest.
const GUESSES: usize = 4096;

/// Tables of the encoded bytes. A report shows millions of pixels, and a power function for each channel
/// would be slow.
struct Bytes {
    /// For each byte the least linear value that is encoded as the next byte.
    next: [f32; 256],
    /// The byte at the start of each interval.
    guess: [u8; GUESSES + 1],
}

static BYTES: LazyLock<Bytes> = LazyLock::new(|| {
    let mut next = [f32::INFINITY; 256];
    for (byte, next) in next.iter_mut().take(255).enumerate() {
        // The search bisects the bit patterns, since positive floats are ordered like their bits.
        let (mut below, mut above) = (0.0_f32.to_bits(), 1.0_f32.to_bits());
        while below + 1 < above {
            let middle = below.midpoint(above);
            if usize::from(byte_of(f32::from_bits(middle))) > byte { above = middle } else { below = middle }
        }
        *next = f32::from_bits(above);
    }
    Bytes { next, guess: std::array::from_fn(|step| byte_of(step as f32 / GUESSES as f32)) }
});

/// The sRGB byte nearest to a linear value, which is clipped to \[0,1\]. NaN gives 0.
pub fn encode_srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let byte = BYTES.guess[(linear * GUESSES as f32) as usize];
    byte + u8::from(linear >= BYTES.next[usize::from(byte)])
}

/// The same as [`encode_srgb`] without tables, for a value in \[0,1\].
fn byte_of(linear: f32) -> u8 {
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// The linear value of an sRGB-encoded one, both in \[0,1\] (IEC 61966-2-1).
pub fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_give_the_bytes_of_the_curve() {
        let of_bits = (0..=1.0_f32.to_bits()).step_by(1009).map(f32::from_bits);
        let steps = (0..=4 * GUESSES).map(|step| step as f32 / (4 * GUESSES) as f32);
        let least = BYTES.next.into_iter().take(255).flat_map(|next| [next, next.next_down()]);
        for linear in of_bits.chain(steps).chain(least) {
            assert_eq!(encode_srgb(linear), byte_of(linear), "{linear}");
        }
        assert_eq!([-1.0, 2.0, f32::INFINITY, f32::NAN].map(encode_srgb), [0, 255, 255, 0]);
    }

    #[test]
    fn encoding_inverts_decoding_for_every_byte() {
        for byte in 0..=255_u8 {
            assert_eq!(encode_srgb(decode_srgb(f32::from(byte) / 255.0)), byte);
        }
    }
}
