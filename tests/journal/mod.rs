//! The journal: what was appended comes back as it was or not at all, whatever happens to the file and its writer.

mod claims;
mod damage;
mod faults;
mod kill;
mod photos;
mod products;

use std::path::{Path, PathBuf};

use krylux::journal::{Identity, Journal, Key, Kind};
use proptest::prelude::*;

/// The file that holds the records.
fn file(folder: &Path) -> PathBuf {
    folder.join("photos.journal")
}

fn identity() -> Identity {
    Identity::new().with("rig file", "0123abcd").with("size", "8x8")
}

/// A record as a test knows it.
type Record = (Key, Vec<u8>, Vec<u8>);

/// Appends photos of these metadata and payloads, each with a pattern.
fn write(folder: &Path, content: &[(Vec<u8>, Vec<u8>)]) -> Vec<Record> {
    let mut journal = Journal::resume(folder, &identity()).expect("the folder is fresh");
    let mut records = Vec::new();
    for (index, (metadata, payload)) in content.iter().enumerate() {
        journal.pattern(&[index as u8 / 2; 5]).expect("there is room");
        let key = journal.key(&[b"test", &index.to_le_bytes()]);
        journal.append(Kind::Photo, key, metadata, payload).expect("there is room");
        records.push((key, metadata.clone(), payload.clone()));
    }
    records
}

/// A small journal: lengths of payloads from none to some.
fn small(folder: &Path) -> Vec<Record> {
    let content = |index: u8| (vec![b'm'; usize::from(index)], vec![index; 7 * usize::from(index)]);
    write(folder, &(0..4).map(content).collect::<Vec<_>>())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_was_appended_comes_back_in_every_way_of_opening(
        content in prop::collection::vec(
            (prop::collection::vec(any::<u8>(), 0..20), prop::collection::vec(any::<u8>(), 0..300)), 0..8
        ),
        again in 0..3_usize,
    ) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let records = write(folder.path(), &content);
        for _ in 0..again {
            Journal::resume(folder.path(), &identity()).expect("nobody else has it");
        }
        for mut journal in [
            Journal::read_only(folder.path()).expect("it is whole"),
            Journal::resume(folder.path(), &identity()).expect("it is whole"),
        ] {
            prop_assert_eq!(journal.photos(), records.len());
            for (key, metadata, payload) in &records {
                let stored = journal.get(*key).expect("it can be read").expect("it is there");
                prop_assert_eq!((&stored.metadata, &stored.payload), (metadata, payload));
            }
            prop_assert!(journal.damages().is_empty() && journal.torn().is_none());
            prop_assert_eq!(journal.identity(), &identity());
            prop_assert!(journal.get(journal.key(&[b"never"])).expect("it can be read").is_none());
        }
    }
}

#[test]
fn a_pattern_is_kept_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    small(folder.path());
    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let count = |kind| journal.entries().iter().filter(|entry| entry.kind == kind).count();
    assert_eq!((count(Kind::Pattern), count(Kind::Photo)), (2, 4));
    let key = journal.entries()[0].key;
    assert_eq!((format!("{key:?}"), key.to_string().len()), (key.to_string(), 64));
}

#[test]
fn a_photo_is_never_appended_twice() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let records = small(folder.path());
    let mut journal = Journal::resume(folder.path(), &identity()).expect("it is whole");
    let before = std::fs::metadata(file(folder.path())).expect("it is there").len();
    journal.append(Kind::Photo, records[1].0, b"", b"another").expect_err("it is there already");
    assert_eq!(std::fs::metadata(file(folder.path())).expect("it is there").len(), before);
}
