//! A still camera that is played by scripts.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use krylux::rig::{Gphoto2, Gphoto2Spec, WallClock};
use tempfile::TempDir;

/// Width and height of its sensor.
pub const SENSOR: [usize; 2] = [12, 8];

/// A camera's state, as files beside links to the scripts.
pub struct Studio {
    pub folder: TempDir,
}

/// The scripts, written once before any is run: a file that is open for writing cannot be.
fn scripts() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = TempDir::new().expect("a temporary folder can be made");
        for (name, text) in [("gphoto2", include_str!("gphoto2.sh")), ("dcraw", include_str!("decoder.sh"))] {
            let path = folder.path().join(name);
            fs::write(&path, text).expect("the folder can be written");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("it is ours");
        }
        folder
    });
    folder.path()
}

/// Counts of 14 bits that differ from photosite to photosite.
pub fn counts() -> Vec<u16> {
    (0..SENSOR[0] * SENSOR[1]).map(|site| (site * 167 + 20) as u16).collect()
}

impl Studio {
    /// A camera that is on, in mode M, with RAW chosen.
    pub fn new() -> Self {
        let studio = Self { folder: TempDir::new().expect("a temporary folder can be made") };
        for name in ["gphoto2", "dcraw"] {
            symlink(scripts().join(name), studio.path(name)).expect("the folder can be written");
        }
        studio.cameras(&[("Krylux Still One", "usb:001,005")]);
        studio.setting("iso", "400", &["100", "200", "400"]);
        studio.setting("f-number", "f/8", &["f/4", "f/5.6", "f/8"]);
        studio.setting("imageformat", "Large Fine JPEG", &["Large Fine JPEG", "RAW"]);
        studio.setting("capturetarget", "Memory card", &["Internal RAM", "Memory card"]);
        studio.setting(
            "shutterspeed",
            "1/60",
            &["bulb", "30", "1", "1/4", "1/15", "1/60", "1/250", "1/1000"],
        );
        studio.takes("cr2", SENSOR, &counts());
        studio
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("it is in the folder")).expect("the folder can be written");
        fs::write(path, content).expect("the folder can be written");
    }

    pub fn cameras(&self, cameras: &[(&str, &str)]) {
        let rows = cameras.iter().map(|(model, port)| format!("{model:<30} {port:<16}\n"));
        let head = "Model                          Port            \n";
        let line = "----------------------------------------------------------\n";
        self.write("cameras", format!("{head}{line}{}", rows.collect::<String>()));
    }

    pub fn setting(&self, name: &str, current: &str, choices: &[&str]) {
        self.write(&format!("settings/{name}/current"), format!("{current}\n"));
        self.write(
            &format!("settings/{name}/choices"),
            choices.iter().map(|choice| format!("{choice}\n")).collect::<String>(),
        );
    }

    /// What a setting is now.
    pub fn current(&self, name: &str) -> String {
        let text = fs::read_to_string(self.path(&format!("settings/{name}/current")));
        text.expect("there is such a setting").trim().to_owned()
    }

    /// What a release leaves.
    pub fn takes(&self, ending: &str, [width, height]: [usize; 2], counts: &[u16]) {
        let _ = fs::remove_dir_all(self.path("taken"));
        let mut bytes = format!("RAWP5\n{width} {height}\n65535\n").into_bytes();
        counts.iter().for_each(|count| bytes.extend(count.to_be_bytes()));
        self.write(&format!("taken/photo.{ending}"), bytes);
    }

    /// What the scripts were asked, a run on each line.
    pub fn log(&self) -> Vec<String> {
        let text = fs::read_to_string(self.path("log")).expect("it was asked");
        text.lines().map(str::to_owned).collect()
    }

    pub fn spec(&self) -> Gphoto2Spec {
        Gphoto2Spec {
            program: self.path("gphoto2").display().to_string(),
            decoder: vec![self.path("dcraw").display().to_string()],
            iso: Some("100".into()),
            image_format: Some("RAW".into()),
            exposures: [1e-3, 1.0],
            // Scripts take their time on a busy machine.
            timeout: 60.0,
            ..Gphoto2Spec::new(SENSOR[0], SENSOR[1])
        }
    }

    pub fn open(&self, spec: &Gphoto2Spec) -> krylux::Result<Gphoto2> {
        Gphoto2::open(spec, WallClock::starting_at(0.0), 0)
    }
}
