//! A still camera that is simulated by scripts.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use krylux::rig::{Frame, Gphoto2, Gphoto2Spec, WallClock};
use tempfile::TempDir;

/// Width and height of the sensor.
pub const SENSOR: [usize; 2] = [12, 8];

/// A folder with the state of the simulated camera as files, and links to the scripts.
pub struct Studio {
    pub folder: TempDir,
}

/// The scripts. They are written once, before any of them runs, because a file that is open for writing cannot be executed.
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

/// The file that the decoder reads.
fn raw([width, height]: [usize; 2], counts: &[u16]) -> Vec<u8> {
    let mut bytes = format!("RAWP5\n{width} {height}\n65535\n").into_bytes();
    counts.iter().for_each(|count| bytes.extend(count.to_be_bytes()));
    bytes
}

impl Studio {
    /// A camera that is switched on, in mode M, and takes RAW files.
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

    /// The current value of a setting.
    pub fn current(&self, name: &str) -> String {
        let text = fs::read_to_string(self.path(&format!("settings/{name}/current")));
        text.expect("there is such a setting").trim().to_owned()
    }

    /// Sets the file that a release of the shutter leaves.
    pub fn takes(&self, ending: &str, size: [usize; 2], counts: &[u16]) {
        let _ = fs::remove_dir_all(self.path("taken"));
        self.write(&format!("taken/photo.{ending}"), raw(size, counts));
    }

    /// From now on a photo shows what is in view when it is taken: [`counts`] where that is white, and in proportion to gray of 8 bits.
    pub fn sees(&self, mut view: impl FnMut() -> Option<Frame> + Send + 'static) {
        for pipe in ["looks", "seen"] {
            let made = Command::new("mkfifo").arg(self.path(pipe)).status();
            assert!(made.expect("every system has it").success());
        }
        let folder = self.folder.path().to_owned();
        // Reading and writing wait for the script, at most until the process of the tests ends.
        std::thread::spawn(move || {
            while fs::read(folder.join("looks")).is_ok() {
                let Some(frame) = view() else { break };
                let shares = counts().into_iter().zip(frame.levels());
                let seen = shares.map(|(count, &level)| (u32::from(count) * u32::from(level) / 255) as u16);
                let seen = raw(SENSOR, &seen.collect::<Vec<u16>>());
                fs::write(folder.join("taken/photo.cr2"), seen).expect("the folder can be written");
                fs::write(folder.join("seen"), "\n").expect("the script reads it");
            }
        });
    }

    /// The arguments of each run of the scripts, one run on each line.
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
            // Scripts may be slow on a busy machine.
            timeout: 60.0,
            ..Gphoto2Spec::new(SENSOR[0], SENSOR[1])
        }
    }

    pub fn open(&self, spec: &Gphoto2Spec) -> krylux::Result<Gphoto2> {
        Gphoto2::open(spec, WallClock::starting_at(0.0), 0)
    }
}
