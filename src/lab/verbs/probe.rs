//! Photos that contain only selected light paths.

use crate::analysis::Probing;
use crate::analysis::probe::probe;
use crate::error::Result;
use crate::lab::ProbedLight;
use crate::lab::{Lab, LabOperator};
use crate::transport::Part;

impl Lab {
    /// Probes every channel with `photos` random patterns. Fails as [`probe`] and [`Lab::operators`].
    pub fn probe(&mut self, probing: Probing, photos: usize) -> Result<ProbedLight> {
        probing.check()?;
        self.allow_photos(photos);
        let (resolution, seed) = (self.resolution(), self.seed());
        let mut operators = self.operators(Part::Full)?;
        self.expect(probing.photos(photos));
        let one = |operator: &mut LabOperator| probe(operator, resolution, probing, photos, seed);
        let found = self.photos(|_| operators.iter_mut().map(one).collect::<Result<Vec<_>>>())?;
        let matrices = self.traced_matrices(Part::Full)?;
        let truth = matrices.map(|of| of.iter().map(|matrix| probing.exact(matrix, resolution)).collect());
        Ok(ProbedLight::new(probing, found, truth))
    }
}
