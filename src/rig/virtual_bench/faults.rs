//! The choice of frames that fail: a function of the seed and the frame's number.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::Faults;

/// The fate of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// The frame arrives as it should.
    Good,
    /// It does not arrive.
    Dropped,
    /// The previous frame arrives again instead.
    Repeated,
    /// It was exposed before the last pattern was shown.
    Late,
    /// Its exposure began as soon as the last pattern was confirmed.
    Early,
}

/// A generator for one purpose: equal keys give equal numbers.
pub(super) fn generator(seed: u64, frame: u64, purpose: u64) -> Pcg64 {
    let mut key = [0; 32];
    for (word, value) in key.chunks_exact_mut(8).zip([seed, frame, purpose, 0x6b72_796c_7578]) {
        word.copy_from_slice(&value.to_le_bytes());
    }
    // The hash makes the seeds of neighbouring keys unrelated.
    Pcg64::from_seed(*blake3::hash(&key).as_bytes())
}

impl Faults {
    /// The fate of frame `id`.
    pub(super) fn fate(&self, seed: u64, id: u64) -> Fate {
        let by_number = [
            (&self.dropped_frames, Fate::Dropped),
            (&self.repeated_frames, Fate::Repeated),
            (&self.late_frames, Fate::Late),
            (&self.early_frames, Fate::Early),
        ];
        if let Some((_, fate)) = by_number.into_iter().find(|(frames, _)| frames.contains(&id)) {
            return fate;
        }
        let mut chance: f64 = generator(seed, id, u64::MAX).random();
        let by_chance = [
            (self.dropped, Fate::Dropped),
            (self.repeated, Fate::Repeated),
            (self.late, Fate::Late),
            (self.early, Fate::Early),
        ];
        for (share, fate) in by_chance {
            if chance < share {
                return fate;
            }
            chance -= share;
        }
        Fate::Good
    }

    /// Whether the camera hangs after frame `id`.
    pub(super) fn freezes_after(&self, id: u64) -> bool {
        self.freeze_after.contains(&id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_have_their_probabilities_and_repeat_with_the_seed() {
        let faults = Faults { dropped: 0.1, repeated: 0.05, late: 0.2, ..Faults::default() };
        let fates: Vec<Fate> = (1..=20_000).map(|id| faults.fate(7, id)).collect();
        for (fate, share) in
            [(Fate::Dropped, 0.1), (Fate::Repeated, 0.05), (Fate::Late, 0.2), (Fate::Early, 0.0)]
        {
            let found = fates.iter().filter(|&&found| found == fate).count() as f64 / 2e4;
            // Five standard errors of a binomial share.
            assert!((found - share).abs() <= 5.0 * (share * (1.0 - share) / 2e4).sqrt(), "{fate:?}: {found}");
        }
        assert!((1..=20_000).all(|id| faults.fate(7, id) == fates[id as usize - 1]));
        assert!((1..=20_000).any(|id| faults.fate(8, id) != fates[id as usize - 1]));
    }

    #[test]
    fn a_frame_given_by_its_number_always_fails() {
        let faults = Faults { dropped_frames: vec![3], repeated_frames: vec![5], ..Faults::default() };
        let fates: Vec<Fate> = (1..=5).map(|id| faults.fate(0, id)).collect();
        assert_eq!(fates, [Fate::Good, Fate::Good, Fate::Dropped, Fate::Good, Fate::Repeated]);
    }
}
