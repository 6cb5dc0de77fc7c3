//! The window on its monitor. Each frame is presented, confirmed and read back.

use std::time::Instant;

use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::errors::{ConnectionError, ReplyOrIdError};
use x11rb::protocol::present::{self, ConnectionExt as _};
use x11rb::protocol::xproto::{ConnectionExt as _, Gcontext, Pixmap, Window};
use x11rb::rust_connection::RustConnection;

use super::canvas::{Canvas, Difference, Picture};
use super::monitor;
use super::reader::Reader;
use super::spec::{MonitorInfo, X11Spec};
use super::watch::Watch;
use super::window;
use super::wire::ShowTimes;
use super::{fault, lost};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::Frame;

/// Refreshes that a compositor may take to bring a confirmed frame to the screen.
const LAG: u32 = 6;

/// The open window of a projector.
pub(super) struct Screen {
    connection: RustConnection,
    window: Window,
    gc: Gcontext,
    /// The two pixmaps are shown alternately, so that the one on screen is never drawn on.
    pixmaps: [Pixmap; 2],
    /// The pixmap that receives each row of a pattern once; the server copies rows from it.
    rows: Pixmap,
    turn: usize,
    serial: u32,
    canvas: Canvas,
    reader: Reader,
    watch: Watch,
    monitor: MonitorInfo,
    /// The position of patterns on the monitor.
    offset: [i16; 2],
    spec: X11Spec,
    /// The picture on screen. `None`: not known.
    shown: Option<Picture>,
}

impl Screen {
    /// Opens the window, verifies with a test frame that it shows what it is told, and makes it black.
    pub(super) fn open(spec: &X11Spec) -> Result<Self> {
        let (connection, number) = monitor::connect(spec.display.as_deref())?;
        let screen = connection.setup().roots[number].clone();
        let root = screen.root;
        for (extension, name) in [(present::X11_EXTENSION_NAME, "Present"), ("RANDR", "RandR")] {
            let known = connection.extension_information(extension).map_err(opening)?;
            if known.is_none() {
                return Err(fault(
                    format!("the X server has no {name} extension, which is needed to confirm frames"),
                    "use the system's own X server (Xorg), not a remote or nested one",
                ));
            }
        }
        connection.present_query_version(1, 0).map_err(opening)?.reply().map_err(opening)?;
        let monitor = monitor::choose(monitor::listed(&connection, root)?, spec)?;
        monitor::check_passes(&connection, &monitor)?;
        let canvas = Canvas::new(&connection, &screen, spec.magnify)?;
        let window = window::window(&connection, &screen, &monitor).map_err(opening)?;
        let (gc, pixmaps) = window::pixmaps(&connection, &screen, &monitor).map_err(opening)?;
        let rows = window::rows(&connection, &screen, spec).map_err(opening)?;
        let (size, [x, y]) = (monitor.resolution, monitor.place.map(i32::from));
        let mut watch = Watch::new(window, [x, y, size.width as i32, size.height as i32]);
        connection.map_window(window).map_err(opening)?.check().map_err(opening)?;
        watch.until_mapped(&connection)?;
        let shown = spec.shown();
        let middle = |of: usize, shown: usize| ((of - shown) / 2) as i16;
        let offset = [middle(size.width, shown.width), middle(size.height, shown.height)];
        let reader = Reader { root, corner: [0, 1].map(|axis| monitor.place[axis] + offset[axis]) };
        let spec = spec.clone();
        let mut screen = Self {
            connection,
            window,
            gc,
            pixmaps,
            rows,
            turn: 0,
            serial: 0,
            canvas,
            reader,
            watch,
            monitor,
            offset,
            spec,
            shown: None,
        };
        let info = screen.spec.info();
        screen.show(&test_frame(info.resolution, info.channels)?)?;
        screen.show(&Frame::filled(info.resolution, info.channels, 0))?;
        Ok(screen)
    }

    pub(super) fn monitor(&self) -> &MonitorInfo {
        &self.monitor
    }

    /// Shows a frame that fits. On return the server has confirmed it, the settle refreshes are over, and it was read back.
    pub(super) fn show(&mut self, frame: &Frame) -> Result<ShowTimes> {
        let began = Instant::now();
        self.watch.look(&self.connection)?;
        let picture = self.canvas.draw(frame)?;
        self.turn = 1 - self.turn;
        let pixmap = self.pixmaps[self.turn];
        self.put(&picture, pixmap).map_err(|why| lost("take a frame", &why))?;
        let drawn = began.elapsed();
        self.shown = None;
        self.serial += 1;
        let none = x11rb::NONE;
        self.connection
            .present_pixmap(
                self.window,
                pixmap,
                self.serial,
                none,
                none,
                0,
                0,
                none,
                none,
                none,
                0,
                0,
                0,
                0,
                &[],
            )
            .map_err(presenting)?;
        self.connection.flush().map_err(presenting)?;
        let confirmed = self.watch.completed(&self.connection, self.serial, true)?;
        if confirmed.skipped {
            return Err(fault(
                "the X server skipped a frame in favour of a later one",
                "let no other program draw on the projector's window",
            ));
        }
        let presented = began.elapsed();
        let settles = self.spec.settle_frames > 0;
        if settles {
            self.await_refresh(confirmed.refresh + self.spec.settle_frames)?;
        }
        // Reading back happens while the refreshes pass. A window that covers this one earlier causes an event; one that covers it
        // later is found by `confirm`, after the photo.
        let is_there = self.difference(&picture)?.is_none();
        let verified = began.elapsed();
        if settles {
            self.refreshed()?;
        }
        let settled = began.elapsed();
        if !is_there {
            self.read_back(&picture)?;
        }
        self.shown = Some(picture);
        let verified_late = began.elapsed() - settled;
        Ok(ShowTimes {
            draw: drawn.as_secs_f64(),
            present: (presented - drawn).as_secs_f64(),
            settle: (settled - verified).as_secs_f64(),
            verify: (verified - presented + verified_late).as_secs_f64(),
        })
    }

    fn put(&self, picture: &Picture, pixmap: Pixmap) -> std::result::Result<(), ConnectionError> {
        let ([left, top], wide) = (self.offset, picture.width());
        if picture.magnify == 1 {
            picture.rows.put(&self.connection, pixmap, self.gc, left, top)?;
            return Ok(());
        }
        picture.rows.put(&self.connection, self.rows, self.gc, 0, 0)?;
        for y in 0..picture.height() {
            let (from, to) = (picture.row(y) as i16, top + y as i16);
            self.connection.copy_area(self.rows, pixmap, self.gc, 0, from, left, to, wide, 1)?;
        }
        Ok(())
    }

    /// Confirms that the last frame is still on screen, and that nothing covered it since.
    pub(super) fn confirm(&mut self) -> Result<()> {
        self.watch.look(&self.connection)?;
        let Some(picture) = self.shown.take() else { return Ok(()) };
        self.read_back(&picture)?;
        self.shown = Some(picture);
        // The server sends events in order: those from before its answer have arrived by now.
        self.watch.look(&self.connection)
    }

    /// Asks the server for an event when the monitor reaches this refresh.
    fn await_refresh(&mut self, refresh: u64) -> Result<()> {
        self.serial += 1;
        self.connection.present_notify_msc(self.window, self.serial, refresh, 0, 0).map_err(presenting)?;
        self.connection.flush().map_err(presenting)
    }

    /// Waits for that event; returns the number of the refresh.
    fn refreshed(&mut self) -> Result<u64> {
        Ok(self.watch.completed(&self.connection, self.serial, false)?.refresh)
    }

    /// Checks pixel by pixel that the framebuffer holds what was drawn, with some refreshes of patience.
    fn read_back(&mut self, drawn: &Picture) -> Result<()> {
        let mut found = self.difference(drawn)?;
        let mut refresh = 0;
        for _ in 0..LAG {
            if found.is_none() {
                return Ok(());
            }
            // A refresh that is past already means the next one.
            self.await_refresh(refresh + 1)?;
            refresh = self.refreshed()?;
            found = self.difference(drawn)?;
        }
        let Some(found) = found else { return Ok(()) };
        self.watch.look(&self.connection)?;
        Err(fault(
            format!(
                "what is on monitor {} is not what was drawn, at {} pixels: pixel ({}, {}) has levels {:?}, not {:?}",
                self.monitor.name, found.count, found.x, found.y, found.seen, found.drawn,
            ),
            "keep other windows off the projector's monitor, and switch off scaling, colour management and the compositor",
        ))
    }

    fn difference(&self, drawn: &Picture) -> Result<Option<Difference>> {
        self.reader.difference(&self.connection, &self.canvas, drawn)
    }
}

fn opening(why: impl Into<ReplyOrIdError>) -> crate::Error {
    lost("open the projector's window", &why.into())
}

fn presenting(why: ConnectionError) -> crate::Error {
    lost("show a frame", &why)
}

/// A frame whose neighbouring pixels have different levels in every channel: scaling would mix them, and colour management would
/// change them.
fn test_frame(resolution: Resolution, channels: usize) -> Result<Frame> {
    let level = |sample: usize| {
        let (pixel, channel) = (sample / channels, sample % channels);
        let (x, y) = (pixel % resolution.width, pixel / resolution.width);
        ((37 * x + 101 * y + 85 * channel) % 256) as u16
    };
    Frame::new(resolution, channels, (0..resolution.pixels() * channels).map(level).collect())
}
