//! Gray pictures in Netpbm's binary PGM format, read without any scaling.

/// A picture: its width and height, and its counts row by row from the top left.
#[derive(Debug, PartialEq)]
pub(super) struct Gray {
    pub(super) size: [usize; 2],
    pub(super) counts: Vec<u16>,
}

/// Reads a PGM (`P5`): width, height and the highest count as text, with comments in between, one white space, and then the counts.
/// A count has one byte, or two bytes (high byte first) if the highest is 256 or more. `None`: the bytes are anything else, or end
/// too early.
pub(super) fn read(bytes: &[u8]) -> Option<Gray> {
    let mut rest = bytes.strip_prefix(b"P5")?;
    let mut next = || -> Option<usize> {
        rest = skipped(rest)?;
        let length = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (digits, after) = rest.split_at(length);
        rest = after;
        std::str::from_utf8(digits).ok()?.parse().ok()
    };
    let (size, highest) = ([next()?, next()?], next()?);
    let (white, body) = rest.split_first()?;
    let pixels = size[0].checked_mul(size[1])?;
    if !white.is_ascii_whitespace() || !(1..=65535).contains(&highest) || pixels == 0 {
        return None;
    }
    let counts: Vec<u16> = if highest < 256 {
        body.get(..pixels)?.iter().map(|&byte| u16::from(byte)).collect()
    } else {
        let body = body.get(..pixels.checked_mul(2)?)?;
        body.as_chunks::<2>().0.iter().map(|&pair| u16::from_be_bytes(pair)).collect()
    };
    Some(Gray { size, counts })
}

/// Skips white space and comments. `None`: there is no white space.
fn skipped(mut bytes: &[u8]) -> Option<&[u8]> {
    let before = bytes.len();
    loop {
        match bytes.first()? {
            b'#' => {
                let end = bytes.iter().position(|&byte| byte == b'\n')?;
                bytes = &bytes[end..];
            }
            byte if byte.is_ascii_whitespace() => bytes = &bytes[1..],
            _ => return (bytes.len() < before).then_some(bytes),
        }
    }
}

impl Gray {
    /// The counts of the part of this size that begins at this offset. `None`: it does not fit.
    pub(super) fn part(&self, [width, height]: [usize; 2], [x, y]: [usize; 2]) -> Option<Vec<u16>> {
        if x + width > self.size[0] || y + height > self.size[1] {
            return None;
        }
        let rows = (y..y + height).map(|row| row * self.size[0] + x);
        Some(rows.flat_map(|start| &self.counts[start..start + width]).copied().collect())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_picture_is_read_count_by_count() {
        let wide = b"P5\n# by hand\n2 2 # and here\n65535\n\x00\x01\x3f\xff\xff\xff\x12\x34";
        let found = read(wide).expect("it is one");
        assert_eq!(found, Gray { size: [2, 2], counts: vec![1, 16383, 65535, 0x1234] });
        // A byte of a count may look like white space; counts are not scaled to the highest.
        assert_eq!(read(b"P5 3 1 15\n\n\x0f\x01").expect("it is one").counts, [10, 15, 1]);
        assert_eq!(found.part([1, 2], [1, 0]), Some(vec![16383, 0x1234]));
        assert_eq!(found.part([2, 1], [1, 0]), None);
    }

    #[test]
    fn other_formats_and_truncated_files_are_refused() {
        for bytes in [
            &b"P6\n1 1\n255\n\x00\x00\x00"[..],
            b"P5\n2 2\n65535\n\x00\x01\x00",
            b"P5\n2 2\n70000\n\x00\x01\x00\x01\x00\x01\x00\x01",
            b"P5\n0 2\n255\n",
            b"P5\n99999999999 99999999999\n65535\n",
            b"P512 2 255\n",
            b"II*\x00",
            b"",
        ] {
            assert_eq!(read(bytes), None, "{bytes:?}");
        }
    }

    proptest! {
        #[test]
        fn written_counts_are_read_back(width in 1_usize..9, counts in prop::collection::vec(any::<u16>(), 1..60)) {
            let height = counts.len() / width;
            prop_assume!(height > 0);
            let mut bytes = format!("P5 {width} {height} 65535\n").into_bytes();
            let counts = &counts[..width * height];
            counts.iter().for_each(|count| bytes.extend(count.to_be_bytes()));
            prop_assert_eq!(read(&bytes), Some(Gray { size: [width, height], counts: counts.to_vec() }));
        }

        #[test]
        fn random_bytes_never_cause_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let _ = read(&[b"P5 ".as_slice(), &bytes].concat());
        }
    }
}
