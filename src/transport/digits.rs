//! A stable sort of a few hundred elements by small numbers, digit by digit.

/// Fewer elements are compared: the counters of a digit would take longer.
const FEWEST: usize = 48;

/// The most bits of a digit: its counters take a small part of the first cache, and are added up for each digit.
const MOST_BITS: u32 = 8;

/// Sorts by `number`. Elements of equal numbers keep their order. `spare` is memory that serves again.
pub(super) fn sort_by_number<T: Copy>(elements: &mut [T], spare: &mut Vec<T>, number: impl Fn(&T) -> u32) {
    if elements.len() < FEWEST {
        return elements.sort_by_key(number);
    }
    // Only the bits in which some of the numbers differ need sorting.
    let first = number(&elements[0]);
    let differing = elements.iter().fold(0, |bits, element| bits | (number(element) ^ first));
    if differing == 0 {
        return;
    }
    let lowest = differing.trailing_zeros();
    let bits = u32::BITS - differing.leading_zeros() - lowest;
    let passes = bits.div_ceil(MOST_BITS);
    let of_digit = bits.div_ceil(passes);
    spare.clear();
    spare.extend_from_slice(elements);
    let (mut from, mut to) = (&mut *elements, spare.as_mut_slice());
    for pass in 0..passes {
        let shift = lowest + pass * of_digit;
        by_digit(from, to, |element| (number(element) >> shift) & ((1 << of_digit) - 1));
        std::mem::swap(&mut from, &mut to);
    }
    if passes % 2 == 1 {
        to.copy_from_slice(from);
    }
}

/// Copies the elements to places in the order of a digit of at most [`MOST_BITS`] bits.
fn by_digit<T: Copy>(from: &[T], to: &mut [T], digit: impl Fn(&T) -> u32) {
    let digit = |element: &T| digit(element) as usize % (1 << MOST_BITS);
    let mut next = [0_u32; 1 << MOST_BITS];
    from.iter().for_each(|element| next[digit(element)] += 1);
    let mut before = 0;
    for next in &mut next {
        (*next, before) = (before, before + *next);
    }
    for element in from {
        let next = &mut next[digit(element)];
        to[*next as usize] = *element;
        *next += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_order_is_that_of_a_stable_sort(
            numbers in prop::collection::vec(any::<u32>(), 0..300),
            bits in 0..32_u32,
            shift in 0..32_u32,
        ) {
            let number = |drawn: u32| ((drawn & ((1 << bits) - 1)) << shift) | 0x10;
            let mut elements: Vec<(u32, usize)> =
                numbers.iter().enumerate().map(|(at, &drawn)| (number(drawn), at)).collect();
            let mut expected = elements.clone();
            expected.sort_by_key(|element| element.0);
            sort_by_number(&mut elements, &mut Vec::new(), |element| element.0);
            prop_assert_eq!(elements, expected);
        }
    }
}
