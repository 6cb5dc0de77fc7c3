//! All mutants of krylux's rooms as switches of one build, and against each the tests that reach it.
//!
//! A build for each mutant would take days. `cargo mutants --list` says what the mutants are; here they are all written into
//! a copy of the project at once, each behind the number that switches it on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Parser;

mod build;
mod learn;
mod list;
mod plan;
mod records;
mod rewrite;
mod sites;
mod table;
#[cfg(test)]
mod tests;
mod trial;

use plan::{Mutant, Plan};
use trial::{Outcome, Trial};

/// Errors of a program for developers: their text is what matters.
type Fallible<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// Runs the mutants of krylux against its tests. What is known is kept in a folder, so that a run can be stopped at any time.
#[derive(Parser)]
#[command(version)]
struct Options {
    /// The rooms.
    #[arg(long, value_delimiter = ',', default_value = "krylov,transport,measure,journal,io")]
    rooms: Vec<String>,
    /// The targets of tests: `lib` for the tests beside the code, and names of programs of tests.
    #[arg(long, value_delimiter = ',', default_value = "lib,library,commands,scene")]
    tests: Vec<String>,
    /// One piece of the whole: K/N, with K from 0.
    #[arg(long, value_name = "K/N")]
    shard: Option<String>,
    /// So many mutants of each room, drawn at random.
    #[arg(long, value_name = "N")]
    sample: Option<usize>,
    /// Which sample.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Tries those again that were not caught, after tests were added.
    #[arg(long)]
    again: bool,
    /// Only mutants with this in their name.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Forgets what is known of the tests with this in their name.
    #[arg(long, value_name = "TEXT")]
    forget: Option<String>,
    /// Uses only tests of which is known what they reach, and runs none to learn it.
    #[arg(long)]
    learnt: bool,
    /// Shows the table of what is known, and runs nothing.
    #[arg(long)]
    table: bool,
    /// Runs the tests that caught something once more, with no mutant.
    #[arg(long)]
    check: bool,
    /// Mutants at a time.
    #[arg(long, default_value_t = 2)]
    jobs: usize,
    /// Seconds of passed tests for a mutant; the tests that are left are then not run.
    #[arg(long, default_value_t = 120.0)]
    budget: f64,
    /// Tests that take longer than this number of seconds are not used.
    #[arg(long, default_value_t = 60.0)]
    longest: f64,
    /// The folder of the copy and of all records.
    #[arg(long, default_value = "target/mutants")]
    folder: PathBuf,
    /// The program cargo-mutants, from version 25 on.
    #[arg(long, default_value = "cargo-mutants")]
    cargo_mutants: PathBuf,
}

fn main() -> Fallible<()> {
    let options = Options::parse();
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize()?;
    std::fs::create_dir_all(&options.folder)?;
    let folder = options.folder.canonicalize()?;
    let reasons = table::reasons(&project.join("tests/mutants/survivors.toml"))?;
    let trials = folder.join("trials.jsonl");
    if options.table {
        let mutants: Vec<Mutant> = records::read(&folder.join("mutants.jsonl"))?;
        print!("{}", table::table(&mutants, &trial::latest(&trials)?, &reasons));
        return Ok(());
    }

    let tree = folder.join("tree");
    let mut plan = prepare(&options, &project, &folder)?;
    build::copy(&project, &tree)?;
    build::build(&project, &tree, &mut plan, &["build".into(), "--lib".into(), "--bins".into()])?;
    keep(&folder, &plan)?;
    let programs = build::build(&project, &tree, &mut plan, &test_arguments(&options.tests))?;
    keep(&folder, &plan)?;

    if let Some(text) = &options.forget {
        forget(&folder, text)?;
    }
    let jobs = if options.learnt { 0 } else { options.jobs };
    let learnt = learn::learn(&folder, &tree, &programs, jobs, options.longest)?;
    for test in learnt.iter().filter(|test| !test.passed) {
        eprintln!("not used, since it does not pass in the copy: {} {}", test.target, test.test);
    }
    let known = trial::latest(&trials)?;
    let settings =
        trial::Settings { folder: &folder, tree: &tree, jobs: options.jobs, budget: options.budget };
    if options.check {
        for name in trial::unreliable(&settings, &programs, &learnt, &known)? {
            println!("fails without a mutant: {name}");
        }
        return Ok(());
    }
    let chosen = choose(&options, &plan.mutants, &known)?;
    trial::run(&settings, &programs, &learnt, &chosen)?;
    print!("{}", table::table(&plan.mutants, &trial::latest(&trials)?, &reasons));
    Ok(())
}

/// The mutants at their places, without those that did not compile the last time.
fn prepare(options: &Options, project: &Path, folder: &Path) -> Fallible<Plan> {
    let listed = list::mutants(&options.cargo_mutants, project, &options.rooms)?;
    let mut plan = plan::plan(project, &listed)?;
    let before: Vec<Mutant> = records::read(&folder.join("mutants.jsonl"))?;
    let same = before.len() == plan.mutants.len()
        && before
            .iter()
            .zip(&plan.mutants)
            .all(|(before, now)| before.name == now.name && before.code == now.code);
    if !same {
        // Numbers of places have changed, and with them what is known of the tests.
        let _ = std::fs::remove_file(folder.join("tests.jsonl"));
    }
    let refused = before.into_iter().filter_map(|mutant| Some((mutant.name, mutant.left_out?)));
    let refused: BTreeMap<String, String> = refused.collect();
    let refused = plan
        .mutants
        .iter()
        .filter_map(|mutant| Some((mutant.number, refused.get(&mutant.name)?.clone())))
        .collect();
    build::leave_out(&mut plan, &refused);
    Ok(plan)
}

fn keep(folder: &Path, plan: &Plan) -> Fallible<()> {
    let file = folder.join("mutants.jsonl");
    let lines: Result<Vec<String>, _> = plan.mutants.iter().map(serde_json::to_string).collect();
    Ok(std::fs::write(file, lines?.join("\n") + "\n")?)
}

fn test_arguments(targets: &[String]) -> Vec<String> {
    let mut arguments = vec!["test".to_owned(), "--no-run".to_owned()];
    for target in targets {
        if target == "lib" {
            arguments.push("--lib".to_owned());
        } else {
            arguments.extend(["--test".to_owned(), target.clone()]);
        }
    }
    arguments
}

fn forget(folder: &Path, text: &str) -> Fallible<()> {
    let file = folder.join("tests.jsonl");
    let known: Vec<learn::Learnt> = records::read(&file)?;
    let lines: Result<Vec<String>, _> = known
        .iter()
        .filter(|one| !format!("{} {}", one.target, one.test).contains(text))
        .map(serde_json::to_string)
        .collect();
    Ok(std::fs::write(file, lines?.join("\n") + "\n")?)
}

/// The mutants that are to be tried now.
fn choose<'a>(
    options: &Options,
    mutants: &'a [Mutant],
    known: &BTreeMap<String, Trial>,
) -> Fallible<Vec<&'a Mutant>> {
    let mut chosen: Vec<&Mutant> = mutants.iter().filter(|mutant| mutant.left_out.is_none()).collect();
    if let Some(shard) = &options.shard {
        let (piece, pieces) = shard.split_once('/').ok_or("a shard is K/N")?;
        let (piece, pieces): (usize, usize) = (piece.parse()?, pieces.parse()?);
        if piece >= pieces {
            return Err(format!("the shards of {pieces} are 0 to {}", pieces - 1).into());
        }
        chosen = chosen.into_iter().skip(piece).step_by(pieces).collect();
    }
    // A larger sample of the same seed contains the smaller one, and the rooms take turns.
    fastrand::Rng::with_seed(options.seed).shuffle(&mut chosen);
    let mut taken: BTreeMap<&str, usize> = BTreeMap::new();
    let mut ranked = Vec::new();
    for mutant in chosen {
        let rank = taken.entry(&mutant.room).or_default();
        *rank += 1;
        ranked.push((*rank, mutant));
    }
    ranked.sort_by_key(|(rank, _)| *rank);
    let wanted = |mutant: &Mutant| {
        let caught = |trial: &Trial| matches!(trial.outcome, Outcome::Caught | Outcome::TimedOut);
        let open = known.get(&mutant.name).map_or(!options.again, |trial| options.again && !caught(trial));
        open && options.only.as_ref().is_none_or(|text| mutant.name.contains(text))
    };
    let within = |rank: usize| options.sample.is_none_or(|sample| rank <= sample);
    Ok(ranked.into_iter().filter(|(rank, mutant)| within(*rank) && wanted(mutant)).map(|(_, m)| m).collect())
}
