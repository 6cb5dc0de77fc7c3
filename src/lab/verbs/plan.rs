//! Predictions of the costs of a verb on a rig and of the accuracy of its answer, from runs on the rig's virtual twin.

use std::cell::Cell;
use std::ops::ControlFlow;

use serde_json::{Value, json};

use super::super::{Lab, SharedObserver};
use crate::analysis::plan::{CompensationPlan, Cost, MethodTrial, Planner};
use crate::analysis::{CompensateOptions, SegmentOptions};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::krylov::EigsOptions;
use crate::observer::{Estimate, Observer, Step};
use crate::transport::Part;

/// The verb to plan.
#[derive(Clone, Debug)]
pub enum PlanRequest {
    /// A segmentation of this part of the light.
    Segment(Part, SegmentOptions),
    /// A compensation for this gray target of the camera's pixels, in \[0, 1\].
    Compensate(Image, CompensateOptions),
    /// The same compensation by every method, at equal numbers of photos and at equal numbers of frames.
    CompareMethods(Image, CompensateOptions),
    /// Eigenpairs of this part of the light.
    Eigs(Part, EigsOptions),
}

/// The predicted costs of a verb and accuracy of its answer, with one entry for each trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Photos, patterns, frames and seconds.
    pub costs: Vec<Cost>,
    /// Predicted figures of the answer: a name, and a value for each trial.
    pub figures: Vec<(String, Vec<f64>)>,
    /// The reference for the figures, by name: the answer with ideal devices.
    pub ideal: Value,
    /// The trials with all their data.
    pub trials: Value,
}

impl PlanRequest {
    /// The name of the verb that is planned.
    pub fn verb(&self) -> &'static str {
        match self {
            Self::Segment(..) => "segment",
            Self::Compensate(..) | Self::CompareMethods(..) => "compensate",
            Self::Eigs(..) => "eigs",
        }
    }
}

impl Lab {
    /// Predicts photos, time and error of a verb on a virtual rig, from `trials` runs on the rig's twin, each with different noise.
    ///
    /// # Errors
    /// [`Error::Option`] if the source is not a rig, or if there are no trials; [`Error::Data`] if the devices are real;
    /// [`Error::Interrupted`]; the errors of tracing and of the verb.
    pub fn plan(&self, request: &PlanRequest, trials: u64) -> Result<Plan> {
        let rig = self.rig().ok_or_else(|| self.is_no_rig())?;
        if trials == 0 {
            return Err(
                Error::option("--trials", "0 runs predict nothing").help("ask for at least 1, better 3")
            );
        }
        if let PlanRequest::Compensate(_, options) | PlanRequest::CompareMethods(_, options) = request {
            options.check()?;
        }
        let (devices, twin) = (rig.devices()?, rig.twin()?);
        let progress =
            Trials { observer: &self.observer, done: Cell::new(0), total: trials, stopped: Cell::new(false) };
        let planner = Planner {
            rig: devices,
            twin: &twin,
            calibration: &rig.calibration,
            measurement: &rig.file.measurement,
            observer: &progress,
        };
        // The rig's own seed is not used, since a prediction must not know the noise.
        let seeds: Vec<u64> = (1..=trials).map(|trial| devices.seed.wrapping_add(trial)).collect();
        match request {
            PlanRequest::Segment(part, options) => {
                let truth = self.truth()?.map(|truth| truth.labels);
                of_segment(&planner, &progress, (*part, options), truth.as_deref(), &seeds)
            }
            PlanRequest::Compensate(target, options) => {
                of_compensate(&planner, &progress, target, options, &seeds)
            }
            PlanRequest::CompareMethods(target, options) => {
                of_methods(&planner, &progress, target, options, &seeds)
            }
            PlanRequest::Eigs(part, options) => {
                let n = self.projector_resolution().pixels();
                let confirm = options.confirm.map(|confirm| confirm.on_rig(n));
                let options = &EigsOptions { confirm, ..options.clone() };
                of_eigs(&planner, &progress, (*part, options), &seeds)
            }
        }
    }
}

/// Tells the laboratory's observer about trials, and hides the photos within each.
struct Trials<'a> {
    observer: &'a SharedObserver,
    done: Cell<u64>,
    total: u64,
    stopped: Cell<bool>,
}

impl Observer for Trials<'_> {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        let step =
            Step { stage: "trials", done: self.done.get(), total: self.total, estimate: Estimate::None };
        let flow = self.observer.0.step(&step);
        self.stopped.set(self.stopped.get() || flow.is_break());
        flow
    }
}

impl Trials<'_> {
    fn each<T>(&self, seeds: &[u64], mut trial: impl FnMut(u64) -> Result<T>) -> Result<Vec<T>> {
        let begin = Step { stage: "trials", done: 0, total: self.total, estimate: Estimate::None };
        let mut trials = Vec::new();
        for &seed in seeds {
            // A stopped method returns its best result so far, which is not a valid trial.
            if self.step(&begin).is_break() {
                return Err(Error::Interrupted);
            }
            let done = trial(seed)?;
            if self.stopped.get() {
                return Err(Error::Interrupted);
            }
            trials.push(done);
            self.done.set(trials.len() as u64);
        }
        let _ = self.step(&begin);
        Ok(trials)
    }
}

fn of_segment(
    planner: &Planner<'_>,
    progress: &Trials<'_>,
    (part, options): (Part, &SegmentOptions),
    labels: Option<&[u8]>,
    seeds: &[u64],
) -> Result<Plan> {
    let mut options = SegmentOptions { resolution: Some(planner.rig.scene.size()), ..options.clone() };
    let ideal = planner.ideal_segmentation(part, &options)?;
    options.groups = ideal.labels.iter().map(|(groups, _)| *groups).collect();
    let trials = progress.each(seeds, |seed| planner.segmentation(part, &options, &ideal, labels, seed))?;
    let mut figures = Vec::new();
    for (index, groups) in options.groups.iter().enumerate() {
        let agreement = trials.iter().map(|trial| trial.agreement[index].1);
        figures.push((format!("{groups} groups against those without noise"), agreement.collect()));
        let truth: Vec<f64> = trials.iter().filter_map(|trial| Some(trial.truth.get(index)?.1)).collect();
        if !truth.is_empty() {
            figures.push((format!("{groups} groups against the true labels"), truth));
        }
    }
    let costs = trials.iter().map(|trial| trial.cost).collect();
    Ok(Plan { costs, figures, ideal: json!({ "eigenvalues": ideal.eigenvalues }), trials: json!(trials) })
}

fn of_compensate(
    planner: &Planner<'_>,
    progress: &Trials<'_>,
    target: &Image,
    options: &CompensateOptions,
    seeds: &[u64],
) -> Result<Plan> {
    let ideal = planner.ideal_compensation(target, options)?;
    let trials = progress.each(seeds, |seed| planner.compensation(&ideal, options, seed))?;
    let figures = vec![
        ("residual".into(), trials.iter().map(|trial| trial.residual).collect()),
        (
            "more than the best pattern's, as a share".into(),
            trials.iter().map(|trial| trial.excess).collect(),
        ),
    ];
    let costs = trials.iter().map(|trial| trial.cost).collect();
    Ok(Plan { costs, figures, ideal: of_ideal(&ideal), trials: json!(trials) })
}

/// The errors that ideal devices reach, with compensation and with the target itself as the pattern.
fn of_ideal(ideal: &CompensationPlan) -> Value {
    json!({ "relative_residual": ideal.optimum, "relative_residual_uncompensated": ideal.uncompensated })
}

fn of_methods(
    planner: &Planner<'_>,
    progress: &Trials<'_>,
    target: &Image,
    options: &CompensateOptions,
    seeds: &[u64],
) -> Result<Plan> {
    let ideal = planner.ideal_compensation(target, options)?;
    let trials = progress.each(seeds, |seed| planner.methods(&ideal, options, seed))?;
    let mut figures: Vec<(String, Vec<f64>)> = vec![(
        "frames at which methods are compared".into(),
        trials.iter().map(|of| of.frames as f64).collect(),
    )];
    let names = trials.first().map_or(&[][..], |trial| &trial.methods).iter().map(|method| method.name);
    for (index, name) in names.enumerate() {
        let of = |figure: fn(&MethodTrial) -> f64| -> Vec<f64> {
            trials.iter().filter_map(|trial| trial.methods.get(index)).map(figure).collect()
        };
        figures.push((format!("{name}: residual after all photos"), of(|method| method.residual)));
        figures.push((format!("{name}: frames of all photos"), of(|method| method.frames as f64)));
        figures.push((format!("{name}: residual at equal frames"), of(|method| method.at_equal_frames)));
    }
    let costs = trials.iter().map(|trial| trial.cost).collect();
    Ok(Plan { costs, figures, ideal: of_ideal(&ideal), trials: json!(trials) })
}

fn of_eigs(
    planner: &Planner<'_>,
    progress: &Trials<'_>,
    (part, options): (Part, &EigsOptions),
    seeds: &[u64],
) -> Result<Plan> {
    let ideal = planner.ideal_eigenpairs(part, options)?;
    let trials = progress.each(seeds, |seed| planner.eigenvalues(part, options, &ideal, seed))?;
    let of = |index: usize| trials.iter().filter_map(move |trial| trial.errors.get(index).copied()).collect();
    let name = |index: usize| format!("error of eigenvalue {}, relative to the largest", index + 1);
    let figures = (0..ideal.values.len()).map(|index| (name(index), of(index))).collect();
    let costs = trials.iter().map(|trial| trial.cost).collect();
    Ok(Plan { costs, figures, ideal: json!({ "eigenvalues": ideal.values }), trials: json!(trials) })
}
