//! The sRGB curve.

use std::sync::LazyLock;

/// Steps of a first guess: less than a byte each, where the curve is steepest.
const GUESSES: usize = 4096;

/// The curve's bytes, found once: a page shows millions of pixels, and each would raise its colours to a power.
struct Bytes {
    /// The least linear value of the byte above each.
    next: [f32; 256],
    /// The byte at each step.
    guess: [u8; GUESSES + 1],
}

static BYTES: LazyLock<Bytes> = LazyLock::new(|| {
    let mut next = [f32::INFINITY; 256];
    for (byte, next) in next.iter_mut().take(255).enumerate() {
        // Positive numbers are in the order of their bits.
        let (mut below, mut above) = (0.0_f32.to_bits(), 1.0_f32.to_bits());
        while below + 1 < above {
            let middle = below.midpoint(above);
            if usize::from(byte_of(f32::from_bits(middle))) > byte { above = middle } else { below = middle }
        }
        *next = f32::from_bits(above);
    }
    Bytes { next, guess: std::array::from_fn(|step| byte_of(step as f32 / GUESSES as f32)) }
});

/// The sRGB byte nearest to a linear value; clips to \[0,1\]. 0 for NaN.
pub fn encode_srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let byte = BYTES.guess[(linear * GUESSES as f32) as usize];
    byte + u8::from(linear >= BYTES.next[usize::from(byte)])
}

/// The same by the curve itself, for what lies in \[0,1\].
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
    fn bytes_are_those_of_the_curve() {
        let of_bits = (0..=1.0_f32.to_bits()).step_by(1009).map(f32::from_bits);
        let steps = (0..=4 * GUESSES).map(|step| step as f32 / (4 * GUESSES) as f32);
        let least = BYTES.next.into_iter().take(255).flat_map(|next| [next, next.next_down()]);
        for linear in of_bits.chain(steps).chain(least) {
            assert_eq!(encode_srgb(linear), byte_of(linear), "{linear}");
        }
        assert_eq!([-1.0, 2.0, f32::INFINITY, f32::NAN].map(encode_srgb), [0, 255, 255, 0]);
    }

    #[test]
    fn every_byte_survives_decoding_and_encoding() {
        for byte in 0..=255_u8 {
            assert_eq!(encode_srgb(decode_srgb(f32::from(byte) / 255.0)), byte);
        }
    }
}
