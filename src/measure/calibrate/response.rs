//! The camera's response, from counts of constant light at several exposures (O'Toole and Kutulakos, section
//! 8.1).
//!
//! The signal of light `L` at exposure `e` is `L e`, and exposures are known. The inverse response `g` is the
//! function that makes the counts of each pixel proportional to the exposure, `g(count) = L e`. This is the
//! method of Debevec and Malik (1997), with `g` in place of its logarithm, which a black level and ambient
//! light would disturb. Pixels with similar light are averaged in groups first.

use super::least_squares::Normal;
use crate::error::Result;
use crate::rig::RawFrame;

/// The number of groups. Pixels are sorted into all but the last one by their light under white; the last one
/// contains all pixels under black.
const GROUPS: usize = 25;

/// The number of knots of the inverse response over the range of counts.
const KNOTS: usize = 33;

/// A response is linear when no group departs further from a line than this, as a share of the range.
pub(super) const LINEAR_WITHIN: f64 = 2e-3;

/// The mean count of a group at an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    group: usize,
    exposure: f64,
    count: f64,
    /// The standard error of the count.
    error: f64,
}

/// The response that follows from an exposure series.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Response {
    /// The extrapolated count without light.
    pub(super) black: f64,
    /// Its standard error.
    pub(super) black_error: f64,
    /// The largest departure from a line beyond noise, as a share of the range.
    pub(super) departure: f64,
    /// Linear DN above black for each count. `None` when the response is linear.
    pub(super) curve: Option<Vec<f64>>,
}

/// Fits the response to frames of white and of black at several exposures.
///
/// Pixels are grouped by `sorting`, a photo of white that is not among these frames. A group with a sample of
/// `limit` or more is left out at that exposure. `full` is the largest count, and `floor` approximates the
/// black level.
pub(super) fn response(
    whites: &[RawFrame],
    blacks: &[RawFrame],
    sorting: &RawFrame,
    floor: f64,
    limit: f64,
    full: f64,
) -> Result<Response> {
    let points = points(whites, blacks, sorting, limit);
    let (black, black_error, departure) = line(&points, full - floor)?;
    if departure <= LINEAR_WITHIN {
        return Ok(Response { black, black_error, departure, curve: None });
    }
    let (black, curve) = curve(&points, floor, limit, full)?;
    let dark = points.iter().min_by(|a, b| a.count.total_cmp(&b.count));
    Ok(Response { black, black_error: dark.map_or(1.0, |point| point.error), departure, curve: Some(curve) })
}

/// The mean counts of all groups at all exposures.
fn points(whites: &[RawFrame], blacks: &[RawFrame], sorting: &RawFrame, limit: f64) -> Vec<Point> {
    let mut order: Vec<usize> = (0..sorting.counts.len()).collect();
    let everywhere = order.clone();
    order.sort_by_key(|&sample| sorting.counts[sample]);
    let groups: Vec<&[usize]> = order.chunks(order.len().div_ceil(GROUPS - 1)).collect();
    let of_white = whites.iter().flat_map(|frame| {
        groups.iter().enumerate().map(move |(group, samples)| point(frame, group, samples, limit))
    });
    let of_black = blacks.iter().map(|frame| point(frame, GROUPS - 1, &everywhere, limit));
    of_white.chain(of_black).flatten().collect()
}

/// The mean count of some samples, unless one of them is saturated.
fn point(frame: &RawFrame, group: usize, samples: &[usize], limit: f64) -> Option<Point> {
    let counts = || samples.iter().map(|&sample| f64::from(frame.counts[sample]));
    if counts().any(|count| count >= limit) {
        return None;
    }
    let number = samples.len() as f64;
    let count = counts().sum::<f64>() / number;
    // The shot noise of a camera with one electron per DN. Real cameras have more electrons per DN, and so
    // less noise.
    let error = ((1.0 + count) / number).sqrt().max(0.02);
    Some(Point { group, exposure: frame.exposure, count, error })
}

/// Fits one line per group with a common intercept. Returns the intercept, its standard error, and the
/// largest departure from the lines.
fn line(points: &[Point], range: f64) -> Result<(f64, f64, f64)> {
    let mut normal = Normal::new(1 + GROUPS);
    let mut seen = [0; GROUPS];
    points.iter().for_each(|point| seen[point.group] += 1);
    let usable = |point: &&Point| seen[point.group] >= 2;
    for group in (0..GROUPS).filter(|&group| seen[group] < 2) {
        normal.add(&[(1 + group, 1.0)], 0.0, 1.0);
    }
    for point in points.iter().filter(usable) {
        normal.add(&[(0, 1.0), (1 + point.group, point.exposure)], point.count, point.error.powi(-2));
    }
    let found = normal.solve()?;
    let departure = |point: &Point| {
        let residual = point.count - found.values[0] - found.values[1 + point.group] * point.exposure;
        residual.abs() - 3.0 * point.error
    };
    let largest = points.iter().filter(usable).map(departure).fold(0.0, f64::max);
    Ok((found.values[0], found.error(0), largest / range))
}

/// The exponent `a` of `count − floor ∝ (light · exposure)^a` that fits best. It is a first estimate of the
/// response, for the weights.
fn exponent(points: &[Point], floor: f64, range: f64) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for group in 0..GROUPS {
        let logs: Vec<(f64, f64)> = points
            .iter()
            .filter(|point| point.group == group && point.count - floor > 0.01 * range)
            .map(|point| (point.exposure.ln(), (point.count - floor).ln()))
            .collect();
        let count = logs.len().max(1) as f64;
        let [x, y] = [0, 1]
            .map(|axis| logs.iter().map(|log| if axis == 0 { log.0 } else { log.1 }).sum::<f64>() / count);
        products += logs.iter().map(|log| (log.0 - x) * (log.1 - y)).sum::<f64>();
        squares += logs.iter().map(|log| (log.0 - x).powi(2)).sum::<f64>();
    }
    if squares > 0.0 { (products / squares).clamp(0.2, 5.0) } else { 1.0 }
}

/// The count at which the inverse response is 0, and the inverse response of each count.
fn curve(points: &[Point], floor: f64, limit: f64, full: f64) -> Result<(f64, Vec<f64>)> {
    let dark = points.iter().map(|point| point.count).fold(f64::INFINITY, f64::min);
    let low = dark.min(floor);
    // Knots are denser at small counts, where a compressive response is curved most.
    let knot = |index: usize| low + (limit - low) * (index as f64 / (KNOTS - 1) as f64).powf(1.5);
    let knots: Vec<f64> = (0..KNOTS).map(knot).collect();
    let place = |count: f64| {
        let at = knots.partition_point(|&knot| knot <= count).clamp(1, KNOTS - 1) - 1;
        let share = (count - knots[at]) / (knots[at + 1] - knots[at]);
        (at, share)
    };
    // The slope of the curve converts errors of counts to errors of light. The slope of the fit itself would
    // be unstable: where it is small, the weight is large, which makes the slope still smaller.
    let steep = exponent(points, dark, limit - dark).recip();
    let slope = |count: f64| {
        let share = ((count - dark) / (limit - dark)).clamp(1e-3, 1.0);
        (steep * share.powf(steep - 1.0)).clamp(1e-3, 1e3)
    };
    let mut normal = Normal::new(KNOTS + GROUPS);
    for point in points {
        let (at, share) = place(point.count);
        let row = [(at, 1.0 - share), (at + 1, share), (KNOTS + point.group, -point.exposure)];
        normal.add(&row, 0.0, (point.error * slope(point.count)).powi(-2));
    }
    // The scale is arbitrary: the largest count keeps its value. Between and beyond the data, the slope
    // should change as little as possible.
    let largest = points.iter().map(|point| point.count).fold(dark, f64::max);
    let (at, share) = place(largest);
    normal.add(&[(at, 1.0 - share), (at + 1, share)], largest - dark, 1e6);
    for k in 1..KNOTS - 1 {
        let [before, after] = [knots[k] - knots[k - 1], knots[k + 1] - knots[k]].map(f64::recip);
        normal.add(&[(k - 1, before), (k, -before - after), (k + 1, after)], 0.0, 1e-1);
    }
    let mut seen = [false; GROUPS];
    points.iter().for_each(|point| seen[point.group] = true);
    for group in (0..GROUPS).filter(|&group| !seen[group]) {
        normal.add(&[(KNOTS + group, 1.0)], 0.0, 1.0);
    }
    let mut values = normal.solve()?.values;
    values.truncate(KNOTS);
    // Light must not decrease with the count.
    for k in 1..KNOTS {
        values[k] = values[k].max(values[k - 1] + 1e-6 * (knots[k] - knots[k - 1]));
    }
    let light = |count: f64| {
        let (at, share) = place(count);
        values[at] + share * (values[at + 1] - values[at])
    };
    // A curve that is flat at its beginning cannot be extrapolated. Black is then the count of the darkest
    // frames.
    let first = (values[1] - values[0]) / (knots[1] - knots[0]);
    let black = if first > 0.2 { knots[0] - values[0] / first } else { dark };
    Ok((black, (0..=full as usize).map(|count| light(count as f64)).collect()))
}
