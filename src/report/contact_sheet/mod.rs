//! The contact sheet: every photo of a run in order, each below its pattern, as in Figs. 9 and 10 of the paper.

mod sheet;
mod thumb;

use super::html::{Block, Section, Sheet};
use crate::error::Result;
use crate::image::Resolution;
use thumb::Thumb;

/// The maximum number of photos on a page. A longer run shows its first photos.
pub const LONGEST: usize = 512;

/// A run's patterns and photos, kept as small pictures while they are taken.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    sizes: [Resolution; 2],
    channels: usize,
    counts: Vec<usize>,
    shots: Vec<[Thumb; 2]>,
}

impl ContactSheet {
    /// An empty contact sheet for `channels` (one or three) channels; `sizes` are the resolutions `[patterns, photos]`.
    pub fn new(sizes: [Resolution; 2], channels: usize) -> Self {
        Self { sizes, channels: channels.max(1), counts: vec![0; channels.max(1)], shots: Vec::new() }
    }

    /// Adds a channel's pattern and photo, each of which may be signed. The `k`-th photos of all channels form the `k`-th colour photo.
    /// `dual` says that the pattern is on the camera's side (a product with the transpose). Fails if there is not one value per pixel.
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

    /// Number of photos so far, including those beyond [`LONGEST`].
    pub fn len(&self) -> usize {
        self.counts.iter().copied().max().unwrap_or(0)
    }

    /// Whether there are no photos yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All pictures on one sheet, each with a separate exposure. Each photo's label gives the value of its brightest colour.
    ///
    /// # Errors
    /// [`crate::Error::Dimension`] when there is no photo.
    pub fn sheet(&self) -> Result<Sheet> {
        sheet::sheet(&self.shots)
    }

    /// The page section with the sheet; `None` without photos. `unit` is the photos' unit, `order` explains their order.
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

/// Explains the colours of a picture with negative values.
pub const SIGNED: &str = "What is negative is blue, what is positive red: a rig shows such a pattern by photos of patterns that are not negative.";
