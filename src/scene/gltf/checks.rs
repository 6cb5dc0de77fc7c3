//! Range checks of a material's factors.

use glam::Vec3;

use super::Document;
use crate::error::{Error, Result};

/// The amount by which a fraction may lie outside `[0, 1]`: exporters that compute in single precision
/// overshoot by rounding.
const ROUNDING: f32 = 1e-5;

/// Range checks whose errors name the material and the factor.
pub(super) struct Checks<'a> {
    pub document: &'a Document,
    /// The material's name in messages.
    pub what: &'a str,
}

impl Checks<'_> {
    /// A value in `[0, 1]`, up to rounding.
    pub(super) fn fraction(&self, factor: &str, value: f32) -> Result<f32> {
        // NaN fails the comparison, too.
        if (-ROUNDING..=1.0 + ROUNDING).contains(&value) {
            return Ok(value.clamp(0.0, 1.0));
        }
        Err(self.out_of_range(factor, value, "between 0 and 1"))
    }

    /// A colour in `[0, 1]`, up to rounding.
    pub(super) fn fractions(&self, factor: &str, values: [f32; 3]) -> Result<Vec3> {
        let [red, green, blue] = values;
        Ok(Vec3::new(
            self.fraction(factor, red)?,
            self.fraction(factor, green)?,
            self.fraction(factor, blue)?,
        ))
    }

    /// A colour of finite, non-negative values.
    pub(super) fn not_negative(&self, factor: &str, values: [f32; 3]) -> Result<Vec3> {
        match values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            Some(&value) => Err(self.out_of_range(factor, value, "finite and not negative")),
            None => Ok(Vec3::from_array(values)),
        }
    }

    /// A finite value.
    pub(super) fn finite(&self, factor: &str, value: f32) -> Result<f32> {
        if value.is_finite() { Ok(value) } else { Err(self.out_of_range(factor, value, "finite")) }
    }

    /// A positive value. It may be infinite, which means no limit.
    pub(super) fn positive(&self, factor: &str, value: f32) -> Result<f32> {
        if value > 0.0 { Ok(value) } else { Err(self.out_of_range(factor, value, "positive")) }
    }

    /// An index of refraction: at least 1, or 0.
    pub(super) fn ior(&self, value: f32) -> Result<f32> {
        // By KHR_materials_ior, 0 asks for a Fresnel term of 1 everywhere.
        if value == 0.0 || (value.is_finite() && value >= 1.0) {
            return Ok(value);
        }
        Err(self.out_of_range("ior", value, "0 or at least 1"))
    }

    fn out_of_range(&self, factor: &str, value: f32, expected: &str) -> Error {
        self.document.fault(
            format!("{}: its {factor} is {value}", self.what),
            format!("correct the material: the value must be {expected}"),
        )
    }
}
