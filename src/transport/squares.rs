//! Sums of the squares of all entries, from which the noise of the matrix follows.

use super::exact_sum::ExactSum;

/// The sums of the squares of values and errors over all entries of the matrix, including the diagonal. They have the same bits, whatever the order
/// of the entries: of a symmetric matrix, each process and each thread adds those that it merges.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EntrySquares {
    /// Of the entries without light of one bounce: nearly all of them.
    indirect: [ExactSum; 2],
    /// Of the entries with light of one bounce: that of all their light, and that of two or more bounces.
    direct: [ExactSum; 2],
    beside_direct: [ExactSum; 2],
}

impl EntrySquares {
    /// The words of the sums in a message.
    pub(super) const WORDS: usize = 6 * ExactSum::WORDS;

    /// Adds the squares of the values and errors of one entry without light of one bounce, as often as `times`.
    #[inline]
    pub(super) fn add_indirect<const C: usize>(&mut self, times: f64, entry: &[[f64; 2]; C]) {
        add(&mut self.indirect, times, entry);
    }

    /// Adds those of an entry with light of one bounce: of all its light, and of its light of two or more bounces.
    pub(super) fn add_direct<const C: usize>(
        &mut self,
        times: f64,
        whole: &[[f64; 2]; C],
        global: &[[f64; 2]; C],
    ) {
        add(&mut self.direct, times, whole);
        add(&mut self.beside_direct, times, global);
    }

    /// Adds all entries of other sums.
    pub(super) fn add_all(&mut self, other: &Self) {
        self.sums_mut().zip(other.sums()).for_each(|(sum, other)| sum.add_all(other));
    }

    /// The squares of the values and errors of all light.
    pub(super) fn whole(&self) -> [f64; 2] {
        [0, 1].map(|of| self.indirect[of].value() + self.direct[of].value())
    }

    /// The same for light of two or more bounces.
    pub(super) fn global(&self) -> [f64; 2] {
        [0, 1].map(|of| self.indirect[of].value() + self.beside_direct[of].value())
    }

    /// The sums in a message.
    pub(super) fn to_words(&self) -> Vec<u64> {
        self.sums().flat_map(ExactSum::to_words).collect()
    }

    /// The sums of [`EntrySquares::to_words`]; `None` for other words.
    pub(super) fn from_words(words: &[u64]) -> Option<Self> {
        let mut squares = Self::default();
        if words.len() != Self::WORDS {
            return None;
        }
        for (sum, words) in squares.sums_mut().zip(words.chunks(ExactSum::WORDS)) {
            *sum = ExactSum::from_words(words)?;
        }
        Some(squares)
    }

    fn sums(&self) -> impl Iterator<Item = &ExactSum> {
        [&self.indirect, &self.direct, &self.beside_direct].into_iter().flatten()
    }

    fn sums_mut(&mut self) -> impl Iterator<Item = &mut ExactSum> {
        [&mut self.indirect, &mut self.direct, &mut self.beside_direct].into_iter().flatten()
    }
}

#[inline]
fn add<const C: usize>(to: &mut [ExactSum; 2], times: f64, entry: &[[f64; 2]; C]) {
    for [mean, error] in entry {
        to[0].add(times * mean * mean);
        to[1].add(times * error * error);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_of_direct_and_indirect_light_are_told_apart() {
        let mut squares = EntrySquares::default();
        squares.add_indirect(2.0, &[[3.0, 0.5], [1.0, 0.0]]);
        squares.add_direct(1.0, &[[2.0, 0.25], [0.0, 0.0]], &[[1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(squares.whole(), [20.0 + 4.0, 0.5 + 0.0625]);
        assert_eq!(squares.global(), [20.0 + 1.0, 0.5]);
        assert_eq!(EntrySquares::from_words(&squares.to_words()), Some(squares.clone()));
        assert_eq!(EntrySquares::from_words(&squares.to_words()[1..]), None);
        let mut twice = squares.clone();
        twice.add_all(&squares);
        assert_eq!(twice.whole(), [48.0, 1.125]);
    }
}
