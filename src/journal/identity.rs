//! The identity of a journal's source.

use serde::{Deserialize, Serialize};

/// An ordered list of named values on which all photos of a journal depend, such as the hashes of the rig
/// file and of the calibration, or the hash of a scene and the settings of the tracer. Two photos have the
/// same source if all values are equal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Identity(Vec<(String, String)>);

impl Identity {
    /// An identity without parts.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a part. Error messages call it `name` when two values differ.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.0.push((name.into(), value.to_string()));
        self
    }

    /// The value of the part called `name`.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(part, _)| part == name).map(|(_, value)| value.as_str())
    }

    /// Descriptions of the parts in which `other` differs; empty if the two are equal.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut names: Vec<&str> = self.0.iter().map(|(name, _)| name.as_str()).collect();
        names.extend(other.0.iter().map(|(name, _)| name.as_str()).filter(|name| self.get(name).is_none()));
        names.retain(|name| self.get(name) != other.get(name));
        let value = |identity: &Self, name| identity.get(name).map_or("none".into(), shorten);
        let mut differences: Vec<String> = names
            .into_iter()
            .map(|name| format!("{name} (then {}, now {})", value(self, name), value(other, name)))
            .collect();
        if differences.is_empty() && self != other {
            differences.push("the order of its parts".into());
        }
        differences
    }

    /// The identity as JSON, as it is stored in the file.
    pub(super) fn encode(&self) -> Vec<u8> {
        // Encoding a list of pairs of strings cannot fail.
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// BLAKE3 hash of the encoding.
    pub(super) fn hash(&self) -> [u8; 32] {
        *blake3::hash(&self.encode()).as_bytes()
    }
}

/// Abbreviates a hash to its first 12 digits, and quotes any other value.
fn shorten(value: &str) -> String {
    let is_hash = value.len() == 64 && value.bytes().all(|byte| byte.is_ascii_hexdigit());
    if is_hash { format!("{}…", &value[..12]) } else { format!("`{value}`") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_name_the_parts_and_both_values() {
        let then = Identity::new().with("rig file", "0".repeat(64)).with("size", "8x8");
        let now =
            Identity::new().with("rig file", "f".repeat(64)).with("calibration", "ideal").with("size", "8x8");
        assert_eq!(
            then.differences(&now),
            ["rig file (then 000000000000…, now ffffffffffff…)", "calibration (then none, now `ideal`)"]
        );
        assert!(then.differences(&then).is_empty());
        // Abbreviated are hashes alone: 64 digits, neither other words of that length nor other lengths.
        let [word, short] = ["z".repeat(64), "0".repeat(63)];
        let now = then.clone().with("word", word.clone()).with("short", short.clone());
        assert_eq!(
            then.differences(&now),
            [format!("word (then none, now `{word}`)"), format!("short (then none, now `{short}`)")]
        );
        let swapped = Identity::new().with("size", "8x8").with("rig file", "0".repeat(64));
        assert_eq!(then.differences(&swapped), ["the order of its parts"]);
    }
}
