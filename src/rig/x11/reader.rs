//! Reading back the server's framebuffer where a pattern was drawn.

use x11rb::connection::Connection;
use x11rb::errors::{ConnectionError, ParseError, ReplyError};
use x11rb::image::Image;
use x11rb::protocol::xproto::{ConnectionExt as _, ImageFormat, Window};
use x11rb::rust_connection::RustConnection;

use super::canvas::{Canvas, Difference, Picture};
use super::lost;
use crate::error::{Error, Result};

/// Reads the framebuffer at one position.
pub(super) struct Reader {
    /// The root window, which holds all others: a window that covers the projector's is read, too.
    pub(super) root: Window,
    /// The position of a pattern's top left pixel.
    pub(super) corner: [i16; 2],
}

impl Reader {
    /// Compares the framebuffer with the drawn picture. `None`: they are equal.
    pub(super) fn difference(
        &self,
        connection: &RustConnection,
        canvas: &Canvas,
        drawn: &Picture,
    ) -> Result<Option<Difference>> {
        let ([left, corner], width) = (self.corner, drawn.width());
        let ask = |[top, height]: [u16; 2]| -> std::result::Result<_, ConnectionError> {
            let format = ImageFormat::Z_PIXMAP;
            let asked =
                connection.get_image(format, self.root, left, corner + top as i16, width, height, !0)?;
            Ok((top, height, asked))
        };
        let mut found: Option<Difference> = None;
        let mut coming = None;
        // One band is compared while the next is on its way.
        for band in drawn.bands().map(Some).chain([None]) {
            let next = band.map(ask).transpose().map_err(|why| failed(&why))?;
            let Some((top, height, asked)) = std::mem::replace(&mut coming, next) else { continue };
            let reply = asked.reply().map_err(|why: ReplyError| failed(&why))?;
            let seen = Image::get_from_reply(connection.setup(), width, height, reply)
                .map_err(|why: ParseError| failed(&why))?;
            let Some(here) = canvas.difference(drawn, top, &seen) else { continue };
            let count = here.count + found.as_ref().map_or(0, |found| found.count);
            found = Some(Difference { count, ..found.unwrap_or(here) });
        }
        Ok(found)
    }
}

fn failed(why: &dyn std::fmt::Display) -> Error {
    lost("read its picture back", why)
}
