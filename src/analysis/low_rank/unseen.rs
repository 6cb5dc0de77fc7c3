//! The part of a pattern that a model from a few photos does not know.

use super::LowRank;
use crate::krylov::{dot, norm};

/// One in `LAST` photos, the last ones, shows how much light an unseen direction sends.
const LAST: usize = 4;

impl LowRank {
    /// The expected norm of the error of a product with `x` (`n` values), in the unit of the photos. It is the part of `x` outside the span
    /// of the captured patterns, times the light that a new direction sends. A Krylov process finds directions that send much light first.
    /// The last quarter of its photos therefore shows how much the next ones send; random patterns outside send less. Noise of the photos
    /// is not counted.
    pub fn error_of_rank(&self, x: &[f64]) -> f64 {
        let photos = self.photos();
        let newest = &photos[photos.len() - photos.len().div_ceil(LAST)..];
        let sent: f64 = newest.iter().map(|photo| dot(photo, photo)).sum();
        let mut rest = x.to_vec();
        for vector in self.basis() {
            let share = dot(vector, &rest);
            rest.iter_mut().zip(vector).for_each(|(rest, value)| *rest -= share * value);
        }
        norm(&rest) * (sent / newest.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;

    #[test]
    fn captured_patterns_are_known_and_others_by_what_the_last_photos_sent() -> Result<()> {
        let unit = |at: usize| (0..8).map(|i| f64::from(u8::from(i == at))).collect::<Vec<f64>>();
        let scaled = |at: usize, by: f64| unit(at).iter().map(|value| by * value).collect::<Vec<f64>>();
        // Photos that fade from 1 to 0.2.
        let photos = vec![scaled(0, 1.0), scaled(1, 0.6), scaled(2, 0.4), scaled(3, 0.2)];
        let model = LowRank::new((0..4).map(unit).collect(), photos, Vec::new(), true)?;
        assert_eq!(model.error_of_rank(&scaled(2, 3.0)), 0.0);
        assert!((model.error_of_rank(&scaled(6, 2.0)) - 0.4).abs() < 1e-15);
        Ok(())
    }
}
