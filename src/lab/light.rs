//! The light transport of a laboratory: opened when it is first needed, handed out as operators, and what is known of its matrix.

use std::sync::{Arc, Mutex};
use std::time::Instant;

use super::lock::lock;
use super::source::Source;
use super::transport::{self, LightTransport};
use super::{Lab, LabOperator};
use crate::error::{Error, Result};
use crate::io::manifest::ProductsOn;
use crate::operator::{Operator, Symmetry};
use crate::render::TraceSummary;
use crate::sparse::Csr;
use crate::transport::{Assembled, ExplicitMatrix, Noise, Part};

impl Lab {
    /// One part of the light transport, as a linear operator: the first channel.
    ///
    /// # Errors
    /// What keeps the scene from being traced, the rig from being opened or the run from being read.
    pub fn operator(&mut self, part: Part) -> Result<LabOperator> {
        self.channel_operator(part, 0)
    }

    /// One part of the light transport, as a linear operator for each channel.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn operators(&mut self, part: Part) -> Result<Vec<LabOperator>> {
        let channels = lock(self.transport()?).shape().channels;
        (0..channels).map(|channel| self.channel_operator(part, channel)).collect()
    }

    pub(super) fn channel_operator(&mut self, part: Part, channel: usize) -> Result<LabOperator> {
        let transport = Arc::clone(self.transport()?);
        Ok(LabOperator::new(&transport, part, channel, &self.observer, Some(&self.sheet)))
    }

    /// As [`Lab::operators`], for products that are not photos of the run: comparisons with a truth. They are neither shown nor recorded.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn reference_operators(&mut self, part: Part) -> Result<Vec<LabOperator>> {
        let transport = Arc::clone(self.transport()?);
        let channels = lock(&transport).shape().channels;
        let operator = |channel| LabOperator::new(&transport, part, channel, &self.observer, None);
        Ok((0..channels).map(operator).collect())
    }

    /// Traces the scene or opens the rig, where that was not done yet.
    pub(crate) fn prepare(&mut self) -> Result<()> {
        self.transport().map(drop)
    }

    /// The light transport, opened now if it is not.
    pub(super) fn transport(&mut self) -> Result<&Arc<Mutex<LightTransport>>> {
        let transport = match self.transport.take() {
            Some(transport) => transport,
            None => {
                let start = Instant::now();
                let run = self.run.as_ref().filter(|_| self.keeps_photos);
                let run = run.map(|run| (run, self.kept_truth.as_ref()));
                let opened =
                    LightTransport::open(&self.source, &self.settings, self.channels, run, &self.observer)?;
                self.prepared(&opened, start);
                Arc::new(Mutex::new(self.trusted(opened)?))
            }
        };
        Ok(self.transport.insert(transport))
    }

    /// Refuses a rig that does not see its projector, and one that was not calibrated and whose light is not in proportion to its levels and
    /// counts: its answers would be wrong, and nothing would say so. An audit finds that itself.
    fn trusted(&self, mut transport: LightTransport) -> Result<LightTransport> {
        let Some(measured) = transport.rig().filter(|_| !self.audits) else { return Ok(transport) };
        measured.measurement.sight()?.require()?;
        let is_tested = matches!(&self.source, Source::Rig(rig) if !rig.is_calibrated);
        match measured.measurement.check_pattern(!is_tested) {
            // A run that is asked again looks at its own photo, so that white is photographed again after the same patterns as before. Those of
            // earlier programs have none.
            Err(Error::NotTaken { .. }) => {}
            map => {
                let map = map?;
                map.require()?;
                measured.map = Some(map);
            }
        }
        Ok(transport)
    }

    /// Records how long the light transport took to open, and what is known of its matrix.
    fn prepared(&mut self, transport: &LightTransport, start: Instant) {
        let Some(run) = &mut self.run else { return };
        run.manifest.record(self.source.preparation(), start.elapsed());
        if let Some(traced) = transport.assembled() {
            run.manifest.noise = traced.noise.as_ref().map(Into::into);
            run.manifest.products =
                Some(if traced.is_on_gpu() { ProductsOn::Device } else { ProductsOn::Cpu });
        }
    }

    /// From now on a rig answers whatever its light looks like: the question is what it sees, and the answer is compared with the truth.
    pub(crate) fn unexamined(&mut self) {
        self.audits = true;
    }

    /// From now on photos are not kept in the journal of the run.
    pub(crate) fn without_journal(&mut self) {
        if self.keeps_photos && self.run.is_some() {
            self.transport = None;
        }
        self.keeps_photos = false;
    }

    /// Products of a part with white, one for each channel.
    pub(crate) fn white_of(&mut self, part: Part) -> Result<Vec<Vec<f64>>> {
        let white = |mut operator: LabOperator| -> Result<Vec<f64>> {
            let mut photo = vec![0.0; operator.rows()];
            operator.apply(&vec![1.0; operator.cols()], &mut photo)?;
            Ok(photo)
        };
        self.reference_operators(part)?.into_iter().map(white).collect()
    }

    /// The traced scene, where photos are products with its matrix: the matrix, the ambient light, the noise. It is shared, not copied.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn assembled(&mut self) -> Result<Option<Arc<Assembled>>> {
        Ok(lock(self.transport()?).assembled().cloned())
    }

    /// One part and channel of the light transport matrix, `rows × cols`, without a photo: that of a scene or of a matrix file. A rig's is
    /// photographed column by column: [`crate::analysis::brute_force`].
    ///
    /// # Errors
    /// [`Error::Option`] where the source has no matrix; those of [`Lab::operator`].
    pub fn matrix(&mut self, part: Part, channel: usize) -> Result<Csr> {
        if let Source::Matrix(source) = &self.source {
            return match part {
                Part::Full => Ok(source.matrix.clone()),
                _ => ExplicitMatrix::part_of(&source.matrix, part),
            };
        }
        match self.assembled()? {
            Some(traced) => traced.matrix.to_csr(part, channel),
            None => Err(Error::Option {
                option: "SOURCE".into(),
                fault: "this source takes photos, and has no matrix in memory".into(),
                help: "photograph the matrix column by column, or open a scene with the replay operator"
                    .into(),
            }),
        }
    }

    /// The direct light of each channel, where a traced matrix has it as a diagonal.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn direct_diagonal(&mut self) -> Result<Option<Vec<Vec<f64>>>> {
        Ok(self.assembled()?.and_then(|traced| transport::direct_diagonal(&traced)))
    }

    /// The noise of the traced matrix, where it is known.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn noise(&mut self) -> Result<Option<Noise>> {
        Ok(lock(self.transport()?).assembled().and_then(|traced| traced.noise.clone()))
    }

    /// The expected norm of the error that the noise of a traced matrix leaves in a product of `part` with a vector of
    /// norm 1, in the first channel: `‖E‖_F / √n`. Also known of a run of a scene. `None` where no matrix was traced: a rig's operators state the errors
    /// of their products ([`Operator::standard_errors`]), and explicit matrices have none.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn product_noise(&mut self, part: Part) -> Result<Option<f64>> {
        lock(self.transport()?).product_noise(part)
    }

    /// What the tracing of the matrix took, where there is one.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn trace_summary(&mut self) -> Result<Option<TraceSummary>> {
        Ok(lock(self.transport()?).assembled().map(|traced| traced.summary))
    }

    /// Whether the light transport matrix is symmetric: that of a coaxial rig.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn is_symmetric(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).shape().symmetry == Symmetry::Symmetric)
    }

    /// Whether photos cost nothing but computing: those of everything but a rig.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn is_simulated(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).is_simulated())
    }
}
