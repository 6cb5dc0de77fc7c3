//! The light transport of a laboratory. It is opened on the first request, and is returned as operators.

use std::sync::{Arc, Mutex};
use std::time::Instant;

use super::lock;
use super::source::Source;
use super::transport::{self, LightTransport};
use super::{Lab, LabOperator};
use crate::error::{Error, Result};
use crate::io::manifest::ProductsOn;
use crate::operator::{Operator, Symmetry, product};
use crate::render::TraceSummary;
use crate::sparse::Csr;
use crate::transport::{Assembled, Noise, Part};

impl Lab {
    /// One part of the light transport, as a linear operator on the first channel. Fails if the scene cannot be traced, the rig cannot be
    /// opened, or the run cannot be read.
    pub fn operator(&mut self, part: Part) -> Result<LabOperator> {
        self.channel_operator(part, 0)
    }

    /// One part of the light transport, as a linear operator for each channel. Fails as [`Lab::operator`].
    pub fn operators(&mut self, part: Part) -> Result<Vec<LabOperator>> {
        let channels = lock(self.transport()?).shape().channels;
        (0..channels).map(|channel| self.channel_operator(part, channel)).collect()
    }

    pub(super) fn channel_operator(&mut self, part: Part, channel: usize) -> Result<LabOperator> {
        let transport = Arc::clone(self.transport()?);
        Ok(LabOperator::new(&transport, part, channel, &self.observer, Some(&self.sheet)))
    }

    /// Operators as [`Lab::operators`], for comparisons with a truth. Their products are neither shown nor recorded as photos of the run.
    pub fn reference_operators(&mut self, part: Part) -> Result<Vec<LabOperator>> {
        let transport = Arc::clone(self.transport()?);
        let channels = lock(&transport).shape().channels;
        let operator = |channel| LabOperator::new(&transport, part, channel, &self.observer, None);
        Ok((0..channels).map(operator).collect())
    }

    /// Traces the scene or opens the rig, unless this was already done.
    pub(crate) fn prepare(&mut self) -> Result<()> {
        self.transport().map(drop)
    }

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

    /// Refuses a rig whose camera does not see the projector, and an uncalibrated rig whose light is not proportional to the projected
    /// levels and the camera's counts. The answers of such a rig would be wrong without a warning. An audit accepts such a rig, since an
    /// audit finds these faults.
    fn trusted(&self, mut transport: LightTransport) -> Result<LightTransport> {
        let Some(measured) = transport.rig().filter(|_| !self.audits) else { return Ok(transport) };
        measured.measurement.sight()?.require()?;
        let is_tested = matches!(&self.source, Source::Rig(rig) if !rig.is_calibrated);
        match measured.measurement.check_pattern(!is_tested) {
            // The check needs a photo of a test pattern. The journal of an old run lacks this photo.
            Err(Error::NotTaken { .. }) => {}
            map => {
                let map = map?;
                map.require()?;
                measured.map = Some(map);
            }
        }
        Ok(transport)
    }

    /// Records how long the light transport took to open, and the known facts about its matrix.
    fn prepared(&mut self, transport: &LightTransport, start: Instant) {
        let Some(run) = &mut self.run else { return };
        run.manifest.record(self.source.preparation(), start.elapsed());
        if let Some(traced) = transport.assembled() {
            run.manifest.noise = traced.noise.as_ref().map(Into::into);
            run.manifest.products =
                Some(if traced.is_on_gpu() { ProductsOn::Device } else { ProductsOn::Cpu });
        }
    }

    /// Disables the checks of a rig's light from now on, for a caller that itself compares the rig's photos with the truth.
    pub(crate) fn unexamined(&mut self) {
        self.audits = true;
    }

    /// Whether photos are kept in the journal of the run.
    pub(crate) fn keeps_photos(&self) -> bool {
        self.keeps_photos
    }

    pub(crate) fn without_journal(&mut self) {
        if self.keeps_photos && self.run.is_some() {
            self.transport = None;
        }
        self.keeps_photos = false;
    }

    /// The product of a part of the light with a white pattern, for each channel.
    pub(crate) fn white_of(&mut self, part: Part) -> Result<Vec<Vec<f64>>> {
        let white = |mut operator: LabOperator| {
            let pattern = vec![1.0; operator.cols()];
            product(&mut operator, &pattern)
        };
        self.reference_operators(part)?.into_iter().map(white).collect()
    }

    /// The traced matrix, shared and not copied; `None` if photos are not products with a traced matrix. Fails as [`Lab::operator`].
    pub fn assembled(&mut self) -> Result<Option<Arc<Assembled>>> {
        Ok(lock(self.transport()?).assembled().cloned())
    }

    /// One part and channel of the light transport matrix, `rows × cols`, without a photo. The source is a scene or a matrix file. The
    /// matrix of a rig is photographed column by column instead: [`crate::analysis::brute_force`].
    ///
    /// # Errors
    /// [`Error::Option`] if the source has no matrix; the errors of [`Lab::operator`].
    pub fn matrix(&mut self, part: Part, channel: usize) -> Result<Csr> {
        if let Source::Matrix(source) = &self.source {
            return source.part(part, channel);
        }
        match self.assembled()? {
            Some(traced) => traced.matrix.to_csr(part, channel),
            None => Err(Error::option("SOURCE", "this source takes photos, and has no matrix in memory")
                .help("photograph the matrix column by column, or open a scene with the replay operator")),
        }
    }

    /// The direct light of each channel, if a matrix in memory holds it as a diagonal. Fails as [`Lab::operator`].
    pub fn direct_diagonal(&mut self) -> Result<Option<Vec<Vec<f64>>>> {
        if let Source::Matrix(source) = &self.source {
            return Ok(source.direct_diagonal());
        }
        Ok(self.assembled()?.and_then(|traced| transport::direct_diagonal(&traced)))
    }

    /// The noise of the traced matrix, if this noise is known. Fails as [`Lab::operator`].
    pub fn noise(&mut self) -> Result<Option<Noise>> {
        Ok(lock(self.transport()?).assembled().and_then(|traced| traced.noise.clone()))
    }

    /// The expected norm `‖E‖_F / √n` of the error in a product of `part` with a vector of norm 1, in the first channel. The error is due
    /// to the noise of a traced matrix, also in a run of a scene. Returns `None` if no matrix was traced: the operators of a rig state the
    /// errors of their products ([`Operator::standard_errors`]), and explicit matrices have no errors. Fails as [`Lab::operator`].
    pub fn product_noise(&mut self, part: Part) -> Result<Option<f64>> {
        lock(self.transport()?).product_noise(part)
    }

    /// The cost of tracing the matrix, if it was traced. Fails as [`Lab::operator`].
    pub fn trace_summary(&mut self) -> Result<Option<TraceSummary>> {
        Ok(lock(self.transport()?).assembled().map(|traced| traced.summary))
    }

    /// Whether the light transport matrix is symmetric, as for a coaxial rig. Fails as [`Lab::operator`].
    pub fn is_symmetric(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).shape().symmetry == Symmetry::Symmetric)
    }

    /// Whether photos cost only computing time. This holds for every source except a rig. Fails as [`Lab::operator`].
    pub fn is_simulated(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).is_simulated())
    }
}
