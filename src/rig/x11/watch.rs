//! The server's events about the projector's window.

use std::time::{Duration, Instant};

use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::present::{CompleteKind, CompleteMode};
use x11rb::protocol::xproto::{ConnectionExt as _, Visibility, Window};
use x11rb::rust_connection::RustConnection;

use super::{fault, lost};
use crate::error::{Error, Result};

/// The time between two checks for events. It bounds the delay of a confirmation.
const POLL: Duration = Duration::from_micros(200);

/// The longest wait for a confirmation, which is hundreds of refreshes.
const PATIENCE: Duration = Duration::from_secs(5);

pub(crate) struct Watch {
    window: Window,
    /// The window's position on the server's screen, and its size, in pixels.
    place: [i32; 4],
    mapped: bool,
    obscured: bool,
    /// The trouble that was noticed since the last check. It is kept until it is reported.
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

#[derive(Clone, Copy, Debug)]
pub(crate) struct Completed {
    serial: u32,
    /// Whether the server confirms a frame. Otherwise it reports a refresh.
    of_frame: bool,
    /// Whether the frame was skipped in favour of a later frame.
    pub(crate) skipped: bool,
    pub(crate) refresh: u64,
}

impl Watch {
    pub(crate) fn new(window: Window, place: [i32; 4]) -> Self {
        Self { window, place, mapped: false, obscured: false, trouble: None, completed: None }
    }

    pub(crate) fn until_mapped(&mut self, connection: &RustConnection) -> Result<()> {
        let late = || fault("the X server does not show the projector's window", "restart the server");
        self.wait(connection, |watch| watch.mapped.then_some(()), late)
    }

    pub(crate) fn completed(
        &mut self,
        connection: &RustConnection,
        serial: u32,
        of_frame: bool,
    ) -> Result<Completed> {
        let late = || {
            fault(
                format!("the X server has not confirmed a frame for {} s", PATIENCE.as_secs()),
                "wake the monitor, and switch its power saving off (xset -dpms s off)",
            )
        };
        self.wait(connection, |watch| watch.confirmation(serial, of_frame), late)
    }

    /// Reads events until `found` finds its result.
    fn wait<T>(
        &mut self,
        connection: &RustConnection,
        found: impl Fn(&mut Self) -> Option<T>,
        late: impl FnOnce() -> Error,
    ) -> Result<T> {
        let began = Instant::now();
        loop {
            self.look(connection)?;
            if let Some(found) = found(self) {
                return Ok(found);
            }
            if began.elapsed() > PATIENCE {
                return Err(late());
            }
            std::thread::sleep(POLL);
        }
    }

    /// The confirmation of a frame or refresh with this serial number, if it has arrived. Other confirmations belong to earlier requests.
    fn confirmation(&mut self, serial: u32, of_frame: bool) -> Option<Completed> {
        self.completed.take_if(|found| found.serial == serial && found.of_frame == of_frame)
    }

    /// Reads all pending events. Returns [`Error::Rig`] when the window was closed, hidden, moved or covered, or the server is gone.
    pub(crate) fn look(&mut self, connection: &RustConnection) -> Result<()> {
        self.drain(connection)?;
        if self.trouble == Some(Trouble::Hidden) {
            // A closing window is hidden first. Once the server has answered a request, both events have arrived.
            let asked = connection.get_input_focus().map_err(|why| unreported(&why))?;
            asked.reply().map_err(|why| unreported(&why))?;
            self.drain(connection)?;
        }
        let trouble = self.trouble.take().or(self.obscured.then_some(Trouble::Covered));
        let Some(trouble) = trouble else { return Ok(()) };
        let (what, help) = match trouble {
            Trouble::Closed => ("was closed", "leave it alone while photos are taken"),
            Trouble::Hidden => ("was hidden", "leave it alone while photos are taken"),
            Trouble::Moved => ("was moved or resized", "keep the window manager from placing it"),
            Trouble::Covered => (
                "is covered by another one",
                "keep other windows, notifications and screen savers off its monitor",
            ),
            Trouble::Rearranged => {
                return Err(fault(
                    "the server's monitors were changed",
                    "leave them alone while photos are taken",
                ));
            }
        };
        if trouble == Trouble::Closed {
            self.trouble = Some(trouble);
        }
        Err(fault(format!("the projector's window {what}"), help))
    }

    fn drain(&mut self, connection: &RustConnection) -> Result<()> {
        while let Some(event) = connection.poll_for_event().map_err(|why| unreported(&why))? {
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

fn unreported(why: &dyn std::fmt::Display) -> Error {
    lost("report events of the window", why)
}

#[cfg(test)]
mod tests {
    use x11rb::protocol::present::CompleteNotifyEvent;

    use super::*;

    const WINDOW: Window = 7;

    fn completion(window: Window, serial: u32, kind: CompleteKind, refresh: u64) -> Event {
        Event::PresentCompleteNotify(CompleteNotifyEvent {
            response_type: 0,
            extension: 0,
            sequence: 0,
            length: 0,
            event_type: 0,
            kind,
            mode: CompleteMode::COPY,
            event: 0,
            window,
            serial,
            ust: 0,
            msc: refresh,
        })
    }

    #[test]
    fn a_confirmation_counts_for_the_frame_with_its_serial_number_only() {
        let mut watch = Watch::new(WINDOW, [0, 0, 64, 48]);
        watch.note(&completion(WINDOW, 4, CompleteKind::PIXMAP, 100));
        assert!(watch.confirmation(5, true).is_none(), "frame 4 is on screen, but frame 5 is not");
        watch.note(&completion(WINDOW, 5, CompleteKind::NOTIFY_MSC, 101));
        assert!(watch.confirmation(5, true).is_none(), "a refresh is not a frame");
        watch.note(&completion(WINDOW + 1, 5, CompleteKind::PIXMAP, 102));
        assert!(watch.confirmation(5, true).is_none(), "a frame of another window");
        watch.note(&completion(WINDOW, 5, CompleteKind::PIXMAP, 103));
        assert!(watch.confirmation(5, false).is_none(), "a frame is not a refresh");
        let found = watch.confirmation(5, true).expect("it has come");
        assert_eq!((found.refresh, found.skipped), (103, false));
        assert!(watch.confirmation(5, true).is_none(), "it counts once");
    }
}
