//! What a shard is a part of, and in what two of them differ.

use std::collections::BTreeMap;

use super::Key;

/// What a shard is of. Two shards are of the same matrix where the keys are equal, and all facts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShardOrigin {
    /// The key of the whole matrix.
    pub key: Key,
    /// What the matrix depends on, by name, as people call it: messages say which of them differ.
    pub facts: BTreeMap<String, String>,
}

impl ShardOrigin {
    /// What differs in `other`, as sentences about it; empty where both are of the same matrix.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let names =
            self.facts.keys().chain(other.facts.keys().filter(|name| !self.facts.contains_key(*name)));
        let of_name = |name: &String| {
            let [ours, theirs] = [self, other].map(|of| of.facts.get(name));
            let shown =
                |value: Option<&String>| shortened(value.map_or("not known", |value| value)).to_owned();
            (ours != theirs).then(|| format!("its {name} is {}, not {}", shown(theirs), shown(ours)))
        };
        let mut found: Vec<String> = names.filter_map(of_name).collect();
        if found.is_empty() && self.key.hex() != other.key.hex() {
            found.push("its camera, its materials, or the program's shaders are others".into());
        }
        found
    }
}

/// The first digits of a digest; any other value as it is.
fn shortened(value: &str) -> &str {
    let is_digest = value.len() == 64 && value.bytes().all(|byte| byte.is_ascii_hexdigit());
    if is_digest { &value[..12] } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::transport::{Channels, RigShape};

    fn origin(seed: &str, digit: &str) -> ShardOrigin {
        let camera = Resolution::new(2, 2);
        let rig = RigShape { camera, projector: camera, symmetric: true };
        let key = Key::stored(digit.repeat(32), "a test".into(), Channels::Luma, rig).expect("it is a key");
        let facts = [("scene", "0".repeat(64)), ("seed", seed.into())];
        ShardOrigin { key, facts: facts.map(|(name, value)| (name.to_owned(), value)).into() }
    }

    #[test]
    fn differences_name_what_differs() {
        let one = origin("0", "a");
        assert!(one.differences(&one).is_empty());
        assert_eq!(one.differences(&origin("1", "b")), ["its seed is 1, not 0"]);
        let unnamed = one.differences(&origin("0", "b"));
        assert!(unnamed.len() == 1 && unnamed[0].contains("shaders"), "{unnamed:?}");
        let mut other = origin("0", "b");
        other.facts.insert("scene".into(), "1".repeat(64));
        other.facts.remove("seed");
        assert_eq!(
            one.differences(&other),
            ["its scene is 111111111111, not 000000000000", "its seed is not known, not 0"]
        );
    }

    #[test]
    fn a_key_is_no_path() {
        let RigShape { camera, .. } = origin("0", "a").key.rig();
        let rig = RigShape { camera, projector: camera, symmetric: true };
        for wrong in ["", "../../etc/passwd", &"A".repeat(32), &"a".repeat(33), &"é".repeat(16)] {
            assert!(Key::stored(wrong.into(), String::new(), Channels::Luma, rig).is_none(), "{wrong}");
        }
    }
}
