//! Where the camera stands, by what stands out from the common map.

use super::disparity::{Cell, Disparity};

/// A cell stands out when it is so many standard errors off.
const SIGMAS: f64 = 4.0;

/// ... and so many projector pixels: as much as calibration promises of a map. Indirect light bends codes by up to 0.07 pixels where
/// surfaces meet, also of a rig that is aligned.
const LEAST: f64 = 0.1;

/// So many cells at least stand out, and such a share of all.
const CELLS: (usize, f64) = (3, 0.01);

/// Such a share of what stands out must do so to one side, for the side to be told.
const ONE_SIDED: f64 = 0.8;

/// `tan 22.5°`: what is less aside than that is not said.
const ASIDE: f64 = 0.414;

/// Where the camera stands, as seen from the projector.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CameraOffset {
    /// The direction, of length 1: to the right and down in the photo.
    pub toward: [f64; 2],
    /// How far what stands out is displaced, in projector pixels.
    pub size: f64,
    /// Its standard error.
    pub error: f64,
    /// Whether the side is told; else the camera may as well stand on the other one.
    pub is_certain: bool,
    /// Share of the field that stands out.
    pub share: f64,
}

/// What a cell must be off by to stand out, in projector pixels.
pub(super) fn least(disparity: &Disparity) -> f64 {
    (SIGMAS * disparity.error).max(LEAST)
}

/// By the cells that stand out; none where too few do.
pub(super) fn stand(disparity: &Disparity) -> Option<CameraOffset> {
    let least = least(disparity);
    let out: Vec<&Cell> =
        disparity.cells.iter().filter(|cell| cell.off[0].hypot(cell.off[1]) > least).collect();
    let share = out.len() as f64 / disparity.cells.len().max(1) as f64;
    if out.len() < CELLS.0 || share < CELLS.1 {
        return None;
    }
    let sum = |of: &dyn Fn(&Cell) -> f64| out.iter().map(|cell| of(cell)).sum::<f64>();
    let [xx, xy, yy] = [
        sum(&|cell| cell.off[0].powi(2)),
        sum(&|cell| cell.off[0] * cell.off[1]),
        sum(&|cell| cell.off[1].powi(2)),
    ];
    // The principal axis of the second moments.
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    let axis = [angle.cos(), angle.sin()];
    let along = |cell: &Cell| cell.off[0] * axis[0] + cell.off[1] * axis[1];
    let (net, total) = (sum(&along), sum(&|cell| along(cell).abs()));
    let side = if net < 0.0 { -1.0 } else { 1.0 };
    let ahead: Vec<f64> = out.iter().map(|cell| side * along(cell)).filter(|&off| off > 0.0).collect();
    Some(CameraOffset {
        toward: axis.map(|part| side * part),
        size: middle(ahead),
        // What codes are rounded by does not average out from cell to cell.
        error: disparity.error,
        is_certain: 0.5 * (1.0 + net.abs() / total) >= ONE_SIDED,
        share,
    })
}

/// The displacement up to which half of all of it lies: cells at a thing's border are displaced by a part of what the thing is.
fn middle(mut displacements: Vec<f64>) -> f64 {
    displacements.sort_by(f64::total_cmp);
    let half = 0.5 * displacements.iter().sum::<f64>();
    let mut below = 0.0;
    let found = displacements.iter().find(|&&displacement| {
        below += displacement;
        below >= half
    });
    found.copied().unwrap_or(0.0)
}

impl CameraOffset {
    /// `to the right of the projector and above it`
    pub fn place(&self) -> String {
        let [right, down] = self.parts();
        let sideways = right.map(|is_right| if is_right { "to the right of" } else { "to the left of" });
        let upright = down.map(|is_down| if is_down { "below" } else { "above" });
        match (sideways, upright) {
            (Some(sideways), Some(upright)) => format!("{sideways} the projector and {upright} it"),
            (Some(one), None) | (None, Some(one)) => format!("{one} the projector"),
            // A direction of length 1 is aside along one axis at least.
            (None, None) => "beside the projector".into(),
        }
    }

    /// `left and down`: the way to where the projector is.
    pub fn remedy(&self) -> String {
        let [right, down] = self.parts();
        let ways = [
            right.map(|is_right| if is_right { "left" } else { "right" }),
            down.map(|is_down| if is_down { "up" } else { "down" }),
        ];
        ways.into_iter().flatten().collect::<Vec<_>>().join(" and ")
    }

    /// Whether it is to the right, and below; none where it is hardly either.
    fn parts(&self) -> [Option<bool>; 2] {
        let [x, y] = self.toward;
        [(x.abs() > ASIDE * y.abs()).then_some(x > 0.0), (y.abs() > ASIDE * x.abs()).then_some(y > 0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of which every tenth is off by this, and all by noise of 0.01.
    fn disparity(off: impl Fn(usize) -> [f64; 2]) -> Disparity {
        let cell = |number: usize| {
            let noise = 0.01 * [1.0, -1.0][number % 2];
            let off = if number.is_multiple_of(10) { off(number) } else { [0.0; 2] };
            Cell { at: [0.0; 2], off: [off[0] + noise, off[1] - noise] }
        };
        Disparity { cells: (0..400).map(cell).collect(), side: 4, median: 0.01, upper: 0.01, error: 0.01 }
    }

    #[test]
    fn what_is_displaced_to_one_side_tells_where_the_camera_stands() {
        for (off, place, remedy) in [
            ([1.0, 0.1], "to the right of the projector", "left"),
            ([-0.3, 0.0], "to the left of the projector", "right"),
            ([0.0, 2.0], "below the projector", "up"),
            ([-0.5, -0.6], "to the left of the projector and above it", "right and down"),
        ] {
            let found = stand(&disparity(|_| off)).expect("it stands out");
            assert!(found.is_certain && (found.share - 0.1).abs() < 1e-9);
            assert_eq!((found.place(), found.remedy()), (place.to_owned(), remedy.to_owned()));
            assert!((found.size - f64::hypot(off[0], off[1])).abs() < 0.02, "{found:?}");
        }
    }

    #[test]
    fn what_is_displaced_in_part_does_not_count_like_the_whole() {
        assert_eq!(middle(vec![0.25, 2.0, 0.25, 2.0, 0.25, 2.0, 0.25, 0.25]), 2.0);
        assert_eq!(middle(Vec::new()), 0.0);
    }

    #[test]
    fn noise_alone_stands_out_nowhere_and_both_sides_tell_none() {
        assert_eq!(stand(&disparity(|_| [0.0; 2])), None);
        let both = stand(&disparity(|number| [if number.is_multiple_of(20) { 1.0 } else { -1.0 }, 0.0]));
        let found = both.expect("it stands out");
        assert!(!found.is_certain && found.toward[0].abs() > 0.99, "{found:?}");
    }
}
