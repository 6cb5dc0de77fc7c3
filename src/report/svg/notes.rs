//! Text in a drawing: names of points and notes of marks, placed where they cover least.

use std::fmt::Write;

use super::{Chart, FONT, LETTER, escape};
use crate::report::notes::clearest;

impl Chart {
    /// Writes names beside points. Each is placed where it covers no other name or marked point, if there is such a place.
    pub fn names(&mut self, named: &[((f64, f64), &str)]) {
        let points: Vec<(f64, f64)> = named.iter().map(|(at, _)| *at).collect();
        let mut taken = Vec::new();
        for ((x, y), name) in named {
            let width = LETTER * name.chars().count() as f64 + 4.0;
            let places: Vec<_> = [10.0, 20.0, 34.0]
                .into_iter()
                .flat_map(|away| {
                    let lefts = [x + away, x - away - width, x - width / 2.0];
                    let bases = [y - away + 2.0, y + away + 10.0, y + 5.0];
                    lefts.into_iter().flat_map(move |left| bases.map(|base| (left, base)))
                })
                .map(|(left, base)| [left, base - FONT, left + width, base + 3.0])
                .filter(|place| place[0] >= self.layout.left && place[2] <= self.layout.width)
                .filter(|place| place[1] >= self.top - FONT && place[3] <= self.bottom())
                .collect();
            let Some(place) = clearest(&places, &points, &taken) else { continue };
            taken.push(place);
            draw!(
                self.body,
                r#"<text class="halo" x="{:.1}" y="{:.1}" font-weight="600">{}</text>"#,
                place[0],
                place[3] - 3.0,
                escape(name)
            );
        }
    }

    /// Draws a dashed horizontal line over the full width. Its note is placed where no curve passes.
    pub fn horizontal_mark(&mut self, value: f64, note: &str) {
        let Some(y) = self.y.position(value).map(|along| self.down(along)) else { return };
        let (left, right) = (self.layout.left, self.layout.right());
        draw!(
            self.body,
            r#"<line x1="{left}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="currentColor" stroke-opacity="0.7" stroke-width="1.2" stroke-dasharray="2 4"/>"#
        );
        self.marks.push((y, note.to_owned()));
    }

    /// Writes the notes of the marks above or below their lines, as far left as possible without covering a curve or another note.
    pub(super) fn draw_notes(&mut self) {
        let mut notes = Vec::new();
        for (y, note) in std::mem::take(&mut self.marks) {
            let (width, left, right) =
                (LETTER * note.chars().count() as f64, self.layout.left, self.layout.right());
            let lefts =
                (0..9).map(|eighths| left + 8.0 + f64::from(eighths) / 8.0 * (right - left - 8.0 - width));
            let places: Vec<_> = lefts
                .flat_map(|left| {
                    [y - 6.0, y + 16.0].map(|base| [left, base - FONT, left + width, base + 4.0])
                })
                .filter(|place| place[1] >= self.top - FONT && place[3] <= self.bottom())
                .collect();
            let Some(place) = clearest(&places, &self.drawn, &notes) else { continue };
            notes.push(place);
            draw!(
                self.body,
                r#"<text x="{:.1}" y="{:.1}" fill-opacity="0.75">{}</text>"#,
                place[0],
                place[3] - 4.0,
                escape(&note)
            );
        }
    }
}
