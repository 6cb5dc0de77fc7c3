//! `krylux index`: a page over the runs of a folder.

use std::path::Path;

use krylux::io::npy;
use serde_json::Value;

use crate::program::{assert_error, folder, inside, krylux, text};

#[test]
fn runs_are_listed_on_a_page_of_their_own_program() {
    let folder = folder();
    let [out, matrix, run] = ["out", "matrix.npy", "out/eigs"].map(|name| inside(&folder, name));
    assert_error(&krylux(&["index", &out]), &["out"]);
    std::fs::create_dir(&out).expect("the folder can be written");
    assert_error(&krylux(&["index", &out]), &["holds no run"]);

    npy::write_npy(Path::new(&matrix), &[3, 3], &[2.0, 1.0, 0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 2.0_f64])
        .expect("the folder can be written");
    let output = krylux(&["eigs", &matrix, "--count", "1", "-o", &run]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));

    // A page of another program is kept.
    let page = inside(&folder, "out/index.html");
    std::fs::write(&page, "<title>mine</title>").expect("the folder can be written");
    assert_error(&krylux(&["index", &out]), &["index.html", "another program", "--overwrite"]);
    assert_eq!(std::fs::read_to_string(&page).expect("it is there"), "<title>mine</title>");

    for arguments in [&["index", &out, "--overwrite", "--json"][..], &["index", &out, "--json"]] {
        let output = krylux(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let summary: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
        assert_eq!(summary["runs"].as_array().map(Vec::len), Some(1), "{summary}");
        assert_eq!(
            (&summary["runs"][0]["verb"], &summary["runs"][0]["status"]),
            (&"eigs".into(), &"done".into())
        );
        let html = std::fs::read_to_string(&page).expect("it is written");
        assert!(html.contains("href=\"eigs/report.html\"") && html.contains("<dd>eigs</dd>"));
    }
}
