//! Many small pictures in one PNG file. A page with hundreds of photos stays small, and a browser decodes one image.

use rayon::prelude::*;

use super::thumb::{SIDE, Thumb};
use crate::error::Result;
use crate::image::Resolution;
use crate::io::raster::Raster;
use crate::report::html::{Frame, Sheet, brief};

const ROW: usize = 16;

/// The maximum number of photos at full thumbnail size. With more photos, each side is halved.
const LARGE: usize = 128;

pub(super) fn sheet(shots: &[[Thumb; 2]]) -> Result<Sheet> {
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
