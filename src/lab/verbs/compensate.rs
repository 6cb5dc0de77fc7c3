//! Light transport compensation.

use crate::analysis::compensate::{compare_methods, compensate_by_model, compensate_with};
use crate::analysis::low_rank::SavedModel;
use crate::analysis::{CompensateOptions, Compensation, Crosstalk, MethodRun, Precondition, Prior, Target};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::lab::{Lab, LabOperator, Log};
use crate::operator::Operator;
use crate::scene::predicted_direct;
use crate::transport::Part;

/// What is asked of a compensation.
#[derive(Clone, Debug)]
pub struct CompensateRequest {
    /// What is to be seen, in `[0, 1]` of the peak.
    pub target: Image,
    /// The method, its photos and its box.
    pub options: CompensateOptions,
    /// How the colours of projector and camera mix; only for three channels.
    pub colors: Option<ColorMixing>,
    /// Whether every other method is given as many photos.
    pub compare_methods: bool,
}

/// How the colours of projector and camera mix.
#[derive(Clone, Copy, Debug)]
pub struct ColorMixing {
    /// What each camera channel sees of each projector colour, row by row; `None` where three photos of red, green and blue measure it.
    pub matrix: Option<[[f64; 3]; 3]>,
    /// Whether each channel is solved by itself and the colours are un-mixed afterwards, instead of one coupled system.
    pub unmix: bool,
}

/// A compensation, and other methods with as many photos.
#[derive(Clone, Debug)]
pub struct CompensateAnswer {
    /// The compensation.
    pub found: Compensation,
    /// The other methods.
    pub methods: Vec<MethodRun>,
}

impl Lab {
    /// Finds what to project so that the photo is the target.
    ///
    /// # Errors
    /// As [`compensate_with`] and [`Lab::operators`].
    pub fn compensate(&mut self, request: &CompensateRequest) -> Result<CompensateAnswer> {
        let options = &request.options;
        options.check()?;
        self.allow_photos(options.photos);
        let geometry = self.geometry(options);
        let target = Target::new(&request.target, &self.ambient()?)?;
        let (crosstalk, learned) = match &request.colors {
            Some(colors) => self.crosstalk(colors).map(|(crosstalk, photos)| (Some(crosstalk), photos))?,
            None => (None, 0),
        };
        let direct = match options.precondition {
            Some(Precondition::Direct) if self.is_simulated()? => self.white_of(Part::Direct)?,
            _ => Vec::new(),
        };
        let prior = Prior { direct, geometry, crosstalk, photos: learned, start: None };
        let mut channels = self.operators(Part::Full)?;
        self.expect(1 + options.photos);
        self.photos(|_| {
            let found = compensate_with(&mut channels, &target, options, &prior)?;
            let methods = if request.compare_methods {
                compare_methods(&mut channels, &target, options, &prior)?
            } else {
                Vec::new()
            };
            Ok(CompensateAnswer { found, methods })
        })
    }

    /// Refuses a model of other pixels than this source has.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--model`.
    pub fn check_model(&self, model: &SavedModel) -> Result<()> {
        if self.resolution() != model.resolution || self.projector_resolution() != model.projector {
            return Err(Error::Option {
                option: "--model".into(),
                fault: format!(
                    "its photos have {} pixels, but those of {} have {}",
                    model.resolution,
                    self.name(),
                    self.resolution()
                ),
                help: format!("give --size {}, or the source that it was captured from", model.resolution),
            });
        }
        Ok(())
    }

    /// Finds what to project by a model of the light transport, corrected by so many photos of this source.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--model` when the model has other pixels; as [`compensate_by_model`] and [`Lab::operators`].
    pub fn compensate_by_model(
        &mut self,
        model: &mut SavedModel,
        target: &Target,
        options: &CompensateOptions,
        corrections: usize,
    ) -> Result<Compensation> {
        self.check_model(model)?;
        let mut operators = self.operators(Part::Full)?;
        self.expect(corrections);
        self.photos(|_| {
            let mut photograph = |patterns: &[Vec<f64>]| {
                let photo = |(operator, pattern): (&mut LabOperator, &Vec<f64>)| {
                    let mut photo = vec![0.0; pattern.len()];
                    operator.apply(pattern, &mut photo)?;
                    Ok(photo)
                };
                operators.iter_mut().zip(patterns).map(photo).collect()
            };
            compensate_by_model(&mut model.channels, target, options, corrections, &mut photograph)
        })
    }

    /// The mixing matrix, and the photos that it took to learn it.
    fn crosstalk(&mut self, colors: &ColorMixing) -> Result<(Crosstalk, usize)> {
        let (mut crosstalk, photos) = match colors.matrix {
            Some(matrix) => (Crosstalk::new(matrix)?, 0),
            None => {
                let photos = self.primaries()?;
                (Crosstalk::measured(&photos)?, photos.len())
            }
        };
        if photos > 0 {
            let row = |row: &[f64; 3]| row.map(|entry| format!("{entry:.4}")).join(" ");
            self.observer.info(format_args!(
                "crosstalk {} (red, green and blue, in each camera channel)",
                crosstalk.matrix().each_ref().map(row).join(" | ")
            ));
        }
        if !self.is_simulated()? {
            // A rig's products are measured by gray patterns.
            crosstalk = crosstalk.relative_to_white()?;
        }
        crosstalk.coupled = !colors.unmix;
        Ok((crosstalk, photos))
    }

    /// The direct image that the scene's shape predicts, where it is asked for and there is a scene.
    fn geometry(&self, options: &CompensateOptions) -> Vec<f64> {
        if options.precondition != Some(Precondition::Geometry) {
            return Vec::new();
        }
        // Without a scene the solver reports that its shape is not known.
        self.scene().map_or(Vec::new(), |scene| predicted_direct(scene, self.resolution()))
    }
}
