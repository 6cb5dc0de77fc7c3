//! The command line: `krylux VERB SOURCE [options]`. The verbs of [`crate::verbs::VERBS`] share `cli/asked.rs`; each other verb has a file.
//!
//! Exit status: 0 done; 1 done, but not good enough; 2 error; 130 interrupted.

mod asked;
mod cache;
mod compare;
mod console;
mod embedded_page;
mod generated;
mod info;
mod matrix;
mod opener;
mod opening;
mod options;
mod paint;
mod photo;
mod plan;
mod progress;
#[cfg(feature = "paper")]
mod reproduce;
mod rig;
mod runs;
mod team;
mod tev;
mod trace;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::error::Error;
use crate::finding::{Finding, Grade, worst};
use crate::machine;
use crate::verbs::Plan;
use crate::verbs::photo::{TakePhoto, WriteLabels};
use console::Console;
use options::GlobalArgs;

/// A light transport laboratory: trace a scene once, and ask its light transport matrix anything with a few dozen photos.
#[derive(Parser)]
#[command(version, max_term_width = 100, after_help = EXIT_STATUS, propagate_version = true)]
struct Cli {
    #[command(flatten)]
    global: GlobalArgs,
    #[command(subcommand)]
    verb: Verb,
}

const EXIT_STATUS: &str = "Exit status: 0 done; 1 done, but not good enough; 2 error; 130 interrupted.";

#[derive(Subcommand)]
enum Verb {
    #[command(flatten)]
    Asked(asked::AskedVerb),
    Photo(asked::Asked<TakePhoto, opening::Traced, photo::Kept>),
    Paint(paint::Args),
    #[command(subcommand)]
    Rig(rig::Action),
    Matrix(matrix::Args),
    Reproduce(reproduce::Args),
    Info(info::Args),
    #[command(subcommand)]
    Runs(runs::Action),
    Plan(asked::Asked<Plan, opening::Traced, ()>),
    #[command(subcommand)]
    Cache(cache::Action),
    Compare(compare::Args),
    Index(runs::IndexArgs),
    Labels(asked::Asked<WriteLabels, options::SourceArgs, ()>),
    Completions(generated::Completions),
    Man(generated::Manual),
    #[command(hide = true)]
    Projector(team::Projector),
    #[cfg(any(feature = "gige", feature = "usb3"))]
    #[command(hide = true)]
    DescribeCamera(rig::DescribeCamera),
}

/// `krylux reproduce` in a build without the figures of the paper.
#[cfg(not(feature = "paper"))]
mod reproduce {
    use super::{Console, Error, Outcome};

    /// Make the paper's figures again (not in this build of krylux)
    #[derive(clap::Args)]
    #[command(after_help = "Example:\n  krylux reproduce all")]
    pub(super) struct Args {
        #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
        words: Vec<String>,
    }

    pub(super) fn run(args: &Args, _: &Console) -> crate::Result<Outcome> {
        let named = [&["reproduce".to_owned()], args.words.as_slice()].concat().join(" ");
        Err(Error::option(&named, "this build of krylux leaves out the figures of the paper")
            .help("build krylux with its default features: cargo install --path . --locked"))
    }
}

/// The command line as clap describes it. The reference in the guide is generated from it.
pub fn command() -> clap::Command {
    Cli::command()
}

/// The outcome of a verb that ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Done,
    NotGoodEnough,
}

impl Outcome {
    /// The outcome for these findings. It is good enough if no finding fails.
    fn of(findings: &[Finding]) -> Self {
        if worst(findings) == Grade::Fails { Self::NotGoodEnough } else { Self::Done }
    }
}

/// The `main` of the program: parses the command line, runs the verb, and reports the outcome.
pub fn main() -> ExitCode {
    let team = match team::join() {
        Ok(team::Role::Leader(team)) => team,
        Ok(team::Role::Ended(status)) => return status,
        Err(error) => {
            eprintln!("krylux: error: {error}");
            return ExitCode::from(2);
        }
    };
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(why) => return console::report_usage(&why),
    };
    machine::start_threads();
    let console = Console::new(&cli.global, team.clone());
    let outcome = match &cli.verb {
        Verb::Photo(args) => photo::run(args, &console),
        Verb::Asked(asked) => asked.run(&console),
        Verb::Paint(args) => paint::run(args, &console),
        Verb::Rig(action) => rig::run(action, &console),
        Verb::Plan(args) => plan::run(args, &console),
        Verb::Matrix(args) => matrix::run(args, &console),
        Verb::Reproduce(args) => reproduce::run(args, &console),
        Verb::Labels(args) => photo::labels(args, &console),
        Verb::Compare(args) => compare::run(args, &console),
        Verb::Index(args) => runs::index(args, &console),
        Verb::Info(args) => info::run(args, &console),
        Verb::Cache(action) => cache::run(action, &console),
        Verb::Completions(args) => generated::completions(args, &console),
        Verb::Man(args) => generated::manual(args, &console),
        Verb::Runs(action) => runs::run(action, &console),
        Verb::Projector(_) => team::serve_projector(),
        #[cfg(any(feature = "gige", feature = "usb3"))]
        Verb::DescribeCamera(args) => args.run(&console),
    };
    if let Some(team) = team {
        // The team is ended explicitly, since values that are never dropped may refer to it. MPI would otherwise report a failed process.
        team.end();
    }
    match outcome {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::NotGoodEnough) => ExitCode::from(1),
        Err(error) => {
            console.error(&error);
            ExitCode::from(if matches!(error, Error::Interrupted) { 130 } else { 2 })
        }
    }
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;
    use std::path::{Path, PathBuf};

    use clap::builder::ValueParser;
    use clap::{Arg, Command, Parser};

    #[test]
    fn the_command_line_is_consistent() {
        super::command().debug_assert();
    }

    /// The options of a command and its subcommands whose values have one of these types, each with its parser.
    fn options(command: &Command, types: &[TypeId]) -> Vec<(String, ValueParser)> {
        let of = |argument: &Arg| {
            let parser = argument.get_value_parser().clone();
            // Options for bytes are skipped. They accept larger numbers than options for photos or pixels.
            let is_bytes = argument.get_value_names().is_some_and(|names| names[0] == "BYTES");
            let is_one = !is_bytes && types.iter().any(|of| parser.type_id() == *of);
            is_one.then(|| (format!("{} {argument}", command.get_name()), parser))
        };
        let own = command.get_arguments().filter_map(of);
        own.chain(command.get_subcommands().flat_map(|verb| options(verb, types))).collect()
    }

    /// Asserts that each of more than 20 options takes one text and refuses another.
    fn assert_bounded(types: &[TypeId], [taken, refused]: [&str; 2]) {
        let mut command = super::command();
        command.build();
        let options = options(&command, types);
        assert!(options.len() > 20, "{options:?}");
        for (name, parser) in options {
            let takes = |text: &str| {
                let alone = Command::new("test").arg(Arg::new("x").long("x").value_parser(parser.clone()));
                alone.try_get_matches_from(["test", &format!("--x={text}")]).is_ok()
            };
            assert!(takes(taken) && !takes(refused), "{name}");
        }
    }

    /// The long names of all options of a command and its subcommands.
    fn names(command: &Command) -> Vec<String> {
        let own = command.get_arguments().filter_map(|of| Some(format!("--{}", of.get_long()?)));
        own.chain(command.get_subcommands().flat_map(names)).collect()
    }

    /// The source files below a folder.
    fn sources(folder: &Path) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).expect("sources can be read");
        let paths = entries.map(|entry| entry.expect("an entry").path());
        paths.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
    }

    /// The examples in the help of each verb, by its name. A verb that has only subcommands is replaced by these.
    fn examples(command: &Command, name: &str) -> Vec<(String, Vec<String>)> {
        let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set() && verb.get_name() != "help");
        let verbs: Vec<_> =
            verbs.flat_map(|verb| examples(verb, &format!("{name} {}", verb.get_name()))).collect();
        let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        let lines = text.lines().filter_map(|line| line.strip_prefix("  ")).map(str::to_owned).collect();
        let is_one = verbs.is_empty() || command.get_positionals().next().is_some();
        verbs.into_iter().chain(is_one.then(|| (name.to_owned(), lines))).collect()
    }

    #[test]
    fn every_verb_shows_an_example_that_it_takes() {
        let examples = examples(&super::command(), "krylux");
        assert!(examples.len() > 20, "{examples:?}");
        for (verb, lines) in examples {
            assert!(!lines.is_empty(), "{verb} --help has no example");
            for line in lines {
                let line = line.split(" #").next().unwrap_or_default();
                let last = verb.rsplit(' ').next().unwrap_or_default();
                assert!(line.starts_with("krylux ") && line.contains(last), "an example of {verb}: {line}");
                let parsed = super::Cli::try_parse_from(line.split_whitespace());
                assert!(
                    parsed.is_ok(),
                    "{line}: {}",
                    parsed.err().map(|why| why.to_string()).unwrap_or_default()
                );
            }
        }
    }

    #[test]
    fn errors_name_options_that_exist() {
        let mut command = super::command();
        command.build();
        let names = names(&command);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut found = 0;
        for path in sources(&root) {
            // The options in these files are options of the program gphoto2.
            if path.starts_with(root.join("rig/gphoto2")) || path == root.join("rig/gphoto2.rs") {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("sources are text");
            for quoted in text.split('"').filter(|quoted| quoted.starts_with("--")) {
                let is_name = quoted[2..].bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-');
                if is_name && quoted.len() > 2 {
                    found += 1;
                    assert!(names.iter().any(|name| name == quoted), "{quoted} in {}", path.display());
                }
            }
        }
        assert!(found > 50, "{found}");
    }

    #[test]
    fn no_option_takes_nan_for_a_number() {
        let numbers = [TypeId::of::<f64>(), TypeId::of::<f32>()];
        assert_bounded(&numbers, ["0.5", "nan"]);
        assert_bounded(&numbers, ["1e3", "-NaN"]);
    }

    #[test]
    fn no_option_takes_a_time_that_no_clock_counts() {
        fn times(command: &Command) -> Vec<(String, ValueParser)> {
            let is_time = |of: &&Arg| {
                of.get_value_names().is_some_and(|names| ["SECONDS", "MINUTES"].contains(&names[0].as_str()))
            };
            let own = command.get_arguments().filter(is_time);
            let own = own.map(|of| (format!("{} {of}", command.get_name()), of.get_value_parser().clone()));
            own.chain(command.get_subcommands().flat_map(times)).collect()
        }
        let mut command = super::command();
        command.build();
        let times = times(&command);
        assert!(times.len() >= 3, "{times:?}");
        for (name, parser) in times {
            let takes = |text: &str| {
                let alone = Command::new("test").arg(Arg::new("x").long("x").value_parser(parser.clone()));
                alone.try_get_matches_from(["test", &format!("--x={text}")]).is_ok()
            };
            assert!(["0.5", "1e-6", "3600"].into_iter().all(takes), "{name}");
            for refused in ["-1", "0", "-0.5", "nan", "inf", "-inf", "1e300", "1e-400", "soon"] {
                assert!(!takes(refused), "{name} takes {refused}");
            }
        }
    }

    #[test]
    fn devices_name_no_options_of_verbs_for_runs() {
        // Some verbs that use devices have no `--resume`, so messages of devices must not name it.
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/rig");
        for path in sources(&root) {
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            assert!(!text.contains("--resume"), "{}", path.display());
        }
    }

    #[test]
    fn no_option_takes_a_count_whose_products_overflow() {
        let counts = [TypeId::of::<usize>(), TypeId::of::<u64>()];
        assert_bounded(&counts, ["7", "18446744073709551615"]);
        assert_bounded(&counts, ["7", "1000000000"]);
    }
}
