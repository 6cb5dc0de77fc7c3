//! What a scene would take on several machines.

use super::super::Lab;
use crate::error::{Error, Result};
use crate::lab::source::Source;
use crate::transport::{Network, Probe, Scaled};

/// What several processes would take, from a probe of this machine.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Scaling {
    /// The constants that were measured.
    pub probe: Probe,
    /// The network that the prediction assumes.
    pub network: Network,
    /// A prediction for each number of processes.
    pub processes: Vec<Scaled>,
}

impl Lab {
    /// Predicts memory and time of `photos` photos of a scene by a Krylov method on so many processes, each on a machine like this one. A small
    /// matrix is traced and multiplied for it, which takes seconds.
    ///
    /// # Errors
    /// [`Error::Option`] where the source is no scene; those of tracing.
    pub fn scaling(&self, processes: &[usize], photos: usize, network: Network) -> Result<Scaling> {
        let Source::Scene(scene) = &self.source else {
            return Err(Error::Option {
                option: "--ranks".into(),
                fault: "only scenes are traced by several processes".into(),
                help: "give a scene (.glb, .gltf, .obj)".into(),
            });
        };
        let (settings, channels) = (&scene.settings, self.channels);
        let probe = Probe::measure(&mut scene.tracer(), settings)?;
        let symmetric = scene.is_symmetric();
        let scaled = |&count: &usize| probe.scaled(settings, channels, symmetric, photos, (count, network));
        Ok(Scaling { probe, network, processes: processes.iter().map(scaled).collect() })
    }
}
