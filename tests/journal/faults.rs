//! No room, no permission, no second writer, no other source.

use std::fs;
use std::path::Path;
use std::process::Command;

use krylux::Error;
use krylux::journal::{Identity, Journal, Kind};

use super::{file, identity, small};

/// The folder that the child process below writes to.
const FOLDER: &str = "KRYLUX_TEST_JOURNAL";
const PAYLOAD: [u8; 1000] = [7; 1000];

/// A quota stands for the full disk: to a writer both are an error in the middle of a record. The signal that comes
/// with it is ignored, as it is on a disk that is full.
#[test]
fn a_full_disk_is_an_error_that_loses_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = std::env::current_exe().expect("the test runs");
    let limited = "trap '' XFSZ; ulimit -f 16; exec \"$0\" journal::faults::child_that_writes_until_it_fails \
                   --exact --ignored --nocapture";
    let output = Command::new("sh").arg("-c").arg(limited).arg(program).env(FOLDER, folder.path()).output();
    let output = output.expect("there is a shell");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    // 8 KiB hold the header and seven records of 1,122 bytes.
    assert!(said.contains("photos.journal: cannot write: File too large"), "{said}");
    assert!(said.contains("all 7 photos so far are safe") && said.contains("--resume"), "{said}");

    // With room again it goes on, and has nothing to cut off: the record in part was taken back at once.
    let mut journal = Journal::resume(folder.path(), &identity()).expect("it is whole");
    assert!(journal.torn().is_none() && journal.damages().is_empty());
    assert_eq!(journal.photos(), 7);
    for index in 0..9_u8 {
        let key = journal.key(&[&[index]]);
        match journal.get(key).expect("it can be read") {
            Some(stored) => assert!(index < 7 && stored.payload == PAYLOAD),
            None => journal.append(Kind::Photo, key, b"{}", &PAYLOAD).expect("there is room again"),
        }
    }
    assert_eq!(journal.photos(), 9);
}

#[test]
#[ignore = "the other half of the test above, run by it in a process with a limit on the size of files"]
fn child_that_writes_until_it_fails() {
    let folder = std::env::var_os(FOLDER).expect("its parent says where");
    let mut journal = Journal::create(Path::new(&folder), &identity()).expect("a header fits");
    let mut errors = Vec::new();
    for index in 0..9_u8 {
        let key = journal.key(&[&[index]]);
        if let Err(error) = journal.append(Kind::Photo, key, b"{}", &PAYLOAD) {
            assert!(!journal.holds(key));
            errors.push(error.to_string());
        }
    }
    // The same photo does not fit however often one tries, and nothing else comes to harm.
    assert_eq!(errors.len(), 2);
    println!("{}", errors[0]);
    let first = journal.key(&[&[0]]);
    assert_eq!(journal.get(first).expect("it can be read").expect("it is there").payload, PAYLOAD);
}

/// Permission bits do not bind an administrator, who may run this: a folder below a file, and one below `/proc`, can be
/// written by nobody.
#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let below_a_file = folder.path().join("file/journal");
    fs::write(folder.path().join("file"), "").expect("there is room");
    for place in [below_a_file.as_path(), Path::new("/proc/journal")] {
        let error = Journal::create(place, &identity()).expect_err("nobody can write there").to_string();
        assert!(error.contains(&place.display().to_string()), "{error}");
    }
}

/// Nothing closes the journal here, as if the process were killed.
#[test]
fn what_can_be_computed_again_outlives_its_process_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut journal = Journal::create(folder.path(), &identity()).expect("there is room");
    for index in 0..3_u8 {
        let key = journal.key(&[&[index]]);
        journal.append_buffered(Kind::Photo, key, b"{}", &PAYLOAD).expect("there is room");
        let mut seen = Journal::read_only(folder.path()).expect("it is whole");
        assert_eq!(seen.photos(), usize::from(index) + 1);
        assert_eq!(seen.get(key).expect("it can be read").expect("it is there").payload, PAYLOAD);
        let twice = journal.append_buffered(Kind::Photo, key, b"{}", &PAYLOAD);
        assert!(twice.expect_err("it is there already").to_string().contains("already"));
    }
    std::mem::forget(journal);
    assert_eq!(Journal::read_only(folder.path()).expect("it is whole").photos(), 3);
}

#[test]
fn a_second_writer_is_refused_by_name_until_the_first_has_ended() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    small(folder.path());
    let first = Journal::resume(folder.path(), &identity()).expect("nobody else has it");
    let error = Journal::resume(folder.path(), &identity()).expect_err("it is taken").to_string();
    assert!(error.contains(&format!("process {}", std::process::id())), "{error}");
    assert_eq!(Journal::read_only(folder.path()).expect("reading needs no lock").photos(), 4);
    drop(first);
    Journal::resume(folder.path(), &identity()).expect("it is free again");
}

#[test]
fn photos_of_another_source_are_refused_by_what_differs() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    small(folder.path());
    let other = Identity::new().with("rig file", "0123abcd").with("size", "16x16");
    let error =
        Journal::resume(folder.path(), &other).expect_err("its photos are of another size").to_string();
    assert!(error.contains("size (then `8x8`, now `16x16`)") && !error.contains("rig file"), "{error}");
    assert_eq!(Journal::read_only(folder.path()).expect("it is untouched").photos(), 4);
}

#[test]
fn a_new_journal_never_takes_an_old_ones_place() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    small(folder.path());
    let before = fs::read(file(folder.path())).expect("it is there");
    let error = Journal::create(folder.path(), &identity()).expect_err("there is one").to_string();
    assert!(error.contains("--resume"), "{error}");
    assert_eq!(fs::read(file(folder.path())).expect("it is there"), before);
}

#[test]
fn a_journal_opened_to_read_is_not_changed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    small(folder.path());
    let mut bytes = fs::read(file(folder.path())).expect("it is there");
    bytes.truncate(bytes.len() - 1);
    fs::write(file(folder.path()), &bytes).expect("there is room");
    let mut journal = Journal::read_only(folder.path()).expect("it is whole but for the end");
    assert!(journal.torn().is_some() && journal.photos() == 3);
    let key = journal.key(&[b"more"]);
    let refused = journal.append(Kind::Photo, key, b"", b"");
    assert!(matches!(&refused, Err(Error::Journal { fault, .. }) if fault.contains("for reading only")));
    assert!(!journal.is_writable());
    drop(journal);
    assert_eq!(fs::read(file(folder.path())).expect("it is there"), bytes);
}

#[test]
fn an_identity_longer_than_a_header_holds_is_refused_and_leaves_no_journal() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let long = Identity::new().with("rig file", "a".repeat(1 << 16));
    let error = Journal::create(folder.path(), &long).expect_err("it does not fit").to_string();
    assert!(error.contains("64 KiB"), "{error}");
    assert!(!file(folder.path()).exists());
    let journal = Journal::create(folder.path(), &identity()).expect("the folder is as good as fresh");
    assert!(journal.is_writable());
}
