//! Rig files with a camera of each kind: how they are read, and which are refused.

use std::path::Path;

use krylux::Error;
use krylux::measure::{RigFile, RigKind};
use krylux::rig::{CameraSpec, Colour, PixelFormat, Tiles, V4lFormat};

fn from(camera: &str) -> krylux::Result<RigFile> {
    let text =
        format!("kind = \"hardware\"\n[projector]\nkind = \"x11\"\nsize = [128, 96]\n[camera]\n{camera}");
    RigFile::from_bytes(Path::new("folder/my.toml"), text.as_bytes())
}

#[track_caller]
fn camera(text: &str) -> CameraSpec {
    match from(text).expect("it is whole").kind {
        RigKind::Hardware(rig) => rig.camera,
        other => panic!("not hardware: {other:?}"),
    }
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

const GIGE: &str = "kind = \"gige\"\naddress = \"192.168.1.20\"\nsize = [640, 480]\n";
const USB3: &str = "kind = \"usb3\"\nserial = \"A1\"\nsize = [640, 480]\n";
const V4L: &str = "kind = \"v4l\"\ndevice = \"/dev/video0\"\nsize = [640, 480]\n";
const STILL: &str = "kind = \"gphoto2\"\nsize = [5616, 3744]\ntiles = \"rggb\"\n";

#[test]
fn each_kind_has_its_keys_and_defaults() {
    let all = "offset = [8, 2]\npixel_format = \"bayerrg12p\"\ncolour = \"luma\"\nsaturation = 4000\ngain = 6\n\
               exposures = [1e-3, 0.1]\ntimeout = 2\n";
    let CameraSpec::Genicam(gige) = camera(&format!("{GIGE}{all}packet_size = 1500\n")) else {
        panic!("another kind")
    };
    assert_eq!(
        (gige.pixel_format, gige.colour, gige.saturation),
        (PixelFormat::BayerRG12p, Colour::Luma, Some(4000))
    );
    let CameraSpec::Genicam(usb3) = camera(&format!("{USB3}{all}")) else { panic!("another kind") };
    assert_eq!((usb3.serial.as_deref(), usb3.pixel_format), (Some("A1"), PixelFormat::BayerRG12p));
    let CameraSpec::V4l(v4l) = camera(&format!("{V4L}pixel_format = \"yuyv\"\ngain = 16\nskip = 3\n")) else {
        panic!("another kind")
    };
    assert_eq!((v4l.pixel_format, v4l.gain, v4l.skip), (V4lFormat::Yuyv, Some(16), 3));
    let more = "model = \"Canon EOS 5D Mark II\"\niso = 100\naperture = 5.6\nimage_format = \"RAW\"\nstops = 3\n\
                saturation = 15000\nsettings = { whitebalance = \"Daylight\" }\ndecoder = [\"unprocessed_raw\"]\n";
    let CameraSpec::Gphoto2(still) = camera(&format!("{STILL}{more}")) else { panic!("another kind") };
    assert_eq!((still.iso.as_deref(), still.aperture.as_deref()), (Some("100"), Some("5.6")));
    assert_eq!((still.tiles, still.bits, still.settings.len()), (Some(Tiles::Rggb), 14, 1));
    // Left out.
    let CameraSpec::Gphoto2(still) = camera(STILL) else { panic!("another kind") };
    assert_eq!(still.decoder[..3], ["dcraw", "-4", "-D"]);
    let CameraSpec::Genicam(usb3) = camera("kind = \"usb3\"\nsize = [640, 480]\n") else {
        panic!("another kind")
    };
    assert_eq!((usb3.serial, usb3.pixel_format), (None, PixelFormat::Mono12));
}

#[test]
fn a_pixel_format_may_have_the_cameras_spelling() {
    for (text, format) in [
        ("Mono12Packed", PixelFormat::Mono12Packed),
        ("mono12packed", PixelFormat::Mono12Packed),
        ("BayerRG8", PixelFormat::BayerRG8),
    ] {
        let CameraSpec::Genicam(gige) = camera(&format!("{GIGE}pixel_format = \"{text}\"\n")) else {
            panic!("another kind")
        };
        assert_eq!(gige.pixel_format, format);
    }
}

#[test]
fn a_cameras_name_contains_every_setting_that_changes_counts() {
    let name = |text: &str| camera(text).info().name;
    let changes = [
        (GIGE, ["offset = [8, 2]", "pixel_format = \"mono8\"", "gain = 3.5", "saturation = 4000"].as_slice()),
        (USB3, &["offset = [8, 2]", "pixel_format = \"mono12p\"", "gain = 3.5", "saturation = 4000"]),
        (V4L, &["pixel_format = \"grey\"", "gain = 4", "saturation = 4000"]),
        (
            STILL,
            &[
                "offset = [8, 2]",
                "colour = \"luma\"",
                "iso = 100",
                "aperture = 8",
                "image_format = \"RAW\"",
                "stops = 3",
                "saturation = 15000",
                "settings = { highisonr = \"Off\" }",
                "decoder = [\"unprocessed_raw\"]",
                "model = \"A\"",
            ],
        ),
    ];
    for (text, changes) in changes {
        let mut names: Vec<String> =
            changes.iter().map(|change| name(&format!("{text}{change}\n"))).collect();
        names.push(name(text));
        names.push(name(&text.replace("size = [", "size = [1")));
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count, "each is another: {names:?}");
    }
    let bayer = |colour: &str| name(&format!("{GIGE}pixel_format = \"bayergb12\"\ncolour = \"{colour}\"\n"));
    assert_eq!(bayer("green"), "gige 192.168.1.20 BayerGB12 640x480+0+0 GBRG binned to green");
}

#[test]
fn a_colour_camera_has_half_the_size_and_its_channels() {
    for (colour, channels, bits) in [("rgb", 3, 13), ("luma", 1, 14), ("green", 1, 13)] {
        let text = format!("{USB3}pixel_format = \"bayerbg12packed\"\ncolour = \"{colour}\"\n");
        let info = from(&text).expect("it is whole").kind.camera_info();
        assert_eq!((info.resolution.width, info.resolution.height), (320, 240));
        assert_eq!((info.channels, info.bits), (channels, bits));
    }
}

#[test]
fn misspelt_keys_and_contradictions_are_named() {
    for (text, part, to, expected) in [
        (GIGE, "\"gige\"", "\"gig\"", "line 6, in [camera]: unknown value `gig`; did you mean `gige`?"),
        (GIGE, "\"gige\"", "\"usb\"", "known here: gige, usb3, v4l, gphoto2"),
        (GIGE, "kind = \"gige\"\n", "", "missing field `kind`"),
        (GIGE, "address", "adress", "line 7, in [camera]: unknown key `adress`; did you mean `address`?"),
        (USB3, "serial = \"A1\"", "address = \"10.0.0.1\"", "unknown key `address`"),
        (GIGE, "size", "serial = \"A1\"\nsize", "unknown key `serial`"),
        (GIGE, "address = \"192.168.1.20\"\n", "", "missing field `address`"),
        (USB3, "serial = \"A1\"", "colour = \"rbg\"", "unknown value `rbg`; did you mean `rgb`?"),
        (V4L, "device", "devise", "unknown key `devise`; did you mean `device`?"),
        (V4L, "size", "skip = 1000\nsize", "camera.skip is 1000; give 0 to 100"),
        (STILL, "tiles", "tile", "unknown key `tile`; did you mean `tiles`?"),
        (STILL, "rggb", "rgbg", "unknown value `rgbg`; did you mean"),
        (STILL, "5616", "5615", "camera.size is [5615, 3744], which cuts the 2x2 cells"),
        (STILL, "tiles = \"rggb\"", "colour = \"luma\"", "\"luma\", but the camera is gray"),
        (STILL, "tiles", "bits = 17\ntiles", "camera.bits is 17; give 8 to 16"),
        (STILL, "tiles", "saturation = 16384\ntiles", "camera.saturation is 16384; give 1 to 16383"),
        (STILL, "tiles", "decoder = []\ntiles", "camera.decoder is empty"),
        (STILL, "tiles", "iso = []\ntiles", "one of the camera's choices as text or number"),
        (
            GIGE,
            "size",
            "offset = [3, 0]\npixel_format = \"bayerrg8\"\nsize",
            "camera.offset is [3, 0], which cuts",
        ),
        (GIGE, "size", "pixel_format = \"mono12pack\"\nsize", "did you mean `mono12packed`?"),
        (GIGE, "size", "exposures = [1, 0.1]\nsize", "camera.exposures[1] is 0.1; give 1 to"),
    ] {
        let message = refused(&text.replacen(part, to, 1));
        assert!(message.contains(expected), "{to}: {message}");
    }
}

#[test]
fn opening_a_kind_that_was_not_built_names_its_feature() {
    for (text, built, feature) in [
        (GIGE, cfg!(feature = "gige"), "gige"),
        (USB3, cfg!(feature = "usb3"), "usb3"),
        (V4L, cfg!(feature = "v4l"), "v4l"),
    ] {
        if built {
            continue;
        }
        let RigKind::Hardware(rig) = from(text).expect("a file may name it").kind else {
            panic!("not hardware")
        };
        let helper = krylux::rig::Helper::at("/nonexistent");
        let Err(error) = rig.open(&helper, None) else { panic!("it is not there") };
        let message = error.to_string();
        assert!(message.contains(&format!("--features {feature}")), "{message}");
    }
}
