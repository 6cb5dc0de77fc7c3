//! Bytes change, are lost, or were never written.

use std::fs;
use std::ops::Range;
use std::sync::OnceLock;

use krylux::journal::{Journal, Kind};
use proptest::prelude::*;

use super::{Record, file, identity, small};

/// The places of records and header in the small journal.
struct Whole {
    bytes: Vec<u8>,
    records: Vec<Record>,
    /// For each entry its range in the file, and its record if it is a photo.
    ranges: Vec<(Range<usize>, Option<usize>)>,
    /// The end of the header.
    header: usize,
}

fn whole() -> &'static Whole {
    static WHOLE: OnceLock<Whole> = OnceLock::new();
    WHOLE.get_or_init(make)
}

fn make() -> Whole {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let records = small(folder.path());
    let bytes = fs::read(file(folder.path())).expect("it was just written");
    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let entries = journal.entries();
    let starts: Vec<usize> = entries.iter().map(|entry| entry.offset as usize).collect();
    let ends = starts[1..].iter().copied().chain([bytes.len()]);
    let ranges =
        starts.iter().zip(ends).zip(entries).map(|((&start, end), entry)| {
            (start..end, records.iter().position(|(key, ..)| *key == entry.key))
        });
    Whole { ranges: ranges.collect(), header: starts[0], bytes, records }
}

/// The photos that can be read, by index; every one of them must be as it was written.
fn readable(journal: &mut Journal, records: &[Record]) -> Vec<usize> {
    let mut found = Vec::new();
    for (index, (key, metadata, payload)) in records.iter().enumerate() {
        if let Some(stored) = journal.get(*key).expect("the file can be read") {
            assert_eq!((&stored.metadata, &stored.payload), (metadata, payload), "photo {index}");
            found.push(index);
        }
    }
    found
}

#[test]
fn a_flipped_bit_anywhere_costs_no_more_than_its_own_record_and_is_named() {
    let Whole { bytes, records, ranges, header } = whole();
    let folder = tempfile::tempdir().expect("a temporary folder");
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        fs::write(file(folder.path()), &damaged).expect("there is room");
        let mut journal = Journal::read_only(folder.path()).expect("a copy of the header is whole");
        journal.verify().expect("the file can be read");
        let hit = ranges.iter().find(|(range, _)| range.contains(&at));
        let expected: Vec<usize> =
            (0..records.len()).filter(|&index| hit.is_none_or(|(_, photo)| *photo != Some(index))).collect();
        assert_eq!(readable(&mut journal, records), expected, "byte {at}");
        let named: Vec<Range<u64>> = journal
            .damages()
            .iter()
            .map(|damage| damage.offset..damage.offset + damage.bytes)
            .chain(journal.torn().map(|torn| torn.offset..torn.offset + torn.bytes))
            .collect();
        assert!(named.len() == 1 && named[0].contains(&(at as u64)), "byte {at}: {named:?}");
        if let Some((range, _)) = hit {
            assert_eq!(
                named[0],
                range.start as u64..range.end as u64,
                "byte {at}: the whole record, and no other"
            );
        }
        let record = journal.damages().first().map_or("", |damage| &damage.record);
        match hit {
            None => assert!(at < *header && record == "one copy of the header"),
            // Its number is told by its own head, or else by the photo before it.
            Some((_, Some(photo))) => assert!(
                [format!("photo {}", photo + 1), format!("the record after photo {photo}")]
                    .contains(&record.to_string())
                    || record == "a record before the first photo"
                    || journal.torn().is_some(),
                "byte {at}: {record}"
            ),
            Some((_, None)) => {}
        }
    }
}

#[test]
fn what_was_damaged_is_appended_again_and_found_from_then_on() {
    let Whole { bytes, records, header, .. } = whole();
    let folder = tempfile::tempdir().expect("a temporary folder");
    for at in (*header..bytes.len()).step_by(3) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        fs::write(file(folder.path()), &damaged).expect("there is room");
        let mut journal = Journal::resume(folder.path(), &identity()).expect("its header is whole");
        let mut again = 0;
        for (key, metadata, payload) in records {
            if journal.get(*key).expect("it can be read").is_none() {
                journal.append(Kind::Photo, *key, metadata, payload).expect("there is room");
                again += 1;
            }
        }
        assert!(again <= 1, "byte {at}");
        drop(journal);
        let mut journal = Journal::read_only(folder.path()).expect("its header is whole");
        assert_eq!(readable(&mut journal, records).len(), records.len(), "byte {at}");
    }
}

#[test]
fn a_file_cut_anywhere_keeps_all_records_before_the_cut() {
    let Whole { bytes, records, ranges, header } = whole();
    let folder = tempfile::tempdir().expect("a temporary folder");
    for length in 0..=bytes.len() {
        fs::write(file(folder.path()), &bytes[..length]).expect("there is room");
        let opened = Journal::resume(folder.path(), &identity());
        if length < *header / 2 {
            let error = opened.expect_err("no copy of the header is whole").to_string();
            assert!(error.contains("photos.journal") && error.contains("header"), "{error}");
            continue;
        }
        let mut journal = opened.expect("a copy of the header is whole");
        let expected: Vec<usize> =
            ranges.iter().filter(|(range, _)| range.end <= length).filter_map(|(_, photo)| *photo).collect();
        assert_eq!(readable(&mut journal, records), expected, "{length} bytes");
        let boundary = ranges.iter().map(|(range, _)| range.end).filter(|&end| end <= length).max();
        let boundary = boundary.unwrap_or(*header);
        let torn = journal.torn().map(|torn| (torn.offset as usize, torn.bytes as usize));
        assert_eq!(torn, (length > boundary).then(|| (boundary, length - boundary)), "{length} bytes");
        assert_eq!(journal.damages().is_empty(), length >= *header, "{length} bytes");
        // The torn end is gone for good, and the file can be gone on with.
        let key = journal.key(&[b"one more"]);
        journal.append(Kind::Photo, key, b"", b"1").expect("there is room");
        drop(journal);
        let mut journal = Journal::read_only(folder.path()).expect("a copy of the header is whole");
        assert!(journal.torn().is_none() && journal.damages().is_empty(), "{length} bytes");
        assert_eq!(journal.get(key).expect("it can be read").expect("it is there").payload, b"1");
    }
}

#[test]
fn a_damaged_copy_of_the_header_is_repaired_when_the_run_goes_on_and_not_when_it_is_read() {
    let Whole { bytes, header, .. } = whole();
    let folder = tempfile::tempdir().expect("a temporary folder");
    for at in [20, header / 2 + 20] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1;
        fs::write(file(folder.path()), &damaged).expect("there is room");
        let named = |journal: &Journal| {
            let damages: Vec<(u64, u64)> =
                journal.damages().iter().map(|one| (one.offset, one.bytes)).collect();
            assert_eq!(damages, [(0, *header as u64)]);
        };
        named(&Journal::read_only(folder.path()).expect("one copy is whole"));
        assert!(fs::read(file(folder.path())).expect("it is there") == damaged, "byte {at}");
        named(&Journal::resume(folder.path(), &identity()).expect("one copy is whole"));
        assert!(fs::read(file(folder.path())).expect("it is there") == *bytes, "byte {at}");
    }
}

/// The checksum of a head is of the run, too: bytes that come from the journal of another rig are damage.
#[test]
fn photos_of_another_run_are_none_of_this_one() {
    let Whole { bytes, header, ranges, .. } = whole();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let other = krylux::journal::Identity::new().with("rig file", "0123abcd").with("size", "9x9");
    let mut journal = Journal::create(folder.path(), &other).expect("there is room");
    let key = journal.key(&[b"its own"]);
    journal.append(Kind::Photo, key, b"", b"light").expect("there is room");
    drop(journal);
    let mut mixed = fs::read(file(folder.path())).expect("it is there");
    let own = mixed.len() as u64;
    mixed.extend(&bytes[*header..]);
    fs::write(file(folder.path()), &mixed).expect("there is room");
    let mut journal = Journal::read_only(folder.path()).expect("its header is whole");
    assert_eq!(journal.photos(), 1, "of {} records none is taken for its own", ranges.len());
    assert!(journal.get(key).expect("it can be read").is_some());
    let damages: Vec<(u64, u64)> = journal.damages().iter().map(|one| (one.offset, one.bytes)).collect();
    assert_eq!(damages, [(own, (bytes.len() - header) as u64)]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Several damages of any kind: what no damage touched is found, and nothing is ever wrong.
    #[test]
    fn many_damages_cost_only_the_records_that_they_touch(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0..4_u8, 1..200_usize), 1..4),
    ) {
        let Whole { bytes, records, ranges, header } = whole();
        let mut damaged: Vec<(u8, usize)> = bytes.iter().copied().zip(0..).collect();
        let mut touched = Vec::new();
        for (place, what, length) in edits {
            if damaged.len() <= header + 1 {
                break;
            }
            let at = *header + place.index(damaged.len() - header);
            let end = (at + length).min(damaged.len());
            touched.extend(damaged[at..end].iter().map(|(_, from)| *from));
            match what {
                0 => damaged[at].0 ^= 0x80,
                1 => damaged[at..end].iter_mut().for_each(|(byte, _)| *byte = 0),
                2 => { damaged.drain(at..end); }
                _ => { damaged.splice(at..at, (0..length).map(|index| (index as u8, usize::MAX))); }
            }
        }
        let folder = tempfile::tempdir().expect("a temporary folder");
        let bytes: Vec<u8> = damaged.iter().map(|(byte, _)| *byte).collect();
        fs::write(file(folder.path()), bytes).expect("there is room");
        let mut journal = Journal::read_only(folder.path()).expect("the header is whole");
        let found = readable(&mut journal, records);
        for (range, photo) in ranges {
            // An insertion splits the record that it falls into; its neighbours are safe as soon as a byte lies between.
            let near = range.start.saturating_sub(1)..range.end;
            if let Some(photo) = photo && !touched.iter().any(|at| near.contains(at)) {
                prop_assert!(found.contains(photo), "photo {photo} of {found:?}");
            }
        }
        prop_assert!(found.len() == records.len() || !journal.damages().is_empty() || journal.torn().is_some()
            || touched.len() > 1, "what is missing is named");
    }
}
