//! Each mutant against the tests that reach it, until one fails.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::Fallible;
use crate::build::Program;
use crate::learn::{Bench, End, Learnt, by_target};
use crate::plan::Mutant;
use crate::records;

/// The fate of a mutant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// A test failed.
    Caught,
    /// A test took too long, which counts as caught.
    TimedOut,
    /// All tests that reach it passed.
    Survived,
    /// The tests that were run passed, and others were left because they would take longer than allowed.
    SurvivedSoFar,
    /// No test reaches it.
    Unreached,
}

/// The record of a mutant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    /// Its name.
    pub name: String,
    /// Its fate.
    pub outcome: Outcome,
    /// The test that caught it.
    pub by: Option<String>,
    /// How many tests were run.
    pub tests: usize,
    /// How long that took.
    pub seconds: f64,
}

/// How the trials are run.
pub struct Settings<'a> {
    /// The folder of the records.
    pub folder: &'a Path,
    /// The copy of the project.
    pub tree: &'a Path,
    /// Mutants at a time.
    pub jobs: usize,
    /// Seconds of tests that passed, after which a mutant is left as survived so far.
    pub budget: f64,
}

/// How often a test was run, and how often it caught something.
#[derive(Default)]
struct Record {
    runs: f64,
    caught: f64,
}

struct Tests<'a> {
    by_site: HashMap<u32, Vec<&'a Learnt>>,
    records: Mutex<HashMap<(&'a str, &'a str), Record>>,
}

impl<'a> Tests<'a> {
    fn of(learnt: &'a [Learnt]) -> Self {
        let mut by_site: HashMap<u32, Vec<&Learnt>> = HashMap::new();
        for test in learnt.iter().filter(|test| test.passed) {
            for site in &test.sites {
                by_site.entry(*site).or_default().push(test);
            }
        }
        Self { by_site, records: Mutex::new(HashMap::new()) }
    }

    /// The tests that reach a site: first the one that probably catches a mutant soonest, by its time and by how often it has
    /// caught one so far.
    fn ordered(&self, site: u32) -> Vec<&'a Learnt> {
        let mut tests = self.by_site.get(&site).cloned().unwrap_or_default();
        if let Ok(records) = self.records.lock() {
            let cost = |test: &Learnt| {
                let record = records.get(&(test.target.as_str(), test.test.as_str()));
                let (runs, caught) = record.map_or((0.0, 0.0), |record| (record.runs, record.caught));
                (test.seconds + 0.02) * (runs + 1.0) / (caught + 0.3)
            };
            tests.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        }
        tests
    }

    fn note(&self, test: &'a Learnt, caught: bool) {
        if let Ok(mut records) = self.records.lock() {
            let record = records.entry((&test.target, &test.test)).or_default();
            record.runs += 1.0;
            record.caught += f64::from(u8::from(caught));
        }
    }
}

/// Tries the mutants that are given, and appends a record for each.
pub fn run(
    settings: &Settings<'_>,
    programs: &[Program],
    learnt: &[Learnt],
    mutants: &[&Mutant],
) -> Fallible<()> {
    let file = settings.folder.join("trials.jsonl");
    let paths = by_target(programs);
    let tests = Tests::of(learnt);
    let queue = Mutex::new(mutants.iter().enumerate());
    std::thread::scope(|scope| {
        for worker in 0..settings.jobs {
            let (queue, paths, tests, file) = (&queue, &paths, &tests, &file);
            scope.spawn(move || {
                let temporary = settings.folder.join(format!("worker-{}-{worker}", std::process::id()));
                let bench = Bench { tree: settings.tree, programs: paths, temporary };
                while let Some((index, mutant)) = queue.lock().ok().and_then(|mut queue| queue.next()) {
                    let trial = trial(&bench, tests, mutant, settings.budget);
                    match trial.and_then(|trial| records::append(file, &trial).map(|()| trial)) {
                        Ok(trial) => say(&trial, index, mutants.len()),
                        Err(why) => eprintln!("{}: {why}", mutant.name),
                    }
                }
            });
        }
    });
    Ok(())
}

fn say(trial: &Trial, index: usize, all: usize) {
    if !matches!(trial.outcome, Outcome::Caught | Outcome::TimedOut) || index.is_multiple_of(50) {
        println!(
            "{}/{all} {:?}, {} tests, {:.1} s: {}",
            index + 1,
            trial.outcome,
            trial.tests,
            trial.seconds,
            trial.name
        );
    }
}

fn trial<'a>(bench: &Bench<'_>, tests: &Tests<'a>, mutant: &Mutant, budget: f64) -> Fallible<Trial> {
    let start = Instant::now();
    let number = mutant.number.to_string();
    let reaching = tests.ordered(mutant.site);
    let mut outcome = if reaching.is_empty() { Outcome::Unreached } else { Outcome::Survived };
    let (mut by, mut count) = (None, 0);
    for test in reaching {
        if start.elapsed().as_secs_f64() + test.seconds > budget {
            outcome = Outcome::SurvivedSoFar;
            continue;
        }
        // Others use the processor, too, but a test that takes five times its learnt time hangs.
        let limit = 10.0 + 5.0 * test.seconds;
        let end = bench.run(&test.target, &test.test, limit, ("KRYLUX_MUTANT", &number))?;
        count += 1;
        tests.note(test, end != End::Passed);
        if end != End::Passed {
            outcome = if end == End::Failed { Outcome::Caught } else { Outcome::TimedOut };
            by = Some(format!("{} {}", test.target, test.test));
            break;
        }
    }
    bench.clear();
    Ok(Trial { name: mutant.name.clone(), outcome, by, tests: count, seconds: start.elapsed().as_secs_f64() })
}

/// The last record of each mutant.
pub fn latest(file: &Path) -> Fallible<BTreeMap<String, Trial>> {
    let trials: Vec<Trial> = records::read(file)?;
    Ok(trials.into_iter().map(|trial| (trial.name.clone(), trial)).collect())
}

/// Runs each test that caught something once more with no mutant, and returns those that fail: what they caught is not certain.
pub fn unreliable(
    settings: &Settings<'_>,
    programs: &[Program],
    learnt: &[Learnt],
    trials: &BTreeMap<String, Trial>,
) -> Fallible<Vec<String>> {
    let paths = by_target(programs);
    let bench = Bench {
        tree: settings.tree,
        programs: &paths,
        temporary: settings.folder.join(format!("worker-{}", std::process::id())),
    };
    let mut failed = Vec::new();
    for test in learnt {
        let name = format!("{} {}", test.target, test.test);
        if trials.values().any(|trial| trial.by.as_ref() == Some(&name)) {
            let limit = 10.0 + 5.0 * test.seconds;
            if bench.run(&test.target, &test.test, limit, ("KRYLUX_MUTANT", "0"))? != End::Passed {
                failed.push(name);
            }
        }
    }
    bench.clear();
    Ok(failed)
}
