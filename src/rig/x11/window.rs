//! The window, and the pixmaps that frames are drawn on before they are shown.

use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::errors::ReplyOrIdError;
use x11rb::protocol::present::{self, ConnectionExt as _};
use x11rb::protocol::randr::{ConnectionExt as _, NotifyMask};
use x11rb::protocol::screensaver::{self, ConnectionExt as _};
use x11rb::protocol::xproto::{
    AtomEnum, ConnectionExt as _, CreateGCAux, CreateWindowAux, Cursor, EventMask, Gcontext, Pixmap,
    PropMode, Rectangle, Screen, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use super::spec::{MonitorInfo, X11Spec};

type Made<T> = Result<T, ReplyOrIdError>;

/// Makes a black window over the whole of `monitor`. It bypasses the window manager, so that it gets no border and stays where it
/// is put. It is not mapped yet.
pub(super) fn window(connection: &RustConnection, screen: &Screen, monitor: &MonitorInfo) -> Made<Window> {
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

/// Makes two black pixmaps of the monitor's size, and the graphics context that draws on them.
pub(super) fn pixmaps(
    connection: &RustConnection,
    screen: &Screen,
    monitor: &MonitorInfo,
) -> Made<(Gcontext, [Pixmap; 2])> {
    let [width, height] = sides(monitor);
    let gc = connection.generate_id()?;
    let black = CreateGCAux::new().foreground(screen.black_pixel).graphics_exposures(0);
    connection.create_gc(gc, screen.root, &black)?;
    let mut pixmaps = [0; 2];
    for pixmap in &mut pixmaps {
        *pixmap = connection.generate_id()?;
        connection.create_pixmap(screen.root_depth, *pixmap, screen.root, width, height)?;
        connection.poly_fill_rectangle(*pixmap, gc, &[Rectangle { x: 0, y: 0, width, height }])?;
    }
    Ok((gc, pixmaps))
}

/// Makes the pixmap that receives each row of a pattern once.
pub(super) fn rows(connection: &RustConnection, screen: &Screen, spec: &X11Spec) -> Made<Pixmap> {
    let pixmap = connection.generate_id()?;
    // The pattern fits the monitor, whose sides have 16 bits.
    let [width, height] = [spec.shown().width, spec.size[1]].map(|side| side as u16);
    connection.create_pixmap(screen.root_depth, pixmap, screen.root, width, height)?;
    Ok(pixmap)
}

/// The monitor's sides as the protocol's 16-bit numbers, which they were read from.
fn sides(monitor: &MonitorInfo) -> [u16; 2] {
    [monitor.resolution.width, monitor.resolution.height].map(|side| side as u16)
}

/// An invisible pointer.
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
