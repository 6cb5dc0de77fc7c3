//! Planes of light: one value per pixel, and one plane per channel.

use crate::finding::Ratio;

/// Values of each channel: `[channel][pixel]`.
pub type Planes = Vec<Vec<f64>>;

/// `‖found − truth‖ / ‖truth‖` over all channels. The ratio has no value if the truth is dark.
pub fn relative_error(found: &Planes, truth: &Planes) -> Ratio {
    Ratio::of(norm(&difference(found, truth)), norm(truth), 0.0)
}

/// `numerator / ‖values‖` for values with these standard errors. The ratio has no value if the values are only noise.
pub fn relative_to(numerator: f64, values: &Planes, errors: &Planes) -> Ratio {
    let measured = values.iter().flatten().zip(errors.iter().flatten());
    Ratio::to_length(numerator, measured.map(|(&value, &error)| [value, error * error]))
}

/// The Euclidean norm over all channels.
pub fn norm(planes: &Planes) -> f64 {
    planes.iter().flatten().map(|value| value * value).sum::<f64>().sqrt()
}

/// `a + b`.
pub fn sum(a: &[Vec<f64>], b: &[Vec<f64>]) -> Planes {
    combined(a, b, |a, b| a + b)
}

/// `a − b`.
pub fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> Planes {
    combined(a, b, |a, b| a - b)
}

/// `factor · planes`.
pub fn times(factor: f64, planes: &[Vec<f64>]) -> Planes {
    planes.iter().map(|plane| plane.iter().map(|value| factor * value).collect()).collect()
}

fn combined(a: &[Vec<f64>], b: &[Vec<f64>], with: fn(f64, f64) -> f64) -> Planes {
    let plane = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(&a, &b)| with(a, b)).collect();
    a.iter().zip(b).map(plane).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_relative_to_the_truth_over_all_channels() {
        let (found, truth) = (vec![vec![3.0, 0.0], vec![0.0, 5.0]], vec![vec![3.0, 0.0], vec![0.0, 4.0]]);
        assert_eq!(relative_error(&found, &truth).value(), Some(0.2));
        assert_eq!(relative_error(&found, &vec![vec![0.0; 2]; 2]).value(), None);
        assert_eq!(sum(&truth, &difference(&found, &truth)), found);
    }
}
