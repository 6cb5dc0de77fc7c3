//! A single photo, taken in the cheapest way.

use crate::error::Result;
use crate::image::Image;
use crate::lab::Lab;
use crate::lab::lock::lock;
use crate::lab::settings::OperatorChoice;
use crate::lab::source::{Source, scenes_only};
use crate::lab::transport::{LightTransport, require_photo_memory};
use crate::measure::RigRecord;
use crate::transport::Noise;

use std::sync::{Arc, Mutex};

/// A photo and its errors.
#[derive(Clone, Debug)]
pub struct SinglePhoto {
    /// The photo.
    pub photo: Image,
    /// The standard error of each sample. It is known for a photo that was traced separately or taken by a rig.
    pub standard_error: Option<Image>,
    /// The relative error, if it is known.
    pub noise: Option<f64>,
    /// Whether `noise` belongs to the white photo by the same matrix, rather than to this photo.
    pub is_of_white: bool,
    /// The costs on a rig.
    pub rig: Option<RigRecord>,
}

impl Lab {
    /// Takes one photo. The photo of a scene is traced separately unless the matrix is in the cache, since a matrix for a single photo
    /// costs more. A rig's photo contains only the light of the pattern, unless the rig file says otherwise.
    ///
    /// # Errors
    /// As [`Lab::photo`]; [`crate::Error::Option`] naming `--operator` for other sources than a scene, and `--size` if the photo takes more
    /// than [`OperatorSettings::memory`](crate::lab::OperatorSettings::memory).
    pub fn single_photo(&mut self, pattern: &Image) -> Result<SinglePhoto> {
        if self.run.is_none() {
            self.warn_of_darkness();
        }
        if let Source::Scene(scene) = &self.source {
            if self.transport.is_none() && self.settings.operator.choice == OperatorChoice::Auto {
                let transport = match scene.cached(self.channels)? {
                    Some(traced) => LightTransport::of_assembled(traced, &self.observer),
                    None => {
                        require_photo_memory(scene, self.settings.memory_limit(), self.channels)?;
                        LightTransport::of_retraced(scene, &self.settings, self.channels, &self.observer)?
                    }
                };
                self.transport = Some(Arc::new(Mutex::new(transport)));
            }
        } else if self.settings.operator.choice != OperatorChoice::Auto {
            return Err(scenes_only("--operator"));
        }
        let white: Option<Noise> = self.noise()?;
        let (photo, standard_error) = lock(self.transport()?).photograph_with_error(pattern)?;
        let of_photo = standard_error.as_ref().map(|error| norm(error) / norm(&photo));
        let of_photo = of_photo.filter(|noise| noise.is_finite());
        let rig = match self.kind() {
            crate::lab::SourceKind::Scene => None,
            _ => self.costs()?,
        };
        if let (Some(rig), Some(run)) = (&rig, &mut self.run) {
            run.manifest.rig = Some(rig.clone());
        }
        Ok(SinglePhoto {
            noise: white.as_ref().map(|noise| noise.white_relative).or(of_photo),
            is_of_white: white.is_some(),
            photo,
            standard_error,
            rig,
        })
    }
}

fn norm(image: &Image) -> f64 {
    image.samples().iter().map(|&sample| f64::from(sample).powi(2)).sum::<f64>().sqrt()
}
