//! The uneven brightness of projector and camera, by the photo of a matte sheet.

use super::least_squares::Normal;
use super::reciprocity::centred;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::measure::{FlatField, Measurement};

/// The highest power of a coordinate in the polynomial that describes the sheet's photo.
const DEGREE: usize = 6;

/// The largest share of its light by which an even sheet departs from the polynomial, root mean square.
const EVEN: f64 = 0.05;

/// Photographs an evenly coloured matte sheet that fills the view and stands square to the camera, under white, and tells the brightness of
/// both devices from it. `measurement` must not correct any uneven brightness; `known` is the factor between projector and camera.
///
/// # Errors
/// [`Error::Rig`] when what is seen is no even sheet; those of taking the photo.
pub fn flat_field_of_sheet(measurement: &mut Measurement, known: &FlatField) -> Result<FlatField> {
    let white = measurement.white()?;
    let size = white.resolution;
    let light: Vec<f64> =
        (0..size.pixels()).map(|pixel| white.planes.iter().map(|plane| plane.values[pixel]).sum()).collect();
    let seen: Vec<bool> = measurement.seen().to_vec();
    let smooth = polynomial(&light, &seen, size)?;
    let (mut off, mut all) = (0.0, 0.0);
    for pixel in (0..size.pixels()).filter(|&pixel| seen[pixel]) {
        off += (light[pixel] - smooth[pixel]).powi(2);
        all += light[pixel].powi(2);
    }
    if !(off <= EVEN * EVEN * all && smooth.iter().all(|light| *light > 0.0)) {
        return Err(Error::Rig {
            device: "sheet".into(),
            fault: format!(
                "its photo departs by {:.1} % from a smooth one, so this is no even sheet",
                100.0 * (off / all).sqrt()
            ),
            help: "fill the view with one matte sheet of one colour, square to the camera, and keep other light away".into(),
        });
    }
    known.with_sheet(&smooth)
}

/// The polynomial in both coordinates that fits the pixels that are `seen` best, at every pixel.
fn polynomial(light: &[f64], seen: &[bool], size: Resolution) -> Result<Vec<f64>> {
    let powers: Vec<(i32, i32)> =
        (0..=DEGREE as i32).flat_map(|x| (0..=DEGREE as i32 - x).map(move |y| (x, y))).collect();
    let terms = |pixel: usize| -> Vec<f64> {
        let [x, y] = centred(pixel, size);
        // Chebyshev polynomials, which are far less alike than powers.
        let wave = |x: f64, power: i32| (f64::from(power) * x.acos()).cos();
        powers.iter().map(|&(i, j)| wave(x, i) * wave(y, j)).collect()
    };
    let mut normal = Normal::new(powers.len());
    for pixel in (0..light.len()).filter(|&pixel| seen[pixel]) {
        normal.add_full(&terms(pixel), light[pixel], 1.0);
    }
    let values = normal.solve()?.values;
    let at = |pixel: usize| terms(pixel).iter().zip(&values).map(|(term, value)| term * value).sum();
    Ok((0..light.len()).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vignetting_is_found_also_where_no_pixel_is_seen() -> Result<()> {
        let size = Resolution::new(24, 16);
        let truth: Vec<f64> = (0..size.pixels())
            .map(|pixel| {
                let (x, y) = ((pixel % 24) as f64 / 12.0 - 1.0, (pixel / 24) as f64 / 8.0 - 1.0);
                (1.0 - 0.1 * (x * x + y * y)) * (1.0 - 0.05 * x)
            })
            .collect();
        let seen: Vec<bool> = (0..size.pixels()).map(|pixel| pixel % 7 != 0).collect();
        let dark: Vec<f64> = truth.iter().zip(&seen).map(|(t, seen)| if *seen { *t } else { 0.0 }).collect();
        let found = polynomial(&dark, &seen, size)?;
        // A polynomial of degree three is among those that are fitted: only rounding is left.
        assert!(found.iter().zip(&truth).all(|(found, truth)| (found - truth).abs() < 1e-9));
        Ok(())
    }
}
