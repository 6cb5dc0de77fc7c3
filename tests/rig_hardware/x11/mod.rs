//! A projector that is a window of a real X server: what arrives at which pixel, and what is noticed.

#![allow(clippy::panic, reason = "a failed test panics")]

mod faults;
mod helper;
mod levels;

use std::time::Duration;

use crate::x_server::XServer;
use krylux::rig::{Helper, WallClock, X11Monitor, X11Projector, X11Spec};

fn helper() -> Helper {
    Helper { patience: Duration::from_secs(8), ..Helper::at(env!("CARGO_BIN_EXE_krylux")) }
}

fn spec(server: &XServer, size: [usize; 2]) -> X11Spec {
    X11Spec { display: Some(server.display.clone()), ..X11Spec::new(size[0], size[1]) }
}

fn on(monitor: &str) -> X11Monitor {
    X11Monitor::Name(monitor.into())
}

fn open(spec: &X11Spec) -> krylux::Result<X11Projector> {
    X11Projector::open(spec, &helper(), WallClock::starting_at(0.0))
}

/// The message of what must fail.
#[track_caller]
fn refused<T>(result: krylux::Result<T>) -> String {
    match result {
        Ok(_) => panic!("it is refused"),
        Err(error) => error.to_string(),
    }
}
