//! The helper process: it owns the window and answers the requests that arrive through a pipe.

use std::io::{Read, Write};

use super::wire::{self, Reply, Request};
use super::{Screen, fault};
use crate::error::{Error, Result};
use crate::rig::Frame;

/// Answers requests from `from` on `to` until `from` ends; then the window closes. This is the whole work of the helper process.
///
/// # Errors
/// An error of reading or writing the pipe. Errors of the projector are sent as replies.
pub fn serve(mut from: impl Read, mut to: impl Write) -> std::io::Result<()> {
    let mut screen = None;
    while let Some((request, payload)) = wire::receive(&mut from)? {
        let reply = answer(&mut screen, request, &payload).unwrap_or_else(|error| match error {
            Error::Rig { fault, help, .. } => Reply::Fault { fault, help },
            other => Reply::Fault { fault: other.to_string(), help: "report this".into() },
        });
        wire::send(&mut to, &reply, &[])?;
    }
    Ok(())
}

fn answer(screen: &mut Option<Screen>, request: Request, payload: &[u8]) -> Result<Reply> {
    match (request, screen) {
        (Request::Open(spec), screen) => {
            // The old window is closed before there is a new one.
            *screen = None;
            let opened = screen.insert(Screen::open(&spec)?);
            let monitor = opened.monitor();
            Ok(Reply::Opened { monitor: monitor.name.clone(), resolution: monitor.resolution })
        }
        (Request::Show { resolution, channels }, Some(screen)) => {
            let levels = payload.iter().map(|&level| u16::from(level)).collect();
            Ok(Reply::Shown(screen.show(&Frame::new(resolution, channels, levels)?)?))
        }
        (Request::Confirm, Some(screen)) => screen.confirm().map(|()| Reply::Confirmed),
        (Request::Show { .. } | Request::Confirm, None) => {
            Err(fault("its window was never opened", "open it first"))
        }
    }
}
