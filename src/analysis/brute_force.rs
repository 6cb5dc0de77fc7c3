//! Measures the transport matrix with one photo per column, as a reference for all other methods on a small rig.

use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::operator::{Operator, each_product};
use crate::sparse::Csr;
use crate::transport::Channels;

const PHOTOS: usize = 4096;

/// Refuses a measurement that would take more photos than allowed. Fails with [`Error::Option`] naming `--photos`.
pub fn check_photos(resolution: Resolution, channels: Channels, allowed: Option<usize>) -> Result<()> {
    let needed = resolution.pixels() * channels.count();
    let allowed = allowed.unwrap_or(PHOTOS);
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::option("--photos", format!(
            "a matrix of {resolution} pixels takes {needed} photos, one for each column, but {allowed} are allowed"
        )).help(format!("give --photos {needed} if the rig has so much time, or fewer pixels")))
}

/// Measures the matrix column by column. Every entry that is not exactly 0 is stored, even if it is only noise.
pub fn columns(operator: &mut dyn Operator) -> Result<Csr> {
    let (rows, count) = (operator.rows(), operator.cols());
    let mut entries: Vec<Vec<(u32, f64)>> = vec![Vec::new(); rows];
    let unit = |column| {
        let mut pattern = vec![0.0; count];
        pattern[column] = 1.0;
        pattern
    };
    let mut column = 0;
    each_product(operator, (0..count).map(unit), |_, photo| {
        for (entries, &value) in entries.iter_mut().zip(&photo).filter(|(_, value)| **value != 0.0) {
            entries.push((column, value));
        }
        column += 1;
        Ok(())
    })?;
    Csr::of_rows(count, entries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::SparseOperator;

    #[test]
    fn columns_are_those_of_the_operator() {
        let matrix = Csr::new(3, vec![0, 2, 3], vec![0, 2, 1], vec![1.0, -0.5, 4.0]);
        let matrix = matrix.expect("well formed");
        let found = columns(&mut SparseOperator::new(matrix.clone()));
        assert_eq!(found.expect("no product fails"), matrix);
    }

    #[test]
    fn too_many_photos_are_refused_with_their_number() {
        let refused = |side, allowed| check_photos(Resolution::new(side, side), Channels::Luma, allowed);
        assert!(refused(64, None).is_ok() && refused(8, Some(64)).is_ok());
        let error = refused(65, None).expect_err("4225 photos").to_string();
        assert!(error.contains("--photos") && error.contains("4225"), "{error}");
    }
}
