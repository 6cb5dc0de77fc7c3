//! Separation of direct and global light.

mod answer;
mod page;

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::options::{check_vectors, count, number};
use crate::analysis::planes::Planes;
use crate::analysis::probe::default_sigma;
use crate::analysis::separate::{
    NearFar, NearFarOptions, SeparateBy, Separation, compare_separations, near_far, second_and_rest, separate,
};
use crate::error::{Error, Result};
use crate::lab::{ChannelChoice, Lab, LabOperator, Log, SourceKind, Verb};
use crate::operator::{Operator, Symmetry};
use crate::transport::{Channels, Part};

pub use answer::Separated;

/// Separate direct and global light, and the global light by bounces and by how far it went
#[derive(Clone, Debug, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(after_help = "Example:\n  krylux separate scene.glb --by checkerboards --compare -o out/separated")]
pub struct Separate {
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    #[serde(skip)]
    pub channels: Channels,
    /// The method [default: exact on scenes, checkerboards on rigs]
    #[arg(long, value_enum, value_name = "NAME")]
    pub by: Option<SeparationMethod>,
    /// Pixels of a checkerboard's squares [default: 2, or as captured]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub square: Option<usize>,
    /// Places that checkerboards are shifted to in each direction: as many photos squared [default: 4, or as captured]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub shifts: Option<usize>,
    /// Pixels of a sinusoid's wave
    #[arg(long, value_name = "X", default_value_t = 4.0, value_parser = number::<f64>)]
    pub period: f64,
    /// Photos of a sinusoid in each of two directions
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = count::<usize>)]
    pub phases: usize,
    /// Photos of random patterns or of the capture, beside the white one [default: 40, or the budget of the run that is
    /// SOURCE]; of codes 4, 8, 16 and so on [default: 16]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
    /// The second bounce, and three and more, as images (scenes only)
    #[arg(long)]
    pub bounces: bool,
    /// Near indirect light is weighted by exp(−d²/2σ²) of the distance d in pixels [default: a sixteenth of the width]
    #[arg(long, value_name = "σ", value_parser = number::<f64>)]
    pub sigma: Option<f64>,
    /// Photos of random patterns that tell near from far indirect light; 0 leaves it out [default: 100 on scenes, 0 on
    /// rigs]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub probes: Option<usize>,
    /// All methods at several photo counts against the exact first bounce (scenes only)
    #[arg(long)]
    pub compare: bool,
    /// Exit status 1 if the direct light differs from the exact first bounce by more than this share of it (scenes only)
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    pub max_error: Option<f64>,
}

/// A method of separation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SeparationMethod {
    /// What the simulator knows of each bounce
    Exact,
    /// Nayar's shifted checkerboards
    Checkerboards,
    /// Shifted sinusoids
    Sinusoids,
    /// Patterns in which pixels near to each other have different codes, so that light from near by does not count as direct. For devices in
    /// focus
    Codes,
    /// The diagonal of the matrix from patterns of random signs
    Random,
    /// The same from the photos of a Krylov capture
    Capture,
}

impl Verb for Separate {
    const NAME: &'static str = "separate";
    const NEEDS_PICTURES: bool = true;
    type Answer = Separated;

    fn channels(&self, _: &Path) -> Result<ChannelChoice> {
        Ok(self.channels.into())
    }

    fn splits_bounces(&self) -> bool {
        self.bounces
    }

    /// Refuses exact light from sources without a simulator, and settings that a method cannot use.
    fn check_on(&self, lab: &Lab) -> Result<()> {
        let by = self.by(lab);
        let asked = [
            (by.is_none(), "--by exact"),
            (self.bounces, "--bounces"),
            (self.compare, "--compare"),
            (self.max_error.is_some(), "--max-error"),
        ];
        let knows = |option| lab.kind() == SourceKind::Scene || option != "--bounces" && lab.knows_direct();
        if let Some((_, option)) = asked.into_iter().find(|&(is_asked, option)| is_asked && !knows(option)) {
            return Err(Error::option(option, "the exact bounces of this light are not known")
                .help("leave it out, or give a scene, or a matrix that krylux wrote"));
        }
        check_vectors("--photos", self.budget(lab), lab.projector_resolution().pixels())?;
        by.map_or(Ok(()), SeparateBy::check)
    }

    /// Separates direct and global light under white. The journal omits the photos of a scene, since the simulator is needed anyway to
    /// compute the truth.
    fn answer(&self, lab: &mut Lab) -> Result<Separated> {
        lab.allow_photos(self.budget(lab));
        let (knows_direct, seed) = (lab.knows_direct(), lab.seed());
        if knows_direct {
            lab.without_journal();
        }
        lab.prepare()?;
        // The light of one bounce, and the light of two or more bounces, both under white.
        let bounces =
            |lab: &mut Lab| -> Result<_> { Ok([lab.white_of(Part::Direct)?, lab.white_of(Part::Global)?]) };
        let exact = knows_direct.then(|| lab.timed("exact bounces", bounces)).transpose()?;
        let mut found = match self.by(lab) {
            Some(by) => self.by_photos(lab, by, exact.as_ref())?,
            // Only a source that knows its direct light uses the exact method.
            None => Separated::exact(self, lab.resolution(), exact.clone().unwrap_or_default()),
        };
        if self.bounces {
            found.bounces = lab.assembled()?.map(|traced| second_and_rest(&traced.matrix)).transpose()?;
        }
        let probes = self.probes.unwrap_or(if knows_direct { 100 } else { 0 });
        if probes > 0 {
            let sigma = self.sigma.unwrap_or_else(|| default_sigma(lab.projector_resolution()));
            let options = NearFarOptions { sigma, photos: probes, seed };
            found.near_far = lab.timed("probing", |lab| self.probed(lab, options, &found.global))?;
        }
        if let (true, Some(exact)) = (self.compare, &exact) {
            let resolution = lab.resolution();
            let mut full = lab.reference_operators(Part::Full)?;
            found.comparison = lab.timed("comparison", |_| {
                compare_separations(&mut full, resolution, exact, self.period, seed)
            })?;
        }
        Ok(found)
    }
}

impl Separate {
    fn budget(&self, lab: &Lab) -> usize {
        self.photos.or(lab.photos_of_run()).unwrap_or(40)
    }

    /// The method with its settings; `None` for exact light from a simulator.
    fn by(&self, lab: &Lab) -> Option<SeparateBy> {
        let photos = self.budget(lab);
        let default =
            if lab.knows_direct() { SeparationMethod::Exact } else { SeparationMethod::Checkerboards };
        Some(match self.by.unwrap_or(default) {
            SeparationMethod::Exact => return None,
            SeparationMethod::Checkerboards => {
                let asked = self.square.is_some() || self.shifts.is_some();
                let captured = if asked { None } else { lab.captured_checkerboards() };
                let [square, shifts] =
                    captured.unwrap_or([self.square.unwrap_or(2), self.shifts.unwrap_or(4)]);
                SeparateBy::Checkerboards { square, shifts }
            }
            SeparationMethod::Sinusoids => SeparateBy::Sinusoids { period: self.period, phases: self.phases },
            // The number of photos of a source run is not used as the default: it may be any number, but codes need a power of two.
            SeparationMethod::Codes => SeparateBy::Codes { photos: self.photos.unwrap_or(16) },
            SeparationMethod::Random => SeparateBy::Random { photos },
            SeparationMethod::Capture => SeparateBy::Capture { photos },
        })
    }

    fn by_photos(&self, lab: &mut Lab, by: SeparateBy, exact: Option<&[Planes; 2]>) -> Result<Separated> {
        let (resolution, patterns, seed) = (lab.resolution(), lab.projector_resolution(), lab.seed());
        let mut operators = lab.operators(Part::Full)?;
        let is_coaxial = operators.iter().all(|operator| operator.symmetry() == Symmetry::Symmetric);
        let homes = if is_coaxial { None } else { lab.homes()? };
        lab.expect(by.photos());
        let pixels = (patterns, homes.as_deref());
        let one = |operator: &mut LabOperator| separate(operator, pixels, by, seed);
        let mut found = lab.photos(|_| operators.iter_mut().map(one).collect::<Result<Vec<_>>>())?;
        if lab.is_model()? {
            let model = lab.model()?;
            let channels = found.into_iter().zip(&model.channels);
            found = channels.map(|(found, model)| found.of_model(by, pixels, |x| model.errors(x))).collect();
        }
        let of = |part: fn(&Separation) -> &Vec<f64>| found.iter().map(|f| part(f).clone()).collect();
        let light = [of(|found| &found.direct), of(|found| &found.global)];
        Ok(Separated {
            method: by.in_words(),
            name: by.name(),
            photos: by.photos(),
            standard_error: found.iter().map(|found| found.standard_error.clone()).collect(),
            global_error: found.iter().map(|found| found.global_error.clone()).collect(),
            truth: exact.map(|[direct, _]| direct.clone()),
            ..Separated::exact(self, resolution, light)
        })
    }

    /// Global light split by the distance that it travelled. It is left out if it was not requested and the map from camera to projector
    /// is not known.
    fn probed(&self, lab: &mut Lab, options: NearFarOptions, global: &Planes) -> Result<Option<NearFar>> {
        let homes = match lab.homes() {
            Err(Error::Option { fault, .. }) if self.probes.is_none() => {
                let note = format_args!("note: near and far indirect light are left out: {fault}");
                lab.observer().note(note);
                return Ok(None);
            }
            homes => homes?,
        };
        let mut operators = lab.operators(Part::Global)?;
        lab.expect(options.photos);
        let matrices = lab.matrices_of(Part::Global)?;
        let pixels = (lab.projector_resolution(), homes.as_deref());
        near_far(&mut operators, pixels, options, global, matrices.as_deref()).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::planes::{difference, norm, sum};
    use crate::image::Resolution;
    use crate::io::sparse::{MatrixFile, Pictures};
    use crate::lab::Answer;
    use crate::scene::builtin;
    use crate::sparse::Csr;

    #[test]
    fn a_separation_predicts_a_checkerboard_that_it_did_not_see() -> Result<()> {
        let mut lab = Lab::builder_of_scene(builtin::corner().to_scene()).size(24, 24).samples(64).open()?;
        let mut found = lab.ask(&Separate { probes: Some(0), ..Separate::default() })?;
        let error = |found: &mut Separated, lab: &mut Lab| -> Result<f64> {
            Ok(found.verify(lab)?.map_or(f64::NAN, |checked| checked.verification.error))
        };
        let right = error(&mut found, &mut lab)?;
        assert!(right < 0.05, "{right}");
        found.direct[0].iter_mut().for_each(|value| *value *= 1.3);
        let wrong = error(&mut found, &mut lab)?;
        assert!(wrong > 0.15, "{wrong}");
        Ok(())
    }

    #[test]
    fn near_and_far_light_between_two_sizes_add_up_and_state_their_error() -> Result<()> {
        let (camera, projector) = (Resolution::new(8, 6), Resolution::new(4, 3));
        let home = |row: usize| row / camera.width / 2 * projector.width + row % camera.width / 2;
        let (rows, columns) = (camera.pixels(), projector.pixels());
        let direct = Csr::new(
            columns,
            (0..=rows).collect(),
            (0..rows).map(|row| home(row) as u32).collect(),
            vec![2.0; rows],
        )?;
        let weak = (0..rows * columns).map(|at| (at * 7 % 13) as f64 / 100.0).collect();
        let starts = (0..=rows).map(|row| row * columns).collect();
        let global =
            Csr::new(columns, starts, (0..columns as u32).cycle().take(rows * columns).collect(), weak)?;
        let matrix = MatrixFile {
            channels: vec![Csr::sum(&[(1.0, &direct), (1.0, &global)])?],
            direct: vec![direct],
            pictures: Some(Pictures { camera, projector }),
            noise: None,
        };
        let mut lab = Lab::builder_of_matrix(matrix, "two sizes").open()?;
        let found = lab.ask(&Separate { probes: Some(1000), ..Separate::default() })?;
        let Some(reach) = &found.near_far else { unreachable!("the map is known") };
        // The default is measured on the projector: a sixteenth of its width, and at least one pixel.
        assert_eq!((reach.sigma, reach.photos), (1.0, 1000));
        let (error, noise) = (reach.error.unwrap_or(f64::NAN), reach.noise.value().unwrap_or(f64::NAN));
        // The norm of the error is that of the standard errors, up to the spread of some tens of independent values.
        assert!(noise < 0.1 && error < 1.6 * noise, "{error} {noise}");
        let white = global.times(&vec![1.0; columns]);
        let misfit = difference(&sum(&reach.near, &reach.far), std::slice::from_ref(&white));
        // Photos are in single precision.
        assert!(norm(&misfit) < 1e-6 * norm(&vec![white]));
        Ok(())
    }
}
