//! Low-rank relighting: the light transport is captured once, and the captured model then predicts photos without taking any.

mod answer;
mod page;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::options::{check_vectors, count, number};
use super::pattern::Pattern;
use crate::analysis::low_rank::rank_curve;
use crate::analysis::planes::{Planes, difference};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::picture;
use crate::lab::{ChannelChoice, GivenArray, Lab, LabOperator, SourceKind, Verb};
use crate::transport::{Channels, Part};

use answer::ModelPlace;
pub use answer::Relighting;

/// Capture light transport in a few dozen photos, and relight the scene with any pattern
///
/// The run's folder keeps the model. Given as SOURCE, it relights with other patterns without any photo, and without a
/// graphics device. So does the folder of a `segment`, `eigs` or `compensate` run: a model is made of the photos in its journal
/// (a rough one of `eigs` without `--part global`, whose photos go to direct light).
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(
    after_help = "Examples:\n  krylux relight scene.glb --channels rgb --pattern checker:16 -o out/box\n  krylux relight out/box --pattern left     # no further photo"
)]
pub struct Relight {
    /// One gray system, or red, green and blue as three [default: luma, or what the model has]
    #[arg(long, value_enum)]
    #[serde(skip)]
    pub channels: Option<Channels>,
    /// Photos of the capture [default: 40, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
    /// Patterns of the capture that are chosen beforehand, white and smooth random ones; the others are photos projected back. 1 is
    /// white alone, as for rigs that are not coaxial [default: 12]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub block: Option<usize>,
    /// Relight with it: white, black, left, checker:N, stripes:N, pixel:X,Y, or an image file (.npy, .exr, .png, .tif …); may be given several
    /// times [default: white]
    #[arg(long = "pattern", value_name = "PATTERN")]
    pub patterns: Vec<Pattern>,
    /// Light the scene from the camera by each pattern, as the projector would see it
    #[arg(long)]
    pub dual: bool,
    /// Take the interreflections out of this photo: an image file (.npy, .exr, .hdr, .tif …) of radiance; may be given several times
    #[arg(long = "inverse", value_name = "PHOTO")]
    pub photographs: Vec<PathBuf>,
    /// Exit status 1 if a relit photo differs from the true one by more than this share of it (scenes only)
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    pub max_error: Option<f64>,
    /// Images that a program has in memory, in place of `patterns`, `dual` and `photographs`.
    #[arg(skip)]
    #[serde(skip)]
    pub questions: Option<Questions>,
}

/// Named images for a model to compute with.
#[derive(Clone, Debug, Default)]
pub struct Questions {
    /// Patterns in the projector's pixels, to relight the scene with.
    pub patterns: Vec<(String, Image)>,
    /// Patterns in the camera's pixels, for dual photographs.
    pub duals: Vec<(String, Image)>,
    /// Photos, with ambient light, whose interreflections are to be removed.
    pub photographs: Vec<(String, Planes)>,
}

impl Verb for Relight {
    const NAME: &'static str = "relight";
    const NEEDS_PICTURES: bool = true;
    type Answer = Relighting;

    /// The channels of the request. A run has the channels of its photos. If others are requested, they are refused once the run is open.
    fn channels(&self, source: &Path) -> Result<ChannelChoice> {
        Ok(match (self.channels, SourceKind::of(source)) {
            (_, SourceKind::Run) => ChannelChoice::Native,
            (channels, _) => channels.unwrap_or(Channels::Luma).into(),
        })
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        if let (SourceKind::Rig, Some(_)) = (lab.kind(), self.max_error) {
            let fault = "a rig does not know the true photos of patterns that it never showed";
            return Err(Error::option("--max-error", fault).help("leave it out, or give a scene"));
        }
        let given = [
            (self.photos.is_some(), "--photos"),
            (self.block.is_some(), "--block"),
            (self.channels.is_some(), "--channels"),
            (self.max_error.is_some(), "--max-error"),
        ];
        if let Some((_, option)) = given.into_iter().find(|(is_given, _)| *is_given && lab.has_model()) {
            let name = lab.name();
            let fault =
                format!("{name} holds a model that is captured already, and no scene to compare it with");
            return Err(Error::option(option, fault).help("leave it out, or give the scene or the rig"));
        }
        check_vectors("--block", self.block(), lab.projector_resolution().pixels())?;
        // This call reports unusable files before anything is traced.
        self.questions_to(lab).map(drop)
    }

    /// Takes `patterns`, `duals` and `photographs` in place of files. If none are given, the model is captured but computes no photos.
    fn give(&mut self, given: Vec<GivenArray>) -> Result<()> {
        let questions = self.questions.get_or_insert_default();
        for array in given {
            let image = array.image()?;
            match array.field.as_str() {
                "patterns" => questions.patterns.push((array.name, image)),
                "duals" => questions.duals.push((array.name, image)),
                "photographs" => questions.photographs.push((array.name, image.planes())),
                _ => return Err(array.not_taken()),
            }
        }
        Ok(())
    }

    /// Captures the light transport as a model, or uses the source's model without taking a photo. A captured model is written into the
    /// folder of the open run at once. The journal omits the photos of a scene, since the simulator is needed anyway to compute the truth.
    fn answer(&self, lab: &mut Lab) -> Result<Relighting> {
        let questions = self.questions_to(lab)?;
        if lab.has_model() {
            let place = if lab.has_saved_model() { ModelPlace::Source } else { ModelPlace::Memory };
            let mut answer = Relighting { place, ..Relighting::new(self, lab.model()?) };
            lab.timed("relighting", |_| ask(&mut answer, &questions, [None, None]))?;
            return Ok(answer);
        }
        let photos = self.photos.or(lab.photos_of_run()).unwrap_or(40);
        lab.allow_photos(photos);
        if lab.kind() == SourceKind::Scene {
            lab.without_journal();
        }
        let mut answer = Relighting::new(self, lab.capture_model(photos, self.block())?);
        answer.photos = answer.model.rank();
        if let Some(run) = lab.run() {
            answer.place = ModelPlace::Folder(run.path.clone(), answer.model.write(&run.path)?);
        }
        if let Some(matrices) = lab.matrices_of(Part::Global)? {
            answer.curve = lab.timed("error curve", |lab| {
                rank_curve(&answer.model.channels, &matrices, &mut lab.reference_operators(Part::Global)?)
            })?;
        }
        lab.timed("relighting", |lab| {
            // The truth is computed with light paths of another seed, since the model contains the noise of the captured photos.
            let full = lab.independent_operators(Part::Full)?;
            // The removal of interreflections takes hundreds of products. Only the scene's own matrix makes them affordable.
            let has_matrix = lab.assembled()?.is_some();
            let global = has_matrix.then(|| lab.reference_operators(Part::Global)).transpose()?;
            ask(&mut answer, &questions, [full, global])
        })?;
        Ok(answer)
    }
}

impl Relight {
    /// The number of patterns that are chosen beforehand. The default can distinguish the twelve cups of the egg carton scene.
    fn block(&self) -> usize {
        self.block.unwrap_or(12)
    }

    fn questions_to(&self, lab: &Lab) -> Result<Questions> {
        if let Some(questions) = &self.questions {
            return Ok(questions.clone());
        }
        let [projector, camera] = [lab.projector_resolution(), lab.resolution()];
        let channels = lab.channels().count();
        let photographs = self.photographs.iter().map(|path| photograph(path, camera, channels));
        Ok(Questions {
            patterns: self.images(projector, channels)?,
            duals: if self.dual { self.images(camera, channels)? } else { Vec::new() },
            photographs: photographs.collect::<Result<_>>()?,
        })
    }

    /// The patterns by name. If none is given, white is used.
    fn images(&self, resolution: Resolution, channels: usize) -> Result<Vec<(String, Image)>> {
        let white = [Pattern::White];
        let patterns = if self.patterns.is_empty() { &white[..] } else { &self.patterns };
        let named = |pattern: &Pattern| {
            let (name, image) = (pattern.to_string(), pattern.image(resolution)?);
            if image.channels() > channels {
                return Err(Error::option("--pattern", format!("{name} is coloured, but the model is gray"))
                    .help("give a gray pattern, or capture with --channels rgb"));
            }
            Ok((name, image))
        };
        patterns.iter().map(named).collect()
    }
}

/// A named photo from a file, with the model's number of channels. For a gray model, a coloured photo is weighted by luminance.
fn photograph(path: &Path, camera: Resolution, channels: usize) -> Result<(String, Planes)> {
    let image = picture::read_sized(path, camera, "the camera")?;
    let planes = match (image.channels(), channels) {
        (3, 1) => vec![image.luminance()],
        (1, 3) => {
            return Err(Error::data(path, "it is gray, but the model has three channels")
                .help("give a coloured photo, or capture with --channels luma"));
        }
        _ => image.planes(),
    };
    Ok((path.display().to_string(), planes))
}

/// Computes all requested photos with the model. `[full, global]` are operators of the truth, if the truth is known.
fn ask(
    answer: &mut Relighting,
    questions: &Questions,
    [mut full, mut global]: [Option<Vec<LabOperator>>; 2],
) -> Result<()> {
    let model = &answer.model;
    for (name, pattern) in &questions.patterns {
        answer.relit.push(model.relight(name, pattern.clone(), full.as_deref_mut())?);
    }
    for (name, pattern) in &questions.duals {
        answer.duals.push(model.dual(name.clone(), pattern, full.as_deref_mut())?);
    }
    for (name, photo) in &questions.photographs {
        let photo = difference(photo, &model.ambient.planes());
        answer.reduced.push(model.reduce(name.clone(), &photo, global.as_deref_mut())?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::Answer;
    use crate::scene::builtin;

    #[test]
    fn a_model_is_scored_by_light_that_it_did_not_see() -> Result<()> {
        let mut lab = Lab::builder_of_scene(builtin::zigzag().to_scene()).size(24, 24).samples(64).open()?;
        let mut model = lab.ask(&Relight { photos: Some(20), block: Some(4), ..Relight::default() })?;
        let worst = model.worst().unwrap_or(f64::NAN);
        // The white photo is one of the captured photos, so the model's white photo has the noise of the matrix.
        let noise = lab.noise()?.map_or(f64::NAN, |noise| noise.white_relative);
        assert!((worst / noise - 1.0).abs() < 0.5, "{worst} {noise}");
        let Some(checked) = model.verify(&mut lab)? else { unreachable!("a scene") };
        assert!((checked.verification.error / worst - 1.0).abs() < 0.3, "{checked:?}");
        Ok(())
    }
}
