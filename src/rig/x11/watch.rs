//! The server's events about the projector's window.

use std::time::{Duration, Instant};

use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::present::{CompleteKind, CompleteMode};
use x11rb::protocol::xproto::{ConnectionExt as _, Visibility, Window};
use x11rb::rust_connection::RustConnection;

use super::{fault, lost};
use crate::error::{Error, Result};

/// The time between two looks for events. It bounds the delay of a confirmation.
const POLL: Duration = Duration::from_micros(200);

/// The longest wait for a confirmation: hundreds of refreshes.
const PATIENCE: Duration = Duration::from_secs(5);

/// Follows the events of one window.
pub(super) struct Watch {
    window: Window,
    /// The window's position on the server's screen, and its size, in pixels.
    place: [i32; 4],
    mapped: bool,
    /// Whether the window is covered now.
    obscured: bool,
    /// What went wrong since the last look. It is kept until it is reported.
    trouble: Option<Trouble>,
    completed: Option<Completed>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trouble {
    Closed,
    Hidden,
    Moved,
    Covered,
    Rearranged,
}

/// A confirmation by the server.
#[derive(Clone, Copy, Debug)]
pub(super) struct Completed {
    serial: u32,
    /// Whether it confirms a frame; otherwise it reports a refresh.
    of_frame: bool,
    /// Whether the frame was skipped in favour of a later one.
    pub(super) skipped: bool,
    /// The number of the refresh.
    pub(super) refresh: u64,
}

impl Watch {
    pub(super) fn new(window: Window, place: [i32; 4]) -> Self {
        Self { window, place, mapped: false, obscured: false, trouble: None, completed: None }
    }

    /// Waits until the window is mapped.
    pub(super) fn until_mapped(&mut self, connection: &RustConnection) -> Result<()> {
        let began = Instant::now();
        while !self.mapped {
            self.look(connection)?;
            if began.elapsed() > PATIENCE {
                return Err(fault(
                    "the X server does not show the projector's window",
                    "start the server anew",
                ));
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Waits for the confirmation with this serial number, of a frame or of a refresh.
    pub(super) fn completed(
        &mut self,
        connection: &RustConnection,
        serial: u32,
        of_frame: bool,
    ) -> Result<Completed> {
        let began = Instant::now();
        loop {
            self.look(connection)?;
            if let Some(found) =
                self.completed.take_if(|found| found.serial == serial && found.of_frame == of_frame)
            {
                return Ok(found);
            }
            if began.elapsed() > PATIENCE {
                return Err(fault(
                    format!("the X server has not confirmed a frame for {} s", PATIENCE.as_secs()),
                    "wake the monitor, and switch its power saving off (xset -dpms s off)",
                ));
            }
            std::thread::sleep(POLL);
        }
    }

    /// Reads all pending events.
    ///
    /// # Errors
    /// [`Error::Rig`] when the window was closed, hidden, moved or covered since the last look, or the server is
    /// gone.
    pub(super) fn look(&mut self, connection: &RustConnection) -> Result<()> {
        self.drain(connection)?;
        if self.trouble == Some(Trouble::Hidden) {
            // A window that is closed is hidden first. Once the server has answered a request, both events have arrived.
            let asked = connection.get_input_focus().map_err(|why| untold(&why))?;
            asked.reply().map_err(|why| untold(&why))?;
            self.drain(connection)?;
        }
        let trouble = self.trouble.take().or(self.obscured.then_some(Trouble::Covered));
        let Some(trouble) = trouble else { return Ok(()) };
        let (what, help) = match trouble {
            Trouble::Closed => ("was closed", "leave it alone while photos are taken"),
            Trouble::Hidden => ("was hidden", "leave it alone while photos are taken"),
            Trouble::Moved => ("was moved or resized", "switch the window manager's placing of it off"),
            Trouble::Covered => (
                "is covered by another one",
                "keep other windows, notifications and screen savers off its monitor",
            ),
            Trouble::Rearranged => {
                return Err(fault(
                    "the server's monitors were changed",
                    "leave them alone while photos are taken; go on with --resume",
                ));
            }
        };
        // A closed window stays closed.
        if trouble == Trouble::Closed {
            self.trouble = Some(trouble);
        }
        Err(fault(format!("the projector's window {what}"), format!("{help}; go on with --resume")))
    }

    fn drain(&mut self, connection: &RustConnection) -> Result<()> {
        while let Some(event) = connection.poll_for_event().map_err(|why| untold(&why))? {
            self.note(&event);
        }
        Ok(())
    }

    fn note(&mut self, event: &Event) {
        match event {
            Event::MapNotify(event) if event.window == self.window => self.mapped = true,
            Event::DestroyNotify(event) if event.window == self.window => {
                self.trouble = Some(Trouble::Closed);
            }
            Event::UnmapNotify(event) if event.window == self.window => {
                self.trouble.get_or_insert(Trouble::Hidden);
            }
            Event::ConfigureNotify(event) if event.window == self.window => {
                let place: [i32; 4] =
                    [event.x.into(), event.y.into(), event.width.into(), event.height.into()];
                if place != self.place {
                    self.trouble.get_or_insert(Trouble::Moved);
                }
            }
            Event::VisibilityNotify(event) if event.window == self.window => {
                self.obscured = event.state != Visibility::UNOBSCURED;
                if self.obscured {
                    self.trouble.get_or_insert(Trouble::Covered);
                }
            }
            Event::RandrScreenChangeNotify(_) | Event::RandrNotify(_) => {
                self.trouble.get_or_insert(Trouble::Rearranged);
            }
            Event::PresentCompleteNotify(event) if event.window == self.window => {
                self.completed = Some(Completed {
                    serial: event.serial,
                    of_frame: event.kind == CompleteKind::PIXMAP,
                    skipped: event.mode == CompleteMode::SKIP,
                    refresh: event.msc,
                });
            }
            _ => {}
        }
    }
}

fn untold(why: &dyn std::fmt::Display) -> Error {
    lost("tell what happens to the window", why)
}
