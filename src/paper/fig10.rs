//! Figure 10: the photos of a compensation in order.

use super::bench::Bench;
use super::check::Check;
use super::compensated::percent;
use super::contest::{TargetLight, enter};
use super::fig11::{PHOTOS, SIDE};
use super::figure::{Figure, Reproduced, Strip};
use super::stage::Set;
use super::target::picture;
use crate::error::Result;
use crate::krylov::Method;
use crate::transport::Part;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Corner, side)?;
    let target = picture(side);
    let mut strips = Vec::new();
    let mut checks = Vec::new();
    for (name, method, caption) in [
        (
            "MINRES",
            Method::Minres,
            "MINRES: above what is projected, below its photo; blue is negative. Each is made from the photos before it.",
        ),
        (
            "the method inside the box",
            Method::KrylovBox,
            "Inside the box: candidates between 0 and 1, and residuals of both signs where a gradient is wanted.",
        ),
    ] {
        let operator = &mut bench.photos(&stage, Part::Full)?;
        let target_light = TargetLight::new(&stage, operator, &target)?;
        let entry = enter(&stage, operator, &target_light, (method, false), PHOTOS)?;
        checks.push(Check::at_most(
            format!("photos taken by {name}"),
            entry.shots.len() as f64,
            PHOTOS as f64,
        ));
        checks.push(Check::stated(
            format!("residual of the answer of {name} after them, %"),
            percent(entry.answered_at(PHOTOS)),
        ));
        strips.push(Strip { caption: caption.into(), resolution: stage.resolution, photos: entry.shots });
    }
    Ok(Reproduced {
        setting: format!("corner, {}, the run of figure 11", stage.resolution),
        checks,
        strips,
        photos: 2 * (1 + PHOTOS),
        ..Reproduced::of(Figure::Fig10, bench.rig())
    })
}
