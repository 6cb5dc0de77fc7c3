//! The inner loop of a product: the types of its elements, and the choice of the fastest kernel for this processor.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use bytemuck::{Pod, Zeroable};

/// The number of rows of a slice. The sums of these rows are computed at the same time, one in each SIMD lane.
pub(super) const LANES: usize = 8;

/// Eight rows of a tile with about equal numbers of entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::transport) struct Slice {
    /// For each lane, the number of its row within the tile. A lane without a row has the number after the last row.
    pub(super) rows: [u16; LANES],
    /// The number of steps, which is the number of entries of the longest row.
    pub(super) steps: u32,
}

/// Adds the products of a tile to the sums of its rows: `to[row] += Σ weight · from[column]`. The entries of each row are added in order,
/// and the steps of a slice are processed one after the other. Every row must be below `to.len()`, and every column below `from.len()`.
pub(in crate::transport) type Kernel<V> = fn(&[Slice], &[[u16; LANES]], &[[f32; LANES]], &[V], &mut [V]);

/// The number of vectors that are multiplied at once. The entries of the four vectors at one row or column fill one vector register.
pub(in crate::transport) const BLOCK_WIDTH: usize = 4;

/// The entries of four vectors at one row or column, in one cache line.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::transport) struct Interleaved(pub(in crate::transport) [f64; BLOCK_WIDTH]);

/// An element of a vector. A product multiplies elements by weights, and adds the results.
pub(in crate::transport) trait Value: Pod + Default + Send + Sync + 'static {
    fn times(self, weight: f64) -> Self;

    fn plus(self, other: Self) -> Self;
}

impl Value for f64 {
    fn times(self, weight: f64) -> Self {
        weight * self
    }

    fn plus(self, other: Self) -> Self {
        self + other
    }
}

impl Value for Interleaved {
    fn times(self, weight: f64) -> Self {
        Self(self.0.map(|value| weight * value))
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|vector| self.0[vector] + other.0[vector]))
    }
}

/// Elements for which there are kernels.
pub(in crate::transport) trait Summable: Value {
    /// The kernels with instructions that not every processor has. The list is empty if this processor lacks them. These kernels prefetch.
    fn special() -> Vec<Kernel<Self>>;

    /// The fastest kernel, which is determined once per process.
    fn sums() -> Sums<Self>;
}

macro_rules! summable {
    ($value:ty, $special:ident) => {
        impl Summable for $value {
            fn special() -> Vec<Kernel<Self>> {
                #[cfg(target_arch = "x86_64")]
                return super::gather::$special();
                #[cfg(not(target_arch = "x86_64"))]
                Vec::new()
            }

            fn sums() -> Sums<Self> {
                static FASTEST: OnceLock<Sums<$value>> = OnceLock::new();
                *FASTEST.get_or_init(Sums::fastest)
            }
        }
    };
}
summable!(f64, of_one);
summable!(Interleaved, of_four);

#[derive(Clone, Copy)]
pub(in crate::transport) struct Sums<V>(Kernel<V>);

impl<V: Summable> Sums<V> {
    /// Times the kernels, and returns the fastest, which depends on the maker and generation of the processor. The portable kernel is not
    /// timed, and is returned only if there is no other kernel, because it does not prefetch. The timing cannot show this disadvantage: it
    /// reads entries from the first-level cache, while the entries of a matrix come from memory. With entries from memory, the portable
    /// kernel was the slowest on the only processor where this was measured (AMD Zen 4).
    fn fastest() -> Self {
        let timed = V::special().into_iter().map(|kernel| (Self(kernel).time(), Self(kernel)));
        timed.min_by_key(|(time, _)| *time).map_or(Self(portable), |(_, sums)| sums)
    }

    #[cfg(test)]
    pub(super) fn all() -> Vec<Self> {
        let mut all = vec![Self(portable)];
        all.extend(V::special().into_iter().map(Self));
        all
    }

    pub(super) fn add(
        self,
        slices: &[Slice],
        columns: &[[u16; LANES]],
        weights: &[[f32; LANES]],
        from: &[V],
        to: &mut [V],
    ) {
        (self.0)(slices, columns, weights, from, to);
    }

    fn time(self) -> Duration {
        const STEPS: usize = 512;
        const COLUMNS: usize = 4096;
        let slices = [Slice { rows: [0, 1, 2, 3, 4, 5, 6, 7], steps: 32 }; STEPS / 32];
        let column = |entry: usize| (entry * 1597 % COLUMNS) as u16;
        let columns: Vec<_> =
            (0..STEPS).map(|step| std::array::from_fn(|lane| column(LANES * step + lane))).collect();
        let (weights, from, mut to) =
            (vec![[0.5; LANES]; STEPS], vec![V::default(); COLUMNS], [V::default(); LANES]);
        let once = || {
            let start = Instant::now();
            self.add(&slices, &columns, &weights, &from, &mut to);
            std::hint::black_box(&mut to);
            start.elapsed()
        };
        std::iter::repeat_with(once).take(10).min().unwrap_or(Duration::MAX)
    }
}

fn portable<V: Value>(
    slices: &[Slice],
    mut columns: &[[u16; LANES]],
    mut weights: &[[f32; LANES]],
    from: &[V],
    to: &mut [V],
) {
    for slice in slices {
        let (steps, columns_left) = columns.split_at(slice.steps as usize);
        let (step_weights, weights_left) = weights.split_at(slice.steps as usize);
        let mut sums = slice.rows.map(|row| to[usize::from(row)]);
        for (columns, weights) in steps.iter().zip(step_weights) {
            for lane in 0..LANES {
                sums[lane] =
                    sums[lane].plus(from[usize::from(columns[lane])].times(f64::from(weights[lane])));
            }
        }
        slice.rows.iter().zip(sums).for_each(|(&row, sum)| to[usize::from(row)] = sum);
        (columns, weights) = (columns_left, weights_left);
    }
}
