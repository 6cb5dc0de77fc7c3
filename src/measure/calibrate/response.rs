//! The camera's response: counts over exposures of fixed light.
//!
//! The true signal is `L e` for light `L` and exposure `e`, and exposures are known: whatever makes all series of counts
//! proportional to them is the inverse response `g`, `g(count) = L e` (Debevec and Malik 1997, with `g` itself in place of
//! its logarithm, so that black level and ambient light are no trouble). Pixels of like light are averaged into groups first.

use super::least_squares::Normal;
use super::sitting::percentile;
use crate::error::Result;
use crate::rig::RawFrame;

/// Pixels are put into so many groups by their light.
const GROUPS: usize = 24;

/// Knots of the inverse response, over the range of counts.
const KNOTS: usize = 33;

/// A response is called linear when no group departs further from a line, in shares of the range.
pub(super) const LINEAR_WITHIN: f64 = 2e-3;

/// Mean count of a group at an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    group: usize,
    exposure: f64,
    count: f64,
    /// Standard error of the count.
    error: f64,
}

/// What an exposure series tells.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Response {
    /// The count without light, extrapolated.
    pub(super) black: f64,
    pub(super) black_error: f64,
    /// Largest departure from a line beyond what noise explains, as a share of the range.
    pub(super) departure: f64,
    /// Linear DN above black for each count, where the response is no line.
    pub(super) curve: Option<Vec<f64>>,
}

/// Fits the response to `frames` at several exposures. `sorting` is a photo that is not among them, by which pixels are grouped;
/// samples that reach `limit` leave their group out at that exposure. `full` is the largest count, `floor` about the black level.
pub(super) fn response(
    frames: &[RawFrame],
    sorting: &RawFrame,
    floor: f64,
    limit: f64,
    full: f64,
) -> Result<Response> {
    let points = points(frames, sorting, limit);
    let (black, black_error, departure) = line(&points, full - floor)?;
    if departure <= LINEAR_WITHIN {
        return Ok(Response { black, black_error, departure, curve: None });
    }
    let (black, curve) = curve(&points, floor, limit, full)?;
    let dark = points.iter().min_by(|a, b| a.count.total_cmp(&b.count));
    Ok(Response { black, black_error: dark.map_or(1.0, |point| point.error), departure, curve: Some(curve) })
}

fn points(frames: &[RawFrame], sorting: &RawFrame, limit: f64) -> Vec<Point> {
    let mut order: Vec<usize> = (0..sorting.counts.len()).collect();
    order.sort_by_key(|&sample| sorting.counts[sample]);
    let groups: Vec<&[usize]> = order.chunks(order.len().div_ceil(GROUPS)).collect();
    let mut points = Vec::new();
    for frame in frames {
        for (group, samples) in groups.iter().enumerate() {
            let counts = || samples.iter().map(|&sample| f64::from(frame.counts[sample]));
            // Highlights and their like in the brightest group need not cost the whole of it.
            if percentile(counts(), 1.0) >= limit {
                continue;
            }
            let number = samples.len() as f64;
            let count = counts().sum::<f64>() / number;
            // Shot noise of a camera of one electron per DN; real ones have more, and less noise for it.
            let error = ((1.0 + count) / number).sqrt().max(0.02);
            points.push(Point { group, exposure: frame.exposure, count, error });
        }
    }
    points
}

/// The common intercept of one line for each group, its error, and the largest departure.
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

/// The inverse response as a function of counts, and the count at which it is 0.
fn curve(points: &[Point], floor: f64, limit: f64, full: f64) -> Result<(f64, Vec<f64>)> {
    let low = points.iter().map(|point| point.count).fold(f64::INFINITY, f64::min).min(floor);
    // Knots lie closer where counts are small: that is where a compressive response bends.
    let knot = |index: usize| low + (limit - low) * (index as f64 / (KNOTS - 1) as f64).powf(1.5);
    let knots: Vec<f64> = (0..KNOTS).map(knot).collect();
    let place = |count: f64| {
        let at = knots.partition_point(|&knot| knot <= count).clamp(1, KNOTS - 1) - 1;
        let share = (count - knots[at]) / (knots[at + 1] - knots[at]);
        (at, share)
    };
    let mut slopes = vec![1.0; KNOTS - 1];
    let mut values = Vec::new();
    for _ in 0..8 {
        let mut normal = Normal::new(KNOTS + GROUPS);
        for point in points {
            let (at, share) = place(point.count);
            let error = (point.error * slopes[at]).max(1e-6);
            let row = [(at, 1.0 - share), (at + 1, share), (KNOTS + point.group, -point.exposure)];
            normal.add(&row, 0.0, error.powi(-2));
        }
        // The scale is free: the last knot keeps its count. Between data, slopes change as little as they can.
        normal.add(&[(KNOTS - 1, 1.0)], limit - floor, 1e6);
        for k in 1..KNOTS - 1 {
            let [before, after] = [knots[k] - knots[k - 1], knots[k + 1] - knots[k]].map(f64::recip);
            let row = [(k - 1, before), (k, -before - after), (k + 1, after)];
            normal.add(&row, 0.0, 1e-1);
        }
        for group in 0..GROUPS {
            normal.add(&[(KNOTS + group, 1.0)], 0.0, 1e-18);
        }
        values = normal.solve()?.values;
        values.truncate(KNOTS);
        // Light never falls as counts rise.
        for k in 1..KNOTS {
            values[k] = values[k].max(values[k - 1] + 1e-6 * (knots[k] - knots[k - 1]));
        }
        for k in 0..KNOTS - 1 {
            slopes[k] = ((values[k + 1] - values[k]) / (knots[k + 1] - knots[k])).max(1e-4);
        }
    }
    let light = |count: f64| {
        let (at, share) = place(count);
        values[at] + share * (values[at + 1] - values[at])
    };
    let first = slopes[0];
    let black = knots[0] - values[0] / first;
    Ok((black, (0..=full as usize).map(|count| light(count as f64)).collect()))
}
