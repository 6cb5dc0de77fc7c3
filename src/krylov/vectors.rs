//! Entrywise updates of long vectors, with the same bits for any number of threads.

use rayon::prelude::*;

/// Below this length, threads cost more time than they save.
const PARALLEL: usize = 16_384;
const CHUNK: usize = 4096;

/// `wᵢ ← f(wᵢ, aᵢ)`.
pub(super) fn update(w: &mut [f64], a: &[f64], f: impl Fn(f64, f64) -> f64 + Sync) {
    debug_assert_eq!(w.len(), a.len());
    in_blocks(w, a, &|w, a| {
        for (w, &a) in w.iter_mut().zip(a) {
            *w = f(*w, a);
        }
    });
}

/// `wᵢ ← f(wᵢ, aᵢ, bᵢ)`.
pub(super) fn update2(w: &mut [f64], a: &[f64], b: &[f64], f: impl Fn(f64, f64, f64) -> f64 + Sync) {
    debug_assert!(w.len() == a.len() && w.len() == b.len());
    in_blocks2(w, a, b, &|w, a, b| {
        for ((w, &a), &b) in w.iter_mut().zip(a).zip(b) {
            *w = f(*w, a, b);
        }
    });
}

// The loops over entries are compiled for every `f`, the distribution over threads only once: it is by far the larger
// part of the code, and one indirect call a block costs nothing.

/// An update of one chunk: `w`, `a`.
type Update<'a> = dyn Fn(&mut [f64], &[f64]) + Sync + 'a;

/// An update of one chunk: `w`, `a`, `b`.
type Update2<'a> = dyn Fn(&mut [f64], &[f64], &[f64]) + Sync + 'a;

fn in_blocks(w: &mut [f64], a: &[f64], block: &Update<'_>) {
    if w.len() < PARALLEL {
        block(w, a);
    } else {
        w.par_chunks_mut(CHUNK).zip(a.par_chunks(CHUNK)).for_each(|(w, a)| block(w, a));
    }
}

fn in_blocks2(w: &mut [f64], a: &[f64], b: &[f64], block: &Update2<'_>) {
    if w.len() < PARALLEL {
        block(w, a, b);
    } else {
        let parts = w.par_chunks_mut(CHUNK).zip(a.par_chunks(CHUNK)).zip(b.par_chunks(CHUNK));
        parts.for_each(|((w, a), b)| block(w, a, b));
    }
}

/// `y ← y + α x`.
pub(super) fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    update(y, x, |y, x| y + alpha * x);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_short_vectors_are_updated_equally() {
        for n in [3, PARALLEL + 5] {
            let a: Vec<f64> = (0..n).map(|i| i as f64).collect();
            let b = vec![2.0; n];
            let mut w = vec![1.0; n];
            axpy(3.0, &a, &mut w);
            update2(&mut w, &a, &b, |w, a, b| w - b * a);
            assert!(w.iter().zip(&a).all(|(w, a)| *w == 1.0 + a), "1 + 3a − 2a, exact in small integers");
        }
    }
}
