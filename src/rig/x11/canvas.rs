//! Levels as pixels of a screen, and back.

use x11rb::connection::Connection;
use x11rb::errors::ParseError;
use x11rb::image::{Image, PixelLayout};
use x11rb::protocol::xproto::{Screen, Setup, VisualClass};
use x11rb::rust_connection::RustConnection;

use super::{fault, lost};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::Frame;

/// How pixels of one screen are made of levels.
pub(super) struct Canvas {
    layout: PixelLayout,
    depth: u8,
    setup: Setup,
    /// A pattern's pixel is a square of so many pixels on a side.
    magnify: usize,
}

impl Canvas {
    /// Of a screen whose own visual shows 8 bits for each of red, green and blue.
    pub(super) fn new(connection: &RustConnection, screen: &Screen, magnify: usize) -> Result<Self> {
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

    /// The picture of a frame, magnified.
    pub(super) fn draw(&self, frame: &Frame) -> Result<Image<'static>> {
        let Resolution { width, height } = frame.resolution();
        let [wide, high] = [width * self.magnify, height * self.magnify].map(|side| side as u16);
        let unknown = |why: ParseError| lost("take a picture of its own depth", &why);
        let mut row = Image::allocate_native(wide, 1, self.depth, &self.setup).map_err(unknown)?;
        // A monitor has millions of pixels, a pattern thousands: a row is drawn once, and copied.
        let mut data = Vec::with_capacity(row.data().len() * usize::from(high));
        for y in 0..height {
            for x in 0..width {
                let pixel = self.pixel(frame, y * width + x);
                let square = x * self.magnify..(x + 1) * self.magnify;
                square.for_each(|x| row.put_pixel(x as u16, 0, pixel));
            }
            (0..self.magnify).for_each(|_| data.extend_from_slice(row.data()));
        }
        let (pad, bits, order) = (row.scanline_pad(), row.bits_per_pixel(), row.byte_order());
        Image::new(wide, high, pad, self.depth, bits, order, data.into()).map_err(unknown)
    }

    /// The first pixel of `seen` that is not as in `drawn`: column, row, and levels there, drawn and seen.
    pub(super) fn difference(&self, drawn: &Image<'_>, seen: &Image<'_>) -> Option<Difference> {
        // Nearly always all is well, bits of no meaning included.
        if drawn.data() == seen.data() {
            return None;
        }
        let mut first = None;
        let mut count = 0;
        for y in 0..drawn.height() {
            for x in 0..drawn.width() {
                let [drawn, seen] = [drawn, seen].map(|image| self.levels(image.get_pixel(x, y)));
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
        // Colours are handed over as 16 bits, of which the visual takes the upper 8.
        let level = |channel: usize| frame.levels()[at * channels + channel.min(channels - 1)] * 257;
        self.layout.encode((level(0), level(1), level(2)))
    }

    fn levels(&self, pixel: u32) -> [u16; 3] {
        let (red, green, blue) = self.layout.decode(pixel);
        [red, green, blue].map(|value| value >> 8)
    }
}

/// Where a picture is not as it was drawn.
pub(super) struct Difference {
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) drawn: [u16; 3],
    pub(super) seen: [u16; 3],
    /// Pixels that differ.
    pub(super) count: usize,
}
