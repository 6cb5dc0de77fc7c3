//! The camera's response, from counts of constant light at several exposures.
//!
//! Light `L` at exposure `e` gives the signal `L e`, and the exposures are known. The inverse response `g` makes the counts of each pixel
//! proportional to the exposure: `g(count) = L e`. This is the method of Debevec and Malik (1997), but with `g` instead of its logarithm,
//! because a black level and ambient light would disturb the logarithm. Pixels with similar light are first averaged in groups.

use super::least_squares::Normal;
use crate::error::Result;
use crate::rig::RawFrame;

/// The number of groups. The last group holds all pixels under black. The other groups hold the pixels under white, sorted by their light.
const GROUPS: usize = 25;

/// The number of knots of the inverse response over the range of counts.
const KNOTS: usize = 33;

/// A response is linear when no group departs from a line by more than this fraction of the range.
pub(crate) const LINEAR_WITHIN: f64 = 2e-3;

/// The mean count of a group at an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    group: usize,
    exposure: f64,
    count: f64,
    error: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FittedResponse {
    /// The count without light, extrapolated.
    pub(crate) black: f64,
    /// The standard error of `black`.
    pub(crate) black_error: f64,
    /// The largest departure from a line beyond noise, as a fraction of the range.
    pub(crate) departure: f64,
    /// Linear DN above black for each count. `None` when the response is linear.
    pub(crate) curve: Option<Vec<f64>>,
}

/// Fits the response to frames of white and of black at several exposures.
///
/// `sorting` is a photo of white that is not among these frames. It assigns the pixels to groups. A group is left out at an exposure where
/// one of its samples is at least `limit`. `full` is the largest count, and `floor` approximates the black level.
pub(crate) fn response(
    whites: &[RawFrame],
    blacks: &[RawFrame],
    sorting: &RawFrame,
    floor: f64,
    limit: f64,
    full: f64,
) -> Result<FittedResponse> {
    let points = points(whites, blacks, sorting, limit);
    let (black, black_error, departure) = line(&points, full - floor)?;
    if departure <= LINEAR_WITHIN {
        return Ok(FittedResponse { black, black_error, departure, curve: None });
    }
    let (black, curve) = curve(&points, floor, limit, full)?;
    let dark = points.iter().min_by(|a, b| a.count.total_cmp(&b.count));
    Ok(FittedResponse {
        black,
        black_error: dark.map_or(1.0, |point| point.error),
        departure,
        curve: Some(curve),
    })
}

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

/// The mean count of some samples. It is `None` when one of the samples is saturated.
fn point(frame: &RawFrame, group: usize, samples: &[usize], limit: f64) -> Option<Point> {
    let counts = || samples.iter().map(|&sample| f64::from(frame.counts[sample]));
    if counts().any(|count| count >= limit) {
        return None;
    }
    let number = samples.len() as f64;
    let count = counts().sum::<f64>() / number;
    // The shot noise of a camera with one electron per DN is assumed. Real cameras have more electrons per DN and so less noise.
    let error = ((1.0 + count) / number).sqrt().max(0.02);
    Some(Point { group, exposure: frame.exposure, count, error })
}

/// Fits one line per group with a common intercept. Returns the intercept, its standard error, and the largest departure from the lines.
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

/// Finds the exponent `a` for which `count − floor ∝ (light · exposure)^a` fits best. This first estimate gives the weights.
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

/// Computes the count at which the inverse response is 0, and the inverse response of each count.
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
    // The slope of a power law converts errors of counts to errors of light. The slope of the fitted curve would be unstable: a small slope
    // gives a large weight, which makes the slope still smaller.
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
    // The scale is arbitrary, so the largest count keeps its value. The slope is smoothed between and beyond the data.
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
    // A curve that is flat at its beginning cannot be extrapolated. Black is then the count of the darkest frames.
    let first = (values[1] - values[0]) / (knots[1] - knots[0]);
    let black = if first > 0.2 { knots[0] - values[0] / first } else { dark };
    Ok((black, (0..=full as usize).map(|count| light(count as f64)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    const SAMPLES: usize = 480;
    const FULL: f64 = 65_535.0;

    fn frame(exposure: f64, count: impl Fn(usize) -> f64) -> RawFrame {
        let counts = (0..SAMPLES).map(|sample| count(sample).round() as u16).collect();
        let resolution = Resolution::new(SAMPLES, 1);
        RawFrame { resolution, channels: 1, counts, exposure, id: 0, started: 0.0 }
    }

    /// The light of a sample. It has 24 different values, in mixed order.
    fn light(sample: usize) -> f64 {
        0.1 + 0.9 * ((sample * 7) % 24) as f64 / 23.0
    }

    /// Fits the response to twelve exposures of white and of black by a camera whose true response is `count`.
    fn measured(count: impl Fn(f64) -> f64) -> FittedResponse {
        let exposures: Vec<f64> = (0..12).map(|k| 2.0_f64.powf(-0.5 * f64::from(k))).collect();
        let white = |exposure: f64| frame(exposure, |sample| count(light(sample) * exposure));
        let whites: Vec<RawFrame> = exposures.iter().map(|&exposure| white(exposure)).collect();
        let blacks: Vec<RawFrame> =
            exposures.iter().map(|&exposure| frame(exposure, |_| count(0.0))).collect();
        response(&whites, &blacks, &white(0.9), 1000.0, 64_000.0, FULL).expect("it is determined")
    }

    #[test]
    fn a_line_is_found_with_its_black_level() {
        let found = measured(|light| 1000.0 + 60_000.0 * light);
        // Counts are rounded to integers. About twelve thousand counts enter the fit.
        assert!((found.black - 1000.0).abs() < 0.2 && found.black_error < 1.0, "{found:?}");
        assert!(found.curve.is_none() && found.departure < 1e-5, "{found:?}");
    }

    #[test]
    fn a_compressive_curve_is_inverted_between_black_and_the_limit() {
        let found = measured(|light| 1000.0 + 60_000.0 * light.powf(0.6));
        assert!(found.departure > 10.0 * LINEAR_WITHIN);
        let curve = found.curve.expect("it is no line");
        assert_eq!(curve.len(), 65_536);
        // The largest count keeps its value, 61000 − 1000, as linear DN.
        assert!((curve[61_000] - 60_000.0).abs() < 1.0, "{}", curve[61_000]);
        for share in [0.02, 0.05, 0.1, 0.2, 0.4, 0.7] {
            let count = 1000.0 + 60_000.0 * f64::powf(share, 0.6);
            let off = curve[count.round() as usize] / (60_000.0 * share) - 1.0;
            // The tolerance covers the straight pieces between 33 knots, and the correlated errors of neighbouring knots.
            assert!(off.abs() < 0.01, "{share}: {off}");
        }
        // The inverse begins flat and is not extrapolated. Black is the count of the darkest frames.
        assert_eq!(found.black, 1000.0);
    }

    #[test]
    fn a_curve_that_begins_steep_is_extrapolated_to_black() {
        let found = measured(|light| 1000.0 + 60_000.0 * light.powf(2.5));
        let curve = found.curve.expect("it is no line");
        // The first straight pieces of the curve have an error of a fifth of the light, and black has an error of a thousandth of the
        // range.
        for share in [0.5, 0.7] {
            let count = 1000.0 + 60_000.0 * f64::powf(share, 2.5);
            let off = curve[count.round() as usize] / (60_000.0 * share) - 1.0;
            assert!(off.abs() < 0.01, "{share}: {off}");
        }
        assert!(curve.is_sorted() && (found.black - 1000.0).abs() < 60.0, "{}", found.black);
    }

    /// Points without noise. Group `group` has the light `1 + group`, and the counts follow a power law.
    fn law(power: f64, groups: std::ops::Range<usize>) -> Vec<Point> {
        let exposures = [0.25, 0.5, 1.0, 2.0];
        let of_group = |group: usize| {
            exposures.map(|exposure| {
                let count = 100.0 + 10.0 * ((1 + group) as f64 * exposure).powf(power);
                Point { group, exposure, count, error: 0.5 }
            })
        };
        groups.flat_map(of_group).collect()
    }

    #[test]
    fn the_exponent_of_a_power_law_is_found_and_bounded() {
        for (power, expected) in [(0.45, 0.45), (1.0, 1.0), (2.2, 2.2), (0.1, 0.2), (7.0, 5.0)] {
            // Counts in the lowest hundredth of the range are left out.
            let mut points = law(power, 3..9);
            points.push(Point { group: 3, exposure: 100.0, count: 100.05, error: 0.5 });
            let found = exponent(&points, 100.0, 10.0);
            assert!((found - expected).abs() < 1e-9, "{power}: {found}");
        }
        let one = [Point { group: 0, exposure: 1.0, count: 200.0, error: 0.5 }];
        assert_eq!(exponent(&one, 100.0, 10.0), 1.0, "one exposure says nothing");
    }

    #[test]
    fn a_departure_from_the_lines_is_counted_beyond_three_standard_errors() {
        let mut points = law(1.0, 0..6);
        let (black, error, departure) = line(&points, 1000.0).expect("it is determined");
        assert!((black - 100.0).abs() < 1e-9 && departure == 0.0, "{black} {departure}");
        assert!(error > 0.0 && error < 0.5, "{error}");
        // A group with a single point is ignored.
        points.push(Point { group: 9, exposure: 1.0, count: 5000.0, error: 0.5 });
        assert!((line(&points, 1000.0).expect("it is determined").0 - 100.0).abs() < 1e-9);
        // One point is an outlier, but its weight is too small to move the lines.
        points[5].count += 40.0;
        points[5].error = 10.0;
        points.iter_mut().filter(|point| point.error < 1.0).for_each(|point| point.error = 1e-3);
        let (_, _, departure) = line(&points, 1000.0).expect("it is determined");
        assert!((departure - (40.0 - 30.0) / 1000.0).abs() < 1e-6, "{departure}");
    }

    #[test]
    fn samples_are_grouped_by_their_light_and_a_saturated_group_is_left_out() {
        let white = frame(0.5, |sample| 100.0 + (sample % 240) as f64);
        let black = frame(0.25, |_| 50.0);
        let points = points(std::slice::from_ref(&white), std::slice::from_ref(&black), &white, 330.0);
        // There are 24 groups of 20 samples each. The last group has counts of 330 to 339.
        assert_eq!(points.len(), 23 + 1);
        for (group, point) in points[..23].iter().enumerate() {
            let count = 100.0 + 10.0 * group as f64 + 4.5;
            let error = ((1.0 + count) / 20.0).sqrt();
            assert_eq!((point.group, point.exposure, point.count), (group, 0.5, count));
            assert!((point.error - error).abs() < 1e-12, "{point:?}");
        }
        let last = Point { group: 24, exposure: 0.25, count: 50.0, error: (51.0 / 480.0_f64).sqrt() };
        assert_eq!(points[23], last);
    }
}
