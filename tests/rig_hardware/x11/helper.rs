//! How a program that is not krylux gets the helper program. This test binary is such a program: it runs itself, with one
//! test and another environment, because the environment cannot be changed in a process of many threads.

use std::path::Path;
use std::process::Command;

use krylux::rig::{Helper, WallClock, X11Projector};

use super::spec;
use crate::x_server::XServer;

const KRYLUX: &str = env!("CARGO_BIN_EXE_krylux");

/// Set in the process that the test below starts.
const INNER: &str = "KRYLUX_TEST_FINDS_THE_HELPER";

/// The result of [`Helper::find`] in a process of this program with these two environment variables.
fn found(variable: Option<&str>, path: &Path) -> String {
    let mut command = Command::new(std::env::current_exe().expect("this program has a file"));
    command.args([
        "--exact",
        "x11::helper::a_program_that_is_not_krylux_finds_the_helper_or_is_told_how",
        "--nocapture",
    ]);
    command.env(INNER, "1").env("PATH", path).env_remove(Helper::VARIABLE);
    if let Some(variable) = variable {
        command.env(Helper::VARIABLE, variable);
    }
    let output = command.output().expect("this program can be started");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_program_that_is_not_krylux_finds_the_helper_or_is_told_how() {
    if std::env::var_os(INNER).is_some() {
        match Helper::find() {
            Ok(helper) => println!("found {}", helper.program.display()),
            Err(why) => println!("refused: {why}"),
        }
        return;
    }
    let nowhere = Path::new("/nonexistent");
    let refused = found(None, nowhere);
    for part in ["refused", "no helper program was found", "KRYLUX_HELPER", "PATH", "Helper::at"] {
        assert!(refused.contains(part), "{part}: {refused}");
    }
    let krylux = format!("found {KRYLUX}");
    assert!(found(Some(KRYLUX), nowhere).contains(&krylux));
    let folder = Path::new(KRYLUX).parent().expect("a program is in a folder");
    assert!(found(None, folder).contains(&krylux));
    let refused = found(Some("/nonexistent/krylux"), folder);
    assert!(refused.contains("KRYLUX_HELPER names the helper program \"/nonexistent/krylux\""), "{refused}");
}

#[test]
fn a_program_that_is_not_krylux_opens_a_projector_with_the_helper_that_it_names() {
    let server = XServer::start(64, 48);
    let projector =
        X11Projector::open(&spec(&server, [16, 12]), &Helper::at(KRYLUX), WallClock::starting_at(0.0));
    let projector = projector.expect("the named program is krylux");
    let helper = projector.helper_id().expect("the helper runs");
    let program = std::fs::read_link(format!("/proc/{helper}/exe")).expect("the process is there");
    assert_eq!(program, Path::new(KRYLUX).canonicalize().expect("it is a file"));
}
