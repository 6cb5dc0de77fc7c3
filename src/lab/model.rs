//! The capture of a low-rank model of light transport.

use crate::analysis::low_rank::{
    DirectPart, LowRankCapture, SavedModel, capture_channels, diagonal_of, smooth_starts,
};
use crate::error::{Error, Result};
use crate::lab::Lab;
use crate::sparse::Csr;
use crate::transport::Part;

impl Lab {
    /// Captures the light transport with `photos` photos. The first `block` patterns are chosen beforehand: white, and smooth random
    /// patterns. Each further pattern is a photo that is projected back. If `block` is 1, only white is chosen.
    ///
    /// # Errors
    /// The errors of [`capture_channels`] and [`Lab::operators`]; [`Error::Option`] if photos and patterns have different sizes and no matrix is in
    /// memory.
    pub fn capture_model(&mut self, photos: usize, block: usize) -> Result<SavedModel> {
        let (resolution, projector) = (self.resolution(), self.projector_resolution());
        let maps = self.maps_to_projector()?;
        if resolution != projector && maps.is_empty() {
            return Err(Error::option("--projector-size", format!(
                    "photos have {resolution} pixels and patterns {projector}, and without a matrix the map between them is not known"
                )).help("give both one size, or use --operator replay"));
        }
        // A matrix that came without its direct light keeps that in the model.
        let is_apart = resolution == projector || self.knows_direct();
        self.transport()?;
        let (name, unit) = (self.name(), self.unit().to_owned());
        let seed = self.seed();
        let channels = self.photos(|lab| {
            let ambient = lab.ambient()?;
            let direct = match is_apart {
                true => lab.direct_parts()?,
                false => vec![DirectPart::Diagonal(Vec::new()); lab.channels().count()],
            };
            // The block is limited by the number of photos and by the number of pixels.
            let block = block.min(photos).min(projector.pixels());
            let beside = smooth_starts(projector, 0..block.max(1) - 1, seed);
            let options = LowRankCapture { photos, start: None, beside, map: None };
            lab.expect(photos);
            let mut operators = lab.operators(if is_apart { Part::Global } else { Part::Full })?;
            Ok((ambient, capture_channels(&mut operators, direct, &options, &maps)?))
        });
        let (ambient, channels) = channels?;
        Ok(SavedModel { channels, ambient, resolution, projector, unit, source: name })
    }

    /// The direct light of each channel, stored as a diagonal if its matrix is diagonal.
    fn direct_parts(&mut self) -> Result<Vec<DirectPart>> {
        if let Some(diagonals) = self.direct_diagonal()? {
            return Ok(diagonals.into_iter().map(DirectPart::Diagonal).collect());
        }
        if let Some(parts) = self.measured_direct()? {
            return Ok(parts);
        }
        match self.matrices_of(Part::Direct)? {
            Some(matrices) => Ok(matrices.into_iter().map(DirectPart::Matrix).collect()),
            None => self.reference_operators(Part::Direct)?.iter_mut().map(|of| diagonal_of(of)).collect(),
        }
    }

    /// The direct light of a rig. It is not diagonal, because the lenses spread the light.
    fn measured_direct(&mut self) -> Result<Option<Vec<DirectPart>>> {
        self.with_measurement(|measurement| {
            let channels = 0..measurement.channels();
            channels.map(|channel| direct_part(measurement.direct_rows(channel)?)).collect()
        })
    }
}

fn direct_part(rows: Vec<Vec<(u32, f64)>>) -> Result<DirectPart> {
    let is_diagonal =
        |(pixel, row): (usize, &Vec<(u32, f64)>)| row.iter().all(|entry| entry.0 as usize == pixel);
    if rows.iter().enumerate().all(is_diagonal) {
        let own = |row: &Vec<(u32, f64)>| row.iter().map(|entry| entry.1).sum();
        return Ok(DirectPart::Diagonal(rows.iter().map(own).collect()));
    }
    let mut starts = vec![0];
    rows.iter().for_each(|row| starts.push(starts[starts.len() - 1] + row.len()));
    let (columns, weights) = rows.iter().flatten().copied().unzip();
    Csr::new(rows.len(), starts, columns, weights).map(DirectPart::Matrix)
}
