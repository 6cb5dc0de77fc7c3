//! Every photo of a run in the order in which they were taken, each pattern above its photo, as the paper's Figs. 9 and 10 show
//! them.

mod sheet;
mod thumb;

use super::html::{Block, Section, Sheet};
use crate::error::Result;
use crate::image::Resolution;
use thumb::Thumb;

/// A page shows so many photos at most; of longer runs the first.
pub const LONGEST: usize = 512;

/// Photos kept as small pictures, as they come.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    /// Pixels of patterns and of photos.
    sizes: [Resolution; 2],
    channels: usize,
    /// How many photos each channel has.
    counts: Vec<usize>,
    shots: Vec<[Thumb; 2]>,
}

impl ContactSheet {
    /// An empty strip of photos in so many channels, one or three; `[patterns, photos]` are their pixels.
    pub fn new(sizes: [Resolution; 2], channels: usize) -> Self {
        Self { sizes, channels: channels.max(1), counts: vec![0; channels.max(1)], shots: Vec::new() }
    }

    /// Keeps what a channel was asked, and what it answered; either may be signed. The `k`-th of each channel together make the
    /// `k`-th photo, since one colour photo is a product with each. If `dual`, the pattern is on the camera's side.
    ///
    /// # Errors
    /// [`crate::Error::Dimension`] when there are not as many values as pixels.
    pub fn push(&mut self, channel: usize, pattern: &[f64], photo: &[f64], dual: bool) -> Result<()> {
        let channel = channel.min(self.channels - 1);
        let index = self.counts[channel];
        self.counts[channel] += 1;
        if index >= LONGEST {
            return Ok(());
        }
        let [patterns, photos] = self.sizes;
        let sizes = if dual { [photos, patterns] } else { [patterns, photos] };
        if index == self.shots.len() {
            self.shots.push(sizes.map(|size| Thumb::black(size, self.channels)));
        }
        for ((thumb, values), size) in self.shots[index].iter_mut().zip([pattern, photo]).zip(sizes) {
            thumb.set(channel, size, values)?;
        }
        Ok(())
    }

    /// Photos so far, those among them that a page would leave out.
    pub fn len(&self) -> usize {
        self.counts.iter().copied().max().unwrap_or(0)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All pictures on one sheet. Each is exposed for itself; below each photo stands what its brightest colour is.
    ///
    /// # Errors
    /// [`crate::Error::Dimension`] when there is no photo.
    pub fn sheet(&self) -> Result<Sheet> {
        sheet::sheet(&self.shots)
    }

    /// The part of a page that shows it; none without a photo. `unit` is that of the photos, `order` says what came when.
    ///
    /// # Errors
    /// As [`ContactSheet::sheet`].
    pub fn section(&self, unit: &str, order: &str) -> Result<Option<Section>> {
        if self.is_empty() {
            return Ok(None);
        }
        let all = match (self.len(), self.shots.len()) {
            (1, _) => "The photo".to_owned(),
            (all, shown) if all == shown => format!("All {all} photos"),
            (all, shown) => format!("The first {shown} of {all} photos"),
        };
        let text = format!(
            "{all} in the order in which they were taken, each pattern above its photo, each exposed for itself. The number below is what white, or the \
             deepest red and blue, stands for in {unit}. {SIGNED}{}{order}",
            if order.is_empty() { "" } else { " " },
        );
        Ok(Some(Section {
            title: "Photos in order".into(),
            text,
            blocks: vec![Block::ContactSheet { caption: String::new(), sheet: self.sheet()? }],
        }))
    }
}

/// What colours mean in a picture with negative values.
pub const SIGNED: &str = "What is negative is blue, what is positive red: a rig shows such a pattern by photos of patterns that are not negative.";
