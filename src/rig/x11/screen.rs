//! The window on its monitor, and the pixmaps on which frames are drawn. Each frame is presented, confirmed and read back.

use std::time::Instant;

use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::errors::{ConnectionError, ReplyError, ReplyOrIdError};
use x11rb::image::Image;
use x11rb::protocol::present::ConnectionExt as _;
use x11rb::protocol::randr::{ConnectionExt as _, NotifyMask};
use x11rb::protocol::screensaver::ConnectionExt as _;
use x11rb::protocol::xproto::{
    AtomEnum, ConnectionExt as _, CreateGCAux, CreateWindowAux, Cursor, EventMask, Gcontext, ImageFormat,
    Pixmap, PropMode, Rectangle, Screen as XScreen, Window, WindowClass,
};
use x11rb::protocol::{present, screensaver};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use super::canvas::{Difference, DrawnFrame, ScreenFormat};
use super::projector::ShowTimes;
use super::watch::Watch;
use super::{MonitorInfo, X11Spec, fault, lost, monitor};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::Frame;

/// The number of refreshes that a compositor may take to bring a confirmed frame to the screen.
const LAG: u32 = 6;

pub(crate) struct Screen {
    connection: RustConnection,
    window: Window,
    gc: Gcontext,
    /// The two pixmaps are shown alternately, so that the server never shows the pixmap that is being drawn.
    pixmaps: [Pixmap; 2],
    /// The pixmap that receives each row of a pattern once. The server copies the rows from this pixmap.
    rows: Pixmap,
    turn: usize,
    serial: u32,
    canvas: ScreenFormat,
    /// The root window contains all other windows, so a window that covers the projector's window is read back too.
    root: Window,
    watch: Watch,
    monitor: MonitorInfo,
    offset: [i16; 2],
    spec: X11Spec,
    shown: Option<DrawnFrame>,
}

impl Screen {
    /// Opens the window, verifies with a test frame that it shows the requested levels, and makes it black.
    pub(crate) fn open(spec: &X11Spec) -> Result<Self> {
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
        let canvas = ScreenFormat::new(&connection, &screen, spec.magnify)?;
        let window = window(&connection, &screen, &monitor).map_err(opening)?;
        let (gc, pixmaps) = pixmaps(&connection, &screen, &monitor).map_err(opening)?;
        let shown = spec.shown();
        // The pattern fits the monitor, so its sides fit in 16 bits.
        let rows = [shown.width, spec.size[1]].map(|side| side as u16);
        let rows = pixmap(&connection, &screen, rows).map_err(opening)?;
        let (size, [x, y]) = (monitor.resolution, monitor.place.map(i32::from));
        let mut watch = Watch::new(window, [x, y, size.width as i32, size.height as i32]);
        connection.map_window(window).map_err(opening)?.check().map_err(opening)?;
        watch.until_mapped(&connection)?;
        let middle = |of: usize, shown: usize| ((of - shown) / 2) as i16;
        let offset = [middle(size.width, shown.width), middle(size.height, shown.height)];
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
            root,
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

    /// Shows a frame, which must fit the monitor. On return, the frame has been confirmed and read back, and `settle_frames` refreshes have
    /// passed.
    pub(crate) fn show(&mut self, frame: &Frame) -> Result<ShowTimes> {
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
        // The frame is read back while the refreshes pass. If another window covers the projector's window before, the server sends an
        // event. If a window covers it later, `confirm` notices this after the photo.
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

    fn put(&self, picture: &DrawnFrame, pixmap: Pixmap) -> std::result::Result<(), ConnectionError> {
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

    pub(crate) fn confirm(&mut self) -> Result<()> {
        self.watch.look(&self.connection)?;
        let Some(picture) = self.shown.take() else { return Ok(()) };
        self.read_back(&picture)?;
        self.shown = Some(picture);
        // The server sends events and answers in order. Therefore all events from before the answer have arrived.
        self.watch.look(&self.connection)
    }

    /// Asks the server for an event when the monitor reaches this refresh.
    fn await_refresh(&mut self, refresh: u64) -> Result<()> {
        self.serial += 1;
        self.connection.present_notify_msc(self.window, self.serial, refresh, 0, 0).map_err(presenting)?;
        self.connection.flush().map_err(presenting)
    }

    fn refreshed(&mut self) -> Result<u64> {
        Ok(self.watch.completed(&self.connection, self.serial, false)?.refresh)
    }

    /// Checks pixel by pixel that the framebuffer holds the drawn picture, and allows some refreshes for the picture to appear.
    fn read_back(&mut self, drawn: &DrawnFrame) -> Result<()> {
        let mut found = self.difference(drawn)?;
        let mut refresh = 0;
        for _ in 0..LAG {
            if found.is_none() {
                return Ok(());
            }
            // The server answers a request for a past refresh at the next refresh.
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

    fn difference(&self, drawn: &DrawnFrame) -> Result<Option<Difference>> {
        self.compared(drawn).map_err(|why| lost("let its screen be read back", &why))
    }

    fn compared(&self, drawn: &DrawnFrame) -> std::result::Result<Option<Difference>, ReplyError> {
        let [left, corner] = [0, 1].map(|axis| self.monitor.place[axis] + self.offset[axis]);
        let (width, connection) = (drawn.width(), &self.connection);
        let ask = |[top, height]: [u16; 2]| -> std::result::Result<_, ConnectionError> {
            let format = ImageFormat::Z_PIXMAP;
            let asked =
                connection.get_image(format, self.root, left, corner + top as i16, width, height, !0)?;
            Ok((top, height, asked))
        };
        let mut found: Option<Difference> = None;
        let mut coming = None;
        // One band is compared while the next band is in transit.
        for band in drawn.bands().map(Some).chain([None]) {
            let next = band.map(ask).transpose()?;
            let Some((top, height, asked)) = std::mem::replace(&mut coming, next) else { continue };
            let seen = Image::get_from_reply(connection.setup(), width, height, asked.reply()?)?;
            let Some(here) = self.canvas.difference(drawn, top, &seen) else { continue };
            let count = here.count + found.as_ref().map_or(0, |found| found.count);
            found = Some(Difference { count, ..found.unwrap_or(here) });
        }
        Ok(found)
    }
}

fn opening(why: impl Into<ReplyOrIdError>) -> crate::Error {
    lost("open the projector's window", &why.into())
}

fn presenting(why: ConnectionError) -> crate::Error {
    lost("show a frame", &why)
}

/// A frame whose neighbouring pixels differ in every channel. Scaling would mix the levels, and colour management would change them.
fn test_frame(resolution: Resolution, channels: usize) -> Result<Frame> {
    let level = |sample: usize| {
        let (pixel, channel) = (sample / channels, sample % channels);
        let (x, y) = (pixel % resolution.width, pixel / resolution.width);
        ((37 * x + 101 * y + 85 * channel) % 256) as u16
    };
    Frame::new(resolution, channels, (0..resolution.pixels() * channels).map(level).collect())
}

type Made<T> = std::result::Result<T, ReplyOrIdError>;

/// Makes a black window that covers all of `monitor` and is not mapped yet. The window bypasses the window manager, so that it has no
/// border and stays in its place.
fn window(connection: &RustConnection, screen: &XScreen, monitor: &MonitorInfo) -> Made<Window> {
    let (root, [x, y], [width, height]) = (screen.root, monitor.place, sides(monitor));
    let window = connection.generate_id()?;
    let look = CreateWindowAux::new()
        .override_redirect(1)
        .background_pixel(screen.black_pixel)
        .cursor(blank_cursor(connection, root)?)
        .event_mask(EventMask::STRUCTURE_NOTIFY | EventMask::VISIBILITY_CHANGE);
    let class = WindowClass::INPUT_OUTPUT;
    connection.create_window(screen.root_depth, window, root, x, y, width, height, 0, class, 0, &look)?;
    connection.change_property8(
        PropMode::REPLACE,
        window,
        AtomEnum::WM_NAME,
        AtomEnum::STRING,
        b"krylux projector",
    )?;
    let id = connection.generate_id()?;
    connection.present_select_input(id, window, present::EventMask::COMPLETE_NOTIFY)?;
    connection.randr_select_input(root, NotifyMask::SCREEN_CHANGE | NotifyMask::CRTC_CHANGE)?;
    if connection.extension_information(screensaver::X11_EXTENSION_NAME)?.is_some() {
        // The server resumes the screen saver when this connection ends.
        connection.screensaver_query_version(1, 1)?.reply()?;
        connection.screensaver_suspend(1)?;
    }
    Ok(window)
}

fn pixmap(connection: &RustConnection, screen: &XScreen, [width, height]: [u16; 2]) -> Made<Pixmap> {
    let pixmap = connection.generate_id()?;
    connection.create_pixmap(screen.root_depth, pixmap, screen.root, width, height)?;
    Ok(pixmap)
}

/// Makes two black pixmaps of the size of `monitor`, and the context to draw on them.
fn pixmaps(
    connection: &RustConnection,
    screen: &XScreen,
    monitor: &MonitorInfo,
) -> Made<(Gcontext, [Pixmap; 2])> {
    let [width, height] = sides(monitor);
    let gc = connection.generate_id()?;
    let black = CreateGCAux::new().foreground(screen.black_pixel).graphics_exposures(0);
    connection.create_gc(gc, screen.root, &black)?;
    let new = || pixmap(connection, screen, [width, height]);
    let pixmaps = [new()?, new()?];
    for pixmap in pixmaps {
        connection.poly_fill_rectangle(pixmap, gc, &[Rectangle { x: 0, y: 0, width, height }])?;
    }
    Ok((gc, pixmaps))
}

/// The monitor's sides as 16-bit numbers, the type from which they were read.
fn sides(monitor: &MonitorInfo) -> [u16; 2] {
    [monitor.resolution.width, monitor.resolution.height].map(|side| side as u16)
}

fn blank_cursor(connection: &RustConnection, root: Window) -> Made<Cursor> {
    let [pixmap, cursor, gc] =
        [connection.generate_id()?, connection.generate_id()?, connection.generate_id()?];
    connection.create_pixmap(1, pixmap, root, 1, 1)?;
    connection.create_gc(gc, pixmap, &CreateGCAux::new().foreground(0))?;
    connection.poly_fill_rectangle(pixmap, gc, &[Rectangle { x: 0, y: 0, width: 1, height: 1 }])?;
    connection.create_cursor(cursor, pixmap, pixmap, 0, 0, 0, 0, 0, 0, 0, 0)?;
    connection.free_gc(gc)?;
    connection.free_pixmap(pixmap)?;
    Ok(cursor)
}
