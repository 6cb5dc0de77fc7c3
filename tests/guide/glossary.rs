//! Every figure that a report or `run.json` shows has a definition in the glossary.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::pages::read;
use crate::workplace::Workplace;

/// Runs whose pages have between them every figure that a page can show.
const RUNS: &str = r#"
K="--size 24 --spp 16 --photos 12"
Z=assets/scenes/zigzag/scene.glb
krylux photo assets/scenes/corner/scene.glb --size 24 --spp 16 --pattern checker:4 --channels luma -q -o photo.png
krylux segment $Z $K --groups 2,4 --evidence --features "5,5;20,20" -q -o out/segment || test $? = 1
krylux compensate assets/scenes/corner/scene.glb $K --target photo.png --compare-methods -q -o out/compare || test $? = 1
krylux compensate assets/scenes/corner/scene.glb $K --target photo.png --paper --lift 0.1 --precondition direct -q -o out/paper || test $? = 1
krylux eigs $Z $K --count 4 -q -o out/eigs || test $? = 1
krylux relight $Z $K --pattern left --dual -q -o out/relight || test $? = 1
krylux separate $Z --size 24 --spp 16 --compare -q -o out/separate || test $? = 1
krylux separate $Z --size 24 --spp 16 --by checkerboards -q -o out/checkerboards || test $? = 1
krylux probe $Z $K -q -o out/probe || test $? = 1
krylux matrix $Z --size 8 --spp 16 -q -o matrix.npz
krylux photo $Z --size 8 --spp 16 --channels luma -q -o photo.npy
krylux solve matrix.npz photo.npy -q -o out/solve || test $? = 1
sed 's/size = \[64, 64\]/size = [24, 24]/' assets/rigs/realistic.toml > assets/rigs/small.toml
krylux rig calibrate assets/rigs/small.toml --use -q
krylux segment assets/rigs/small.toml --photos 8 --groups 2 --direct patterns -q -o out/rig || test $? = 1
krylux audit assets/rigs/small.toml -q -o out/audit || test $? = 1
"#;

/// The words of a page that name figures: facts, headings and columns of tables.
fn terms(page: &str) -> BTreeSet<String> {
    let page = page.split("<script>").next().unwrap_or_default();
    let of = |element: &str| {
        let (open, close) = (format!("<{element}"), format!("</{element}>"));
        let parts = page.split(open.as_str()).skip(1);
        let found = parts.filter(|part| part.starts_with(['>', ' '])).filter_map(|part| {
            let (_, inner) = part.split_once('>')?;
            Some(inner.split(close.as_str()).next()?.trim().to_owned())
        });
        found.collect::<Vec<_>>()
    };
    ["dt", "h2", "th"].into_iter().flat_map(of).filter(|term| !term.is_empty()).map(generic).collect()
}

/// `Evidence for 4 groups` and `u7` are one term each for all numbers.
fn generic(term: String) -> String {
    let term = term.replace("&#39;", "'").replace("&#38;", "&");
    let words = term.split(' ').map(|word| {
        let is_number = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
        if is_number { "N" } else { word }
    });
    let term = words.collect::<Vec<_>>().join(" ");
    let is_vector =
        term.len() > 1 && term.starts_with('u') && term[1..].bytes().all(|byte| byte.is_ascii_digit());
    let is_pixel = term.len() == 1 && term.chars().all(|c| c.is_ascii_uppercase());
    match (is_vector, is_pixel) {
        (true, _) => "uN".into(),
        (_, true) => "A, B, …".into(),
        _ => term,
    }
}

/// The names of a record's values, `noise.white`. Options are left out: those of the measurement are keys of rig files, and those of the
/// request are in the reference of the command line.
fn keys(value: &Value, before: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let key = format!("{before}{name}");
                let holds_options = ["rig.measurement", "request"].contains(&key.as_str());
                if !holds_options {
                    keys(value, &format!("{key}."), found);
                }
                if !value.is_object() || holds_options {
                    found.insert(key);
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|value| keys(value, before, found)),
        _ => {}
    }
}

/// The folders of runs in and below this one.
fn runs(folder: &Path) -> Vec<std::path::PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let folders = entries.flatten().map(|entry| entry.path()).filter(|path| path.is_dir());
    let mut found: Vec<_> = folders.flat_map(|path| runs(&path)).collect();
    if folder.join("run.json").exists() {
        found.push(folder.to_path_buf());
    }
    found
}

#[test]
fn the_glossary_defines_every_figure_of_a_report() {
    let cache = tempfile::tempdir().expect("a temporary folder can be made");
    let place = Workplace::new(cache.path());
    place.write("runs.sh", &format!("set -euo pipefail\n{RUNS}"));
    let ended = place.run(Path::new("bash"), &["runs.sh"]);
    assert_eq!(ended.status, Some(0), "{}", ended.output);
    let (mut shown, mut recorded) = (BTreeSet::new(), BTreeSet::new());
    let runs = runs(place.path());
    assert!(runs.len() > 10, "{runs:?}");
    for run in runs {
        shown.extend(terms(&fs::read_to_string(run.join("report.html")).expect("a run has a report")));
        let record = fs::read(run.join("run.json")).expect("a run has a record");
        keys(&serde_json::from_slice(&record).expect("it is JSON"), "", &mut recorded);
    }
    assert!(shown.len() > 60 && recorded.len() > 40, "{} {}", shown.len(), recorded.len());
    let glossary = read("guide/src/reference/glossary.md");
    let first_cells = glossary.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
    let defined: BTreeSet<&str> = first_cells.collect();
    let missing: Vec<&String> = shown.iter().filter(|term| !defined.contains(term.as_str())).collect();
    assert!(missing.is_empty(), "not in the glossary: {missing:#?}");
    let missing: Vec<&String> =
        recorded.iter().filter(|key| !defined.contains(format!("`{key}`").as_str())).collect();
    assert!(missing.is_empty(), "not in the glossary: {missing:#?}");
}
