//! Sums over the rows of the matrix, from which the noise is computed. The sums do not depend on the order of their terms.

use rayon::prelude::*;

use super::RigShape;
use super::contributions::{Chunk, Row, Term};
use super::noise::Estimates;

/// Values are summed exactly if their exponent is at most this much below the largest exponent. Smaller values lose their bits below one
/// unit of the sum.
const POWERS: u32 = 70;

/// The unit of the sums, a power of two. It depends only on the largest of all values, so a sum does not depend on the order of its terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    lowest: u32,
    is_finite: bool,
}

/// The sums of means and errors of contributions, as multiples of the unit. A term is below 2⁹⁴ units, so 2³² terms cannot overflow.
pub(super) type FixedSums<const C: usize> = [[i128; C]; 2];

/// The exponent bits of a value. They never decrease as the magnitude grows.
fn exponent(value: f32) -> u32 {
    value.to_bits() >> 23 & 0xff
}

pub(super) fn largest_exponent<const C: usize>(term: &Term<C>) -> u32 {
    term.mean.iter().chain(&term.error).map(|&value| exponent(value)).max().unwrap_or(0)
}

impl Scale {
    /// The unit for sums of values. `largest` has the exponent bits of the largest value.
    pub(super) fn new(largest: u32) -> Self {
        Self { lowest: largest.saturating_sub(POWERS).max(1), is_finite: largest < 0xff }
    }

    #[inline]
    fn units_of<const C: usize>(self, term: &Term<C>) -> FixedSums<C> {
        [&term.mean, &term.error].map(|values| values.map(|value| self.units(value)))
    }

    fn sums<const C: usize>(self, [mean, error]: &FixedSums<C>) -> Estimates<C> {
        std::array::from_fn(|channel| [self.value(mean[channel]), self.value(error[channel])])
    }

    #[inline]
    fn units(self, value: f32) -> i128 {
        let bits = value.to_bits();
        // Subnormal numbers have no implicit leading bit, and have the exponent of the smallest normal numbers.
        let whole = bits & 0x7f_ffff | u32::from(exponent(value) > 0) << 23;
        let exponent = exponent(value).max(1);
        let units = match exponent.checked_sub(self.lowest) {
            Some(power) => i128::from(whole) << power.min(POWERS),
            None => i128::from(whole.checked_shr(self.lowest - exponent).unwrap_or(0)),
        };
        // Every bit of `sign` is the sign bit. A branch would be slow, because positive and negative errors are equally frequent.
        let sign = -i128::from(bits >> 31);
        (units ^ sign) - sign
    }

    fn value(self, sum: i128) -> f64 {
        if self.is_finite { sum as f64 * 2_f64.powi(self.lowest as i32 - 150) } else { f64::NAN }
    }
}

#[inline]
pub(super) fn add_sums<const C: usize>(to: &mut FixedSums<C>, more: &FixedSums<C>) {
    for (to, more) in to.as_flattened_mut().iter_mut().zip(more.as_flattened()) {
        *to = to.wrapping_add(*more);
    }
}

/// The row sums as floating-point numbers, including direct light on the diagonal. `direct` has one estimate for each row, or is empty.
pub(super) fn with_direct<const C: usize>(
    scale: Scale,
    sums: &[FixedSums<C>],
    direct: &[Estimates<C>],
) -> Vec<Estimates<C>> {
    let mut sums: Vec<Estimates<C>> = sums.par_iter().map(|sums| scale.sums(sums)).collect();
    for (sum, direct) in sums.iter_mut().zip(direct) {
        sum.iter_mut().flatten().zip(direct.iter().flatten()).for_each(|(sum, direct)| *sum += direct);
    }
    sums
}

/// The partial sums of several tasks together take at most `1/MEMORY_SHARE` of the memory of the contributions. A single task may take
/// more.
const MEMORY_SHARE: usize = 4;

/// The number of pixels in a stripe. The sums of one stripe are close together in memory.
const STRIPE: usize = 1 << 14;

/// For each row, the sums of the values and of the errors of all paths in these chunks that start or end at the pixel of the row. The
/// direct light on the diagonal is not included.
pub(super) fn row_sums<const C: usize>(
    chunks: &[&Chunk<C>],
    rig: RigShape,
    scale: Scale,
) -> Vec<FixedSums<C>> {
    let all: usize = chunks.iter().map(|chunk| chunk.terms.len()).sum();
    // Each task holds partial sums of all rows. Sums are exact, so the result does not depend on how contributions are divided among tasks.
    let of_task = rig.camera.pixels().max(1) * size_of::<FixedSums<C>>();
    let room = all * size_of::<Term<C>>() / (MEMORY_SHARE * of_task);
    let tasks = rayon::current_num_threads().min(room).max(1);
    let part = |task: usize| {
        let mut part = Partial { rig, scale, sums: vec![[[0; C]; 2]; rig.camera.pixels()] };
        let share = [all * task / tasks, all * (task + 1) / tasks];
        let mut left: Vec<(Row, &[Term<C>])> = Vec::new();
        let mut before = 0;
        for chunk in chunks {
            // The contributions are cut into equal parts, one for each task. A row belongs to the task whose part contains the end of the
            // row.
            let [first, end] = share.map(|share| chunk.rows.partition_point(|row| before + row.end <= share));
            left.extend((first..end).map(|row| (chunk.rows[row], chunk.row(row))));
            before += chunk.terms.len();
        }
        part.add_all(left);
        part.sums
    };
    let parts: Vec<Vec<FixedSums<C>>> = (0..tasks).into_par_iter().map(part).collect();
    let mut parts = parts.into_iter();
    let mut sums = parts.next().unwrap_or_default();
    for part in parts {
        sums.par_iter_mut().zip(&part).for_each(|(sums, part)| add_sums(sums, part));
    }
    sums
}

struct Partial<const C: usize> {
    rig: RigShape,
    scale: Scale,
    sums: Vec<FixedSums<C>>,
}

impl<const C: usize> Partial<C> {
    /// Adds these contributions, one stripe of end pixels after the other.
    fn add_all(&mut self, mut left: Vec<(Row, &[Term<C>])>) {
        let pixels = self.rig.camera.pixels().max(self.rig.projector.pixels());
        for stripe in (STRIPE..pixels).step_by(STRIPE) {
            for (row, terms) in &mut left {
                let is_now = |term: &&Term<C>| (term.key.other() as usize) < stripe;
                let (now, later) = terms.split_at(terms.iter().take_while(is_now).count());
                self.add(*row, now);
                *terms = later;
            }
        }
        left.into_iter().for_each(|(row, terms)| self.add(row, terms));
    }

    /// Adds the contributions of the paths from one pixel, both to this pixel's row and to the rows of the pixels at which the paths end.
    fn add(&mut self, row: Row, terms: &[Term<C>]) {
        let is_own = self.rig.symmetric || row.from_camera;
        let is_mirrored = self.rig.symmetric || !row.from_camera;
        let mut own = [[0; C]; 2];
        for term in terms {
            let units = self.scale.units_of(term);
            if is_own {
                add_sums(&mut own, &units);
            }
            if is_mirrored {
                add_sums(&mut self.sums[term.key.other() as usize], &units);
            }
        }
        if is_own {
            add_sums(&mut self.sums[row.pixel as usize], &own);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::contributions::Key;

    #[test]
    fn sums_are_exact_in_any_order() {
        // A running `f32` sum that starts with the largest value would lose the small values.
        let values = [1.0, 2_f32.powi(-40), -0.75, 2_f32.powi(-40), -3e-9, 1e-30];
        let scale = Scale::new(values.iter().map(|&value| exponent(value)).max().unwrap_or(0));
        let sum = |values: &mut dyn Iterator<Item = f32>| {
            let mut sums = FixedSums::<1>::default();
            values.for_each(|value| {
                let term = Term { mean: [value], error: [-value], ..Term::none(Key::new(0, 1)) };
                add_sums(&mut sums, &scale.units_of(&term));
            });
            scale.sums(&sums)
        };
        let found = sum(&mut values.iter().copied());
        assert_eq!(found, sum(&mut values.iter().rev().copied()));
        // The last value is smaller than the unit, so it is lost.
        assert_eq!(found[0][0], 0.25 + 2_f64.powi(-39) - f64::from(3e-9_f32));
        assert_eq!(found[0][1], -found[0][0]);
        assert!(Scale::new(exponent(f32::NAN)).sums(&FixedSums::<1>::default())[0][0].is_nan());
    }

    #[test]
    fn each_number_alone_is_its_sum() {
        for value in [0.0, -1.5, 3e38, f32::MIN_POSITIVE / 4.0, -f32::MIN_POSITIVE, 1e-20] {
            let scale = Scale::new(exponent(value));
            assert_eq!(scale.value(scale.units(value)), f64::from(value), "{value:e}");
        }
    }
}
