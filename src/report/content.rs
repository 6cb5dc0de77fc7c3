//! An answer as named arrays and facts. Files, the summary, Python attributes and the lines on the terminal are made from them.

use std::borrow::Cow;
use std::fmt::Display;

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use crate::image::{Image, Resolution};

/// The content of an answer.
#[derive(Clone, Debug, Default)]
pub struct Content<'a> {
    /// The arrays, in the order of their files.
    pub arrays: Vec<Array<'a>>,
    /// The lines on the terminal.
    pub lines: Vec<String>,
    /// The remarks on stderr.
    pub notes: Vec<String>,
    facts: Vec<Fact>,
}

/// A named array in C order.
#[derive(Clone, Debug)]
pub struct Array<'a> {
    /// The name of the file and of the attribute in Python.
    pub name: &'static str,
    /// The number that distinguishes arrays of equal names. With it, the file is `NAME-KEY.npy`, and the attribute is a dictionary.
    pub key: Option<usize>,
    /// The shape.
    pub shape: Vec<usize>,
    /// The elements.
    pub values: Values<'a>,
    /// Whether the array is written to a file.
    pub is_saved: bool,
}

/// The elements of an array.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "each variant is named by its element")]
pub enum Values<'a> {
    F64(Cow<'a, [f64]>),
    F32(Cow<'a, [f32]>),
    U8(Cow<'a, [u8]>),
    Bool(Cow<'a, [bool]>),
    /// The rows of a matrix, one after another.
    Rows(&'a [Vec<f64>]),
    Image(&'a Image),
}

macro_rules! values {
    ($($variant:ident of $element:ty),*) => { $(
        impl<'a> From<&'a [$element]> for Values<'a> {
            fn from(values: &'a [$element]) -> Self {
                Self::$variant(Cow::Borrowed(values))
            }
        }

        impl<'a> From<&'a Vec<$element>> for Values<'a> {
            fn from(values: &'a Vec<$element>) -> Self {
                Self::$variant(Cow::Borrowed(values))
            }
        }

        impl From<Vec<$element>> for Values<'_> {
            fn from(values: Vec<$element>) -> Self {
                Self::$variant(Cow::Owned(values))
            }
        }
    )* };
}

values!(F64 of f64, F32 of f32, U8 of u8, Bool of bool);

#[derive(Clone, Debug)]
struct Fact {
    name: &'static str,
    value: serde_json::Value,
    /// Whether the summary of `--json` contains the fact.
    is_told: bool,
}

impl<'a> Content<'a> {
    /// Adds an array that is written to `NAME.npy`. With a key, the file is `NAME-KEY.npy`.
    pub fn array(
        &mut self,
        name: &'static str,
        shape: &[usize],
        values: impl Into<Values<'a>>,
    ) -> &mut Array<'a> {
        self.arrays.push(Array {
            name,
            key: None,
            shape: shape.to_vec(),
            values: values.into(),
            is_saved: true,
        });
        let last = self.arrays.len() - 1;
        &mut self.arrays[last]
    }

    /// Adds an array as an attribute for programs, without a file.
    pub fn attribute(
        &mut self,
        name: &'static str,
        shape: &[usize],
        values: impl Into<Values<'a>>,
    ) -> &mut Array<'a> {
        let array = self.array(name, shape, values);
        array.is_saved = false;
        array
    }

    /// Adds light of each channel, `[H, W]` or `[H, W, 3]`, as an attribute for programs.
    pub fn planes(&mut self, name: &'static str, size: Resolution, planes: &[Vec<f64>]) {
        let samples = (0..size.pixels()).flat_map(|pixel| planes.iter().map(move |plane| plane[pixel]));
        self.attribute(name, &shape(size, planes.len()), samples.collect::<Vec<f64>>());
    }

    /// Adds an image, `[H, W]` or `[H, W, 3]`, as an attribute for programs.
    pub fn picture(&mut self, name: &'static str, image: &'a Image) -> &mut Array<'a> {
        self.attribute(name, &shape(image.resolution(), image.channels()), image.samples())
    }

    /// Adds an image that is written to `NAME.npy` and `NAME.exr`.
    pub fn image(&mut self, name: &'static str, image: &'a Image) {
        self.array(name, &shape(image.resolution(), image.channels()), Values::Image(image));
    }

    /// Adds a fact. A number that JSON cannot represent becomes null.
    pub fn fact(&mut self, name: &'static str, value: impl Serialize) {
        self.facts.push(Fact { name, value: json(value), is_told: true });
    }

    /// Adds a fact for programs. The summary omits it.
    pub fn detail(&mut self, name: &'static str, value: impl Serialize) {
        self.facts.push(Fact { name, value: json(value), is_told: false });
    }

    /// Adds a line on the terminal.
    pub fn line(&mut self, line: impl Display) {
        self.lines.push(line.to_string());
    }

    /// Adds a remark on stderr.
    pub fn note(&mut self, note: impl Display) {
        self.notes.push(note.to_string());
    }

    /// All facts by name, as JSON, including those that the summary omits.
    pub fn facts(&self) -> impl Iterator<Item = (&'static str, String)> {
        self.facts.iter().map(|fact| (fact.name, fact.value.to_string()))
    }
}

impl Serialize for Content<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for fact in self.facts.iter().filter(|fact| fact.is_told) {
            map.serialize_entry(fact.name, &fact.value)?;
        }
        map.end()
    }
}

impl Array<'_> {
    /// The name of the file without its extension.
    pub fn file(&self) -> String {
        match self.key {
            Some(key) => format!("{}-{key}", self.name),
            None => self.name.to_owned(),
        }
    }
}

/// The shape of light: `[H, W]`, or `[H, W, 3]` in colour.
pub(crate) fn shape(size: Resolution, channels: usize) -> Vec<usize> {
    [size.height, size.width].into_iter().chain((channels > 1).then_some(channels)).collect()
}

/// A value as JSON. A map becomes null if its keys are not strings, but no answer has such a map.
fn json(value: impl Serialize) -> serde_json::Value {
    serde_json::to_value(value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_holds_the_facts_that_are_told_and_programs_all_of_them() {
        let mut content = Content::default();
        content.fact("photos", 7);
        content.fact("error", f64::NAN);
        content.detail("history", [1, 2]);
        content.array("labels", &[2], vec![1_u8, 2]);
        content.array("labels", &[2], vec![1_u8, 2]).key = Some(6);
        assert_eq!(serde_json::to_string(&content).expect("facts"), r#"{"photos":7,"error":null}"#);
        assert_eq!(content.facts().last(), Some(("history", "[1,2]".to_owned())));
        assert_eq!(content.arrays.iter().map(Array::file).collect::<Vec<_>>(), ["labels", "labels-6"]);
    }
}
