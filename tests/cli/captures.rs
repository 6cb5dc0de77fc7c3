//! Folders of captures: every layout, the run that an import leaves, and folders that cannot be read.

use std::fs;
use std::path::Path;

use image::{GrayImage, ImageBuffer, Luma};
use krylux::image::{Image, Resolution};
use krylux::io::{npy, picture};
use krylux::measure::{Captures, shifted_checkerboards};
use tempfile::TempDir;

use crate::program::{command, inside, text};

/// The projector and the camera.
const PATTERN: Resolution = Resolution { width: 6, height: 4 };
const PHOTO: Resolution = Resolution { width: 8, height: 5 };

/// The entry of the light transport matrix: direct light from a shifted place, and even global light.
fn entry(j: usize, i: usize) -> f64 {
    let [x, y] = [(j % PHOTO.width) as f64 * 0.7, (j / PHOTO.width) as f64 * 0.75];
    let square = (x - (i % PATTERN.width) as f64).powi(2) + (y - (i / PATTERN.width) as f64).powi(2);
    0.5 * (-2.0 * square).exp() + 0.004
}

fn photo(pattern: &[f64]) -> Vec<f64> {
    (0..PHOTO.pixels()).map(|j| pattern.iter().enumerate().map(|(i, x)| entry(j, i) * x).sum()).collect()
}

/// Random patterns of zeros and ones.
fn pattern(k: usize) -> Vec<f64> {
    let bit = |i: usize| (i * 2_654_435_761 + (k + 3) * 40_503 + i * i * (k + 1) * 97) >> 7 & 1;
    (0..PATTERN.pixels()).map(|i| bit(i) as f64).collect()
}

/// Writes numbers from 0 to 1 as a picture of 12 bits above a black level of 64.
fn write_photo(path: &Path, values: &[f64]) {
    let level = |value: &f64| Luma([(64.0 + value * (4095.0 - 64.0)).round().clamp(0.0, 4095.0) as u16]);
    let pixels = values.iter().flat_map(|value| level(value).0).collect::<Vec<u16>>();
    fs::create_dir_all(path.parent().expect("a folder")).expect("the folder can be written");
    ImageBuffer::<Luma<u16>, _>::from_vec(PHOTO.width as u32, PHOTO.height as u32, pixels)
        .expect("as many pixels")
        .save(path)
        .expect("the folder can be written");
}

fn write_pattern(path: &Path, values: &[f64]) {
    let pixels = values.iter().map(|value| (value * 255.0).round() as u8).collect();
    fs::create_dir_all(path.parent().expect("a folder")).expect("the folder can be written");
    GrayImage::from_vec(PATTERN.width as u32, PATTERN.height as u32, pixels)
        .expect("as many pixels")
        .save(path)
        .expect("the folder can be written");
}

const PAIRS: &str = "map = \"found\"\n\n[patterns]\nfiles = \"patterns/*.png\"\n\n[photos]\nfiles = \"photos/photo-*.png\"\nbits = 12\nblack_level = 64\n";

/// A folder of 20 pairs.
fn pairs(folder: &Path) {
    for k in 0..20 {
        write_pattern(&folder.join(format!("patterns/{k:03}.png")), &pattern(k));
        write_photo(&folder.join(format!("photos/photo-{k}.png")), &photo(&pattern(k)));
    }
    fs::write(folder.join("captures.toml"), PAIRS).expect("the folder can be written");
}

fn new_folder() -> TempDir {
    TempDir::new().expect("a temporary folder can be made")
}

/// Imports a folder, and returns the error of photos that were left out.
fn imported(folder: &Path, run: &str) -> f64 {
    let folder = folder.display().to_string();
    let output = command(&["import", &folder, "-o", run, "--json"]).output().expect("it runs");
    let told = text(&output.stderr);
    assert!(output.status.success(), "{told}");
    let facts: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a summary");
    facts["relative_error_left_out"].as_f64().unwrap_or_else(|| unreachable!("{facts}"))
}

#[test]
fn an_import_leaves_a_run_that_predicts_photos_of_other_patterns() {
    let folder = new_folder();
    let captures = folder.path().join("captures");
    pairs(&captures);
    let run = inside(&folder, "run");
    let error = imported(&captures, &run);
    // Sixteen photos tell the 24 entries of each row.
    assert!(error < 0.15, "{error}");
    let (shown, file) = (inside(&folder, "shown.npy"), inside(&folder, "photo.npy"));
    let other = pattern(77);
    let image = Image::from_planes(PATTERN, std::slice::from_ref(&other)).expect("one plane");
    picture::write(Path::new(&shown), &image).expect("the folder can be written");
    let output = command(&["photo", &run, "--pattern", &shown, "-o", &file]).output().expect("it runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found = npy::read_npy(Path::new(&file)).expect("a photo");
    assert_eq!(found.shape, [PHOTO.height, PHOTO.width]);
    let truth = photo(&other);
    let apart = |other: &[f64]| -> f64 {
        let rest: f64 = other.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum();
        (rest / truth.iter().map(|value| value * value).sum::<f64>()).sqrt()
    };
    assert!(apart(&found.values) < 0.15, "{}", apart(&found.values));
    // The photo of another pattern is refused by this bound.
    assert!(apart(&photo(&pattern(78))) > 0.15);
    // The same photo comes from the folder of captures itself.
    let again = inside(&folder, "again.npy");
    let captures = captures.display().to_string();
    let output = command(&["photo", &captures, "--pattern", &shown, "-o", &again]).output().expect("it runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(npy::read_npy(Path::new(&again)).expect("a photo"), found);
}

#[test]
fn every_layout_is_imported() {
    let folder = new_folder();
    let at = |name: &str| folder.path().join(name);
    let toml = |name: &str, text: &str| {
        fs::create_dir_all(at(name)).expect("the folder can be written");
        fs::write(at(name).join("captures.toml"), text).expect("the folder can be written");
    };
    let camera = "bits = 12\nblack_level = 64\n";
    toml(
        "pixels",
        &format!("layout = \"pixels\"\n[patterns]\nsize = [6, 4]\n[photos]\nfiles = \"*.png\"\n{camera}"),
    );
    for k in 0..PATTERN.pixels() {
        let single: Vec<f64> = (0..PATTERN.pixels()).map(|i| f64::from(u8::from(i == k))).collect();
        write_photo(&at(&format!("pixels/{k}.png")), &photo(&single));
    }
    toml(
        "boards",
        &format!(
            "layout = \"checkerboards\"\nmap = \"coaxial\"\n[patterns]\nsize = [6, 4]\nsquare = 1\nshifts = 2\n[photos]\nfiles = \"*.png\"\n{camera}"
        ),
    );
    for k in 0..4 {
        let lit = |i: usize| (i % 6 + k % 2 + i / 6 + k / 2).is_multiple_of(2);
        let board: Vec<f64> = (0..PATTERN.pixels()).map(|i| f64::from(u8::from(lit(i)))).collect();
        write_photo(&at(&format!("boards/{k}.png")), &photo(&board));
    }
    toml(
        "compennet",
        "layout = \"compennet\"\n[patterns]\nresponse = \"linear\"\n[photos]\nresponse = \"linear\"\nbits = 12\nblack_level = 64\n",
    );
    for k in 0..20 {
        write_pattern(&at(&format!("compennet/prj/train/img_{k:04}.png")), &pattern(k));
        write_photo(&at(&format!("compennet/cam/raw/train/img_{k:04}.png")), &photo(&pattern(k)));
    }
    toml("arrays", "[patterns]\nfiles = \"x.npy\"\n[photos]\nfiles = [\"y.npy\", \"y.npy\"]\n");
    let stack = |of: &dyn Fn(usize) -> Vec<f64>| (0..20).flat_map(of).collect::<Vec<f64>>();
    npy::write_npy(&at("arrays/x.npy"), &[20, 4, 6], &stack(&pattern)).expect("the folder can be written");
    npy::write_npy(&at("arrays/y.npy"), &[20, 5, 8], &stack(&|k| photo(&pattern(k))))
        .expect("the folder can be written");
    for (name, bound) in [("pixels", 0.5), ("boards", 1.1), ("compennet", 0.15), ("arrays", 0.15)] {
        let error = imported(&at(name), &inside(&folder, &format!("run-{name}")));
        assert!(error < bound, "{name}: {error}");
    }
}

/// A separation asks for the checkerboards that were captured. `info` names them.
#[test]
fn captured_checkerboards_are_what_a_separation_asks_for() {
    let folder = new_folder();
    let at = |name: &str| inside(&folder, name);
    fs::create_dir(at("boards")).expect("the folder can be written");
    let described = "layout = \"checkerboards\"\nmap = \"coaxial\"\n[patterns]\nsize = [6, 4]\nsquare = 3\nshifts = 3\n[photos]\nfiles = \"y.npy\"\n";
    fs::write(at("boards/captures.toml"), described).expect("the folder can be written");
    let boards = shifted_checkerboards(PATTERN, 3, 3);
    let photos: Vec<f64> = boards.flat_map(|board| photo(&board)).collect();
    npy::write_npy(Path::new(&at("boards/y.npy")), &[9, 5, 8], &photos).expect("the folder can be written");
    imported(Path::new(&at("boards")), &at("run"));
    for (words, expected) in [
        (vec!["info", &at("boards")], "checkerboards of 3 px at 3×3 places"),
        (
            vec!["separate", &at("run"), "--probes", "0", "-o", &at("captured")],
            "checkerboards of 3 px at 3×3 places",
        ),
        (
            vec!["separate", &at("run"), "--square", "2", "--probes", "0", "-o", &at("asked")],
            "checkerboards of 2 px at 4×4 places",
        ),
    ] {
        let output = command(&words).output().expect("it runs");
        let said = text(&output.stdout);
        assert!(
            output.status.success() && said.contains(expected),
            "{words:?}: {said}{}",
            text(&output.stderr)
        );
    }
}

/// Raw files go through the program that `converter` names, and other files do not.
#[cfg(unix)]
#[test]
fn raw_files_are_read_through_a_named_converter() {
    use std::os::unix::fs::PermissionsExt;
    let folder = new_folder();
    let at = |name: &str| folder.path().join(name);
    pairs(folder.path());
    let described = PAIRS
        .replace("photo-*.png", "photo-*.nef")
        .replace("bits = 12\nblack_level = 64\n", "converter = \"dcraw\"\n");
    fs::write(at("captures.toml"), described).expect("the folder can be written");
    for k in 0..20 {
        let mut ppm = format!("P5\n{} {}\n65535\n", PHOTO.width, PHOTO.height).into_bytes();
        ppm.extend(photo(&pattern(k)).iter().flat_map(|value| ((value * 65535.0) as u16).to_be_bytes()));
        fs::write(at(&format!("photos/photo-{k}.nef")), ppm).expect("the folder can be written");
    }
    let captures = folder.path().display().to_string();
    let run = |path: &Path, out: &str| {
        let words = ["import", captures.as_str(), "-o", &inside(&folder, out)];
        let output = command(&words).env("PATH", path).output().expect("it runs");
        (output.status.code(), text(&output.stderr))
    };
    // A program that takes its last argument for what it converts.
    fs::create_dir(at("bin")).expect("the folder can be written");
    let program = |script: &str| {
        fs::write(at("bin/dcraw"), script).expect("the folder can be written");
        fs::set_permissions(at("bin/dcraw"), fs::Permissions::from_mode(0o755)).expect("it is there");
    };
    let (status, said) = run(&at("bin"), "none");
    assert!(status == Some(2) && said.contains("dcraw") && said.contains("not installed"), "{said}");
    program("#!/bin/sh\nfor last; do :; done\nexec /bin/cat \"$last\"\n");
    let (status, said) = run(&at("bin"), "run");
    assert_eq!(status, Some(0), "{said}");
    program("#!/bin/sh\necho 'no sensor data' >&2\nexit 1\n");
    let (status, said) = run(&at("bin"), "failed");
    assert!(status == Some(2) && said.contains("photo-0.nef") && said.contains("no sensor data"), "{said}");
}

/// What is changed in a folder of pairs, and the words of the error.
type Broken = (&'static str, fn(&Path), &'static [&'static str]);

fn toml(folder: &Path, from: &str, to: &str) {
    let text = PAIRS.replace(from, to);
    assert_ne!(text, PAIRS);
    fs::write(folder.join("captures.toml"), text).expect("the folder can be written");
}

fn remove(folder: &Path, name: &str) {
    fs::remove_file(folder.join(name)).expect("it is there");
}

fn copy(folder: &Path, from: &str, to: &str) {
    fs::copy(folder.join(from), folder.join(to)).expect("it is there");
}

const BROKEN: [Broken; 22] = [
    (
        "no photo of a pattern",
        |at| remove(at, "photos/photo-7.png"),
        &["patterns/007.png", "number 7", "photos"],
    ),
    ("no pattern of a photo", |at| remove(at, "patterns/003.png"), &["photo-3.png", "number 3", "patterns"]),
    ("a number twice", |at| copy(at, "patterns/003.png", "patterns/3.png"), &["the number 3", "003.png"]),
    ("no number", |at| copy(at, "patterns/003.png", "patterns/last.png"), &["last.png", "not a number"]),
    ("another size", |at| copy(at, "patterns/003.png", "photos/photo-4.png"), &["photo-4.png", "6x4", "8x5"]),
    (
        "a pattern of another size",
        |at| copy(at, "photos/photo-4.png", "patterns/004.png"),
        &["004.png", "8x5", "6x4"],
    ),
    ("no picture", |at| fs::write(at.join("photos/photo-5.png"), "no").expect("a file"), &["photo-5.png"]),
    (
        "cut off",
        |at| {
            let path = at.join("photos/photo-5.png");
            let bytes = fs::read(&path).expect("a file");
            fs::write(&path, &bytes[..bytes.len() / 2]).expect("a file");
        },
        &["photo-5.png"],
    ),
    ("too few bits", |at| toml(at, "bits = 12", "bits = 8"), &["photo-0.png", "from 0 to 255", "bits"]),
    ("no bits at all", |at| toml(at, "bits = 12", "bits = 0"), &["captures.toml", "bits = 0"]),
    ("black above white", |at| toml(at, "black_level = 64", "black_level = 5000"), &["black_level", "4095"]),
    ("no such key", |at| toml(at, "black_level", "black_levl"), &["black_levl", "black_level"]),
    ("no such layout", |at| toml(at, "map = \"found\"", "layout = \"pears\""), &["pears", "pairs"]),
    ("no such map", |at| toml(at, "\"found\"", "\"coxial\""), &["coxial", "coaxial"]),
    ("no map file", |at| toml(at, "\"found\"", "\"map.npy\""), &["map.npy"]),
    ("no files", |at| toml(at, "photos/photo-*.png", "photos/foto-*.png"), &["foto-*.png", "no photos"]),
    ("no star", |at| toml(at, "photos/photo-*.png", "photos/photo-1.png"), &["number", "*"]),
    ("no table", |at| toml(at, "files = \"patterns/*.png\"\n", ""), &["[patterns] has no files"]),
    ("no exposure", |at| toml(at, "bits = 12", "bits = 12\nexposure = 0.0"), &["exposure"]),
    (
        "two exposures",
        |at| toml(at, "bits = 12", "bits = 12\nexposure = [0.1, 0.2]"),
        &["exposure has 2 values", "20"],
    ),
    ("no response", |at| toml(at, "bits = 12", "bits = 12\nresponse = \"log\""), &["log", "linear"]),
    (
        "no rising response",
        |at| toml(at, "bits = 12", "bits = 12\nresponse = [[0.0, 0.0], [0.0, 1.0]]"),
        &["rise"],
    ),
];

#[test]
fn folders_that_cannot_be_read_are_refused_by_name() {
    for (what, spoil, words) in BROKEN {
        let folder = new_folder();
        pairs(folder.path());
        assert!(Captures::read(folder.path()).is_ok());
        spoil(folder.path());
        let told = match Captures::read(folder.path()) {
            Err(error) => error.to_string(),
            Ok(_) => unreachable!("{what} was read"),
        };
        assert!(words.iter().all(|word| told.contains(word)), "{what}: {told}");
        assert!(told.contains("help: ") || told.starts_with("cannot read"), "{what}: {told}");
    }
    // A folder without its file is no source, and no other verb's either.
    let folder = new_folder();
    let output = command(&["import", &folder.path().display().to_string()]).output().expect("it runs");
    let told = text(&output.stderr);
    assert!(output.status.code() == Some(2) && told.contains("captures.toml"), "{told}");
}

#[test]
fn photos_that_do_not_belong_to_their_patterns_fail() {
    let folder = new_folder();
    pairs(folder.path());
    for k in 0..20 {
        write_photo(&folder.path().join(format!("photos/photo-{k}.png")), &photo(&pattern((7 * k + 3) % 20)));
    }
    let run = inside(&folder, "run");
    let captures = folder.path().display().to_string();
    let output = command(&["import", &captures, "-o", &run]).output().expect("it runs");
    let told = text(&output.stdout);
    assert!(output.status.code() == Some(1) && told.contains("belongs to its pattern"), "{told}");
}

#[test]
fn saturated_samples_are_left_out_and_said() {
    let folder = new_folder();
    pairs(folder.path());
    let mut bright = photo(&pattern(2));
    bright.iter_mut().take(10).for_each(|value| *value = 2.0);
    write_photo(&folder.path().join("photos/photo-2.png"), &bright);
    let captures = Captures::read(folder.path()).expect("captures");
    let missing = captures.photos.iter().flat_map(|photo| photo.samples()).filter(|value| value.is_nan());
    assert_eq!(missing.count(), 10);
    let [finding] = &captures.findings[..] else { unreachable!("one finding") };
    assert!(
        finding.found.contains("photo-2.png") && finding.found.contains("saturated"),
        "{}",
        finding.found
    );
}
