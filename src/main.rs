//! The command line program; everything is in the library's [`krylux::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_the_driver();
    krylux::rig::Helper::declare_this_program();
    krylux::cli::main()
}

/// Stops a complaint of Mesa's device selection on stderr. Mesa asks a display server which device to prefer, and complains if there is no
/// such server. krylux needs no display and chooses the device itself.
#[allow(unsafe_code, reason = "the environment is changed before any other thread exists")]
fn quiet_the_driver() {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() && std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: this is the first statement of `main`; no other thread reads the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
