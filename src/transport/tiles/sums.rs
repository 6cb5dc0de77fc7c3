//! The inner loop of a product, by the instructions that this processor is quickest with.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Rows of a slice, whose sums grow side by side.
pub(super) const LANES: usize = 8;

/// Eight rows of a tile with about as many entries each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Slice {
    /// Within the tile, or one past its last for a lane without a row.
    pub(super) rows: [u16; LANES],
    /// Entries of the longest of them.
    pub(super) steps: u32,
}

/// Adds a tile's products to the sums of its rows: `to[row] += Σ weight · from[column]`, the entries of a row in their order.
///
/// Slices take their steps one after the other. Every row must be below `to.len()`, and every column below `from.len()`.
pub(super) type Kernel = fn(&[Slice], &[[u16; LANES]], &[[f32; LANES]], &[f64], &mut [f64]);

/// A way to do it. All give the same bits.
#[derive(Clone, Copy)]
pub(super) struct Sums(Kernel);

impl Sums {
    /// The way that took the least time when it was first asked for: whether looking up several entries by one instruction pays depends on the
    /// processor's maker and generation.
    pub(super) fn fastest() -> Self {
        static FASTEST: OnceLock<Sums> = OnceLock::new();
        *FASTEST.get_or_init(|| {
            let timed = Self::all().into_iter().map(|sums| (sums.time(), sums));
            timed.min_by_key(|(time, _)| *time).map_or(Self(portable), |(_, sums)| sums)
        })
    }

    /// All that this processor can do.
    pub(super) fn all() -> Vec<Self> {
        let mut all = vec![Self(portable)];
        #[cfg(target_arch = "x86_64")]
        all.extend(super::gather::kernel().map(Self));
        all
    }

    pub(super) fn add(
        self,
        slices: &[Slice],
        columns: &[[u16; LANES]],
        weights: &[[f32; LANES]],
        from: &[f64],
        to: &mut [f64],
    ) {
        (self.0)(slices, columns, weights, from, to);
    }

    /// The least time of several for a few thousand entries.
    fn time(self) -> Duration {
        const STEPS: usize = 512;
        const COLUMNS: usize = 4096;
        let slices = [Slice { rows: [0, 1, 2, 3, 4, 5, 6, 7], steps: 32 }; STEPS / 32];
        let column = |entry: usize| (entry * 1597 % COLUMNS) as u16;
        let columns: Vec<_> =
            (0..STEPS).map(|step| std::array::from_fn(|lane| column(LANES * step + lane))).collect();
        let (weights, from, mut to) = (vec![[0.5; LANES]; STEPS], vec![1.0; COLUMNS], [0.0; LANES]);
        let once = || {
            let start = Instant::now();
            self.add(&slices, &columns, &weights, &from, &mut to);
            std::hint::black_box(&mut to);
            start.elapsed()
        };
        std::iter::repeat_with(once).take(10).min().unwrap_or(Duration::MAX)
    }
}

fn portable(
    slices: &[Slice],
    mut columns: &[[u16; LANES]],
    mut weights: &[[f32; LANES]],
    from: &[f64],
    to: &mut [f64],
) {
    for slice in slices {
        let (steps, columns_left) = columns.split_at(slice.steps as usize);
        let (step_weights, weights_left) = weights.split_at(slice.steps as usize);
        let mut sums = slice.rows.map(|row| to[usize::from(row)]);
        for (columns, weights) in steps.iter().zip(step_weights) {
            for lane in 0..LANES {
                sums[lane] += f64::from(weights[lane]) * from[usize::from(columns[lane])];
            }
        }
        slice.rows.iter().zip(sums).for_each(|(&row, sum)| to[usize::from(row)] = sum);
        (columns, weights) = (columns_left, weights_left);
    }
}
