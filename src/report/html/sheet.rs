//! Many pictures in one file.

/// Pictures on one sheet, and where each of them lies.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// A PNG file's bytes.
    pub png: Vec<u8>,
    /// Its pixels.
    pub width: usize,
    /// Its pixels.
    pub height: usize,
    /// In order.
    pub frames: Vec<Frame>,
}

/// A pattern above its photo.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Left, top, width and height on the sheet, and what it shows, in words.
    pub pictures: Vec<([usize; 4], String)>,
    /// The photo's number, from 1.
    pub number: usize,
    /// What its brightest colour stands for.
    pub range: String,
}
