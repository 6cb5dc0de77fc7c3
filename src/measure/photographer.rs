//! From a frame to what the camera saw of it: the stages on the camera's pixels, in their order.

use std::collections::HashSet;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::sync::Arc;

use super::ambient::Blacks;
use super::averaging::{Exposed, average};
use super::drift::Drift;
use super::exposure;
use super::frame_source::FrameSource;
use super::hdr::{Sighting, merge};
use super::options::{MOST_TAKES, MeasureOptions};
use super::response::CameraCurve;
use crate::error::Result;
use crate::rig::Frame;

/// Takes photos: averaging, HDR, ambient, camera response, drift. What it shoots follows from the options, from the frames
/// that it is asked for, and from what earlier frames showed; from nothing else, so that a journal can replay it.
pub(super) struct Photographer {
    pub(super) camera: Exposer,
    basics: Option<Basics>,
    /// Patterns since the last white.
    since_white: u32,
}

/// What all photos need, taken before the first.
pub(super) struct Basics {
    /// Seconds, the shortest first.
    pub(super) exposures: Vec<f64>,
    /// The black photo at each.
    pub(super) blacks: Blacks,
    /// The white photo.
    pub(super) white: Arc<Sighting>,
    /// Share of the samples that matter which some exposure of white saturates.
    pub(super) saturated: f64,
    /// The lamp since.
    pub(super) drift: Drift,
    /// White at the shortest exposure: what sentinels are compared with.
    reference: Exposed,
}

/// Shoots frames at several exposures, and merges.
pub(super) struct Exposer {
    pub(super) shots: Box<dyn FrameSource>,
    pub(super) curve: CameraCurve,
    /// Which camera pixels matter.
    pub(super) used: Vec<bool>,
    /// The frame that lights all that is seen.
    pub(super) white: Arc<Frame>,
    /// The frame that lights nothing.
    pub(super) black: Arc<Frame>,
    pub(super) options: MeasureOptions,
    /// Hashes of the frames shown so far.
    pub(super) shown: HashSet<u64>,
}

impl Photographer {
    pub(super) fn new(camera: Exposer) -> Self {
        Self { camera, basics: None, since_white: 0 }
    }

    /// Exposures, black photo and white photo; taken now if they are not there yet.
    pub(super) fn basics(&mut self) -> Result<&mut Basics> {
        Ok(self.parts()?.0)
    }

    /// The basics, and the camera to work with by what they say.
    pub(super) fn parts(&mut self) -> Result<(&mut Basics, &mut Exposer)> {
        let basics = match &mut self.basics {
            Some(basics) => basics,
            missing => missing.insert(self.camera.basics()?),
        };
        Ok((basics, &mut self.camera))
    }

    /// What the camera sees of `frame`.
    pub(super) fn photograph(&mut self, frame: &Arc<Frame>) -> Result<Arc<Sighting>> {
        let due = self.camera.options.sentinel_every;
        let lamp_is_due = due > 0 && self.since_white >= due;
        let (basics, camera) = self.parts()?;
        if *frame == camera.white {
            return Ok(Arc::clone(&basics.white));
        }
        if lamp_is_due {
            camera.watch_lamp(basics)?;
        }
        let mut seen = camera.see(frame, &basics.exposures, &basics.blacks)?.0;
        seen.scale(1.0 / basics.drift.light(seen.started));
        self.since_white = if lamp_is_due { 1 } else { self.since_white + 1 };
        Ok(Arc::new(seen))
    }
}

impl Exposer {
    fn basics(&mut self) -> Result<Basics> {
        let (white, black) = (Arc::clone(&self.white), Arc::clone(&self.black));
        let exposures = if self.options.exposures.is_empty() {
            exposure::choose(&mut *self.shots, &self.curve, &white, &self.used, self.options.brackets)?
        } else {
            self.options.exposures.clone()
        };
        let mut blacks = Blacks::default();
        if self.options.ambient {
            self.note(&black);
            let takes = self.options.black_takes;
            blacks = Blacks::take(&mut *self.shots, &self.curve, &black, &exposures, takes)?;
        }
        let (seen, mut exposed) = self.see(&white, &exposures, &blacks)?;
        let saturated = self.saturated(&exposed);
        let drift = Drift::new(seen.started);
        let reference = exposed.swap_remove(0);
        Ok(Basics { exposures, blacks, white: Arc::new(seen), saturated, drift, reference })
    }

    fn saturated(&self, exposed: &[Exposed]) -> f64 {
        let channels = self.shots.camera().channels;
        let used = || (0..self.used.len() * channels).filter(|sample| self.used[sample / channels]);
        let lost = used().filter(|&sample| exposed.iter().any(|exposed| exposed.saturated[sample])).count();
        lost as f64 / used().count().max(1) as f64
    }

    /// A frame at all exposures, merged and apart.
    fn see(
        &mut self,
        frame: &Arc<Frame>,
        exposures: &[f64],
        blacks: &Blacks,
    ) -> Result<(Sighting, Vec<Exposed>)> {
        self.note(frame);
        let takes = 0..self.options.takes;
        let exposed: Vec<Exposed> = exposures
            .iter()
            .map(|&exposure| average(&mut *self.shots, &self.curve, frame, exposure, takes.clone()))
            .collect::<Result<_>>()?;
        let merged =
            merge(&exposed, &blacks.exposed, &self.curve, &self.used, self.shots.camera().resolution)?;
        Ok((merged, exposed))
    }

    /// Shoots the sentinel, and notes what it says of the lamp.
    fn watch_lamp(&mut self, basics: &mut Basics) -> Result<()> {
        let take = MOST_TAKES + basics.drift.count() as u32;
        let white = Arc::clone(&self.white);
        let now = average(&mut *self.shots, &self.curve, &white, basics.exposures[0], take..take + 1)?;
        let black = basics.blacks.exposed.first();
        let channels = self.shots.camera().channels;
        let (mut sum, mut reference) = (0.0, 0.0);
        for sample in (0..now.mean.len()).filter(|sample| self.used[sample / channels]) {
            if !now.saturated[sample] {
                let black = black.map_or(self.curve.zero, |black| black.mean[sample]);
                sum += now.mean[sample] - black;
                reference += basics.reference.mean[sample] - black;
            }
        }
        basics.drift.add(now.started, if reference > 0.0 { sum / reference } else { 1.0 });
        Ok(())
    }

    fn note(&mut self, frame: &Arc<Frame>) {
        self.shown.insert(BuildHasherDefault::<DefaultHasher>::default().hash_one(frame));
    }
}
