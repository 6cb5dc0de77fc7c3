//! Light per pixel, with one plane per channel.

/// Values of each channel: `[channel][pixel]`.
pub type Planes = Vec<Vec<f64>>;

/// `‖found − truth‖ / ‖truth‖` over all channels.
pub fn relative_error(found: &Planes, truth: &Planes) -> f64 {
    norm(&difference(found, truth)) / norm(truth)
}

/// The Euclidean norm over all channels.
pub fn norm(planes: &Planes) -> f64 {
    planes.iter().flatten().map(|value| value * value).sum::<f64>().sqrt()
}

/// `a + b`.
pub fn sum(a: &Planes, b: &Planes) -> Planes {
    combined(a, b, |a, b| a + b)
}

/// `a − b`.
pub fn difference(a: &Planes, b: &Planes) -> Planes {
    combined(a, b, |a, b| a - b)
}

fn combined(a: &Planes, b: &Planes, with: fn(f64, f64) -> f64) -> Planes {
    let plane = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(&a, &b)| with(a, b)).collect();
    a.iter().zip(b).map(plane).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_relative_to_the_truth_over_all_channels() {
        let (found, truth) = (vec![vec![3.0, 0.0], vec![0.0, 5.0]], vec![vec![3.0, 0.0], vec![0.0, 4.0]]);
        assert_eq!(relative_error(&found, &truth), 0.2);
        assert_eq!(sum(&truth, &difference(&found, &truth)), found);
    }
}
