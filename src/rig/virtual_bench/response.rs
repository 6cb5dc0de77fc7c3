//! Response curves: the output of a device, from 0 to 1, as a function of its input, from 0 to 1.

/// A curve through (0, 0) and (1, 1).
#[derive(Clone, Debug, PartialEq)]
pub enum Response {
    /// The power `y = x^gamma`; 1 is linear.
    Gamma(f64),
    /// At least two values at equally spaced `x`, the first at 0, the last at 1; linear between them.
    Curve(Vec<f64>),
}

impl Response {
    /// The value at `x`, which is clamped to \[0, 1\]. The values at both ends are exact.
    pub fn at(&self, x: f64) -> f64 {
        let x = x.clamp(0.0, 1.0);
        match self {
            Self::Gamma(1.0) => x,
            Self::Gamma(gamma) => x.powf(*gamma),
            Self::Curve(values) => {
                let last = values.len() - 1;
                let at = x * last as f64;
                let below = (at as usize).min(last - 1);
                let share = at - below as f64;
                (1.0 - share) * values[below] + share * values[below + 1]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_meets_its_values_and_is_linear_between() {
        let curve = Response::Curve(vec![0.0, 0.1, 1.0]);
        assert_eq!([0.0, 0.5, 1.0, 2.0, -1.0].map(|x| curve.at(x)), [0.0, 0.1, 1.0, 1.0, 0.0]);
        assert!((curve.at(0.75) - 0.55).abs() < 1e-15);
        assert_eq!([0.0, 0.5, 1.0].map(|x| Response::Gamma(2.0).at(x)), [0.0, 0.25, 1.0]);
    }
}
