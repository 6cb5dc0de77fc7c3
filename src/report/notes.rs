//! Placement of notes in a drawing, so that they do not cover curves.

/// A rectangle: left, top, right and bottom.
pub(super) type Frame = [f64; 4];

/// The sampling distance along lines. Closer points are equivalent for the placement of notes.
const STEP: f64 = 3.0;

/// Points along the lines between `corners`, dense enough to detect every line through a note.
pub(super) fn along(corners: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    corners.windows(2).flat_map(|ends| {
        let [(x, y), (to_x, to_y)] = [ends[0], ends[1]];
        let steps = ((to_x - x).hypot(to_y - y) / STEP).ceil().max(1.0) as usize;
        (0..=steps).map(move |step| {
            let share = step as f64 / steps as f64;
            (x + share * (to_x - x), y + share * (to_y - y))
        })
    })
}

/// The first of the places that cover the fewest points and notes; `None` without places.
pub(super) fn clearest(places: &[Frame], points: &[(f64, f64)], notes: &[Frame]) -> Option<Frame> {
    let hidden = |place: &Frame| {
        let inside =
            |&&(x, y): &&(f64, f64)| (place[0]..=place[2]).contains(&x) && (place[1]..=place[3]).contains(&y);
        let meets = |note: &&Frame| {
            note[0] < place[2] && place[0] < note[2] && note[1] < place[3] && place[1] < note[3]
        };
        // Overlapping notes are unreadable, hence the large penalty.
        points.iter().filter(inside).count() + 1000 * notes.iter().filter(meets).count()
    };
    places.iter().copied().min_by_key(hidden)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_stands_where_no_curve_passes_and_no_other_note_stands() {
        let places = [[0.0, 0.0, 50.0, 10.0], [100.0, 0.0, 150.0, 10.0], [200.0, 0.0, 250.0, 10.0]];
        let curve: Vec<_> = along(&[(0.0, -40.0), (40.0, 40.0)]).collect();
        assert_eq!(clearest(&places, &[], &[]), Some(places[0]));
        assert_eq!(clearest(&places, &curve, &[]), Some(places[1]));
        assert_eq!(clearest(&places, &curve, &[[90.0, 5.0, 110.0, 15.0]]), Some(places[2]));
        assert_eq!(clearest(&[], &curve, &[]), None);
    }

    #[test]
    fn a_line_is_seen_all_along() {
        let points: Vec<_> = along(&[(0.0, 0.0), (30.0, 40.0)]).collect();
        assert!(points.windows(2).all(|pair| (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1) <= STEP));
        assert!(points.contains(&(0.0, 0.0)) && points.contains(&(30.0, 40.0)));
    }
}
