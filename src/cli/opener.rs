//! Showing a report on the desktop.

use std::path::Path;
use std::process::{Command, Stdio};

/// The desktop's own opener of files, with the words before the file's name.
const OPENER: &[&str] = if cfg!(target_os = "macos") {
    &["open"]
} else if cfg!(target_os = "windows") {
    &["cmd", "/C", "start", ""]
} else {
    &["xdg-open"]
};

/// Opens `report` without waiting for it. Where there is no opener, or no screen, a note says where the report is: the run itself is
/// done.
pub(super) fn open(report: &Path) {
    if let Err(why) = try_open(report) {
        eprintln!("note: {} is not opened: {why}; open it in a browser", report.display());
    }
}

fn try_open(report: &Path) -> Result<(), String> {
    let is_unix_desktop = cfg!(all(unix, not(target_os = "macos")));
    if is_unix_desktop && ["DISPLAY", "WAYLAND_DISPLAY"].iter().all(|name| std::env::var_os(name).is_none()) {
        return Err("there is no screen (neither DISPLAY nor WAYLAND_DISPLAY is set)".into());
    }
    let mut command = Command::new(OPENER[0]);
    command.args(&OPENER[1..]).arg(report);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match command.spawn() {
        Ok(_) => Ok(()),
        Err(error) => Err(format!("{}: {error}", OPENER[0])),
    }
}
