//! Every block of commands runs as it is printed: the README and then the pages of the guide, in their order, in one folder.

use std::path::{Path, PathBuf};

use crate::blocks::{self, Block, Mark};
use crate::pages::{self, Page};
use crate::workplace::Workplace;

/// The number of blocks that ran, and the failures.
type Found = (usize, Vec<String>);

/// Runs the blocks in one language of every page. A page ends at its first failure, and the next page goes on.
fn run_all(language: &str, run: impl Fn(&Workplace, &Page, &Block) -> Option<(i32, String)>) -> Found {
    let cache = tempfile::tempdir().expect("a temporary folder can be made");
    let place = Workplace::new(cache.path());
    let (mut ran, mut failures) = (0, Vec::new());
    for page in pages::all() {
        failures.extend(run_page(&page, language, &place, &run, &mut ran).err());
    }
    (ran, failures)
}

fn run_page(
    page: &Page,
    language: &str,
    place: &Workplace,
    run: &impl Fn(&Workplace, &Page, &Block) -> Option<(i32, String)>,
    ran: &mut usize,
) -> Result<(), String> {
    let blocks = blocks::of(page);
    let is_run = |block: &Block| block.language == language && !matches!(block.mark, Some(Mark::NotRun(_)));
    if !blocks.iter().any(is_run) {
        return Ok(());
    }
    let mut said = String::new();
    for block in &blocks {
        let fault = match &block.mark {
            Some(Mark::File(name)) => {
                place.write(name, &block.text);
                None
            }
            Some(Mark::Says) => block
                .text
                .lines()
                .find(|line| !said.contains(line.trim()))
                .map(|line| format!("the program does not say `{line}`, but:\n{said}")),
            _ if is_run(block) => {
                *ran += 1;
                let (status, output) = run(place, page, block).unwrap_or((-1, "it took too long".into()));
                said = output;
                let expected = if let Some(Mark::Fails(status)) = block.mark { status } else { 0 };
                (status != expected).then(|| format!("exit status {status}, not {expected}:\n{said}"))
            }
            _ => None,
        };
        if let Some(fault) = fault {
            return Err(format!("{}: {fault}\n{}", page.at(block.line), block.text));
        }
    }
    Ok(())
}

#[track_caller]
fn require_success(language: &str, (ran, failures): Found, least: usize) {
    assert!(failures.is_empty(), "{} pages failed\n\n{}", failures.len(), failures.join("\n\n"));
    println!("{ran} blocks of {language} ran");
    assert!(ran >= least, "only {ran} blocks of {language} were found");
}

/// A shell script whose lines have the numbers of the page's, so that an error names the page and the line.
fn script(page: &Page, block: &Block) -> String {
    let name = page.path.display();
    let trap = format!("set -euo pipefail; trap 'echo \"{name}:$LINENO: failed: $BASH_COMMAND\"' ERR");
    trap + &"\n".repeat(block.line) + &block.text
}

#[test]
fn every_command_runs() {
    let bash = Path::new("bash");
    let found = run_all("sh", |place, page, block| {
        place.write(".block.sh", &script(page, block));
        let ended = place.run(bash, &[".block.sh"]);
        ended.status.map(|status| (status, ended.output))
    });
    require_success("sh", found, 20);
}

/// The interpreter with the Python package, which `.ci/run` installs: `KRYLUX_PYTHON`.
#[test]
fn every_block_of_python_runs() {
    let Some(python) = std::env::var_os("KRYLUX_PYTHON").map(PathBuf::from) else {
        eprintln!("not run: set KRYLUX_PYTHON to a Python that has the package krylux");
        return;
    };
    let found = run_all("python", |place, page, block| {
        place.write(".block.py", &("\n".repeat(block.line) + &block.text));
        let ended = place.run(&python, &[".block.py"]);
        let named = ended.output.replace(".block.py\", line ", &format!("{}\", line ", page.path.display()));
        ended.status.map(|status| (status, named))
    });
    require_success("python", found, 3);
}

#[test]
fn blocks_that_do_not_run_say_why() {
    for page in pages::all() {
        for block in blocks::of(&page) {
            let is_of_commands =
                ["sh", "python", "console", "bash", "shell", ""].contains(&block.language.as_str());
            if let Some(Mark::NotRun(reason)) = &block.mark {
                println!("not run: {}: {reason}", page.at(block.line));
                assert!(reason.len() > 10, "{}: give a reason", page.at(block.line));
            } else if is_of_commands {
                let language = &block.language;
                assert!(
                    ["sh", "python"].contains(&language.as_str()),
                    "{}: commands are marked `sh` or `python`, other text `text`, not `{language}`",
                    page.at(block.line)
                );
            }
        }
    }
}
