//! The contact sheet: every photo of a run in order, each below its pattern. Figures 9 and 10 of the paper show the first five in this way.

use rayon::prelude::*;

use super::colormap::{paint_signed, robust_range};
use super::figure::mean;
use super::html::{Block, Frame, Section, Sheet, brief};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::raster::{Raster, develop, exposure};

/// The maximum number of photos on a page. A page with a longer run shows only the first photos.
pub const LONGEST: usize = 512;

/// The patterns and photos of a run, reduced to small pictures as they are taken.
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

    /// Adds a channel's pattern and photo. Both may have negative values. The `k`-th photos of all channels form the `k`-th colour photo.
    /// `dual` marks a pattern on the camera's side (a product with the transpose). Fails unless there is one value per pixel.
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

    /// All pictures on one sheet, each with a separate exposure. The label of each photo gives the value of its brightest colour.
    ///
    /// # Errors
    /// [`crate::Error::Dimension`] when there is no photo.
    pub fn sheet(&self) -> Result<Sheet> {
        sheet(&self.shots)
    }

    /// The page section with the sheet. `None` without photos. `unit` is the unit of the photos, and `order` explains their order.
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

const ROW: usize = 16;

/// The maximum number of photos at full thumbnail size. If there are more photos, each side of a thumbnail is halved.
const LARGE: usize = 128;

/// All pictures on one sheet. A browser then decodes one image instead of hundreds.
fn sheet(shots: &[[Thumb; 2]]) -> Result<Sheet> {
    let side = if shots.len() > LARGE { SIDE / 2 } else { SIDE };
    let paint = |shot: &[Thumb; 2]| {
        let [(pattern, _), (photo, range)] = [shot[0].within(side).paint()?, shot[1].within(side).paint()?];
        Ok(([pattern, photo], range))
    };
    let painted = shots.par_iter().map(paint).collect::<Result<Vec<_>>>()?;
    let largest = |of: &dyn Fn(Resolution) -> usize, which: usize| {
        painted.iter().map(|(pair, _)| of(pair[which].resolution())).max().unwrap_or(0)
    };
    let width = largest(&|size| size.width, 0).max(largest(&|size| size.width, 1));
    let heights = [0, 1].map(|which| largest(&|size| size.height, which));
    let mut frames = Vec::with_capacity(painted.len());
    for (index, (pair, range)) in painted.iter().enumerate() {
        let (left, top) = (index % ROW * width, index / ROW * (heights[0] + heights[1]));
        let place = |which: usize| {
            let size = pair[which].resolution();
            [left, top + which * heights[0], size.width, size.height]
        };
        let number = index + 1;
        let pictures = vec![(place(0), format!("pattern {number}")), (place(1), format!("photo {number}"))];
        frames.push(Frame { pictures, number, range: brief(*range) });
    }
    let size = Resolution::new(
        width * painted.len().min(ROW),
        (heights[0] + heights[1]) * painted.len().div_ceil(ROW),
    );
    let mut raster = Raster::black(size);
    for ((pair, _), frame) in painted.iter().zip(&frames) {
        for (picture, ([left, top, ..], _)) in pair.iter().zip(&frame.pictures) {
            raster.paste(picture, *left, *top);
        }
    }
    Ok(Sheet { png: raster.encode_png()?, width: size.width, height: size.height, frames })
}

/// Maximum side of a thumbnail, in pixels.
const SIDE: usize = 64;

/// A thumbnail: one plane of values per channel, reduced by averaging square blocks of pixels.
#[derive(Clone, Debug)]
struct Thumb {
    size: Resolution,
    planes: Vec<Vec<f64>>,
}

impl Thumb {
    /// A black thumbnail. Channels that are not set later stay black.
    fn black(size: Resolution, channels: usize) -> Self {
        let size = reduced(size, factor(size, SIDE));
        Self { size, planes: vec![vec![0.0; size.pixels()]; channels] }
    }

    fn set(&mut self, channel: usize, size: Resolution, values: &[f64]) -> Result<()> {
        Error::check_size("pixels of a photo", size.pixels(), values.len())?;
        self.planes[channel] = averaged(size, factor(size, SIDE), values);
        Ok(())
    }

    /// The thumbnail reduced to at most `side` pixels per side.
    fn within(&self, side: usize) -> Self {
        let factor = factor(self.size, side);
        Self {
            size: reduced(self.size, factor),
            planes: self.planes.iter().map(|plane| averaged(self.size, factor, plane)).collect(),
        }
    }

    /// The picture, and the value of its brightest colour. Light is developed. If any value is negative, the signed colour map is used.
    fn paint(&self) -> Result<(Raster, f64)> {
        if self.planes.iter().flatten().any(|&value| value < 0.0) {
            let values = mean(&self.planes);
            let range = robust_range(&values, None);
            return Ok((paint_signed(self.size, &values, None, range)?, range));
        }
        let image = Image::from_planes(self.size, &self.planes)?;
        let scale = exposure(&image);
        Ok((develop(&image, scale), 1.0 / f64::from(scale)))
    }
}

/// Number of source pixels per side of one thumbnail pixel.
fn factor(size: Resolution, side: usize) -> usize {
    size.width.max(size.height).div_ceil(side).max(1)
}

fn reduced(size: Resolution, factor: usize) -> Resolution {
    Resolution::new(size.width.div_ceil(factor), size.height.div_ceil(factor))
}

/// Means of blocks of `factor × factor` pixels. Blocks at the right and lower edge may be smaller.
fn averaged(size: Resolution, factor: usize, values: &[f64]) -> Vec<f64> {
    if factor == 1 {
        return values.to_vec();
    }
    let small = reduced(size, factor);
    let mut means = vec![0.0; small.pixels()];
    for (y, row) in values.chunks(size.width.max(1)).enumerate() {
        let means = &mut means[y / factor * small.width..][..small.width];
        for (sum, values) in means.iter_mut().zip(row.chunks(factor)) {
            values.iter().for_each(|value| *sum += value);
        }
    }
    let there = |at: usize, side: usize| factor.min(side - at * factor);
    for (y, row) in means.chunks_mut(small.width.max(1)).enumerate() {
        for (x, sum) in row.iter_mut().enumerate() {
            *sum /= (there(x, size.width) * there(y, size.height)) as f64;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_averaged_and_what_hangs_over_counts_as_far_as_it_is_there() {
        let size = Resolution::new(3, 2);
        assert_eq!(averaged(size, 2, &[1.0, 3.0, 5.0, 2.0, 6.0, 7.0]), [3.0, 6.0]);
        assert_eq!(
            [(64, 64), (128, 96), (65, 10)].map(|(w, h)| factor(Resolution::new(w, h), SIDE)),
            [1, 2, 2]
        );
    }

    #[test]
    fn light_is_gray_and_signed_values_are_coloured() {
        let size = Resolution::new(2, 1);
        let mut thumb = Thumb::black(size, 1);
        thumb.set(0, size, &[0.25, 0.5]).expect("as many values as pixels");
        let (light, white) = thumb.paint().expect("finite");
        assert_eq!((light.pixel(1, 0), white), ([255; 3], 0.5));
        thumb.set(0, size, &[-0.5, 0.5]).expect("as many values as pixels");
        let (signed, range) = thumb.paint().expect("finite");
        assert_eq!(range, 0.5);
        assert!(signed.pixel(0, 0)[2] > signed.pixel(0, 0)[0], "negative is blue");
        assert!(signed.pixel(1, 0)[0] > signed.pixel(1, 0)[2], "positive is red");
        assert!(thumb.set(0, size, &[1.0]).is_err());
    }
}
