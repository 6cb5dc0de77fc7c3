//! The page, its plots, and the record of a run.

use std::time::Duration;

use krylux::Error;
use krylux::image::Resolution;
use krylux::io::atomic;
use krylux::io::manifest::{Adapter, SourceFile, Status};
use krylux::measure::RunManifest;
use krylux::report::html::{
    Block, Figure, FileLink, Legend, Outcome as Result_, Report, Section, Values, Verdict,
};
use krylux::report::palette;
use krylux::report::plot::{LinePlot, Series, StemPlot};
use tempfile::TempDir;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn residuals() -> LinePlot {
    let line = |name: &str, rate: f64| Series {
        name: name.into(),
        points: (1..=40).map(|photo| (f64::from(photo), (-rate * f64::from(photo)).exp())).collect(),
    };
    LinePlot {
        x_label: "photos".into(),
        y_label: "relative residual".into(),
        logarithmic: true,
        series: vec![line("minres", 0.22), line("jacobi <baseline>", 0.07)],
        marks: vec![(2e-3, "noise floor".into())],
    }
}

fn sample() -> Result<Report, Error> {
    let labels: Vec<u8> = (0..64).map(|pixel| if pixel < 6 { 255 } else { pixel / 32 }).collect();
    let picture = palette::paint_labels(Resolution::new(8, 8), &labels);
    Ok(Report {
        title: "segment & <compensate>".into(),
        verdict: Verdict { outcome: Result_::Short, sentence: "two groups & a \"doubt\"".into() },
        facts: vec![("photos".into(), "24".into()), ("scene".into(), "https://example.org/<scene>".into())],
        sections: vec![Section {
            title: "Groups".into(),
            text: "Which pixels exchange light.".into(),
            blocks: vec![
                Block::Figures(vec![
                    Figure {
                        picture: picture.clone(),
                        caption: "labels".into(),
                        legend: Legend::of_labels(&labels),
                        values: Some(Values::of_labels(Resolution::new(8, 8), &labels)),
                        ..Figure::default()
                    }
                    .named("2 groups", "labels-2.npy"),
                    Figure {
                        picture: picture.clone(),
                        caption: "signed".into(),
                        legend: Legend::signed(0.0412),
                        ..Figure::default()
                    },
                ]),
                Block::Plot { svg: residuals().render(), caption: "Residuals".into() },
                Block::Table {
                    headers: vec!["method".into(), "photos".into()],
                    rows: vec![vec!["minres".into(), "24".into()], vec!["jacobi".into(), "−1.5e-3".into()]],
                    caption: "Photos spent".into(),
                },
            ],
        }],
        files: vec![FileLink::new("labels-2.npy", "8 × 8, uint8"), FileLink::new("run.json", "the record")],
        footer: "krylux segment scene.glb".into(),
        ..Report::default()
    })
}

#[test]
fn the_page_holds_everything_and_fetches_nothing() -> Outcome {
    let page = sample()?.render()?;
    for expected in [
        "segment &#38; &#60;compensate&#62;",
        "two groups &#38; a &#34;doubt&#34;",
        "class=\"verdict short\"",
        "https://example.org/&#60;scene&#62;",
        "Which pixels exchange light.",
        "data:image/png;base64,iVBORw0KGgo",
        "group 0: 41\u{202f}%",
        "group 1: 50\u{202f}%",
        "masked: 9\u{202f}%",
        "background:#0072b2",
        "−0.0412",
        "jacobi &lt;baseline&gt;",
        "noise floor",
        "<caption>Photos spent</caption>",
        "<th scope=\"col\" class=\"number\">photos</th>",
        "<td class=\"number\">24</td>",
        "<td class=\"\">minres</td>",
        "krylux segment scene.glb",
        "href=\"labels-2.npy\"",
        "href=\"run.json\"",
        "labels_2 = np.load(&#34;labels-2.npy&#34;)  # 8 × 8, uint8",
        "&#34;values&#34;:&#34;values-0&#34;",
        "The values of 1 picture are in this page, in single precision",
        "<summary>What these figures mean</summary>",
        "<dt>photos</dt><dd>photos that the row&#39;s answer took</dd>",
    ] {
        assert!(page.contains(expected), "{expected} is missing");
    }
    let own = page.replace("https://example.org/", "");
    for foreign in ["http:", "https:", "url(", "@import", "<link", "fetch(", "XMLHttp", "import("] {
        assert!(!own.contains(foreign), "{foreign} in the page");
    }
    let links: Vec<&str> = own.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert!(links.iter().all(|link| !link.contains(':') && !link.starts_with('/')), "{links:?}");
    // One script, inline, for what can be done without: telling values, zooming, comparing. It comes last, after the values, so that a page
    // without script is the same page.
    let scripts = own.matches("<script").count();
    assert_eq!(
        (own.matches("<script>\n").count(), own.matches("<script type=\"text/plain\"").count()),
        (1, scripts - 1)
    );
    assert!(own.find("<script>") > own.find("<footer>"));
    assert_eq!(own.matches("src=").count(), own.matches("src=\"data:image/png;base64,").count());
    Ok(())
}

#[test]
fn the_same_report_gives_the_same_bytes() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("report.html");
    sample()?.write(&path)?;
    assert_eq!(std::fs::read_to_string(path)?, sample()?.render()?);
    assert!(Report::default().render()?.ends_with("</html>"));
    Ok(())
}

#[test]
fn plots_leave_out_what_has_no_place() {
    let mut plot = residuals();
    let whole = plot.render().matches("<polyline").count();
    plot.series[0].points[10].1 = f64::NAN;
    plot.series[1].points[10].1 = 0.0;
    let svg = plot.render();
    assert_eq!((whole, svg.matches("<polyline").count()), (2, 4));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    for empty in [LinePlot::default().render(), StemPlot::default().render()] {
        assert!(empty.contains("no values to plot"));
    }
    for values in [vec![f64::NAN], vec![0.0], vec![1e-300, f64::MAX, f64::MIN], vec![f64::INFINITY, 1.0]] {
        let line = LinePlot {
            series: vec![Series { name: "x".into(), points: values.iter().map(|&v| (v, v)).collect() }],
            ..Default::default()
        };
        let stems = StemPlot { errors: values.clone(), values, ..Default::default() };
        for svg in [line.render(), LinePlot { logarithmic: true, ..line.clone() }.render(), stems.render()] {
            assert!(!svg.contains("NaN") && !svg.contains("=\"inf"), "{svg}");
        }
    }
}

#[test]
fn a_record_is_rewritten_whole_and_reads_back() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("run.json");
    let mut record = RunManifest::new(["krylux", "segment", "scene.glb"]);
    record.write(&path)?;
    let running = RunManifest::read(&path)?;
    assert_eq!((running.status, running.krylux_format), (Status::Running, 1));
    assert!(running.started.ends_with('Z') && running.started.len() == 20);

    record.seed = Some(7);
    record.adapter =
        Some(Adapter { name: "llvmpipe".into(), driver: "Mesa".into(), backend: "vulkan".into() });
    record.scene = Some(SourceFile { path: "scene.glb".into(), hash: "00ff".into() });
    record.resolution = Some(Resolution::new(128, 96));
    record.photos = 24;
    record.record("trace", Duration::from_millis(1500));
    record.outputs.push("labels-2.npy".into());
    record.finish(Status::Done, "reached rtol");
    record.write(&path)?;
    assert_eq!(RunManifest::read(&path)?, record);
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&path)?)?;
    assert_eq!(json["status"], "done");
    assert_eq!(json["message"], "reached rtol");
    assert_eq!(json["resolution"]["width"], 128);
    assert_eq!(json["timings"][0]["seconds"], 1.5);
    assert_eq!(std::fs::read_dir(folder.path())?.count(), 1, "no temporary file is left");

    std::fs::write(&path, "{\"krylux_format\": 1}")?;
    assert!(matches!(RunManifest::read(&path), Err(Error::Data { .. })));
    Ok(())
}

#[test]
fn a_failed_write_names_the_file_and_leaves_the_old_one() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("kept.txt");
    atomic::write_bytes(&path, b"old")?;
    let failed = atomic::write_with(&path, |_| Err(std::io::Error::from(std::io::ErrorKind::StorageFull)));
    assert!(failed.is_err_and(|error| error.to_string().contains("kept.txt")));
    assert_eq!(std::fs::read(&path)?, b"old");
    assert_eq!(std::fs::read_dir(folder.path())?.count(), 1);
    let absent = folder.path().join("absent").join("file");
    assert!(matches!(atomic::write_bytes(&absent, b""), Err(Error::Write { path, .. }) if path == absent));
    assert!(matches!(atomic::write_bytes(folder.path(), b""), Err(Error::Write { .. })));
    Ok(())
}

/// The device that is always full, where the system has one.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let full = std::path::Path::new("/dev/full");
    if full.exists() {
        assert!(matches!(atomic::write_bytes(full, &[0; 1 << 20]), Err(Error::Write { .. })));
    }
}

#[cfg(unix)]
#[test]
fn a_symbolic_link_is_followed() -> Outcome {
    let folder = TempDir::new()?;
    let (target, link) = (folder.path().join("target"), folder.path().join("link"));
    std::fs::write(&target, "old")?;
    std::os::unix::fs::symlink(&target, &link)?;
    atomic::write_bytes(&link, b"new")?;
    assert_eq!(std::fs::read(&target)?, b"new");
    assert!(std::fs::symlink_metadata(&link)?.is_symlink());
    Ok(())
}
