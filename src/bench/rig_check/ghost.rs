//! The search for a second image of the frame, as a beam splitter's back reflects it.

use rayon::prelude::*;

use super::probe::{Probe, binned};
use super::thresholds::GHOST;
use super::{Finding, Grade};
use crate::error::Result;
use crate::image::{Resolution, percentile};

/// The distance of the dots in projector pixels, and their side. All dots have the same second image beside them, while light of the
/// scene differs from dot to dot.
const DOTS: [usize; 2] = [16, 2];

/// Second images nearer and farther than these distances, in projector pixels, cannot be distinguished from the first one and from that of the next dot.
const RANGE: [f64; 2] = [3.5, 7.5];

/// A second image is a ghost if it is so many times as strong as any other. Mirrors in the scene make several.
const STANDS_OUT: f64 = 2.5;

/// The largest share of a second image. More is another dot, which a camera that sees more than the frame has nearer.
const LARGEST: f64 = 0.4;

/// The photo is made coarser until it has this many pixels for each of the projector's, at most.
const FINEST: f64 = 3.0;

/// Photographs dots, and compares the photo with itself, displaced.
pub(crate) fn ghost(probe: &mut Probe<'_>) -> Result<Finding> {
    let [distance, side] = DOTS;
    let light = probe.pattern(|x, y| [x, y].iter().all(|at| (at + distance / 2) % distance < side))?;
    let ratio = probe.camera().width as f64 / probe.projector().width as f64;
    let (light, size) = binned(&light, probe.camera(), ((ratio / FINEST).ceil() as usize).max(1));
    let ratio = size.width as f64 / probe.projector().width as f64;
    let found = second(&light, size, ratio);
    let is_double = found.is_some_and(|[share, ..]| share > GHOST);
    let text = match found {
        Some([share, right, down]) => format!(
            "a second image of dots has {:.1} % of their light, {:.1} projector pixels away{}",
            100.0 * share,
            right.hypot(down),
            if is_double { ": a ghost, as of the beam splitter's back" } else { "" }
        ),
        None => "dots have no second image that stands out".into(),
    };
    Ok(Finding::graded(
        "ghost",
        if is_double { Grade::Warning } else { Grade::Ok },
        text,
        format!("at most {:.0} %", 100.0 * GHOST),
        "use a beam splitter with an anti-reflection coating on its back, or a pellicle; clean the lenses; glass in front of the scene \
         has the same effect",
    ))
}

/// The strongest second image of a photo of dots: its share, and its displacement in projector pixels, of which the sign is not known.
/// `ratio` is the number of the photo's pixels for each of the projector's.
fn second(light: &[f64], size: Resolution, ratio: f64) -> Option<[f64; 3]> {
    let background = percentile(light.iter().copied(), 0.5);
    let light: Vec<f64> = light.iter().map(|value| value - background).collect();
    let reach = (DOTS[0] as f64 / 2.0 * ratio).ceil() as i64;
    let side = 2 * reach + 1;
    let correlation: Vec<f64> = (0..side * side)
        .into_par_iter()
        .map(|at| correlation(&light, size, [at % side - reach, at / side - reach]))
        .collect();
    let whole = correlation[(reach * side + reach) as usize];
    let at = |[x, y]: [i64; 2]| correlation[((y + reach) * side + x + reach) as usize] / whole;
    let ring = |[x, y]: [i64; 2], near: f64, far: f64| {
        let far = (far * ratio).ceil() as i64;
        let points = (-far..=far).flat_map(move |v| (-far..=far).map(move |u| [u, v]));
        let inside =
            |&[u, v]: &[i64; 2]| (x + u).abs() <= reach && (y + v).abs() <= reach && [u, v] != [0, 0];
        let distant = move |&[u, v]: &[i64; 2]| u.abs().max(v.abs()) as f64 >= near * ratio;
        points.filter(inside).filter(distant).map(|[u, v]| at([x + u, y + v])).collect::<Vec<f64>>()
    };
    // A displacement and its opposite have the same value.
    let lags = (0..=reach).flat_map(|y| (-reach..=reach).map(move |x| [x, y]));
    let is_in_range = |&[x, y]: &[i64; 2]| {
        let distance = x.abs().max(y.abs()) as f64 / ratio;
        (y > 0 || x > 0) && distance > RANGE[0] && distance < RANGE[1]
    };
    let mut peaks: Vec<(f64, [i64; 2])> = lags
        .filter(is_in_range)
        .filter(|&lag| {
            let value = at(lag);
            value <= LARGEST && ring(lag, 0.0, 1.5).iter().all(|&other| other <= value)
        })
        .map(|lag| (at(lag) - percentile(ring(lag, 2.0, 3.5), 0.5), lag))
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let &(share, [x, y]) = peaks.first()?;
    let next = peaks.iter().skip(1).find(|(_, [u, v])| {
        // Equal neighbours are the same peak, and on the axis so are opposite ones.
        let near = |sign: i64| (u - sign * x).abs().max((v - sign * y).abs()) as f64 <= 1.5 * ratio;
        !near(1) && !near(-1)
    });
    let stands_out = next.is_none_or(|(next, _)| share > STANDS_OUT * next);
    stands_out.then_some([share, x as f64 / ratio, y as f64 / ratio])
}

/// The sum of the products of a picture's pixels with those `lag` to the right and down.
fn correlation(light: &[f64], size: Resolution, [right, down]: [i64; 2]) -> f64 {
    let span = |by: i64, of: usize| {
        let by = by.unsigned_abs() as usize;
        by.min(of)..of
    };
    // The displaced picture begins at the later of both starts.
    let columns = span(right, size.width).len();
    let [x0, x1] = if right >= 0 { [0, right as usize] } else { [right.unsigned_abs() as usize, 0] };
    (0..span(down, size.height).len())
        .map(|row| {
            let [y0, y1] = if down >= 0 {
                [row, row + down as usize]
            } else {
                [row + down.unsigned_abs() as usize, row]
            };
            let line = |x: usize, y: usize| &light[y * size.width + x..y * size.width + x + columns];
            if columns == 0 { 0.0 } else { line(x0, y0).iter().zip(line(x1, y1)).map(|(a, b)| a * b).sum() }
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A photo of dots, two pixels for each of the projector's, on a background that varies, with a second image.
    fn dots(share: f64) -> (Vec<f64>, Resolution) {
        let size = Resolution::new(128, 128);
        let dot =
            |x: i64, y: i64| [x, y].iter().all(|at| (0..128).contains(at) && (at + 16) % 32 < 4) as u8 as f64;
        let light = (0..size.pixels()).map(|pixel| {
            let [x, y] = [(pixel % 128) as i64, (pixel / 128) as i64];
            dot(x, y) + share * dot(x - 10, y + 4) + 0.004 * (0.3 * x as f64 + 0.2 * y as f64).sin()
        });
        (light.collect(), size)
    }

    /// Sums of squares of whole numbers, and every lag there is, also beyond the picture.
    #[test]
    fn a_correlation_is_the_sum_over_all_pairs_of_pixels_that_far_apart() {
        let size = Resolution::new(5, 4);
        let light: Vec<f64> = (0..20).map(|pixel| f64::from(pixel * pixel % 13)).collect();
        for (right, down) in (-6..=6).flat_map(|right| (-5..=5).map(move |down| (right, down))) {
            let mut sum = 0.0;
            for (y, x) in (0..4_i64).flat_map(|y| (0..5_i64).map(move |x| (y, x))) {
                let (u, v) = (x + right, y + down);
                if (0..5).contains(&u) && (0..4).contains(&v) {
                    sum += light[(y * 5 + x) as usize] * light[(v * 5 + u) as usize];
                }
            }
            assert_eq!(correlation(&light, size, [right, down]), sum, "{right} {down}");
        }
    }

    #[test]
    fn a_second_image_is_found_with_its_share_and_place_and_its_absence_too() {
        let (light, size) = dots(0.03);
        let [share, right, down] = second(&light, size, 2.0).expect("it is there");
        assert!((share - 0.03).abs() < 0.005, "{share}");
        assert_eq!(
            (right.abs(), down.abs(), right * down < 0.0),
            (5.0, 2.0, true),
            "two to the top, five to the right"
        );
        let (light, size) = dots(0.0);
        assert!(second(&light, size, 2.0).is_none_or(|[share, ..]| share < 0.005));
    }
}
