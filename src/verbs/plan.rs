//! Plans a verb on a rig: predicts its cost and the error of its answer by runs on the rig's virtual twin. Also plans the tracing of a
//! scene on several machines: predicts time and memory.

use std::cell::Cell;
use std::ops::ControlFlow;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::options::{count, number};
use super::{Compensate, Eigs, Segment};
use crate::analysis::plan::{CompensationPlan, Cost, MethodTrial, Planner};
use crate::analysis::{CompensateOptions, SegmentOptions};
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::image::Image;
use crate::io::name::Name;
use crate::krylov::EigsOptions;
use crate::lab::{ChannelChoice, Lab, RigSource, SharedObserver, SourceKind, not_a_rig};
use crate::observer::{Estimate, Observer, Step};
use crate::report::content::Content;
use crate::transport::{Channels, Network, Part};

/// Predict photos, time and error of a verb on a rig, from its virtual twin; or memory and time of a scene on several machines
#[derive(clap::Args, Clone, Debug, Serialize, Deserialize)]
#[command(
    after_help = "Examples:\n  krylux plan rig.toml segment --photos 40 --groups 2\n  krylux plan rig.toml --compare-methods compensate --target target.png --photos 12\n  krylux plan scene.glb --size 1024 --spp 64 --ranks 1,8,64"
)]
pub struct Plan {
    /// Runs on the twin, each with its own noise
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = count::<u64>)]
    pub trials: u64,
    /// Numbers of processes (MPI ranks) on which a scene is to be traced, each on a machine like this one
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = count::<usize>)]
    pub ranks: Vec<usize>,
    /// Bandwidth of the network between the machines, in Gbit/s, for --ranks
    #[arg(long, value_name = "X", default_value_t = 10.0, value_parser = number::<f64>)]
    pub network: f64,
    /// Plan `compensate` by every method, each with as many photos, and say what each shows at equal frames, too
    #[arg(long)]
    pub compare_methods: bool,
    /// The verb on a rig.
    #[command(subcommand)]
    pub question: Option<Planned>,
}

/// The verb that is planned.
#[derive(clap::Subcommand, Clone, Debug, Serialize, Deserialize)]
pub enum Planned {
    /// Plan `krylux segment`: how well the groups agree with those without noise, and with the true labels
    #[command(after_help = "Example:\n  krylux plan rig.toml segment --photos 40 --groups 2")]
    Segment(Segment),
    /// Plan `krylux compensate`: how much larger the residual is than that of the best pattern
    #[command(after_help = "Example:\n  krylux plan rig.toml compensate --target target.png --photos 20")]
    Compensate(Compensate),
    /// Plan `krylux eigs`: how far the eigenvalues are off
    #[command(after_help = "Example:\n  krylux plan rig.toml eigs --count 4 --photos 30")]
    Eigs(Eigs),
}

/// The number of photos that a plan for several machines assumes.
const PHOTOS: usize = 50;
/// The latency of a short message in seconds, as in the usual networks of clusters.
const LATENCY: f64 = 2e-5;

impl Plan {
    /// Whether the plan is for a scene on several machines.
    fn is_of_ranks(&self) -> bool {
        !self.ranks.is_empty() && self.question.is_none()
    }

    /// The channels of the source.
    pub fn channels(&self) -> ChannelChoice {
        if self.is_of_ranks() { ChannelChoice::Luma } else { ChannelChoice::Native }
    }

    /// Checks the request before the source is opened. Errors: [`Error::Option`].
    pub fn check(&self, source: &Path) -> Result<()> {
        if self.is_of_ranks() {
            let help = "give numbers above 0, e.g. --ranks 1,8,64 --network 10";
            if self.ranks.contains(&0) {
                return Err(Error::option("--ranks", "0 processes do nothing").help(help));
            }
            if self.network <= 0.0 {
                return Err(Error::option("--network", "messages need a bandwidth above 0").help(help));
            }
            return Ok(());
        }
        if self.question.is_none() {
            return Err(Error::option("plan", "it is not said what is to be planned")
                .help("give a verb on a rig (segment, compensate or eigs), or --ranks with a scene"));
        }
        check_trials(self.trials)?;
        if SourceKind::of(source) != SourceKind::Rig {
            return Err(not_a_rig(source));
        }
        Ok(())
    }

    /// Predicts the requested costs. The request must have been checked. Fails as [`Planned::predict`] and [`Lab::scaling`].
    pub fn ask(&self, lab: &Lab) -> Result<Content<'static>> {
        match &self.question {
            Some(question) => Ok(question.predict(lab, self.trials, self.compare_methods)?.content()),
            None => self.scaling(lab),
        }
    }

    fn scaling(&self, lab: &Lab) -> Result<Content<'static>> {
        let network = Network { bandwidth: self.network * 1e9 / 8.0, latency: LATENCY };
        let found = lab.scaling(&self.ranks, PHOTOS, network)?;
        let probe = &found.probe;
        let mut content = Content::default();
        content.line(format_args!(
            "measured  {:.3} µs a light path with {:.1} connections; an entry {:.1} ns to merge and {:.2} ns to multiply",
            1e6 * probe.path,
            probe.connections,
            1e9 * probe.merge,
            1e9 * probe.multiply
        ));
        let entries = found.processes.first().map_or(0.0, |scaled| scaled.entries);
        content.line(format_args!(
            "matrix    about {:.1} million entries; {PHOTOS} photos, and a network of {} Gbit/s",
            entries / 1e6,
            self.network
        ));
        content.line("            memory in GB   seconds");
        content.line(
            "  ranks     each  vectors   tracing  merging  exchange  products  messages  vectors      all  longest",
        );
        for scaled in &found.processes {
            content.line(format_args!(
                "  {:>5}  {:>7.2}  {:>7.2}  {:>8.1}  {:>7.1}  {:>8.1}  {:>8.1}  {:>8.1}  {:>7.1}  {:>7.1}  {}",
                scaled.processes,
                scaled.memory / 1e9,
                scaled.vectors_memory / 1e9,
                scaled.tracing,
                scaled.merging,
                scaled.exchange,
                scaled.products,
                scaled.messages,
                scaled.vectors,
                scaled.seconds(),
                scaled.binds()
            ));
        }
        content.line("the leader needs its vectors beside its part of the matrix");
        content.fact("photos", PHOTOS);
        content.fact("scaling", found);
        Ok(content)
    }
}

fn check_trials(trials: u64) -> Result<()> {
    if trials > 0 {
        return Ok(());
    }
    Err(Error::option("--trials", "0 runs predict nothing").help("ask for at least 1, better 3"))
}

/// The predicted costs of a verb and the predicted accuracy of its answer, with one entry for each trial.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// The name of the verb.
    pub verb: &'static str,
    /// The rig file's path.
    rig: Name,
    /// Photos, patterns, frames and seconds.
    pub costs: Vec<Cost>,
    /// Predicted figures of the answer: a name, and one value per trial.
    pub figures: Vec<(String, Vec<f64>)>,
    /// The reference values of the figures, by name, from an answer with ideal devices.
    pub ideal: Value,
    /// The trials with all their data.
    pub trials: Value,
}

/// The prediction of a checked request, from runs on the twin.
type Predicts<'a> = Box<dyn FnOnce(&Trials<'_>) -> Result<Prediction> + 'a>;

impl Planned {
    /// Predicts photos, time and error of the verb on a virtual rig, from `trials` runs on the rig's twin. Each run has different noise. A
    /// compensation can be predicted for every method, at equal numbers of photos and at equal numbers of frames.
    ///
    /// # Errors
    /// [`Error::Option`] if the source is not a rig, if there are no trials, and for options that cannot be planned; [`Error::Data`] if the
    /// devices are real; [`Error::Interrupted`]; the errors of tracing and of the verb.
    pub fn predict(&self, lab: &Lab, trials: u64, compare_methods: bool) -> Result<Prediction> {
        if compare_methods && !matches!(self, Self::Compensate(_)) {
            return Err(Error::option("--compare-methods", "only methods of a compensation are compared")
                .help("leave it out, or plan compensate"));
        }
        let rig = lab.rig().ok_or_else(|| lab.is_no_rig())?;
        check_trials(trials)?;
        // Wrong options are refused before anything is traced.
        let predict: Predicts<'_> = match self {
            Self::Segment(asked) => {
                asked.check_plan()?;
                Box::new(|trials| {
                    let truth = lab.truth()?.map(|truth| truth.labels);
                    trials.segmentation(asked.part(), asked.options(lab.seed(), None), truth.as_deref())
                })
            }
            Self::Compensate(asked) => {
                asked.check_plan()?;
                let target = asked.target(lab.resolution(), Channels::Luma)?;
                let options = asked.options(rig.is_symmetric(), None);
                options.check()?;
                Box::new(move |trials| trials.compensation(&target, &options, compare_methods))
            }
            Self::Eigs(asked) => {
                let options = asked.options(lab.seed(), None);
                let n = lab.projector_resolution().pixels();
                let confirm = options.confirm.map(|confirm| confirm.on_rig(n));
                let options = EigsOptions { confirm, ..options };
                Box::new(move |trials| trials.eigenpairs(asked.part.into(), &options))
            }
        };
        let (devices, twin) = (rig.devices()?, rig.twin()?);
        let observer = TrialObserver {
            observer: lab.observer(),
            done: Cell::new(0),
            total: trials,
            stopped: Cell::new(false),
        };
        let planner = Planner {
            rig: devices,
            twin: &twin,
            calibration: &rig.calibration,
            measurement: &rig.file.measurement,
            observer: &observer,
        };
        // The seeds differ from the rig's own seed, since a prediction must not know the noise of the real run.
        let seeds: Vec<u64> = (1..=trials).map(|trial| devices.seed.wrapping_add(trial)).collect();
        predict(&Trials { planner, observer: &observer, rig, seeds })
    }
}

/// An observer that reports the trials to the laboratory's observer, and hides the photos of each trial.
struct TrialObserver<'a> {
    observer: &'a SharedObserver,
    done: Cell<u64>,
    total: u64,
    stopped: Cell<bool>,
}

impl Observer for TrialObserver<'_> {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        let step =
            Step { stage: "trials", done: self.done.get(), total: self.total, estimate: Estimate::None };
        let flow = self.observer.0.step(&step);
        self.stopped.set(self.stopped.get() || flow.is_break());
        flow
    }
}

/// Runs on the twin, one for each seed of the noise.
struct Trials<'a> {
    planner: Planner<'a>,
    observer: &'a TrialObserver<'a>,
    rig: &'a RigSource,
    seeds: Vec<u64>,
}

impl Trials<'_> {
    fn each<T>(&self, mut trial: impl FnMut(u64) -> Result<T>) -> Result<Vec<T>> {
        let begin = Step { stage: "trials", done: 0, total: 0, estimate: Estimate::None };
        let mut trials = Vec::new();
        for &seed in &self.seeds {
            // A stopped method returns its best result so far. This is not a valid trial, so a stop discards all trials.
            if self.observer.step(&begin).is_break() {
                return Err(Error::Interrupted);
            }
            let done = trial(seed)?;
            if self.observer.stopped.get() {
                return Err(Error::Interrupted);
            }
            trials.push(done);
            self.observer.done.set(trials.len() as u64);
        }
        let _ = self.observer.step(&begin);
        Ok(trials)
    }

    fn prediction<T: Serialize>(
        &self,
        verb: &'static str,
        (trials, cost): (&[T], fn(&T) -> Cost),
        figures: Vec<(String, Vec<f64>)>,
        ideal: Value,
    ) -> Prediction {
        let costs = trials.iter().map(cost).collect();
        Prediction {
            verb,
            rig: Name::from(&self.rig.file.path),
            costs,
            figures,
            ideal,
            trials: json!(trials),
        }
    }

    fn segmentation(&self, part: Part, options: SegmentOptions, labels: Option<&[u8]>) -> Result<Prediction> {
        let mut options = SegmentOptions { resolution: Some(self.planner.rig.scene.size()), ..options };
        let ideal = self.planner.ideal_segmentation(part, &options)?;
        options.groups = ideal.labels.iter().map(|(groups, _)| *groups).collect();
        let trials = self.each(|seed| self.planner.segmentation(part, &options, &ideal, labels, seed))?;
        let mut figures = Vec::new();
        for (index, groups) in options.groups.iter().enumerate() {
            let agreement = trials.iter().map(|trial| trial.agreement[index].1);
            figures.push((format!("{groups} groups against those without noise"), agreement.collect()));
            let truth: Vec<f64> = trials.iter().filter_map(|trial| Some(trial.truth.get(index)?.1)).collect();
            if !truth.is_empty() {
                figures.push((format!("{groups} groups against the true labels"), truth));
            }
        }
        let ideal = json!({ "eigenvalues": ideal.eigenvalues });
        Ok(self.prediction("segment", (&trials, |trial| trial.cost), figures, ideal))
    }

    fn compensation(
        &self,
        target: &Image,
        options: &CompensateOptions,
        compare_methods: bool,
    ) -> Result<Prediction> {
        let ideal = self.planner.ideal_compensation(target, options)?;
        if compare_methods {
            return self.methods(&ideal, options);
        }
        let trials = self.each(|seed| self.planner.compensation(&ideal, options, seed))?;
        let figures = vec![
            ("residual".into(), trials.iter().map(|trial| trial.residual).collect()),
            (
                "more than the best pattern's, as a share".into(),
                trials.iter().map(|trial| trial.excess).collect(),
            ),
        ];
        Ok(self.prediction("compensate", (&trials, |trial| trial.cost), figures, errors_of(&ideal)))
    }

    fn methods(&self, ideal: &CompensationPlan, options: &CompensateOptions) -> Result<Prediction> {
        let trials = self.each(|seed| self.planner.methods(ideal, options, seed))?;
        let frames = trials.iter().map(|trial| trial.frames as f64).collect();
        let mut figures = vec![("frames at which methods are compared".into(), frames)];
        let names = trials.first().map_or(&[][..], |trial| &trial.methods).iter().map(|method| method.name);
        for (index, name) in names.enumerate() {
            let of = |figure: fn(&MethodTrial) -> f64| -> Vec<f64> {
                trials.iter().filter_map(|trial| trial.methods.get(index)).map(figure).collect()
            };
            figures.push((format!("{name}: residual after all photos"), of(|method| method.residual)));
            figures.push((format!("{name}: frames of all photos"), of(|method| method.frames as f64)));
            figures.push((format!("{name}: residual at equal frames"), of(|method| method.at_equal_frames)));
        }
        Ok(self.prediction("compensate", (&trials, |trial| trial.cost), figures, errors_of(ideal)))
    }

    fn eigenpairs(&self, part: Part, options: &EigsOptions) -> Result<Prediction> {
        let ideal = self.planner.ideal_eigenpairs(part, options)?;
        let trials = self.each(|seed| self.planner.eigenvalues(part, options, &ideal, seed))?;
        let of =
            |index: usize| trials.iter().filter_map(move |trial| trial.errors.get(index).copied()).collect();
        let name = |index: usize| format!("error of eigenvalue {}, relative to the largest", index + 1);
        let figures = (0..ideal.values.len()).map(|index| (name(index), of(index))).collect();
        let ideal = json!({ "eigenvalues": ideal.values });
        Ok(self.prediction("eigs", (&trials, |trial| trial.cost), figures, ideal))
    }
}

/// The errors with ideal devices, both of the compensation and of the target itself as the pattern.
fn errors_of(ideal: &CompensationPlan) -> Value {
    json!({ "relative_residual": ideal.optimum, "relative_residual_uncompensated": ideal.uncompensated })
}

/// The mean, the smallest and the largest value.
pub(super) fn range(values: impl Iterator<Item = f64> + Clone) -> [f64; 3] {
    let (sum, count) = values.clone().fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    [sum / count, values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
}

/// The mean, the smallest and the largest value as a fact.
pub(super) fn fact_of([mean, min, max]: [f64; 3]) -> Value {
    json!({ "mean": mean, "min": min, "max": max })
}

impl Prediction {
    /// The facts and lines. For programs, the fact `values` has all figures by name, with a value for each trial.
    pub fn content(&self) -> Content<'static> {
        let mut content = Content::default();
        let ideal = |name: &str| self.ideal.get(name).and_then(Value::as_f64).map(|value| decimal(value, 4));
        if let (Some(best), Some(uncompensated)) =
            (ideal("relative_residual"), ideal("relative_residual_uncompensated"))
        {
            content.line(format_args!("best      {best} of the target; {uncompensated} uncompensated"));
        }
        content.line("           photos  patterns   frames   seconds on the rig");
        for (trial, Cost { photos, patterns, frames, seconds }) in (1..).zip(&self.costs) {
            content.line(format_args!(
                "  trial {trial:<2} {photos:>6}  {patterns:>8}  {frames:>7}  {seconds:>8.1}"
            ));
        }
        let width = self.figures.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        content.line(format_args!("           {:width$}      mean     least   largest", ""));
        let mut figures = serde_json::Map::new();
        for (name, values) in &self.figures {
            let range = range(values.iter().copied());
            let [mean, least, largest] = range.map(|value| decimal(value, 4));
            content.line(format_args!("           {name:width$}  {mean:>8}  {least:>8}  {largest:>8}"));
            figures.insert(name.clone(), fact_of(range));
        }
        content.fact("question", self.verb);
        content.fact("rig", &self.rig);
        let of_costs = |of: fn(&Cost) -> f64| fact_of(range(self.costs.iter().map(of)));
        content.fact("photos", of_costs(|cost| cost.photos as f64));
        content.fact("patterns", of_costs(|cost| cost.patterns as f64));
        content.fact("frames", of_costs(|cost| cost.frames as f64));
        content.fact("seconds", of_costs(|cost| cost.seconds));
        content.fact("figures", figures);
        content.fact("ideal", &self.ideal);
        content.fact("trials", &self.trials);
        content.detail("verb", self.verb);
        content.detail("values", &self.figures);
        content
    }
}
