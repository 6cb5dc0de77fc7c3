//! The camera offset, estimated from the cells that are displaced from the common map.

use super::disparity::{Cell, Disparity};

/// A cell counts as displaced beyond this many standard errors, …
const SIGMAS: f64 = 4.0;

/// … and beyond this many projector pixels, the accuracy that calibration promises for a map. Indirect light shifts codes by up
/// to 0.07 pixels where surfaces meet, even in an aligned rig.
const LEAST: f64 = 0.1;

/// The least number of displaced cells, and their least share of all cells.
const CELLS: (usize, f64) = (3, 0.01);

/// The share of the displacement that must point to one side before that side is called certain.
const ONE_SIDED: f64 = 0.8;

/// `tan 22.5°`: a direction's component below this multiple of the other one is not mentioned.
const ASIDE: f64 = 0.414;

/// The camera's offset as seen from the projector.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CameraOffset {
    /// The direction, of length 1, to the right and down in the photo.
    pub toward: [f64; 2],
    /// The typical displacement of the displaced cells, in projector pixels.
    pub size: f64,
    /// The standard error of `size`.
    pub error: f64,
    /// Whether the side is certain; if not, the camera may equally be on the opposite side.
    pub is_certain: bool,
    /// The share of displaced cells in the field.
    pub share: f64,
}

/// The least displacement, in projector pixels, that counts as different from the map.
pub(crate) fn least(disparity: &Disparity) -> f64 {
    (SIGMAS * disparity.error).max(LEAST)
}

/// The offset by the displaced cells; none where there are too few.
pub(crate) fn stand(disparity: &Disparity) -> Option<CameraOffset> {
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
        // The rounding of codes does not average out from cell to cell.
        error: disparity.error,
        is_certain: 0.5 * (1.0 + net.abs() / total) >= ONE_SIDED,
        share,
    })
}

/// The displacement at which the sorted cumulative sum reaches half: cells at an object's border belong to it only in part.
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
    /// The camera's position in words, such as `to the right of the projector and above it`.
    pub fn place(&self) -> String {
        let [right, down] = self.parts();
        let sideways = right.map(|is_right| if is_right { "to the right of" } else { "to the left of" });
        let upright = down.map(|is_down| if is_down { "below" } else { "above" });
        match (sideways, upright) {
            (Some(sideways), Some(upright)) => format!("{sideways} the projector and {upright} it"),
            (Some(one), None) | (None, Some(one)) => format!("{one} the projector"),
            // A direction of length 1 has a large component along at least one axis.
            (None, None) => "beside the projector".into(),
        }
    }

    /// The way to move the camera towards the projector, such as `left and down`.
    pub fn remedy(&self) -> String {
        let [right, down] = self.parts();
        let ways = [
            right.map(|is_right| if is_right { "left" } else { "right" }),
            down.map(|is_down| if is_down { "up" } else { "down" }),
        ];
        ways.into_iter().flatten().collect::<Vec<_>>().join(" and ")
    }

    /// Whether the camera is to the right, and below; none for a component that is too small.
    fn parts(&self) -> [Option<bool>; 2] {
        let [x, y] = self.toward;
        [(x.abs() > ASIDE * y.abs()).then_some(x > 0.0), (y.abs() > ASIDE * x.abs()).then_some(y > 0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of which every tenth is displaced by `off`, and all by noise of 0.01.
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
