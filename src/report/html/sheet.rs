//! Many pictures in one file.

/// Pictures on one sheet, with their positions.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// Bytes of a PNG file.
    pub png: Vec<u8>,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The frames in order.
    pub frames: Vec<Frame>,
}

/// One frame: a pattern above its photo.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Left, top, width and height of each picture on the sheet, and its description.
    pub pictures: Vec<([usize; 4], String)>,
    /// Number of the photo, from 1.
    pub number: usize,
    /// The value of the photo's brightest colour.
    pub range: String,
}
