//! The light transport matrix, traced or photographed column by column.

use crate::analysis::brute_force;
use crate::error::{Error, Result};
use crate::lab::{Lab, LabOperator, SourceKind};
use crate::sparse::Csr;
use crate::transport::{Assembled, Bounces, Part};

impl Lab {
    /// The light transport matrix of every channel, `[channel]`, each with a name for its file. The matrix of a scene is traced, and the
    /// matrix of a rig is photographed column by column. With `split_bounces`, three matrices replace the matrix of `part`: the first
    /// bounce, the second bounce, and all later bounces. The laboratory must then have been opened with
    /// [`split_bounces`](crate::lab::Settings::split_bounces). `photos` is the number of photos that a rig may take; the default is 4096.
    ///
    /// # Errors
    /// [`Error::Option`] for a request that the source does not support; the errors of [`Lab::operator`].
    pub fn matrices(
        &mut self,
        part: Part,
        split_bounces: bool,
        photos: Option<usize>,
    ) -> Result<Vec<Vec<(&'static str, Csr)>>> {
        if self.run.is_none() {
            self.warn_of_darkness();
        }
        if matches!(self.kind(), SourceKind::Scene | SourceKind::Matrix) {
            return self.matrices_in_memory(part, split_bounces, photos);
        }
        if split_bounces {
            return Err(Error::option(
                "--split-bounces",
                "a photo does not tell how often its light has bounced",
            )
            .help("give --part direct or --part global, which are told apart by shifted patterns"));
        }
        let resolution = self.projector_resolution();
        brute_force::check_photos(resolution, self.channels(), photos)?;
        let operators = self.operators(part)?;
        self.expect(resolution.pixels());
        let columns = |mut operator: LabOperator| Ok(vec![("", brute_force::columns(&mut operator)?)]);
        self.photos(|_| operators.into_iter().map(columns).collect())
    }

    fn matrices_in_memory(
        &mut self,
        part: Part,
        split_bounces: bool,
        photos: Option<usize>,
    ) -> Result<Vec<Vec<(&'static str, Csr)>>> {
        if photos.is_some() {
            return Err(Error::option("--photos", "a scene's matrix is traced, not photographed")
                .help("leave it out; --spp says how many light paths are traced"));
        }
        let count = self.channels().count();
        if !split_bounces {
            let matrix = |channel| Ok(vec![("", self.matrix(part, channel)?)]);
            return (0..count).map(matrix).collect();
        }
        let Some(traced) = self.assembled()? else {
            return Err(Error::option("--split-bounces", "the bounces of this matrix are not known")
                .help("leave it out, or give a scene"));
        };
        bounces_apart(&traced)
    }

    /// One part of the traced matrix, `[channel]`. Returns `None` if no matrix was traced.
    pub(crate) fn traced_matrices(&mut self, part: Part) -> Result<Option<Vec<Csr>>> {
        let Some(traced) = self.assembled()? else { return Ok(None) };
        let channels = 0..traced.matrix.channels().count();
        channels.map(|channel| traced.matrix.to_csr(part, channel)).collect::<Result<_>>().map(Some)
    }
}

/// Separate matrices of the first bounce, the second bounce and all later bounces, `[channel]`, each with a name for its file.
pub(super) fn bounces_apart(traced: &Assembled) -> Result<Vec<Vec<(&'static str, Csr)>>> {
    let channel = |channel| {
        let mut matrices = vec![("_direct", traced.matrix.to_csr(Part::Direct, channel)?)];
        for layer in &*traced.matrix.layers()? {
            match layer.bounces() {
                // The direct part already contains the first bounce.
                Bounces::One => {}
                Bounces::Two => matrices.push(("_second", layer.to_csr(channel)?)),
                Bounces::Rest | Bounces::Global => matrices.push(("_rest", layer.to_csr(channel)?)),
            }
        }
        Ok(matrices)
    };
    (0..traced.matrix.channels().count()).map(channel).collect()
}
