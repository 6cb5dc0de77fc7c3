//! Opens pages on the desktop.

use std::ffi::OsStr;

use super::console::Console;

/// Opens a file or an address without waiting for the browser. If there is no opener or no screen, a note gives the location of the page.
/// This is no error, since the requested page exists.
pub(super) fn open(page: impl AsRef<OsStr>, console: &Console) {
    let page = page.as_ref();
    if let Err(why) = try_open(page) {
        let page = page.display();
        console.note(format_args!("note: {page} is not opened: {why}; open it in a browser"));
    }
}

fn try_open(page: &OsStr) -> Result<(), String> {
    // Without a screen, an opener would start a browser in the terminal.
    let is_unix_desktop = cfg!(all(unix, not(target_os = "macos")));
    if is_unix_desktop && ["DISPLAY", "WAYLAND_DISPLAY"].iter().all(|name| std::env::var_os(name).is_none()) {
        return Err("there is no screen (neither DISPLAY nor WAYLAND_DISPLAY is set)".into());
    }
    open::that_detached(page).map_err(|error| error.to_string())
}
