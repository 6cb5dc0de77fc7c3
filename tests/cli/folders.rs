//! The folder of a run: its photos are not lost, and nothing else is written over.

use std::fs;
use std::path::Path;
use std::process::Output;

use tempfile::TempDir;

use crate::program::{assert_error, folder, inside, krylux, rig, text};

/// A folder with a rig and a run on it.
struct Bench {
    folder: TempDir,
    rig: String,
    run: String,
}

impl Bench {
    fn new() -> Self {
        let folder = folder();
        let (rig, run) = (rig(&folder, 8, ""), inside(&folder, "run"));
        let bench = Self { folder, rig, run };
        bench.done(&bench.segment(&[]));
        bench
    }

    /// Segmentation of the rig into the run's folder.
    fn segment<'a>(&'a self, more: &[&'a str]) -> Vec<&'a str> {
        let first =
            ["segment", &self.rig, "--photos", "8", "--groups", "2", "--eigenvectors", "2", "-o", &self.run];
        [&first, more].concat()
    }

    #[track_caller]
    fn done(&self, arguments: &[&str]) -> String {
        let output = krylux(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stderr)
    }

    /// The photos, and what the run says of itself.
    fn kept(&self) -> (String, String) {
        let record: serde_json::Value = serde_json::from_slice(&self.read("run.json")).expect("it is JSON");
        (blake3::hash(&self.read("journal/photos.journal")).to_string(), record["status"].to_string())
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(Path::new(&self.run).join(name)).unwrap_or_default()
    }

    /// The names in the folder.
    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.run).expect("the run has a folder");
        let mut names: Vec<_> = entries
            .map(|entry| entry.expect("it is there").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
}

#[test]
fn a_run_is_asked_anew_in_its_own_folder() {
    let bench = Bench::new();
    let before = bench.kept();
    assert!(before.1 == "\"done\"");
    let link = inside(&bench.folder, "link");
    std::os::unix::fs::symlink(&bench.run, &link).expect("links can be made");
    for (source, groups, more) in
        [(&bench.run, "3", &[][..]), (&link, "4", &[]), (&bench.run, "5", &["--overwrite"])]
    {
        let again = ["segment", source, "--groups", groups, "--eigenvectors", "2", "-o", &bench.run];
        bench.done(&[&again, more].concat());
        assert_eq!(bench.kept(), before, "--groups {groups}");
        assert!(!bench.read(&format!("labels-{groups}.npy")).is_empty());
    }
    // A question that fails leaves the record of the run alone, too.
    let wrong = ["segment", &bench.run, "--groups", "2", "--features", "999,999", "-o", &bench.run];
    let wrong = krylux(&wrong);
    assert!(wrong.status.code() != Some(0), "{}", text(&wrong.stdout));
    assert_eq!(bench.kept(), before);
}

#[test]
fn a_photo_that_a_run_lacks_is_no_reason_for_an_option_that_photo_has_no_use_for() {
    let bench = Bench::new();
    let output =
        krylux(&["photo", &bench.run, "--pattern", "checker:2", "-o", &inside(&bench.folder, "a.npy")]);
    let message = text(&output.stderr);
    assert!(message.contains("to take them, ask the rig or the scene itself"), "{message}");
    assert!(!message.contains("--resume"), "{message}");
}

#[test]
fn overwrite_discards_nothing_for_a_run_that_cannot_start() {
    let bench = Bench::new();
    let before = (bench.kept(), bench.names());
    let relight = ["relight", &bench.rig, "--photos", "0", "-o", &bench.run, "--overwrite"];
    let direct = bench.segment(&["--overwrite", "--direct", "patterns", "--direct-square", "0"]);
    for arguments in [&relight[..], &direct] {
        let output = krylux(arguments);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
        assert_eq!((bench.kept(), bench.names()), before, "{arguments:?}");
    }
}

#[test]
fn overwrite_ends_with_the_new_run_alone() {
    let bench = Bench::new();
    let (photos, names) = (bench.kept().0, bench.names());
    let said = bench.done(&bench.segment(&["--overwrite", "--seed", "7"]));
    assert!(said.contains("throws away"), "{said}");
    let (replaced, status) = bench.kept();
    assert!(replaced != photos && status == "\"done\"");
    assert_eq!(bench.names(), names);
}

#[test]
fn of_several_runs_in_one_folder_one_is_done() {
    for _ in 0..3 {
        let folder = folder();
        let (rig, run) = (rig(&folder, 8, ""), inside(&folder, "run"));
        let bench = Bench { folder, rig, run };
        let outputs: Vec<Output> = std::thread::scope(|scope| {
            let runs = [(); 6].map(|()| scope.spawn(|| krylux(&bench.segment(&[]))));
            runs.map(|run| run.join().expect("no thread panics")).into()
        });
        let done = outputs.iter().filter(|output| output.status.code() == Some(0)).count();
        let refused = outputs.iter().filter(|output| output.status.code() == Some(2)).count();
        let said: Vec<_> = outputs.iter().map(|output| text(&output.stderr)).collect();
        assert_eq!((done, refused), (1, 5), "{said:?}");
        assert_eq!(bench.kept().1, "\"done\"", "{said:?}");
        bench.done(&[
            "segment",
            &bench.run,
            "--groups",
            "3",
            "--eigenvectors",
            "2",
            "-o",
            &inside(&bench.folder, "again"),
        ]);
    }
}

#[test]
fn what_other_programs_wrote_is_not_written_over() {
    let bench = Bench::new();
    let other = inside(&bench.folder, "other");
    fs::create_dir(&other).expect("the folder is ours");
    let (page, victim) = (format!("{other}/report.html"), inside(&bench.folder, "victim"));
    fs::write(&page, "precious").expect("the folder is ours");
    fs::write(&victim, "precious").expect("the folder is ours");
    let run = ["segment", &bench.rig, "--photos", "8", "--groups", "2", "--eigenvectors", "2", "-o", &other];
    assert_error(&krylux(&run), &["report.html of another program", "--overwrite"]);
    assert_eq!(fs::read_to_string(&page).ok().as_deref(), Some("precious"));

    fs::remove_file(&page).expect("the folder is ours");
    for name in ["report.html", "labels-2.npy"] {
        let link = format!("{other}/{name}");
        std::os::unix::fs::symlink(&victim, &link).expect("links can be made");
        for more in [&[][..], &["--overwrite"]] {
            assert_error(&krylux(&[&run, more].concat()), &[name, "is a link"]);
        }
        fs::remove_file(&link).expect("the folder is ours");
    }
    assert_eq!(fs::read_to_string(&victim).ok().as_deref(), Some("precious"));
    bench.done(&run);
}
