//! Showing a report on the desktop.

use std::path::Path;

use super::console::Console;

/// Opens `report` without waiting for the browser. Where there is no opener, or no screen, a note says where the report is: the run itself
/// is done.
pub(super) fn open(report: &Path, console: &Console) {
    if let Err(why) = try_open(report) {
        let report = report.display();
        console.note(format_args!("note: {report} is not opened: {why}; open it in a browser"));
    }
}

fn try_open(report: &Path) -> Result<(), String> {
    // Without a screen an opener would fall back to a browser in the terminal.
    let is_unix_desktop = cfg!(all(unix, not(target_os = "macos")));
    if is_unix_desktop && ["DISPLAY", "WAYLAND_DISPLAY"].iter().all(|name| std::env::var_os(name).is_none()) {
        return Err("there is no screen (neither DISPLAY nor WAYLAND_DISPLAY is set)".into());
    }
    open::that_detached(report).map_err(|error| error.to_string())
}
