//! Rig files of real devices: how they are read, and which are refused.

use std::path::Path;

use krylux::Error;
use krylux::measure::{RigFile, RigKind};
use krylux::rig::{CameraSpec, PixelFormat, X11Monitor};

const WHOLE: &str = "kind = \"hardware\"\ncalibration = \"found\"\n\
    [projector]\nkind = \"x11\"\nmonitor = \"HDMI-1\"\nsize = [128, 96]\nmagnify = 10\n\
    [camera]\nkind = \"gige\"\naddress = \"192.168.1.20\"\nsize = [640, 480]\npixel_format = \"mono12\"\n\
    [measurement]\nsettle = 0.05\n";

fn from(text: &str) -> krylux::Result<RigFile> {
    RigFile::from_bytes(Path::new("folder/my.toml"), text.as_bytes())
}

#[track_caller]
fn refused(text: &str) -> String {
    match from(text) {
        Err(Error::Data { path, fault, help }) => {
            assert_eq!(path, Path::new("folder/my.toml"), "the error names the file");
            format!("{fault}; {help}")
        }
        other => panic!("not an error about the file: {other:?}"),
    }
}

#[test]
fn a_rig_file_of_real_devices_has_defaults() {
    let file = from(WHOLE).expect("it is whole");
    assert_eq!(file.calibration.as_deref(), Some(Path::new("folder/found")));
    assert_eq!(file.measurement.settle, Some(0.05));
    let RigKind::Hardware(rig) = &file.kind else { panic!("not hardware: {file:?}") };
    assert_eq!(rig.projector.monitor, X11Monitor::Name("HDMI-1".into()));
    assert_eq!((rig.projector.channels, rig.projector.settle_frames), (1, 1));
    let CameraSpec::Genicam(camera) = &rig.camera else { panic!("not GigE Vision: {rig:?}") };
    assert_eq!(camera.pixel_format, PixelFormat::Mono12);
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    assert_eq!(
        (projector.resolution.width, projector.bits, camera.resolution.height, camera.bits),
        (128, 8, 480, 12)
    );
    let numbered = WHOLE.replace("\"HDMI-1\"", "1");
    let RigKind::Hardware(rig) = from(&numbered).expect("by number, too").kind else {
        panic!("not hardware")
    };
    assert_eq!(rig.projector.monitor, X11Monitor::Number(1));
}

#[test]
fn misspelt_keys_and_values_out_of_range_are_named() {
    for (part, to, expected) in [
        (
            "monitor = ",
            "moniter = ",
            "line 5, in [projector]: unknown key `moniter`; did you mean `monitor`?",
        ),
        ("\"x11\"", "\"x12\"", "unknown value `x12`; did you mean `x11`?"),
        ("\"gige\"", "\"gig\"", "unknown value `gig`; did you mean `gige`?"),
        ("mono12", "mono13", "unknown value `mono13`; did you mean"),
        ("192.168.1.20", "192.168.1", "line 10, in [camera]: invalid IPv4"),
        ("magnify = 10", "magnify = 0", "projector.magnify is 0; give 1 to 1024"),
        ("[640, 480]", "[640, 0]", "camera.size is 0; give 1 to 65535"),
        ("settle = 0.05", "settle = -1", "measurement.settle is -1"),
        ("[measurement]", "[scene]\nfile = 'a'\n[measurement]", "unknown key `scene`"),
        ("kind = \"x11\"\n", "", "missing field `kind`"),
    ] {
        let message = refused(&WHOLE.replacen(part, to, 1));
        assert!(message.contains(expected), "{to}: {message}");
    }
}
