//! A command line that cannot be parsed, and requests for help.

use std::io::Write;
use std::process::ExitCode;

use super::console::json_of;

/// Says why the command line cannot be parsed, as JSON with `--json`; or prints the help that was asked for.
pub(super) fn report(why: &clap::Error) -> ExitCode {
    let wants_json = std::env::args_os().any(|argument| argument == "--json");
    if why.use_stderr() && wants_json {
        let _ = writeln!(std::io::stderr().lock(), "{}", json_of(&as_error_and_help(&why.to_string())));
    } else {
        // A reader who has gone is not an error.
        let _ = why.print();
    }
    ExitCode::from(u8::try_from(why.exit_code()).unwrap_or(2))
}

/// The message in the form of krylux's own errors: what is wrong first, then what to do about it.
fn as_error_and_help(message: &str) -> String {
    let message = message.trim();
    let (error, help) = message.split_once("\n\n").unwrap_or((message, "see --help"));
    format!("{}\n  help: {}", error.trim_start_matches("error: "), help.trim())
}
