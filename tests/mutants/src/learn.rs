//! Which tests there are, how long each takes, and which places each reaches.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::Fallible;
use crate::build::Program;
use crate::records;

/// A test, with the switches that it reaches and its time.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Learnt {
    /// The target, `lib` for the tests beside the code.
    pub target: String,
    /// The name within the target.
    pub test: String,
    /// How long it took, while it was recorded what it reaches.
    pub seconds: f64,
    /// Whether it passed in the copy, with all mutants off.
    pub passed: bool,
    /// The numbers of the places that it reaches.
    pub sites: Vec<u32>,
}

/// How a test ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// With success.
    Passed,
    /// Without.
    Failed,
    /// It was ended because it took too long.
    TimedOut,
}

/// The environment in which one worker runs tests.
pub struct Bench<'a> {
    /// The copy of the project.
    pub tree: &'a Path,
    /// The programs by their target.
    pub programs: &'a BTreeMap<String, PathBuf>,
    /// A folder for what tests leave behind.
    pub temporary: PathBuf,
}

impl Bench<'_> {
    /// Runs one test, alone in a process.
    pub fn run(&self, target: &str, test: &str, limit: f64, variable: (&str, &str)) -> Fallible<End> {
        let program = self.programs.get(target).ok_or_else(|| format!("there is no program {target}"))?;
        fs::create_dir_all(&self.temporary)?;
        // A mutant may take all memory, or never end; the processes that a test started end with it.
        let script = "ulimit -v 16000000; exec timeout -s KILL \"$0\" \"$@\"";
        let mut command = Command::new("sh");
        command.args(["-c", script, &format!("{limit:.1}")]).arg(program);
        command.args(["--exact", test, "--test-threads", "1"]);
        command.env("TMPDIR", &self.temporary).env("NODEVICE_SELECT", "1").env(variable.0, variable.1);
        command.env("CARGO_MANIFEST_DIR", self.tree).current_dir(self.tree);
        let output = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status()?;
        Ok(match output.code() {
            Some(0) => End::Passed,
            Some(137) | None => End::TimedOut,
            Some(_) => End::Failed,
        })
    }

    /// Removes what tests left behind.
    pub fn clear(&self) {
        let _ = fs::remove_dir_all(&self.temporary);
    }
}

/// The names of a program's tests, without those that are ignored.
fn names(program: &Program, tree: &Path) -> Fallible<Vec<String>> {
    let list = |more: &[&str]| -> Fallible<BTreeSet<String>> {
        let said = Command::new(&program.path)
            .args(["--list", "--format", "terse"])
            .args(more)
            .current_dir(tree)
            .output()?;
        let said = String::from_utf8(said.stdout)?;
        Ok(said.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
    };
    let ignored = list(&["--ignored"])?;
    Ok(list(&[])?.into_iter().filter(|name| !ignored.contains(name)).collect())
}

/// Runs every test of which nothing is known yet once, and keeps what was learnt in a file.
pub fn learn(
    folder: &Path,
    tree: &Path,
    programs: &[Program],
    jobs: usize,
    longest: f64,
) -> Fallible<Vec<Learnt>> {
    let file = folder.join("tests.jsonl");
    let mut known: Vec<Learnt> = records::read(&file)?;
    let have: BTreeSet<(String, String)> =
        known.iter().map(|one| (one.target.clone(), one.test.clone())).collect();
    let mut tests = Vec::new();
    let mut all = BTreeSet::new();
    for program in programs {
        for test in names(program, tree)? {
            all.insert((program.target.clone(), test.clone()));
            if !have.contains(&(program.target.clone(), test.clone())) {
                tests.push((program.target.clone(), test));
            }
        }
    }
    eprintln!("{} tests are known, {} are run once to learn what they reach", have.len(), tests.len());
    let paths = by_target(programs);
    let queue = Mutex::new(tests.into_iter());
    let learnt = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for worker in 0..jobs {
            let (queue, learnt, paths, file) = (&queue, &learnt, &paths, &file);
            scope.spawn(move || {
                let bench = Bench {
                    tree,
                    programs: paths,
                    temporary: folder.join(format!("learn-{}-{worker}", std::process::id())),
                };
                while let Some((target, test)) = queue.lock().ok().and_then(|mut queue| queue.next()) {
                    match one(&bench, folder, worker, target, test, longest) {
                        Ok(one) => {
                            if let Ok(mut learnt) = learnt.lock() {
                                records::append(file, &one).unwrap_or_else(|why| eprintln!("{why}"));
                                learnt.push(one);
                            }
                        }
                        Err(why) => eprintln!("{why}"),
                    }
                }
            });
        }
    });
    known.extend(learnt.into_inner()?);
    known.retain(|one| all.contains(&(one.target.clone(), one.test.clone())));
    Ok(known)
}

/// Programs by the name of their target.
pub fn by_target(programs: &[Program]) -> BTreeMap<String, PathBuf> {
    programs.iter().map(|program| (program.target.clone(), program.path.clone())).collect()
}

fn one(
    bench: &Bench<'_>,
    folder: &Path,
    worker: usize,
    target: String,
    test: String,
    longest: f64,
) -> Fallible<Learnt> {
    let reached = folder.join(format!("reached-{}-{worker}", std::process::id()));
    let _ = fs::remove_file(&reached);
    let name = reached.to_str().ok_or("the folder's name is not text")?;
    let start = Instant::now();
    let end = bench.run(&target, &test, longest, ("KRYLUX_REACHED", name))?;
    let seconds = start.elapsed().as_secs_f64();
    bench.clear();
    let bytes = fs::read(&reached).unwrap_or_default();
    let _ = fs::remove_file(&reached);
    let sites: BTreeSet<u32> = bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    Ok(Learnt { target, test, seconds, passed: end == End::Passed, sites: sites.into_iter().collect() })
}
