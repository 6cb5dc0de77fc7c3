//! Paths and arguments in records. They may contain any bytes.

use std::ffi::{OsStr, OsString};
use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A path or an argument. In a record, it is a string. If it is not Unicode, the record contains its bytes instead (on Windows, its 16-bit
/// units): `{"Unix": [255]}`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Name(OsString);

impl Name {
    /// The path or argument as a string, if it is Unicode.
    pub fn to_str(&self) -> Option<&str> {
        self.0.to_str()
    }
}

impl<T: AsRef<OsStr> + ?Sized> From<&T> for Name {
    fn from(name: &T) -> Self {
        Self(name.as_ref().to_owned())
    }
}

/// Bytes that are not Unicode are replaced.
impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.display().fmt(f)
    }
}

impl Serialize for Name {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize(&self.0, serializer)
    }
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserialize::<OsString, D>(deserializer).map(Self)
    }
}

/// Writes a path like [`Name`], for fields with `#[serde(with = "name")]`.
pub(crate) fn serialize<S: Serializer>(name: &impl AsRef<OsStr>, serializer: S) -> Result<S::Ok, S::Error> {
    let name = name.as_ref();
    match name.to_str() {
        Some(text) => text.serialize(serializer),
        None => name.serialize(serializer),
    }
}

/// Reads a path like [`Name`], for fields with `#[serde(with = "name")]`.
pub(crate) fn deserialize<'de, T: From<OsString>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<T, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Either {
        Text(String),
        Bytes(OsString),
    }
    Ok(match Either::deserialize(deserializer)? {
        Either::Text(text) => OsString::from(text),
        Either::Bytes(bytes) => bytes,
    }
    .into())
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::ffi::OsStringExt;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_record_keeps_every_byte(bytes in prop::collection::vec(1..=255_u8, 0..20)) {
            let name = Name(OsString::from_vec(bytes));
            let record = serde_json::to_string(&name).expect("every name can be written");
            let back: Name = serde_json::from_str(&record).expect("what was written can be read");
            prop_assert_eq!(&back, &name);
            prop_assert_eq!(record.starts_with('"'), name.to_str().is_some(), "{}", record);
        }
    }
}
