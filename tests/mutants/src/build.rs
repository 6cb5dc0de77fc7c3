//! The copy of the project with all mutants in it, and its build. What the compiler refuses is left out until it builds.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;

use crate::Fallible;
use crate::plan::Plan;
use crate::rewrite::{Owner, Text, rewrite};
use crate::sites::Shape;

const SWITCH: &str = include_str!("switch.rs.txt");

/// A program of tests.
#[derive(Clone, Debug)]
pub struct Program {
    /// The name of its target.
    pub target: String,
    /// The program.
    pub path: PathBuf,
}

#[derive(Deserialize)]
struct Line {
    reason: String,
    message: Option<Message>,
    executable: Option<PathBuf>,
    target: Option<Target>,
    profile: Option<Profile>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
    kind: Vec<String>,
}

#[derive(Deserialize)]
struct Profile {
    test: bool,
}

#[derive(Deserialize)]
struct Message {
    level: String,
    message: String,
    code: Option<Code>,
    spans: Vec<Spot>,
}

#[derive(Deserialize)]
struct Code {
    code: String,
}

#[derive(Clone, Deserialize)]
struct Spot {
    file_name: String,
    byte_start: usize,
    byte_end: usize,
    is_primary: bool,
    expansion: Option<Box<Expansion>>,
}

#[derive(Clone, Deserialize)]
struct Expansion {
    span: Spot,
}

/// Copies what git knows of the project, and only what has changed. Sources that the project no longer has are removed.
pub fn copy(project: &Path, tree: &Path) -> Fallible<()> {
    let arguments = ["ls-files", "-z", "--cached", "--others", "--exclude-standard"];
    let said = Command::new("git").args(arguments).current_dir(project).output()?;
    let names = String::from_utf8(said.stdout)?;
    remove_gone(project, tree, Path::new("src"))?;
    remove_gone(project, tree, Path::new("tests"))?;
    for name in names.split('\0').filter(|name| !name.is_empty() && !name.starts_with("tests/mutants/")) {
        let (from, to) = (project.join(name), tree.join(name));
        if !from.is_file() {
            continue;
        }
        let bytes = std::fs::read(&from)?;
        let switched = to.with_extension("rs.before");
        // A file with switches is compared with what it was made of.
        if std::fs::read(&switched).or_else(|_| std::fs::read(&to)).is_ok_and(|before| before == bytes) {
            continue;
        }
        write(&to, &bytes)?;
        std::fs::set_permissions(&to, std::fs::metadata(&from)?.permissions())?;
        let _ = std::fs::remove_file(switched);
    }
    Ok(())
}

/// Removes the sources below `folder` that are in the copy only: a module may have become a folder. The module of switches stays.
fn remove_gone(project: &Path, tree: &Path, folder: &Path) -> Fallible<()> {
    let Ok(listing) = std::fs::read_dir(tree.join(folder)) else { return Ok(()) };
    for item in listing {
        let item = item?;
        let name = folder.join(item.file_name());
        if item.file_type()?.is_dir() {
            remove_gone(project, tree, &name)?;
        } else if name.extension().is_some_and(|extension| extension == "rs")
            && name != Path::new("src/mutant.rs")
            && !project.join(&name).exists()
        {
            std::fs::remove_file(item.path())?;
            let _ = std::fs::remove_file(item.path().with_extension("rs.before"));
        }
    }
    Ok(())
}

/// Writes a file where its content is another, so that cargo compiles only what has changed.
fn write(path: &Path, bytes: &[u8]) -> Fallible<()> {
    if std::fs::read(path).is_ok_and(|before| before == bytes) {
        return Ok(());
    }
    std::fs::create_dir_all(path.parent().ok_or("a file has a folder")?)?;
    Ok(std::fs::write(path, bytes)?)
}

/// Writes the files with their switches, and the module that they ask.
fn write_switches(project: &Path, tree: &Path, plan: &Plan) -> Fallible<BTreeMap<String, Text>> {
    let mut texts = BTreeMap::new();
    for source in &plan.sources {
        let text = rewrite(&source.text, source.sites.clone());
        write(&tree.join(&source.file), text.text.as_bytes())?;
        write(&tree.join(&source.file).with_extension("rs.before"), source.text.as_bytes())?;
        texts.insert(source.file.clone(), text);
    }
    let sites = plan.mutants.len() + 1;
    write(&tree.join("src/mutant.rs"), SWITCH.replace("SITES", &sites.to_string()).as_bytes())?;
    let root = std::fs::read_to_string(project.join("src/lib.rs"))?;
    let allowed =
        "#![allow(warnings, arithmetic_overflow, unconditional_panic, unused_must_use, unsafe_code)]";
    write(&tree.join("src/lib.rs"), format!("{allowed}\n{root}\npub mod mutant;\n").as_bytes())?;
    write(&tree.join("src/lib.rs.before"), root.as_bytes())?;
    Ok(texts)
}

/// Builds the copy, and leaves out what does not compile. Returns the programs of tests that were built.
pub fn build(project: &Path, tree: &Path, plan: &mut Plan, arguments: &[String]) -> Fallible<Vec<Program>> {
    for round in 1.. {
        let texts = write_switches(project, tree, plan)?;
        let mut command = Command::new("cargo");
        command.args(arguments).args(["--release", "--locked", "--message-format=json"]).current_dir(tree);
        let said = command.stderr(Stdio::inherit()).output()?;
        let lines = String::from_utf8_lossy(&said.stdout);
        let lines: Vec<Line> = lines.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        if said.status.success() {
            return Ok(programs(&lines));
        }
        let refused = refused(&lines, &texts, plan);
        eprintln!("round {round}: {} mutants are left out", refused.len());
        if refused.is_empty() {
            return Err("the copy does not build, and no switch is to blame".into());
        }
        leave_out(plan, &refused);
    }
    Err("never reached".into())
}

fn programs(lines: &[Line]) -> Vec<Program> {
    let programs = lines.iter().filter_map(|line| {
        let target = line.target.as_ref()?;
        let path = line.executable.clone()?;
        let library = target.kind.iter().any(|kind| kind == "lib");
        let name = if library { "lib".to_owned() } else { target.name.clone() };
        line.profile.as_ref()?.test.then_some(Program { target: name, path })
    });
    programs.collect()
}

/// The mutants that errors point at, with the reason.
fn refused(lines: &[Line], texts: &BTreeMap<String, Text>, plan: &Plan) -> BTreeMap<u32, String> {
    let mut refused = BTreeMap::new();
    for line in lines.iter().filter(|line| line.reason == "compiler-message") {
        let Some(message) = line.message.as_ref().filter(|message| message.level == "error") else {
            continue;
        };
        let code = message.code.as_ref().map_or("error", |code| &code.code);
        let mut spots: Vec<&Spot> = message.spans.iter().collect();
        spots.sort_by_key(|spot| !spot.is_primary);
        let spots: Vec<(&str, Range<usize>)> =
            spots.into_iter().filter_map(|spot| in_text(spot, texts)).collect();
        let before = refused.len();
        let owner = spots.iter().find_map(|(file, range)| innermost(&texts[*file], range));
        match owner {
            Some(Owner::Mutant(number)) => {
                refused.insert(number, format!("the mutant does not compile ({code})"));
            }
            Some(Owner::Site(site)) => {
                drop_site(plan, site, code, &mut refused);
            }
            None => {
                if let Some((file, range)) = spots.first() {
                    for site in near(&texts[*file], range, plan, file) {
                        drop_site(plan, site, code, &mut refused);
                    }
                }
            }
        }
        if refused.len() == before && owner.is_none() {
            eprintln!("not placed: {} {}", code, message.message);
        }
    }
    refused
}

/// The place of an error in a file with switches, also if a macro of the standard library is expanded there.
fn in_text<'a>(spot: &Spot, texts: &'a BTreeMap<String, Text>) -> Option<(&'a str, Range<usize>)> {
    match texts.get_key_value(&spot.file_name) {
        Some((file, _)) => Some((file, spot.byte_start..spot.byte_end)),
        None => spot.expansion.as_ref().and_then(|expansion| in_text(&expansion.span, texts)),
    }
}

/// The smallest owned part around an error.
fn innermost(text: &Text, at: &Range<usize>) -> Option<Owner> {
    let around = text.owned.iter().filter(|(range, _)| range.start <= at.start && at.end <= range.end);
    around.min_by_key(|(range, _)| range.len()).map(|(_, owner)| *owner)
}

/// The sites within an error, or else in its lines, or else the body that begins before it.
fn near(text: &Text, at: &Range<usize>, plan: &Plan, file: &str) -> BTreeSet<u32> {
    let sites = |range: Range<usize>| -> BTreeSet<u32> {
        let touched = text.owned.iter().filter(|(part, _)| part.start < range.end && range.start < part.end);
        touched
            .filter_map(|(_, owner)| if let Owner::Site(site) = owner { Some(*site) } else { None })
            .collect()
    };
    let within = sites(at.clone());
    if !within.is_empty() {
        return within;
    }
    let start = text.text[..at.start].rfind('\n').unwrap_or(0);
    let end = text.text[at.end..].find('\n').map_or(text.text.len(), |end| at.end + end);
    let within = sites(start..end);
    if !within.is_empty() {
        return within;
    }
    let bodies: BTreeSet<u32> = plan
        .sources
        .iter()
        .filter(|source| source.file == file)
        .flat_map(|source| &source.sites)
        .filter(|site| matches!(site.found.shape, Shape::Body))
        .map(|site| site.number)
        .collect();
    let before = text.owned.iter().filter_map(|(part, owner)| match owner {
        Owner::Site(site) if part.start < at.start && bodies.contains(site) => Some((part.start, *site)),
        _ => None,
    });
    before.max().map(|(_, site)| site).into_iter().collect()
}

fn drop_site(plan: &Plan, site: u32, code: &str, refused: &mut BTreeMap<u32, String>) {
    let sites = plan.sources.iter().flat_map(|source| &source.sites).filter(|one| one.number == site);
    for mutant in sites.flat_map(|site| &site.mutants) {
        refused.entry(mutant.number).or_insert_with(|| format!("the switch does not compile ({code})"));
    }
}

/// Takes mutants out of the plan.
pub fn leave_out(plan: &mut Plan, refused: &BTreeMap<u32, String>) {
    for mutant in &mut plan.mutants {
        if let Some(reason) = refused.get(&mutant.number) {
            mutant.left_out = Some(reason.clone());
        }
    }
    for source in &mut plan.sources {
        for site in &mut source.sites {
            site.mutants.retain(|mutant| !refused.contains_key(&mutant.number));
        }
        source.sites.retain(|site| !site.mutants.is_empty());
    }
}
