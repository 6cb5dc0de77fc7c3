//! The conversion between levels and the pixel values of an X screen, and the comparison of the framebuffer with the drawn picture.

use x11rb::connection::Connection;
use x11rb::image::{Image, PixelLayout};
use x11rb::protocol::xproto::{Screen, Setup, VisualClass};
use x11rb::rust_connection::RustConnection;

use super::{fault, lost};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::Frame;

const BAND: usize = 1 << 16;

pub(crate) struct ScreenFormat {
    layout: PixelLayout,
    depth: u8,
    setup: Setup,
    /// The side of a pattern pixel's square, in screen pixels.
    magnify: usize,
}

impl ScreenFormat {
    /// The format of `screen`. Its root visual must show 8 bits for each of red, green and blue.
    pub(crate) fn new(connection: &RustConnection, screen: &Screen, magnify: usize) -> Result<Self> {
        let visuals = screen.allowed_depths.iter().flat_map(|depth| &depth.visuals);
        let visual = visuals.into_iter().find(|visual| visual.visual_id == screen.root_visual);
        let exact = visual
            .filter(|visual| visual.class == VisualClass::TRUE_COLOR)
            .filter(|visual| {
                [visual.red_mask, visual.green_mask, visual.blue_mask].iter().all(|m| m.count_ones() == 8)
            })
            .and_then(|visual| PixelLayout::from_visual_type(*visual).ok());
        let layout = exact.ok_or_else(|| {
            fault(
                format!(
                    "the X server's screen, of depth {}, does not show 8 bits for each colour",
                    screen.root_depth
                ),
                "set the server's depth to 24",
            )
        })?;
        Ok(Self { layout, depth: screen.root_depth, setup: connection.setup().clone(), magnify })
    }

    pub(crate) fn draw(&self, frame: &Frame) -> Result<DrawnFrame> {
        let Resolution { width, height } = frame.resolution();
        let mut rows =
            Image::allocate_native((width * self.magnify) as u16, height as u16, self.depth, &self.setup)
                .map_err(|why| lost("give the format of its pixels", &why))?;
        for at in 0..width * height {
            let pixel = self.pixel(frame, at);
            let (x, y) = (at % width * self.magnify, at / width);
            (x..x + self.magnify).for_each(|x| rows.put_pixel(x as u16, y as u16, pixel));
        }
        Ok(DrawnFrame { rows, magnify: self.magnify })
    }

    /// Compares the drawn picture with `seen`, which holds the screen's rows from `top` on. `None`: they are equal.
    pub(crate) fn difference(&self, drawn: &DrawnFrame, top: u16, seen: &Image<'_>) -> Option<Difference> {
        // In almost all cases, all bytes agree, even the unused ones.
        if drawn.is_same(top, seen) {
            return None;
        }
        let mut first = None;
        let mut count = 0;
        for y in top..top + seen.height() {
            for x in 0..drawn.width() {
                let [drawn, seen] =
                    [drawn.pixel(x, y), seen.get_pixel(x, y - top)].map(|pixel| self.levels(pixel));
                if drawn != seen {
                    count += 1;
                    first.get_or_insert((x, y, drawn, seen));
                }
            }
        }
        let (x, y, drawn, seen) = first?;
        Some(Difference { x, y, drawn, seen, count })
    }

    fn pixel(&self, frame: &Frame, at: usize) -> u32 {
        let channels = frame.channels();
        // `encode` takes colours of 16 bits, of which the visual keeps the upper 8.
        let level = |channel: usize| frame.levels()[at * channels + channel.min(channels - 1)] * 257;
        self.layout.encode((level(0), level(1), level(2)))
    }

    fn levels(&self, pixel: u32) -> [u16; 3] {
        let (red, green, blue) = self.layout.decode(pixel);
        [red, green, blue].map(|value| value >> 8)
    }
}

/// A frame in the server's pixel format. It holds each row of the pattern once, in the width on screen. The server repeats the rows, so
/// that less data is sent.
pub(crate) struct DrawnFrame {
    pub(crate) rows: Image<'static>,
    pub(crate) magnify: usize,
}

impl DrawnFrame {
    pub(crate) fn width(&self) -> u16 {
        self.rows.width()
    }

    pub(crate) fn height(&self) -> u16 {
        // The picture fits the monitor, so its height fits in 16 bits.
        (usize::from(self.rows.height()) * self.magnify) as u16
    }

    pub(crate) fn row(&self, y: u16) -> u16 {
        (usize::from(y) / self.magnify) as u16
    }

    fn pixel(&self, x: u16, y: u16) -> u32 {
        self.rows.get_pixel(x, self.row(y))
    }

    /// The first row and the height of each band that one request reads back. A small band needs no fresh memory from the system, which
    /// would take longer than reading the band.
    pub(crate) fn bands(&self) -> impl Iterator<Item = [u16; 2]> + use<> {
        let (height, rows) = (self.height(), (BAND / self.stride()).max(1));
        // The result is not greater than the height, which has 16 bits.
        let rows = rows.min(height.into()) as u16;
        (0..height).step_by(rows.into()).map(move |top| [top, rows.min(height - top)])
    }

    fn is_same(&self, top: u16, seen: &Image<'_>) -> bool {
        let stride = self.stride();
        let drawn = |y: u16| &self.rows.data()[usize::from(self.row(y)) * stride..][..stride];
        (top..top + seen.height()).map(drawn).eq(seen.data().chunks(stride))
    }

    fn stride(&self) -> usize {
        self.rows.data().len() / usize::from(self.rows.height())
    }
}

pub(crate) struct Difference {
    pub(crate) x: u16,
    pub(crate) y: u16,
    pub(crate) drawn: [u16; 3],
    pub(crate) seen: [u16; 3],
    pub(crate) count: usize,
}
