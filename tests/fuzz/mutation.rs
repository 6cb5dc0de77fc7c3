//! Changes of files, as accidents and malice make them.

use proptest::prelude::*;
use proptest::sample::Index;

/// One change of a file.
#[derive(Clone, Debug)]
pub enum Mutation {
    /// A bit is flipped.
    Flip(Index, u8),
    /// A byte is replaced.
    Byte(Index, u8),
    /// The end is cut off.
    Truncate(Index),
    /// Bytes are removed.
    Remove(Index, u8),
    /// Bytes appear twice.
    Repeat(Index, u8),
    /// Bytes of another seed are put in place of others.
    Splice(Index, Index, Index, u16),
    /// A binary number of 2, 4 or 8 bytes becomes an extreme one.
    Extreme(Index, Width, bool, Limit),
    /// A number written in digits becomes an extreme one.
    Digits(Index, Limit),
}

#[derive(Clone, Copy, Debug)]
pub enum Width {
    Two,
    Four,
    Eight,
}

/// Numbers at which readers fail.
#[derive(Clone, Copy, Debug)]
pub enum Limit {
    Zero,
    One,
    MinusOne,
    HalfRange,
    MostOf31,
    MostOf32,
    MostOf63,
    Large,
    NotANumber,
    Infinite,
}

const LIMITS: [Limit; 10] = [
    Limit::Zero,
    Limit::One,
    Limit::MinusOne,
    Limit::HalfRange,
    Limit::MostOf31,
    Limit::MostOf32,
    Limit::MostOf63,
    Limit::Large,
    Limit::NotANumber,
    Limit::Infinite,
];

impl Limit {
    fn bits(self) -> u64 {
        match self {
            Self::Zero => 0,
            Self::One => 1,
            Self::MinusOne => u64::MAX,
            Self::HalfRange => 0x8000_8000_8000_8000,
            Self::MostOf31 => 0x7fff_ffff_7fff_ffff,
            Self::MostOf32 => 0xffff_ffff,
            Self::MostOf63 => i64::MAX as u64,
            Self::Large => 1 << 24,
            Self::NotANumber => f64::NAN.to_bits(),
            Self::Infinite => f64::INFINITY.to_bits(),
        }
    }

    fn text(self) -> &'static str {
        match self {
            Self::Zero => "0",
            Self::One => "1",
            Self::MinusOne => "-1",
            Self::HalfRange => "9223372036854775808",
            Self::MostOf31 => "2147483647",
            Self::MostOf32 => "4294967295",
            Self::MostOf63 => "18446744073709551615",
            Self::Large => "16777216",
            Self::NotANumber => "nan",
            Self::Infinite => "1e999",
        }
    }
}

impl Arbitrary for Mutation {
    type Parameters = ();
    type Strategy = BoxedStrategy<Self>;

    fn arbitrary_with((): ()) -> BoxedStrategy<Self> {
        let at = any::<Index>;
        let limit = || prop::sample::select(LIMITS.to_vec());
        let width = prop::sample::select(vec![Width::Two, Width::Four, Width::Eight]);
        prop_oneof![
            (at(), 0_u8..8).prop_map(|(at, bit)| Self::Flip(at, bit)),
            (at(), any::<u8>()).prop_map(|(at, byte)| Self::Byte(at, byte)),
            at().prop_map(Self::Truncate),
            (at(), any::<u8>()).prop_map(|(at, count)| Self::Remove(at, count)),
            (at(), any::<u8>()).prop_map(|(at, count)| Self::Repeat(at, count)),
            (at(), at(), at(), any::<u16>())
                .prop_map(|(seed, from, to, count)| Self::Splice(seed, from, to, count)),
            (at(), width, any::<bool>(), limit())
                .prop_map(|(at, width, big, limit)| Self::Extreme(at, width, big, limit)),
            (at(), limit()).prop_map(|(at, limit)| Self::Digits(at, limit)),
        ]
        .boxed()
    }
}

/// The seed `of` after these changes.
pub fn mutated(seeds: &[Vec<u8>], of: usize, mutations: &[Mutation]) -> Vec<u8> {
    let mut bytes = seeds[of].clone();
    for mutation in mutations {
        if !bytes.is_empty() {
            apply(mutation, seeds, &mut bytes);
        }
    }
    bytes
}

fn apply(mutation: &Mutation, seeds: &[Vec<u8>], bytes: &mut Vec<u8>) {
    let length = bytes.len();
    match *mutation {
        Mutation::Flip(at, bit) => bytes[at.index(length)] ^= 1 << bit,
        Mutation::Byte(at, byte) => bytes[at.index(length)] = byte,
        Mutation::Truncate(at) => bytes.truncate(at.index(length)),
        Mutation::Remove(at, count) => {
            let at = at.index(length);
            drop(bytes.drain(at..length.min(at + usize::from(count))));
        }
        Mutation::Repeat(at, count) => {
            let at = at.index(length);
            let again = bytes[at..length.min(at + usize::from(count))].to_vec();
            drop(bytes.splice(at..at, again));
        }
        Mutation::Splice(seed, from, to, count) => {
            let seed = &seeds[seed.index(seeds.len())];
            let (from, to, count) = (from.index(seed.len().max(1)), to.index(length), usize::from(count));
            let piece = seed[from.min(seed.len())..seed.len().min(from + count)].to_vec();
            drop(bytes.splice(to..length.min(to + piece.len()), piece));
        }
        Mutation::Extreme(at, width, big, limit) => {
            let (little, large) = (limit.bits().to_le_bytes(), limit.bits().to_be_bytes());
            let count = match width {
                Width::Two => 2,
                Width::Four => 4,
                Width::Eight => 8,
            };
            let number = if big { &large[8 - count..] } else { &little[..count] };
            let at = at.index(length);
            let count = count.min(length - at);
            bytes[at..at + count].copy_from_slice(&number[..count]);
        }
        Mutation::Digits(at, limit) => {
            let at = at.index(length);
            let is_digit = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
            let Some(start) = bytes[at..].iter().position(is_digit).map(|start| at + start) else { return };
            let end =
                bytes[start..].iter().position(|byte| !is_digit(byte)).map_or(length, |end| start + end);
            drop(bytes.splice(start..end, limit.text().bytes()));
        }
    }
}
