//! Runs of the real program on a virtual rig, killed at any moment, damaged, resumed, repeated: never a photo lost or taken
//! twice, never another result.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::program::{self, text};
use krylux::journal::{Journal, Key, Kind};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Eight by eight pixels in two halves that exchange no light, behind devices with all that depends on number and time: noise,
/// drift, latency, frames that go wrong. Nobody calibrates it, so that its light is in proportion to its levels; and direct light is told by
/// squares of one pixel, because those of four are as wide as the halves, whose global light would follow them.
const RIG: &str = r#"
kind = "virtual"
seed = 5
[scene]
matrix = "matrix.mtx"
size = [8, 8]
[projector]
gamma = 1.0
black_level = 0.002
latency = 0.01
frame_time = 0.0167
[camera]
bits = 14
black_level = 64.0
full_well = 60000.0
read_noise = 5.0
exposures = [1e-4, 1.0]
[ambient]
level = 0.05
[drift]
swing = 0.01
period = 60.0
[faults]
dropped = 0.05
repeated = 0.03
late = 0.03
[measurement]
settle = 0.02
sentinel_every = 5
response = false
direct_square = 1
"#;

/// Photos with their counts, in the order of the file.
type Photos = Vec<(Key, Vec<u8>)>;
/// Files by name.
type Results = BTreeMap<String, Vec<u8>>;

/// A folder with the rig and its matrix.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::write(bench.path("rig.toml"), RIG).expect("there is room");
        let mut entries = String::new();
        let mut count = 0;
        for row in 0..64_usize {
            for column in 0..=row {
                let [(x, y), (u, v)] = [row, column].map(|pixel| (pixel % 8, pixel / 8));
                let distance = (x.abs_diff(u).pow(2) + y.abs_diff(v).pow(2)) as f64;
                let value = match row == column {
                    true => 0.3 + 0.02 * (row * 37 % 11) as f64,
                    false if (x < 4) == (u < 4) => 0.02 / (1.0 + 0.2 * distance),
                    false => continue,
                };
                writeln!(entries, "{} {} {value}", row + 1, column + 1).expect("a string takes all");
                count += 1;
            }
        }
        let matrix = format!("%%MatrixMarket matrix coordinate real symmetric\n64 64 {count}\n{entries}");
        fs::write(bench.path("matrix.mtx"), matrix).expect("there is room");
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = program::command(arguments);
        command.current_dir(self.0.path());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program starts")
    }

    /// A run that must end well; what it says on stderr.
    fn done(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let said = text(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
        said
    }

    /// Photos in the order of the file, with their counts.
    fn photos(&self, run: &str) -> Photos {
        let mut journal = Journal::read_only(&self.path(run).join("journal")).expect("there is a journal");
        assert!(journal.torn().is_none() && journal.damages().is_empty());
        let photos = journal.entries().iter().filter(|entry| entry.kind == Kind::Photo);
        let keys: Vec<Key> = photos.map(|entry| entry.key).collect();
        let mut payload = |key| journal.get(key).expect("it can be read").expect("it is whole").payload;
        keys.into_iter().map(|key| (key, payload(key))).collect()
    }
}

/// All arrays and tables of a run, by name.
fn results(folder: &Path) -> Results {
    let files = fs::read_dir(folder).expect("it is there").map(|file| file.expect("it can be listed").path());
    let is_result = |path: &PathBuf| path.extension().is_some_and(|it| it == "npy" || it == "csv");
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    files.filter(is_result).map(|path| (name(&path), fs::read(&path).expect("it can be read"))).collect()
}

const SEGMENT: [&str; 10] =
    ["segment", "rig.toml", "--photos", "8", "--groups", "2", "--eigenvectors", "3", "--no-check", "-q"];

fn segment<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SEGMENT, more].concat()
}

const KILLS: usize = 1000;

/// Four at a time, which mostly wait for the disk; delays from before the first photo to half of a whole run.
#[test]
fn a_thousand_kills_lose_no_photo_double_none_and_change_no_result() {
    let bench = Bench::new();
    bench.done(&segment(&["-o", "warm"]));
    let begun = Instant::now();
    bench.done(&segment(&["-o", "whole"]));
    let whole = begun.elapsed().as_secs_f64();
    let expected = (bench.photos("whole"), results(&bench.path("whole")));
    let unique: BTreeSet<Key> = expected.0.iter().map(|(key, _)| *key).collect();
    assert_eq!(unique.len(), expected.0.len(), "each photo once");
    assert!(expected.0.len() > 20 && expected.1.len() >= 5);

    let landed: Vec<BTreeMap<Option<usize>, usize>> = std::thread::scope(|scope| {
        let (bench, expected) = (&bench, &expected);
        let workers =
            [1, 2, 3, 4].map(|seed| scope.spawn(move || kill_runs(bench, expected, seed, 0.5 * whole)));
        workers.map(|worker| worker.join().expect("no assertion failed")).into()
    });
    let mut places: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    for (place, count) in landed.into_iter().flatten() {
        *places.entry(place).or_default() += count;
    }
    let kills: usize = places.values().sum();
    println!("{kills} kills in {:.1} s: {places:?}", begun.elapsed().as_secs_f64());
    assert!(kills >= KILLS);
    assert!(places.contains_key(&None), "some before there was a journal");
    let with_photos = (0..=unique.len()).filter(|count| places.contains_key(&Some(*count))).count();
    assert!(2 * with_photos > unique.len(), "at more than half of all numbers of photos: {places:?}");
}

/// Kills a quarter of all; how often at each number of photos.
fn kill_runs(
    bench: &Bench,
    expected: &(Photos, Results),
    seed: u64,
    longest: f64,
) -> BTreeMap<Option<usize>, usize> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut landed: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    let mut kills = 0;
    for run in 0.. {
        if 4 * kills >= KILLS {
            break;
        }
        let name = format!("run-{seed}-{run}");
        let folder = bench.path(&name);
        let resume = segment(&["-o", &name, "--resume"]);
        // On a machine that is busy with the other workers' runs the program may need longer to its next photo than it is given: then a
        // little more time, until one is taken.
        let (mut patience, mut photos) = (1.0, None);
        loop {
            let mut command = bench.command(&resume);
            let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
            std::thread::sleep(Duration::from_secs_f64(random.random_range(0.0..longest * patience)));
            if child.try_wait().expect("it is our child").is_none() {
                // SIGKILL: nothing is cleaned up.
                child.kill().expect("it is our child");
            }
            let output = child.wait_with_output().expect("it is our child");
            match output.status.code() {
                Some(code) => {
                    assert_eq!(code, 0, "{}", text(&output.stderr));
                    break;
                }
                None => {
                    kills += 1;
                    let journal = Journal::read_only(&folder.join("journal")).ok();
                    let taken = journal.map(|journal| journal.photos());
                    patience = if taken > photos { 1.0 } else { 1.1 * patience };
                    photos = taken.max(photos);
                    *landed.entry(taken).or_default() += 1;
                }
            }
        }
        assert_eq!(bench.photos(&name), expected.0, "{name}");
        assert_eq!(results(&folder), expected.1, "{name}");
        fs::remove_dir_all(folder).expect("nobody uses it any more");
    }
    landed
}

#[test]
fn a_damaged_photo_is_named_and_taken_again_alone() {
    let bench = Bench::new();
    bench.done(&segment(&["-o", "run"]));
    let (photos, expected) = (bench.photos("run"), results(&bench.path("run")));
    let file = bench.path("run/journal/photos.journal");
    let bytes = fs::read(&file).expect("it is there");
    let journal = Journal::read_only(&bench.path("run/journal")).expect("it is whole");
    let entries: Vec<_> =
        journal.entries().iter().filter(|entry| entry.kind == Kind::Photo).cloned().collect();
    // The first, one in the middle, the last; in their heads, their metadata, their counts.
    for (index, photo) in [0, photos.len() / 2, photos.len() - 1].into_iter().enumerate() {
        let entry = &entries[photo];
        let metadata = 130;
        let counts = 120 + entry.metadata.len() + 60;
        for at in [3, metadata, counts] {
            let mut damaged = bytes.clone();
            damaged[entry.offset as usize + at] ^= 1 << index;
            fs::write(&file, damaged).expect("there is room");
            let output = bench.run(&[
                "segment",
                "rig.toml",
                "--photos",
                "8",
                "--groups",
                "2",
                "--eigenvectors",
                "3",
                "--no-check",
                "--json",
                "-o",
                "run",
                "--resume",
            ]);
            let said = text(&output.stderr);
            assert!(output.status.success(), "{said}");
            let name = match at {
                _ if at == counts => format!("photo {} (byte {})", photo + 1, entry.offset),
                _ if photo == 0 => "a record before the first photo".into(),
                _ => format!("the record after photo {photo}"),
            };
            assert!(said.contains(&name), "{name} in {said}");
            let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
            let effort = &summary["rig"]["effort"];
            assert_eq!(
                (&effort["taken"], &effort["replayed"]),
                (&1.into(), &(photos.len() - 1).into()),
                "{said}"
            );
            assert_eq!(results(&bench.path("run")), expected, "photo {photo}, byte {at}");
        }
    }
}

#[test]
fn a_finished_run_answers_again_and_other_questions_without_the_rig() {
    let bench = Bench::new();
    bench.done(&segment(&["-o", "run"]));
    // Neither the rig file nor what it looks at is there any more.
    fs::remove_file(bench.path("rig.toml")).expect("it is there");
    fs::remove_file(bench.path("matrix.mtx")).expect("it is there");
    let again = ["segment", "run", "--photos", "8", "--eigenvectors", "3", "-q", "--groups"];
    bench.done(&[&again[..], &["2", "-o", "again"]].concat());
    assert_eq!(results(&bench.path("again")), results(&bench.path("run")));
    bench.done(&[&again[..], &["2,3", "-o", "more"]].concat());
    assert!(results(&bench.path("more")).contains_key("labels-3.npy"));
    assert_eq!(results(&bench.path("more"))["labels-2.npy"], results(&bench.path("run"))["labels-2.npy"]);

    // A photo that the run did not take is answered by a model, and it is said how to take it.
    let longer = ["segment", "run", "--photos", "9", "-o", "longer"];
    let output = bench.run(&longer);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("a model of rank") && said.contains("ask the rig or the scene itself"), "{said}");
    let output = bench.run(&["segment", "again", "-o", "never"]);
    assert!(text(&output.stderr).contains("it holds no run whose photos were kept"));
}

#[test]
fn photos_are_neither_mixed_with_another_rigs_nor_thrown_away_unsaid() {
    let bench = Bench::new();
    bench.done(&segment(&["-o", "run"]));
    let (photos, expected) = (bench.photos("run"), results(&bench.path("run")));
    let fails = |arguments: &[&str], with: &[&str]| {
        let output = bench.run(arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        with.iter().for_each(|with| assert!(said.contains(with), "{with} in {said}"));
    };
    fails(&segment(&["-o", "run"]), &["already holds a run", "--resume", "--overwrite"]);
    fs::write(bench.path("rig.toml"), RIG.replace("seed = 5", "seed = 6")).expect("there is room");
    fails(&segment(&["-o", "run", "--resume"]), &["another source", "rig file (then"]);
    assert_eq!((bench.photos("run"), results(&bench.path("run"))), (photos.clone(), expected));

    let overwrite = ["segment", "rig.toml", "--photos", "8", "--groups", "2", "-o", "run", "--overwrite"];
    let said = bench.done(&overwrite);
    assert!(said.contains(&format!("throws away {} photos", photos.len())), "{said}");
    assert_ne!(bench.photos("run"), photos);
}

/// No driver is found where there is none: the replay has no graphics device.
#[test]
fn a_scenes_run_is_repeated_without_scene_and_graphics_device() {
    let bench = Bench::new();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/zigzag/scene.glb");
    fs::copy(scene, bench.path("zigzag.glb")).expect("it is shipped");
    let small = ["--size", "16", "--spp", "8", "-q", "--no-check"];
    for (verb, question) in [
        ("segment", &["--photos", "10", "--groups", "2", "--eigenvectors", "3"][..]),
        ("eigs", &["--photos", "10", "--count", "2"][..]),
    ] {
        let run = format!("{verb}-run");
        let first = [&[verb, "zigzag.glb", "-o", &run][..], question, &small].concat();
        let code = bench.run(&first).status.code();
        assert!(matches!(code, Some(0 | 1)), "{verb}: {code:?}");
        let expected = results(&bench.path(&run));
        let photos = bench.photos(&run);
        assert!(photos.len() >= 10 && expected.len() >= 3);

        let resume = [&first[..], &["--resume"]].concat();
        assert_eq!(bench.run(&resume).status.code(), code);
        assert_eq!((bench.photos(&run), results(&bench.path(&run))), (photos, expected.clone()), "{verb}");

        let again = format!("{verb}-again");
        let replay = [&[verb, &run, "-o", &again, "-q"][..], question].concat();
        let nowhere = bench.path("nowhere");
        let mut command = bench.command(&replay);
        command.env("VK_DRIVER_FILES", &nowhere).env("VK_ICD_FILENAMES", &nowhere);
        let output = command.output().expect("the program starts");
        assert_eq!(output.status.code(), code, "{}", text(&output.stderr));
        assert_eq!(results(&bench.path(&again)), expected, "{verb}");
    }
}
