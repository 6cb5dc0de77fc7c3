//! The command line on a rig with a still camera: the X server is real, scripts simulate the camera.

use std::process::Command;

use krylux::image::Resolution;
use krylux::io::npy;

use super::studio::{SENSOR, Studio, counts};
use crate::x_server::XServer;

/// The file of a rig with the simulated still camera; `more` is added to the camera's table.
fn rig(server: &XServer, more: &str) -> String {
    let [width, height] = SENSOR;
    format!(
        "kind = \"hardware\"\n\
         [projector]\nkind = \"x11\"\ndisplay = \"{}\"\nsize = [{width}, {height}]\n\
         [camera]\nkind = \"gphoto2\"\nsize = [{width}, {height}]\niso = 100\nimage_format = \"RAW\"\n\
         exposures = [0.001, 1.0]\ntimeout = 60\n{more}\n\
         [measurement]\nexposures = [0.25]\nambient = false\nresponse = false\n",
        server.display
    )
}

/// A still camera before a screen of 64 by 48 pixels, in whose middle the projector shows its patterns.
fn studio_and_server() -> (Studio, XServer) {
    let (studio, server) = (Studio::new(), XServer::start(64, 48));
    let [width, height] = SENSOR;
    let place = [(64 - width as i16) / 2, (48 - height as i16) / 2];
    studio.sees(server.view(place, 1, Resolution::new(width, height)));
    (studio, server)
}

#[test]
fn a_photo_of_a_window_by_a_still_camera_is_written_to_a_file() {
    let (studio, server) = studio_and_server();
    let [width, height] = SENSOR;
    // The scripts are found on PATH, as installed programs would be. Nothing is subtracted: the photo has the counts of the file.
    studio.write("rig.toml", rig(&server, ""));
    // The script ignores the options of dcraw, and reads the file that the last argument names.
    let path = std::env::var("PATH").expect("there is one");
    let output = Command::new(env!("CARGO_BIN_EXE_krylux"))
        .args(["photo", "rig.toml", "--pattern", "white", "-o", "photo.npy"])
        .current_dir(studio.folder.path())
        .env("PATH", format!("{}:{path}", studio.folder.path().display()))
        .env("KRYLUX_CACHE", "")
        .output()
        .expect("the program is built with the tests");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let photo = npy::read_npy(&studio.path("photo.npy")).expect("it is written");
    assert_eq!(photo.values.len(), width * height);
    for (site, (found, count)) in photo.values.iter().zip(counts()).enumerate() {
        let expected = f64::from(count) / 0.25;
        // The file has single precision.
        assert!(
            (found - expected).abs() <= 1e-6 * expected,
            "photosite {site}: {found}, not {expected} DN/s"
        );
    }
    assert_eq!(studio.current("shutterspeed"), "1/4");
}

#[test]
fn programs_that_a_strangers_rig_file_names_are_run_only_if_that_is_allowed() {
    let (studio, server) = studio_and_server();
    let spec = studio.spec();
    let named = format!("program = \"{}\"\ndecoder = [\"{}\"]", spec.program, spec.decoder[0]);
    for file in ["rig.toml", "config/krylux/rig.toml"] {
        studio.write(file, rig(&server, &named));
    }
    let krylux = |verb: &[&str], file: &str, more: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_krylux"))
            .args(verb)
            .arg(file)
            .args(more)
            .current_dir(studio.folder.path())
            .env("XDG_CONFIG_HOME", studio.path("config"))
            .env("KRYLUX_CACHE", "")
            .output()
            .expect("the program is built with the tests");
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let photo = ["-o", "photo.npy"];
    for (verb, more, status) in [(&["photo"][..], &photo[..], 2), (&["rig", "check"], &[], 1)] {
        let (found, said) = krylux(verb, "rig.toml", more);
        assert_eq!(found, Some(status), "{said}");
        for part in ["rig.toml", spec.program.as_str(), spec.decoder[0].as_str(), "--allow-programs"] {
            assert!(said.contains(part), "{verb:?}: `{part}` is missing in: {said}");
        }
        assert!(!studio.path("log").exists(), "{verb:?}: nothing is run");
    }
    let (status, said) = krylux(&["--allow-programs", "photo"], "rig.toml", &photo);
    assert!(status == Some(0) && said.contains(&format!("runs the program `{}`", spec.program)), "{said}");
    let (status, said) = krylux(&["photo"], "config/krylux/rig.toml", &photo);
    assert_eq!(status, Some(0), "{said}");
}
