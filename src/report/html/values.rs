//! The exact values of pictures, in the format that the page's scripts read.

use std::collections::HashMap;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{Block, Figure, Report};
use crate::image::{Image, Resolution};
use crate::report::palette::MASKED_LABEL;
use crate::report::web::{OF_FLOATS, deflated};

/// The maximum number of bytes for the values of all pictures in a page. Further values are only in the files of the run.
pub const MOST_BYTES: usize = 8 << 20;

/// The values of a picture's pixels. The page stores them in single precision: 24 bits, about seven digits.
#[derive(Clone, Debug)]
pub struct Values {
    /// The picture's size.
    pub size: Resolution,
    /// The meaning of the values.
    pub kind: Kind,
    /// One plane, or red, green and blue; each row by row from the top.
    pub planes: Vec<Vec<f32>>,
    /// The unit of the values; empty for dimensionless values.
    pub unit: String,
}

/// The meaning of a picture's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Light. The picture shows it up to `white`. The page can develop it at other exposures.
    Light {
        /// The value that is shown as white.
        white: f64,
    },
    /// Signed or unsigned numbers.
    Number,
    /// Entries of an eigenvector.
    Eigenvector {
        /// The eigenvalue of the normalized cut, with which the page computes rows of the matrix; `None` for other eigenvectors.
        eigenvalue: Option<f64>,
        /// The factor from entries to the coordinates that groups are computed from; `None` if there are no groups.
        weight: Option<f64>,
        /// The range to which entries are clamped before the multiplication by `weight`.
        range: (f64, f64),
    },
    /// Numbers of groups.
    Label,
}

impl Values {
    /// The light of an image, shown up to `white`.
    pub fn of_light(image: &Image, white: f64, unit: &str) -> Self {
        let channels = image.channels();
        let plane = |channel| image.samples().iter().skip(channel).step_by(channels).copied().collect();
        Self {
            size: image.resolution(),
            kind: Kind::Light { white },
            planes: (0..channels).map(plane).collect(),
            unit: unit.to_owned(),
        }
    }

    /// Numbers in `unit`.
    pub fn of_numbers(size: Resolution, kind: Kind, values: &[f64], unit: &str) -> Self {
        let plane = values.iter().map(|&value| value as f32).collect();
        Self { size, kind, planes: vec![plane], unit: unit.to_owned() }
    }

    /// Numbers of groups.
    pub fn of_labels(size: Resolution, labels: &[u8]) -> Self {
        let plane = labels.iter().map(|&label| f32::from(label)).collect();
        Self { size, kind: Kind::Label, planes: vec![plane], unit: String::new() }
    }

    /// The data that the scripts need about a figure with these values, as a JSON object.
    fn describe(&self, figure: &Figure) -> Value {
        let mut about = match self.kind {
            Kind::Light { white } => json!({ "kind": "light", "white": white }),
            Kind::Number => json!({ "kind": "number" }),
            Kind::Eigenvector { eigenvalue, weight, range } => {
                json!({ "kind": "eigenvector", "eigenvalue": eigenvalue, "weight": weight, "range": range })
            }
            Kind::Label => json!({ "kind": "label", "masked": MASKED_LABEL }),
        };
        about["width"] = json!(self.size.width);
        about["height"] = json!(self.size.height);
        about["planes"] = json!(self.planes.len());
        about["unit"] = json!(self.unit);
        about["name"] = json!(figure.name);
        about["file"] = json!(figure.file);
        about["series"] = json!(figure.series);
        about["flips"] = json!(figure.flips);
        about
    }
}

/// Floats as text, deflated, in base64. The first bytes of all floats come first, then all second bytes, and so on, which deflates better.
pub(super) fn packed(planes: &[Vec<f32>]) -> String {
    let count = planes.iter().map(Vec::len).sum::<usize>();
    let mut bytes = vec![0; 4 * count];
    for (index, value) in planes.iter().flatten().enumerate() {
        for (place, byte) in value.to_le_bytes().into_iter().enumerate() {
            bytes[place * count + index] = byte;
        }
    }
    deflated(&bytes, OF_FLOATS)
}

#[derive(Default)]
pub(super) struct Embedded {
    /// The data that the scripts need about each picture, as JSON. The key is (section, block, number).
    about: HashMap<[usize; 3], String>,
    /// The names and the packed texts of the embedded values.
    pub(super) sections: Vec<(String, String)>,
    /// The number of pictures whose values exceeded the limit of the page.
    pub(super) left_out: usize,
}

impl Embedded {
    pub(super) fn new(report: &Report) -> Self {
        let mut figures: Vec<([usize; 3], &Figure)> = Vec::new();
        for (section, of) in report.sections.iter().enumerate() {
            for (block, of) in of.blocks.iter().enumerate() {
                let Block::Figures(of) = of else { continue };
                let of = of.iter().enumerate();
                figures.extend(of.map(|(number, figure)| ([section, block, number], figure)));
            }
        }
        let values: Vec<([usize; 3], &Figure, &Values)> = figures
            .into_iter()
            .filter_map(|(at, figure)| Some((at, figure, figure.values.as_ref()?)))
            .collect();
        let mut embedded = Self::default();
        let mut bytes = 0;
        // One for each thread at a time, because packing a value that is then left out costs time.
        for values in values.chunks(rayon::current_num_threads().max(1)) {
            let fits =
                |(.., values): &(_, _, &Values)| (embedded.left_out == 0).then(|| packed(&values.planes));
            let texts: Vec<Option<String>> = values.par_iter().map(fits).collect();
            for ((at, figure, values), text) in values.iter().zip(texts) {
                embedded.add(*at, values.describe(figure), text, &mut bytes);
            }
        }
        embedded
    }

    /// Adds the values of a figure, packed as `text`. `about` describes the figure. After the first figure that does not fit, all are left
    /// out.
    fn add(&mut self, at: [usize; 3], mut about: Value, text: Option<String>, bytes: &mut usize) {
        match text.filter(|text| self.left_out == 0 && *bytes + text.len() <= MOST_BYTES) {
            Some(text) => {
                *bytes += text.len();
                let id = format!("values-{}", self.sections.len());
                about["values"] = json!(id);
                self.sections.push((id, text));
            }
            None => self.left_out += 1,
        }
        self.about.insert(at, about.to_string());
    }

    /// The data that the scripts need about a picture; empty if it has no values.
    pub(super) fn about(&self, at: [usize; 3]) -> &str {
        self.about.get(&at).map_or("", String::as_str)
    }

    /// A sentence about where the values of the pictures are stored; empty for a page without values.
    pub(super) fn sentence(&self) -> String {
        let bytes: usize = self.sections.iter().map(|(_, text)| text.len()).sum();
        let mut text = match self.sections.len() {
            0 => return String::new(),
            1 => "The values of 1 picture are in this page".to_owned(),
            count => format!("The values of {count} pictures are in this page"),
        };
        text += &format!(
            ", in single precision (24 bits, about seven digits), {}.",
            crate::report::text::bytes(bytes as u64)
        );
        if self.left_out > 0 {
            text += &format!(
                " Those of {} more are in the files only: a page holds at most {} of values.",
                self.left_out,
                crate::report::text::bytes(MOST_BYTES as u64)
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;

    use super::*;
    use crate::report::html::Section;

    fn unpacked(text: &str) -> Vec<f32> {
        let deflated = STANDARD.decode(text).expect("base64");
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(&deflated[..]).read_to_end(&mut bytes).expect("deflated");
        let count = bytes.len() / 4;
        (0..count).map(|at| f32::from_le_bytes([0, 1, 2, 3].map(|place| bytes[place * count + at]))).collect()
    }

    #[test]
    fn values_are_packed_without_loss() {
        let planes = [vec![0.0, -1.5, f32::MIN_POSITIVE], vec![1e30, 0.1, f32::INFINITY]];
        assert_eq!(unpacked(&packed(&planes)), planes.concat());
    }

    #[test]
    fn a_page_holds_no_more_values_than_it_may() {
        // Random bits do not deflate, so the values of each plane take more than a quarter of the limit.
        let size = Resolution::new(800, 800);
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(f32::from_bits((state >> 34) as u32 & 0x7e7f_ffff))
        };
        let mut figure = || {
            let values: Vec<f64> = (0..size.pixels()).map(|_| noise()).collect();
            Figure { values: Some(Values::of_numbers(size, Kind::Number, &values, "")), ..Figure::default() }
        };
        let blocks = vec![Block::Figures((0..4).map(|_| figure()).collect())];
        let report = Report { sections: vec![Section { blocks, ..Section::default() }], ..Report::default() };
        let embedded = Embedded::new(&report);
        let bytes: usize = embedded.sections.iter().map(|(_, text)| text.len()).sum();
        assert!(bytes <= MOST_BYTES && embedded.left_out > 0, "{bytes}, {}", embedded.left_out);
        assert_eq!(embedded.sections.len() + embedded.left_out, 4);
        assert!(embedded.sentence().contains("in the files only"));
        assert!(
            embedded.about([0, 0, 0]).contains("values-0") && !embedded.about([0, 0, 3]).contains("values-")
        );
    }
}
