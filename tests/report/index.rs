//! The page over many runs.

use krylux::image::Resolution;
use krylux::io::manifest::{SourceFile, Status};
use krylux::measure::RunManifest;
use krylux::report::index;
use tempfile::TempDir;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn run(folder: &std::path::Path, verb: &str, started: &str, status: Status, outputs: &[&str]) -> Outcome {
    std::fs::create_dir_all(folder)?;
    let mut record = RunManifest::new(["krylux", "-q", verb, "scene <1>.glb"]);
    record.started = started.into();
    record.scene = Some(SourceFile { path: "scene <1>.glb".into(), hash: "00".into() });
    record.resolution = Some(Resolution::new(8, 8));
    record.photos = 24;
    record.outputs = outputs.iter().map(|name| (*name).to_owned()).collect();
    record.finish(status, "reached rtol");
    record.write(&folder.join("run.json"))?;
    for name in outputs {
        std::fs::write(folder.join(name), b"anything")?;
    }
    Ok(())
}

#[test]
fn a_page_lists_the_runs_of_a_folder_with_their_pictures_and_links() -> Outcome {
    let root = TempDir::new()?;
    let first = ["labels-true.png", "white.png", "labels-2.png", "report.html"];
    run(&root.path().join("first run"), "segment", "2026-01-01T00:00:00Z", Status::Done, &first)?;
    run(&root.path().join("deep/er/second"), "eigs", "2026-02-01T00:00:00Z", Status::Failed, &[])?;
    std::fs::create_dir_all(root.path().join("broken"))?;
    std::fs::write(root.path().join("broken/run.json"), "{")?;
    std::fs::create_dir_all(root.path().join("nothing"))?;

    let runs = index::find(root.path())?;
    let folders: Vec<String> = runs.iter().map(|run| run.folder.display().to_string()).collect();
    assert_eq!(folders, ["deep/er/second", "first run", "broken"], "those that started last come first");
    assert_eq!(runs[1].record.as_ref().map(RunManifest::verb).ok(), Some("segment"));
    assert!(runs[1].has_page && !runs[0].has_page && runs[2].record.is_err());

    let page = std::fs::read_to_string(index::write(root.path(), &runs)?)?;
    for expected in [
        "href=\"first%20run/report.html\"",
        "src=\"first%20run/labels-2.png\"",
        "loading=\"lazy\"",
        "scene &#60;1&#62;.glb",
        "Done: reached rtol.",
        "Failed: reached rtol.",
        "3 runs, of which 2 did not end well.",
        "run.json cannot be read",
        "<dd>24</dd>",
    ] {
        assert!(page.contains(expected), "{expected} is missing");
    }
    assert_eq!(page.matches("report.html").count(), 1, "a run without a page has no link");
    assert!(index::is_own(page.as_bytes()) && !index::is_own(b"<p>another</p>"));
    Ok(())
}

#[cfg(unix)]
#[test]
fn links_that_lead_in_circles_are_not_followed() -> Outcome {
    let root = TempDir::new()?;
    run(&root.path().join("run"), "segment", "2026-01-01T00:00:00Z", Status::Done, &[])?;
    std::os::unix::fs::symlink(root.path(), root.path().join("again"))?;
    assert_eq!(index::find(root.path())?.len(), 1);
    assert!(index::find(&root.path().join("absent")).is_err());
    Ok(())
}
