//! The conversion of a frame's bytes to counts.

use super::V4lFormat;

/// The counts of a frame of `width` by `height` pixels, row by row. A row begins `stride` bytes after the previous one. `None`: there
/// are too few bytes.
///
/// The layouts are those of the kernel's documentation (V4L2_PIX_FMT_GREY, _Y10, _Y12, _Y16, _YUYV). Counts of more than 8 bits take 16
/// bits, low byte first; in YUYV every second byte is luma.
pub(super) fn counts(
    format: V4lFormat,
    [width, height]: [usize; 2],
    stride: usize,
    bytes: &[u8],
) -> Option<Vec<u16>> {
    let taken = width * if format == V4lFormat::Grey { 1 } else { 2 };
    let mut counts = Vec::with_capacity(width * height);
    for row in 0..height {
        // The last row may lack its padding.
        let row = bytes.get(row * stride..row * stride + taken)?;
        match format {
            V4lFormat::Grey => counts.extend(row.iter().map(|&byte| u16::from(byte))),
            V4lFormat::Yuyv => counts.extend(row.as_chunks::<2>().0.iter().map(|[luma, _]| u16::from(*luma))),
            V4lFormat::Y10 | V4lFormat::Y12 | V4lFormat::Y16 => {
                // The driver may leave anything in the unused upper bits.
                let mask = ((1_u32 << format.bits()) - 1) as u16;
                counts.extend(row.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair) & mask));
            }
        }
    }
    Some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_decoded_as_the_kernel_documents() {
        use V4lFormat as F;
        for (format, bytes, expected) in [
            (F::Grey, &[1, 255][..], &[1, 255][..]),
            (F::Y10, &[0xFF, 0x03, 0x01, 0xFE], &[1023, 0x201]),
            (F::Y12, &[0xBC, 0x0A, 0x23, 0xF1], &[0xABC, 0x123]),
            (F::Y16, &[0x34, 0x12, 0xFF, 0xFF], &[0x1234, 65535]),
            // Y₀ U Y₁ V.
            (F::Yuyv, &[10, 128, 20, 130], &[10, 20]),
        ] {
            assert_eq!(counts(format, [2, 1], bytes.len(), bytes).as_deref(), Some(expected), "{format:?}");
        }
    }

    #[test]
    fn rows_may_be_padded_and_a_short_frame_is_refused() {
        let bytes = [1, 2, 99, 3, 4];
        assert_eq!(counts(V4lFormat::Grey, [2, 2], 3, &bytes), Some(vec![1, 2, 3, 4]));
        assert_eq!(counts(V4lFormat::Grey, [2, 2], 3, &bytes[..4]), None);
        assert_eq!(counts(V4lFormat::Y16, [2, 2], 4, &bytes), None);
    }
}
