//! Raw frames through a journal: no frame is taken twice or lost, and a replay gives the same frames.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use krylux::Result;
use krylux::image::Resolution;
use krylux::journal::{Journal, Kind};
use krylux::measure::{CaptureRequest, Effort, FrameSource, JournaledFrames, Opener};
use krylux::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame, Stamp};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{file, identity};

const SIZE: Resolution = Resolution { width: 4, height: 2 };

/// A rig whose counts depend on everything that they may depend on: the pattern, the pattern before (a slow
/// screen), the exposure, the number of the frame, and the time. Every fifth frame is dropped.
struct Rig {
    projector: ProjectorInfo,
    camera: CameraInfo,
    /// The stamp of the last frame.
    last: Stamp,
    shown: Vec<u16>,
    effort: Effort,
    /// Frames taken, by all rigs of a test.
    taken: Arc<AtomicU64>,
}

impl Rig {
    fn open(after: Option<Stamp>, taken: &Arc<AtomicU64>) -> Self {
        let projector = ProjectorInfo {
            name: "test projector".into(),
            resolution: SIZE,
            channels: 1,
            bits: 8,
            // A number without a short decimal, which must be read back to the last bit.
            frame_time: 1.0 / 59.94,
        };
        let camera = CameraInfo {
            name: "test camera".into(),
            resolution: SIZE,
            channels: 1,
            bits: 16,
            exposures: [1e-5 / 3.0, 0.7],
        };
        let last = after.unwrap_or(Stamp { id: 0, time: 0.0 });
        let shown = vec![0; 8];
        Self { projector, camera, last, shown, effort: Effort::default(), taken: Arc::clone(taken) }
    }
}

impl FrameSource for Rig {
    fn projector(&self) -> &ProjectorInfo {
        &self.projector
    }

    fn camera(&self) -> &CameraInfo {
        &self.camera
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        self.taken.fetch_add(1, Ordering::Relaxed);
        self.effort.taken += 1;
        self.last.id += 1;
        if self.last.id.is_multiple_of(5) {
            self.last.id += 1;
            self.effort.dropped += 1;
        }
        let started = self.last.time + 0.1;
        let mut random = Pcg64::seed_from_u64(self.last.id ^ started.to_bits());
        let levels = request.frame.levels().iter().zip(&self.shown);
        let counts = levels.map(|(level, before)| level * 16 + before + random.random_range(0..16)).collect();
        let exposure = request.exposure * (1.0 + 1e-12);
        let frame = RawFrame { resolution: SIZE, channels: 1, counts, exposure, id: self.last.id, started };
        self.last = Stamp::of(&frame);
        self.shown = request.frame.levels().to_vec();
        Ok(frame)
    }

    fn follow(&mut self, request: &CaptureRequest, frame: &RawFrame) -> Result<()> {
        assert_eq!(self.last, Stamp::of(frame));
        self.shown = request.frame.levels().to_vec();
        Ok(())
    }

    fn set_settle(&mut self, _: f64) {}

    fn effort(&self) -> Effort {
        Effort { seconds: self.last.time, ..self.effort }
    }
}

/// The events at the rig.
#[derive(Clone, Default)]
struct Log {
    /// For each time that it was opened, the number of the frame after which it continued.
    opened: Arc<Mutex<Vec<Option<u64>>>>,
    /// The frames that it took.
    taken: Arc<AtomicU64>,
}

impl Log {
    fn taken(&self) -> u64 {
        self.taken.load(Ordering::Relaxed)
    }

    fn opened(&self) -> Vec<Option<u64>> {
        self.opened.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn opener(&self) -> Opener<'static> {
        let log = self.clone();
        Box::new(move |after| {
            log.opened.lock().unwrap_or_else(PoisonError::into_inner).push(after.map(|stamp| stamp.id));
            Ok(Box::new(Rig::open(after, &log.taken)))
        })
    }
}

fn request(index: u16) -> CaptureRequest {
    // Two takes of each frame, and repeated frames.
    let levels = (0..8).map(|pixel| (index / 2 % 5 * 8 + pixel) % 256).collect();
    let frame = Arc::new(Frame::new(SIZE, 1, levels).expect("eight levels"));
    CaptureRequest { frame, exposure: 0.1 / 3.0, take: u32::from(index % 2 + index / 10 * 2) }
}

fn resume(folder: &Path, log: &Log) -> JournaledFrames<'static> {
    let journal = Journal::resume(folder, &identity()).expect("it can be opened");
    JournaledFrames::new(journal, log.opener()).expect("it is of this rig")
}

/// The frames of a run of `count` requests.
fn run(folder: &Path, log: &Log, count: u16) -> Vec<RawFrame> {
    let mut frames = resume(folder, log);
    (0..count).map(|index| frames.capture(&request(index)).expect("the rig works")).collect()
}

const COUNT: u16 = 12;

#[test]
fn a_finished_run_is_repeated_without_the_rig() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = Log::default();
    let first = run(folder.path(), &log, COUNT);
    assert_eq!((log.taken(), log.opened()), (12, vec![None]));

    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let mut replay = JournaledFrames::replay(journal).expect("it knows its devices");
    let rig = Rig::open(None, &log.taken);
    assert_eq!((replay.projector(), replay.camera()), (rig.projector(), rig.camera()));
    for (index, frame) in (0..COUNT).zip(&first) {
        assert_eq!(&replay.capture(&request(index)).expect("it is there"), frame);
    }
    assert_eq!(replay.effort(), Effort { replayed: 12, ..Effort::default() });
    assert_eq!((replay.past().taken, replay.past().dropped), (12, 2));

    let error = replay.capture(&request(COUNT)).expect_err("it was never taken").to_string();
    assert!(error.contains("take 2") && error.contains("krylux VERB rig.toml --resume -o"), "{error}");
    let other = CaptureRequest { exposure: 0.2, ..request(0) };
    assert!(replay.capture(&other).expect_err("it was never taken").to_string().contains("at 0.2 s"));

    let pairs: Vec<_> = replay.pairs().collect::<Result<_>>().expect("it can be read");
    let taken: Vec<_> = pairs.into_iter().map(|pair| (pair.shot, pair.seen)).collect();
    let expected = (0..COUNT).map(request).zip(first);
    assert_eq!(taken, expected.collect::<Vec<_>>());
}

#[test]
fn a_run_that_was_cut_off_anywhere_continues_without_a_difference() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let first = run(folder.path(), &Log::default(), COUNT);
    let bytes = fs::read(file(folder.path())).expect("it is there");
    let header = Journal::read_only(folder.path()).expect("it is whole").entries()[0].offset as usize;
    for length in (header..=bytes.len()).step_by(67) {
        fs::write(file(folder.path()), &bytes[..length]).expect("there is room");
        let there = Journal::read_only(folder.path()).expect("its header is whole").photos() as u64;
        let log = Log::default();
        assert_eq!(run(folder.path(), &log, COUNT), first, "{length} bytes");
        assert_eq!(log.taken(), 12 - there, "{length} bytes");
        let journal = Journal::read_only(folder.path()).expect("it is whole");
        let keys = journal.entries().iter().filter(|entry| entry.kind == Kind::Photo).count();
        assert_eq!((keys, journal.photos()), (12, 12));
    }
}

#[test]
fn only_a_damaged_photo_is_taken_again_and_it_is_the_same() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let first = run(folder.path(), &Log::default(), COUNT);
    let bytes = fs::read(file(folder.path())).expect("it is there");
    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let photos: Vec<bool> = journal.entries().iter().map(|entry| entry.kind == Kind::Photo).collect();
    let starts: Vec<usize> = journal.entries().iter().map(|entry| entry.offset as usize).collect();
    for at in (starts[0]..bytes.len()).step_by(53) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        fs::write(file(folder.path()), &damaged).expect("there is room");
        let is_photo = photos[starts.iter().rposition(|&start| start <= at).expect("it is in a record")];
        // The second run finds the journal repaired.
        for again in [u64::from(is_photo), 0] {
            let log = Log::default();
            assert_eq!(run(folder.path(), &log, COUNT), first, "byte {at}");
            assert_eq!(log.taken(), again, "byte {at}");
        }
    }
}

#[test]
fn two_damaged_neighbours_are_taken_again_in_their_order() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let first = run(folder.path(), &Log::default(), COUNT);
    let bytes = fs::read(file(folder.path())).expect("it is there");
    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let photos: Vec<usize> = journal
        .entries()
        .iter()
        .filter(|entry| entry.kind == Kind::Photo)
        .map(|entry| entry.offset as usize)
        .collect();
    // In the marker, the key, the metadata, the counts.
    for (first_at, second_at) in [(0, 0), (0, 130), (30, 400), (600, 0), (600, 600), (130, 600)] {
        for index in 0..photos.len() - 1 {
            let mut damaged = bytes.clone();
            for (photo, at) in [(index, first_at), (index + 1, second_at)] {
                let end = photos.get(photo + 1).copied().unwrap_or(bytes.len());
                damaged[(photos[photo] + at).min(end - 1)] ^= 0x20;
            }
            fs::write(file(folder.path()), &damaged).expect("there is room");
            let log = Log::default();
            assert_eq!(run(folder.path(), &log, COUNT), first, "{first_at}, {second_at} of photo {index}");
            assert!(log.taken() <= 2);
        }
    }
}

#[test]
fn a_new_photo_is_taken_after_all_others() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    run(folder.path(), &Log::default(), COUNT);
    // One record is lost, and its photo is not requested again.
    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let third =
        journal.entries().iter().filter(|entry| entry.kind == Kind::Photo).nth(2).expect("of twelve").offset;
    drop(journal);
    let mut bytes = fs::read(file(folder.path())).expect("it is there");
    bytes[third as usize] ^= 1;
    fs::write(file(folder.path()), &bytes).expect("there is room");

    let log = Log::default();
    let mut frames = resume(folder.path(), &log);
    frames.capture(&request(7)).expect("it is there");
    frames.capture(&request(0)).expect("it is there");
    let new = frames.capture(&request(40)).expect("the rig works");
    drop(frames);
    let journal = Journal::read_only(folder.path()).expect("it is whole");
    let mut replay = JournaledFrames::replay(journal).expect("it knows its devices");
    let ids: Vec<u64> = replay.pairs().map(|pair| pair.expect("it can be read").seen.id).collect();
    assert_eq!(ids.len(), 12);
    assert!(ids.windows(2).all(|pair| pair[0] < pair[1]) && ids[11] == new.id, "no number twice: {ids:?}");
}

#[test]
fn another_rig_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    run(folder.path(), &Log::default(), 2);
    let taken = Arc::default();
    let opener: Opener<'static> = Box::new(move |after| {
        let mut rig = Rig::open(after, &taken);
        rig.camera.name = "another camera".into();
        Ok(Box::new(rig))
    });
    let journal = Journal::resume(folder.path(), &identity()).expect("it can be opened");
    let mut frames = JournaledFrames::new(journal, opener).expect("the rig is not needed yet");
    frames.capture(&request(0)).expect("it is there");
    let error = frames.capture(&request(2)).expect_err("another camera is attached").to_string();
    assert!(error.contains("another camera") && error.contains("test camera"), "{error}");
}

#[test]
fn metadata_of_more_than_a_megabyte_are_refused_and_the_journal_goes_on() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut journal = Journal::create(&folder.path().join("run"), &identity()).expect("it can be written");
    for (length, fits) in [((1 << 20) + 1, false), (1 << 20, true), (2 << 20, false)] {
        let key = journal.key(&[&[u8::from(fits)]]);
        let written = journal.append(Kind::Photo, key, &vec![7; length], b"counts");
        assert_eq!(written.is_ok(), fits, "{length}");
    }
    assert_eq!(journal.photos(), 1);
}
