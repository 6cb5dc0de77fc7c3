//! Figure 10: the photos of the compensation out of focus in order.

use super::bench::Bench;
use super::check::Check;
use super::compensated::percent;
use super::contest::{Entry, TargetLight, enter};
use super::fig12::{PHOTOS, SIDE};
use super::figure::{Figure, Reproduced, Strip};
use super::stage::Set;
use super::target::picture;
use crate::error::Result;
use crate::krylov::Method;
use crate::transport::Part;

/// The photos of the paper's shorter run, which are to suffice.
const FEWER: usize = 8;
/// As good as all photos: a residual that is at most this share above theirs.
const NEARLY: f64 = 0.05;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Defocused, side)?;
    let target = picture(side);
    let mut strips = Vec::new();
    let mut checks = Vec::new();
    for (name, method, caption) in [
        (
            "the method inside the box",
            Method::KrylovBox,
            "Inside the box: candidates between 0 and 1, and residuals of both signs where a gradient is wanted.",
        ),
        (
            "GMRES",
            Method::Gmres,
            "GMRES: above what is projected, below its photo; blue is negative. Each is made from the photos before it.",
        ),
    ] {
        let operator = &mut bench.photos(&stage, Part::Full)?;
        let target_light = TargetLight::new(&stage, operator, &target)?;
        let entry = enter(&stage, operator, &target_light, (method, false), PHOTOS)?;
        if method == Method::KrylovBox {
            checks.push(Check::at_most(
                format!("photos until {name} displays what is within 5 % of the residual after {PHOTOS}"),
                enough(&entry) as f64,
                FEWER as f64,
            ));
        }
        checks.push(Check::stated(
            format!("residual displayed by {name} after {PHOTOS} photos, %"),
            percent(entry.displayed_at(PHOTOS)),
        ));
        strips.push(Strip { caption: caption.into(), resolution: stage.resolution, photos: entry.shots });
    }
    Ok(Reproduced {
        setting: format!("corner out of focus, {}, the runs of figure 12", stage.resolution),
        checks,
        strips,
        photos: 2 * (1 + PHOTOS),
        ..Reproduced::of(Figure::Fig10, bench.rig())
    })
}

/// The number of photos from which on the displayed residual is nearly that of all.
fn enough(entry: &Entry) -> usize {
    let wanted = (1.0 + NEARLY) * entry.displayed_at(PHOTOS);
    let worse =
        |&photos: &usize| entry.displayed_at(photos).partial_cmp(&wanted).is_none_or(|order| order.is_gt());
    (1..=PHOTOS).rev().find(worse).map_or(1, |last| last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_are_enough_after_the_last_that_were_not() {
        let of = |residuals: Vec<f64>| enough(&Entry { displayed: residuals, ..Entry::default() });
        assert_eq!(of(vec![0.5, 0.1, 0.3, 0.104, 0.1]), 4);
        assert_eq!(of(vec![0.1; 12]), 1);
        assert_eq!(of(vec![0.2, f64::NAN, 0.1]), 3);
    }
}
