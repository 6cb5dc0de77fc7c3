//! Single photos of a laboratory, their costs, and the labels of their pixels.

use std::sync::{Arc, Mutex};

use super::settings::OperatorChoice;
use super::source::{Source, scenes_only};
use super::transport::{LightTransport, require_photo_memory};
use super::{Lab, Log, SourceKind, Truth, lock};
use crate::bench::rig_check;
use crate::error::{Error, Result};
use crate::finding::{Finding, merge};
use crate::image::Image;
use crate::measure::{Measurement, RigRecord};
use crate::observer::{Estimate, Level, Step};
use crate::report::contact_sheet::ContactSheet;
use crate::scene::view::reason_for_darkness;
use crate::transport::Noise;

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
    /// The errors of [`Lab::photo`]; [`crate::Error::Option`] naming `--operator` for other sources than a scene, and `--size` if the photo takes more
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
            SourceKind::Scene => None,
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

    /// The photo of a pattern, in [`Lab::unit`], with the ambient light. A rig's photo excludes the ambient light unless the rig file says
    /// otherwise. A pattern of one channel lights all channels.
    ///
    /// # Errors
    /// [`crate::Error::Dimension`] when the pattern does not have the pixels or channels of the projector; the errors of [`Lab::operator`].
    pub fn photo(&mut self, pattern: &Image) -> Result<Image> {
        lock(self.transport()?).photograph(pattern)
    }

    /// Works like [`Lab::photo`], with the standard error of each sample if the source knows it. A scene is traced for this photo, since its matrix
    /// does not contain the errors of single photos. Fails as [`Lab::photo`].
    pub fn photo_with_error(&mut self, pattern: &Image) -> Result<(Image, Option<Image>)> {
        if let Source::Scene(scene) = &self.source {
            let mut traced =
                LightTransport::of_retraced(scene, &self.settings, self.channels, &self.observer)?;
            return traced.photograph_with_error(pattern);
        }
        lock(self.transport()?).photograph_with_error(pattern)
    }

    /// The photo under an all-ones pattern. Fails as [`Lab::operator`].
    pub fn white(&mut self) -> Result<Image> {
        lock(self.transport()?).white()
    }

    /// The photo without projector light. Fails as [`Lab::operator`].
    pub fn ambient(&mut self) -> Result<Image> {
        lock(self.transport()?).ambient()
    }

    /// Photos of red, green and blue alone, in each of the camera's channels, without ambient light: `[primary][channel][pixel]`.
    ///
    /// # Errors
    /// [`crate::Error::Option`] if projector or camera is gray; the errors of [`Lab::operator`].
    pub fn primaries(&mut self) -> Result<[[Vec<f64>; 3]; 3]> {
        lock(self.transport()?).primaries()
    }

    /// Every photo so far, as small pictures.
    pub fn contact_sheet(&self) -> ContactSheet {
        lock(&self.sheet).clone()
    }

    /// Tells the observer how many photos of each channel will be taken.
    pub(crate) fn expect(&self, photos: usize) {
        let total = (photos * self.channels.count()) as u64;
        let step = Step { stage: "photos", done: 0, total, estimate: Estimate::None };
        // A request to stop is honoured at the first photo.
        let _ = self.observer.0.step(&step);
    }

    /// Runs `work`, which takes photos. Records its time, and the costs on a rig, even if `work` fails.
    pub(crate) fn photos<T>(&mut self, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.photos_with(|_| true, work)
    }

    /// Works like [`Self::photos`]. `is_complete` says whether the photos are enough to know noise and drift.
    pub(crate) fn photos_with<T>(
        &mut self,
        is_complete: impl FnOnce(&T) -> bool,
        work: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let found = self.timed("photos", work);
        let is_complete = found.as_ref().is_ok_and(is_complete);
        let record = self.transport.as_ref().map(|transport| lock(transport).record(is_complete));
        let record = record.transpose()?.flatten();
        // A replayed run keeps the findings from all of its photos, even if this request does not need all of them.
        self.findings = self.source.findings();
        if let Some(mut rig) = record {
            merge(&mut self.findings, std::mem::take(&mut rig.findings));
            rig.findings.clone_from(&self.findings);
            self.observer.costs(&rig);
            if let Some(run) = &mut self.run {
                run.manifest.rig = Some(rig);
            }
        }
        found
    }

    /// The costs of a rig so far, with the noise and drift that its photos show; `None` for other sources. Fails as [`Lab::operator`].
    pub fn costs(&mut self) -> Result<Option<RigRecord>> {
        lock(self.transport()?).record(true)
    }

    /// Findings about the rig from the photos of the last verb: whether its camera sees the projector, whether its light is steady, and
    /// whether each light path has the same strength in both directions. Empty for other sources.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Calls `work` with the rig's measurement; `None` if no rig takes the photos. Fails as [`Lab::operator`] and `work`.
    pub fn with_measurement<T>(
        &mut self,
        work: impl FnOnce(&mut Measurement) -> Result<T>,
    ) -> Result<Option<T>> {
        let mut transport = lock(self.transport()?);
        transport.rig().map(|rig| work(&mut rig.measurement)).transpose()
    }

    /// Findings about unrequested behaviour of a rig's devices, such as an automatic iris. The devices are opened for this check alone,
    /// before they are opened to take photos. The list is empty if they cannot be opened.
    pub(crate) fn faults_of_devices(&mut self) -> Result<Vec<Finding>> {
        self.transport = None;
        let Source::Rig(rig) = &self.source else { return Ok(Vec::new()) };
        let known = rig.is_calibrated.then_some(&rig.calibration);
        let mut frames = match rig.opener()(None) {
            Ok(frames) => frames,
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // The audit opens the devices next, and reports the error then.
            Err(_) => return Ok(Vec::new()),
        };
        rig_check::faults(&rig.file, known, &mut *frames)
    }

    /// The region that the centre of each pixel of a scene sees, row by row; 255 marks a pixel that sees none.
    ///
    /// # Errors
    /// [`crate::Error::Data`] if there is no scene; [`crate::Error::Scene`] for more than 255 regions.
    pub fn labels(&self) -> Result<Vec<u8>> {
        self.scene_source()?.labels(self.resolution())
    }

    /// The true labels by the scene's author, if there are any. Fails as [`Lab::labels`].
    pub fn truth(&self) -> Result<Option<Truth>> {
        self.source.truth()
    }

    /// The true labels that a segmentation supplied, or else [`Lab::truth`]. Fails as [`Lab::labels`].
    pub fn known_truth(&self) -> Result<Option<Truth>> {
        match &self.kept_truth {
            Some(truth) => Ok(Some(truth.clone())),
            None => self.truth(),
        }
    }

    /// Makes the journal of the run keep the true labels, so that a replay of the run knows them. Call it before the first photo.
    pub(crate) fn keep_truth(&mut self, truth: Option<&Truth>) {
        self.kept_truth = truth.cloned();
    }

    /// Warns if the photos of a scene will be black or nearly so, and gives the reason.
    pub(super) fn warn_of_darkness(&self) {
        let Ok(source) = self.scene_source() else { return };
        let scene = &source.scene;
        if let Some(reason) = reason_for_darkness(scene, source.settings.resolution) {
            let message = format!("warning: {}: {reason}", scene.path.display());
            self.observer.log(Level::Warning, &message);
        }
    }
}

fn norm(image: &Image) -> f64 {
    image.samples().iter().map(|&sample| f64::from(sample).powi(2)).sum::<f64>().sqrt()
}
