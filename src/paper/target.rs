//! The target picture of the compensations, computed so that no image file has to be shipped.

/// A picture of `side × side` values in [0.02, 1]: a soft gradient, a bright disc with a dark ring, bars that become finer to the
/// right, and a staircase of grays. It has edges in all directions and large uniform areas.
pub(super) fn picture(side: usize) -> Vec<f64> {
    let pixels = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
    pixels
        .map(|(row, column)| {
            let (x, y) = ((column as f64 + 0.5) / side as f64, (row as f64 + 0.5) / side as f64);
            value(x, y)
        })
        .collect()
}

/// The value at `x` from the left and `y` from the top, both in [0, 1].
fn value(x: f64, y: f64) -> f64 {
    let from_center = (x - 0.5).hypot(y - 0.4);
    if from_center < 0.16 {
        return 1.0;
    }
    if from_center < 0.26 {
        return 0.02;
    }
    if y > 0.86 {
        // Six steps of gray.
        return 0.02 + 0.19 * (6.0 * x).floor().min(5.0);
    }
    if (0.72..0.82).contains(&y) {
        // Bars with widths of 1/12, 1/16 and 1/24 of the picture.
        let bars = if x < 1.0 / 3.0 {
            12.0
        } else if x < 2.0 / 3.0 {
            16.0
        } else {
            24.0
        };
        return if ((bars * x) as usize).is_multiple_of(2) { 0.9 } else { 0.1 };
    }
    0.35 + 0.3 * x + 0.1 * (1.0 - y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_can_be_projected_and_edges_are_there() {
        let picture = picture(100);
        assert!(picture.iter().all(|value| (0.02..=1.0).contains(value)));
        let edges = picture.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > 0.1).count();
        // The bars alone have nine edges in each of ten rows, the staircase five in fourteen, disc and ring four in most of 52.
        assert!(edges > 9 * 10 + 5 * 14 + 2 * 52, "{edges} of 10,000 neighbours differ");
    }
}
