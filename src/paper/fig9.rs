//! Figure 9: the photos of the segmentation of the empty carton in order.

use super::bench::Bench;
use super::check::Check;
use super::fig8::{BLUR, CELLS, PHOTOS, SIDE, asked};
use super::figure::{Figure, Reproduced, Strip};
use super::stage::Set;
use crate::analysis::segment::segment;
use crate::analysis::{Blurred, adjusted_rand_index};
use crate::error::{Error, Result};
use crate::image::Blur;
use crate::operator::Recorded;
use crate::transport::Part;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Carton, bench.side(SIDE))?;
    let mut operator = bench.photos(&stage, Part::Global)?;
    // Recorded is what is really projected, and its photo before that is blurred in turn.
    let mut recorded = Recorded::new(&mut operator);
    let blur = Blur::new(stage.resolution, BLUR).ok_or(Error::Interrupted)?;
    let found = segment(&mut Blurred::new(&mut recorded, blur)?, &asked(&stage))?;
    let shots = recorded.products;
    let nine = found.labels.iter().find(|(groups, _)| *groups == CELLS).map_or(&[][..], |(_, nine)| nine);
    Ok(Reproduced {
        setting: format!("the empty carton, {}, the run of figure 8", stage.resolution),
        checks: vec![
            Check::at_least(
                format!("adjusted Rand index of the nine groups that these {PHOTOS} photos give"),
                adjusted_rand_index(nine, &stage.truth)?,
                0.95,
            ),
            Check::stated("photos taken, white included", shots.len() as f64),
        ],
        strips: vec![Strip {
            caption: "Above what is projected, below its photo without direct light; blue is negative. The first is white, and those after \
                      it begin with the smooth patterns that the process starts from."
                .into(),
            resolution: stage.resolution,
            photos: shots,
        }],
        photos: found.photos,
        ..Reproduced::of(Figure::Fig9, bench.rig())
    })
}
