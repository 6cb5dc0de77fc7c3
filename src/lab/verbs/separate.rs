//! Separation of direct and global light.

use crate::analysis::planes::Planes;
use crate::analysis::separate::{
    NearFar, NearFarOptions, SeparateBy, Separation, compare_separations, near_far, second_and_rest, separate,
};
use crate::error::{Error, Result};
use crate::lab::Separated;
use crate::lab::{Lab, LabOperator, Log, SourceKind};
use crate::operator::Operator;
use crate::transport::Part;

/// What is asked of a separation.
#[derive(Clone, Debug)]
pub struct SeparateRequest {
    /// The method, if it takes photos; `None` is what a simulator knows.
    pub by: Option<SeparateBy>,
    /// Whether the second bounce and the rest are wanted as images; the laboratory must have been opened with
    /// [`split_bounces`](crate::lab::Settings::split_bounces).
    pub bounces: bool,
    /// Near and far global light.
    pub near_far: Option<NearFarOptions>,
    /// Whether every method is compared at several photo counts; the period of the sinusoids in pixels.
    pub compare: Option<f64>,
    /// The largest error of the direct light that is good enough.
    pub max_error: Option<f64>,
}

impl SeparateRequest {
    /// Refuses what only a simulator knows where there is none, and settings that a method cannot use.
    ///
    /// # Errors
    /// [`Error::Option`] naming the option.
    pub fn check(&self, is_scene: bool) -> Result<()> {
        let asked = [
            (self.by.is_none(), "--by exact"),
            (self.bounces, "--bounces"),
            (self.compare.is_some(), "--compare"),
            (self.max_error.is_some(), "--max-error"),
        ];
        match asked.into_iter().find(|(is_asked, _)| *is_asked && !is_scene) {
            Some((_, option)) => Err(Error::Option {
                option: option.into(),
                fault: "a rig does not know the exact bounces of its light".into(),
                help: "leave it out, or give a scene".into(),
            }),
            None => self.by.map_or(Ok(()), SeparateBy::check),
        }
    }
}

impl Lab {
    /// Separates direct and global light under white. The photos of a scene are not kept in a journal: a simulator is also asked for the
    /// truth, by hundreds of products.
    ///
    /// # Errors
    /// As [`SeparateRequest::check`], [`separate`] and [`Lab::operators`].
    pub fn separate(&mut self, request: &SeparateRequest) -> Result<Separated> {
        let is_scene = self.kind() == SourceKind::Scene;
        request.check(is_scene)?;
        if is_scene {
            self.without_journal();
        }
        self.transport()?;
        let exact = match is_scene {
            true => Some(self.timed("exact bounces", Self::exact_bounces)?),
            false => None,
        };
        let mut found = match (request.by, &exact) {
            (Some(by), exact) => self.separated_by(by, exact.as_ref())?,
            (None, Some([direct, global])) => Separated {
                method: "the simulator".to_owned(),
                name: "exact",
                photos: 0,
                direct: direct.clone(),
                global: global.clone(),
                standard_error: None,
                global_error: None,
                truth: None,
                bounces: None,
                near_far: None,
                comparison: Vec::new(),
                max_error: None,
            },
            // The check refuses this for anything but a scene, whose exact bounces are known.
            (None, None) => return Err(Error::Interrupted),
        };
        found.max_error = request.max_error;
        if request.bounces {
            found.bounces = self.assembled()?.map(|traced| second_and_rest(&traced.matrix)).transpose()?;
        }
        if let Some(options) = request.near_far.filter(|options| options.photos > 0) {
            found.near_far = self.timed("probing", |lab| lab.near_far(options, &found.global))?;
        }
        if let (Some(period), Some(exact)) = (request.compare, &exact) {
            let (resolution, seed) = (self.resolution(), self.seed());
            let mut full = self.reference_operators(Part::Full)?;
            found.comparison = self
                .timed("comparison", |_| compare_separations(&mut full, resolution, exact, period, seed))?;
        }
        Ok(found)
    }

    /// The light of one bounce, and that of two bounces and more, under white.
    fn exact_bounces(&mut self) -> Result<[Planes; 2]> {
        Ok([self.white_of(Part::Direct)?, self.white_of(Part::Global)?])
    }

    fn separated_by(&mut self, by: SeparateBy, exact: Option<&[Planes; 2]>) -> Result<Separated> {
        let (resolution, seed) = (self.resolution(), self.seed());
        let mut operators = self.operators(Part::Full)?;
        self.expect(by.photos());
        let one = |operator: &mut LabOperator| separate(operator, resolution, by, seed);
        let found = self.photos(|_| operators.iter_mut().map(one).collect::<Result<Vec<_>>>())?;
        let of = |part: fn(&Separation) -> &Vec<f64>| found.iter().map(|f| part(f).clone()).collect();
        Ok(Separated {
            method: by.in_words(),
            name: by.name(),
            photos: by.photos(),
            direct: of(|found| &found.direct),
            global: of(|found| &found.global),
            standard_error: found.iter().map(|found| found.standard_error.clone()).collect(),
            global_error: found.iter().map(|found| found.global_error.clone()).collect(),
            truth: exact.map(|[direct, _]| direct.clone()),
            bounces: None,
            near_far: None,
            comparison: Vec::new(),
            max_error: None,
        })
    }

    fn near_far(&mut self, options: NearFarOptions, global: &Planes) -> Result<Option<NearFar>> {
        let resolution = self.resolution();
        let mut operators = self.operators(Part::Global)?;
        if operators.iter().any(|operator| operator.rows() != operator.cols()) {
            self.observer.note(format_args!(
                "note: near and far indirect light are left out: projector and camera differ in their pixels"
            ));
            return Ok(None);
        }
        self.expect(options.photos);
        let matrices = self.traced_matrices(Part::Global)?;
        near_far(&mut operators, resolution, options, global, matrices.as_deref()).map(Some)
    }
}
