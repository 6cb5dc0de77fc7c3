//! The inner loop of a product with vector instructions (AVX2), which multiply and add several lanes at once. A kernel for a single vector
//! looks up the vector's entries four at a time, or one by one. The kernel for four interleaved vectors looks up four entries together. All
//! kernels prefetch.

#![allow(
    unsafe_code,
    reason = "the standard library has these instructions as unsafe functions; every place that they reach is checked here"
)]

use std::arch::x86_64::*;

use super::kernels::{Interleaved, Kernel, LANES, Slice};

/// The number of steps between prefetch and use of an entry, which covers memory latency. The kernels prefetch because hardware prefetchers
/// do not cross pages.
const AHEAD: usize = 80;

/// The kernels for a single vector. The list is empty if the processor lacks the instructions.
pub(super) fn of_one() -> Vec<Kernel<f64>> {
    if !is_x86_feature_detected!("avx2") {
        return Vec::new();
    }
    // SAFETY: the processor has the instructions.
    let by_four: Kernel<f64> = |slices, columns, weights, from, to| unsafe {
        by_four(slices, columns, weights, from, to);
    };
    // SAFETY: as above.
    let one_by_one: Kernel<f64> = |slices, columns, weights, from, to| unsafe {
        one_by_one(slices, columns, weights, from, to);
    };
    vec![by_four, one_by_one]
}

/// The kernel for four interleaved vectors. The four numbers of an element fill one register. The list is empty if the processor lacks the
/// instructions.
pub(super) fn of_four() -> Vec<Kernel<Interleaved>> {
    if !is_x86_feature_detected!("avx2") {
        return Vec::new();
    }
    // SAFETY: the processor has the instructions.
    vec![|slices, columns, weights, from, to| unsafe {
        of_interleaved(slices, columns, weights, from, to);
    }]
}

/// Adds the products with a single vector, whose entries are looked up four at a time. It panics at an invalid step or row. An invalid
/// column (no tile has one) reads the last entry of `from`.
#[target_feature(enable = "avx2")]
fn by_four(
    slices: &[Slice],
    columns: &[[u16; LANES]],
    weights: &[[f32; LANES]],
    from: &[f64],
    to: &mut [f64],
) {
    assert!(!from.is_empty(), "a tile has columns");
    let last = _mm256_set1_epi32(from.len().min(1 << 16) as i32 - 1);
    let mut first = 0;
    for slice in slices {
        let end = first + slice.steps as usize;
        let mut sums = slice.rows.map(|row| to[usize::from(row)]);
        // SAFETY: these read the eight values of `sums`.
        let (mut low, mut high) =
            unsafe { (_mm256_loadu_pd(sums.as_ptr()), _mm256_loadu_pd(sums.as_ptr().add(4))) };
        for (columns, weights) in columns[first..end].iter().zip(&weights[first..end]) {
            prefetch(columns, weights);
            // SAFETY: these read the eight values of `columns` and of `weights`.
            let (places, weights) =
                unsafe { (_mm_loadu_si128(columns.as_ptr().cast()), _mm256_loadu_ps(weights.as_ptr())) };
            let places = _mm256_min_epu32(_mm256_cvtepu16_epi32(places), last);
            // SAFETY: no place is above the last of `from`.
            let (from_low, from_high) = unsafe {
                (
                    _mm256_i32gather_pd::<8>(from.as_ptr(), _mm256_castsi256_si128(places)),
                    _mm256_i32gather_pd::<8>(from.as_ptr(), _mm256_extracti128_si256::<1>(places)),
                )
            };
            let weights_low = _mm256_cvtps_pd(_mm256_castps256_ps128(weights));
            let weights_high = _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(weights));
            // Products and sums are rounded separately (no fused multiply-add), as in the portable kernel.
            low = _mm256_add_pd(low, _mm256_mul_pd(weights_low, from_low));
            high = _mm256_add_pd(high, _mm256_mul_pd(weights_high, from_high));
        }
        // SAFETY: these write the eight values of `sums`.
        unsafe {
            _mm256_storeu_pd(sums.as_mut_ptr(), low);
            _mm256_storeu_pd(sums.as_mut_ptr().add(4), high);
        }
        slice.rows.iter().zip(sums).for_each(|(&row, sum)| to[usize::from(row)] = sum);
        first = end;
    }
}

/// Works like [`by_four`], for processors that look up entries faster one by one. It panics at an invalid step, row or column.
#[target_feature(enable = "avx2")]
fn one_by_one(
    slices: &[Slice],
    columns: &[[u16; LANES]],
    weights: &[[f32; LANES]],
    from: &[f64],
    to: &mut [f64],
) {
    let mut first = 0;
    for slice in slices {
        let end = first + slice.steps as usize;
        let mut sums = slice.rows.map(|row| to[usize::from(row)]);
        for (columns, weights) in columns[first..end].iter().zip(&weights[first..end]) {
            prefetch(columns, weights);
            let from = columns.map(|column| from[usize::from(column)]);
            for ((sum, from), &weight) in sums.iter_mut().zip(from).zip(weights) {
                // Products and sums are rounded separately, as above.
                *sum += f64::from(weight) * from;
            }
        }
        slice.rows.iter().zip(sums).for_each(|(&row, sum)| to[usize::from(row)] = sum);
        first = end;
    }
}

/// Adds the products with four interleaved vectors. It panics at an invalid step, row or column.
#[target_feature(enable = "avx2")]
fn of_interleaved(
    slices: &[Slice],
    columns: &[[u16; LANES]],
    weights: &[[f32; LANES]],
    from: &[Interleaved],
    to: &mut [Interleaved],
) {
    // SAFETY: a value is four numbers, as well aligned as the instruction wants.
    let load = |value: &Interleaved| unsafe { _mm256_load_pd(value.0.as_ptr()) };
    let mut first = 0;
    for slice in slices {
        let end = first + slice.steps as usize;
        let mut sums = slice.rows.map(|row| load(&to[usize::from(row)]));
        for (columns, weights) in columns[first..end].iter().zip(&weights[first..end]) {
            prefetch(columns, weights);
            // SAFETY: these read the eight values of `weights`.
            let (low, high) =
                unsafe { (_mm_loadu_ps(weights.as_ptr()), _mm_loadu_ps(weights.as_ptr().add(4))) };
            let (low, high) = (_mm256_cvtps_pd(low), _mm256_cvtps_pd(high));
            let weights = [
                _mm256_permute4x64_pd::<0b00_00_00_00>(low),
                _mm256_permute4x64_pd::<0b01_01_01_01>(low),
                _mm256_permute4x64_pd::<0b10_10_10_10>(low),
                _mm256_permute4x64_pd::<0b11_11_11_11>(low),
                _mm256_permute4x64_pd::<0b00_00_00_00>(high),
                _mm256_permute4x64_pd::<0b01_01_01_01>(high),
                _mm256_permute4x64_pd::<0b10_10_10_10>(high),
                _mm256_permute4x64_pd::<0b11_11_11_11>(high),
            ];
            for ((sum, &column), weight) in sums.iter_mut().zip(columns).zip(weights) {
                // Products and sums are rounded separately, as above.
                *sum = _mm256_add_pd(*sum, _mm256_mul_pd(weight, load(&from[usize::from(column)])));
            }
        }
        for (&row, sum) in slice.rows.iter().zip(sums) {
            // SAFETY: as above.
            unsafe { _mm256_store_pd(to[usize::from(row)].0.as_mut_ptr(), sum) };
        }
        first = end;
    }
}

#[inline(always)]
fn prefetch(columns: &[u16; LANES], weights: &[f32; LANES]) {
    // SAFETY: a prefetch may point anywhere; it reads nothing.
    #[allow(unused_unsafe, reason = "newer compilers know that")]
    unsafe {
        _mm_prefetch::<_MM_HINT_T0>(columns.as_ptr().wrapping_add(AHEAD * LANES).cast());
        _mm_prefetch::<_MM_HINT_T0>(weights.as_ptr().wrapping_add(AHEAD * LANES).cast());
    }
}
