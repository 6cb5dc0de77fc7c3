//! The command line on a rig with a still camera: the X server is real, scripts simulate the camera.

use std::process::Command;

use krylux::io::npy;

use super::studio::{SENSOR, Studio, counts};
use crate::x_server::XServer;

#[test]
fn a_photo_of_a_window_by_a_still_camera_is_written_to_a_file() {
    let (studio, server) = (Studio::new(), XServer::start(64, 48));
    let [width, height] = SENSOR;
    // The scripts are found on PATH, as installed programs would be. The picture does not depend on the pattern; therefore no black
    // photo is subtracted.
    let text = format!(
        "kind = \"hardware\"\n\
         [projector]\nkind = \"x11\"\ndisplay = \"{}\"\nsize = [{width}, {height}]\n\
         [camera]\nkind = \"gphoto2\"\nsize = [{width}, {height}]\niso = 100\nimage_format = \"RAW\"\n\
         exposures = [0.001, 1.0]\ntimeout = 60\n\
         [measurement]\nexposures = [0.25]\nambient = false\nresponse = false\n",
        server.display
    );
    studio.write("rig.toml", text);
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
