//! Journaled raw frames: each frame is written to disk before it is used, and never taken twice.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

pub use super::journal_records::JournaledPhoto;
use super::journal_records::{self, PhotoMetadata};
use super::{CaptureRequest, Effort, FrameSource};
use crate::error::{Error, Result};
use crate::journal::{Damage, Journal, Key, Kind};
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame, Stamp};

/// Opens the rig. With a stamp, the session continues after the photo of that stamp. A virtual rig then has exactly the state that it had
/// after that photo.
pub type Opener<'a> = Box<dyn FnMut(Option<Stamp>) -> Result<Box<dyn FrameSource + 'a>> + Send + 'a>;

/// A frame source with a journal. A frame that the journal holds is read from the journal. Any other frame is taken by the rig, written to
/// the journal, and only then returned.
///
/// The rig is opened when the journal lacks a requested photo, so that a finished run can be repeated without the rig. A photo that was
/// lost to damage is taken again, with the rig in its state after the previous photo. The frames of a virtual rig are a function of their
/// number and time, so the new photo equals the lost photo bit for bit.
pub struct JournaledFrames<'a> {
    journal: Journal,
    opener: Option<Opener<'a>>,
    /// The open rig, and the stamp of its last photo.
    inner: Option<(Box<dyn FrameSource + 'a>, Option<Stamp>)>,
    projector: ProjectorInfo,
    camera: CameraInfo,
    settle: Option<f64>,
    order: CaptureOrder,
    /// The stamp of the photo that was returned last.
    last: Option<Stamp>,
    effort: Effort,
    report: Box<dyn FnMut(&Damage) + Send + 'a>,
}

const DEVICES: &str = "devices";

impl<'a> JournaledFrames<'a> {
    /// Continues a journal, new or old. With a new journal, the rig is opened at once to record its devices.
    ///
    /// # Errors
    /// [`Error::Rig`] when the rig cannot be opened or does not match the journal; [`Error::Journal`] when the journal cannot be read or
    /// written.
    pub fn new(mut journal: Journal, mut opener: Opener<'a>) -> Result<Self> {
        let known = journal.read_note(DEVICES)?;
        let (devices, inner) = match known {
            Some(known) => (known, None),
            None => {
                let after = CaptureOrder::of(&journal).last();
                let inner = opener(after)?;
                let devices = journal_records::encode_devices(inner.projector(), inner.camera());
                journal.note(DEVICES, &devices)?;
                (devices, Some((inner, after)))
            }
        };
        let journaled = Self::with(journal, &devices, Some(opener))?;
        Ok(Self { inner, ..journaled })
    }

    /// A source that returns only the frames of the journal, without a rig.
    ///
    /// # Errors
    /// [`Error::Journal`] when the journal does not name the devices of its photos.
    pub fn replay(mut journal: Journal) -> Result<Self> {
        match journal.read_note(DEVICES)? {
            Some(devices) => Self::with(journal, &devices, None),
            None => Err(Error::journal(
                journal.path(),
                "it does not say which projector and camera its photos come from",
            )
            .help("attach the rig, and go on with that run by the command that began it, and --resume")),
        }
    }

    fn with(journal: Journal, devices: &[u8], opener: Option<Opener<'a>>) -> Result<Self> {
        let (projector, camera) = journal_records::decode_devices(devices)
            .ok_or_else(|| journal_records::unknown_format(&journal, "the devices"))?;
        let (order, effort) = (CaptureOrder::of(&journal), Effort::default());
        Ok(Self {
            journal,
            opener,
            inner: None,
            projector,
            camera,
            settle: None,
            order,
            last: None,
            effort,
            report: Box::new(|_| {}),
        })
    }

    /// Calls `report` for each record that is found damaged when it is read.
    #[must_use]
    pub fn reporting(self, report: impl FnMut(&Damage) + Send + 'a) -> Self {
        Self { report: Box::new(report), ..self }
    }

    /// The journal.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// The costs of the run in all of its sessions, up to the last photo in the journal.
    pub fn past(&self) -> Effort {
        let notes = self.journal.entries().iter().filter_map(PhotoMetadata::of);
        notes.max_by_key(|note| note.id).map_or_else(Effort::default, |note| note.effort)
    }

    /// All photos in the journal with the frames that were shown, in the order in which they were taken. The iterator reads each photo when
    /// it is reached, and skips damaged photos.
    pub fn pairs(&mut self) -> impl Iterator<Item = Result<JournaledPhoto>> + '_ {
        let keys = self.order.keys();
        keys.into_iter().filter_map(|key| JournaledPhoto::read(&mut self.journal, key).transpose())
    }

    fn key(&self, request: &CaptureRequest, pattern: &[u8]) -> Key {
        let pattern = Journal::pattern_key(pattern);
        let exposure = request.exposure.to_bits().to_le_bytes();
        self.journal.key(&[b"raw frame", pattern.bytes(), &exposure, &request.take.to_le_bytes()])
    }

    fn replayed(&mut self, key: Key) -> Result<Option<RawFrame>> {
        let known = self.journal.damages().len();
        let stored = self.journal.get(key)?;
        self.journal.damages()[known..].iter().for_each(&mut self.report);
        let Some(stored) = stored else { return Ok(None) };
        let (note, frame) = journal_records::photo(&self.journal, &stored)?;
        self.last = Some(note.stamp());
        self.effort.replayed += 1;
        Ok(Some(frame))
    }

    fn repair_pattern(&mut self, pattern: &[u8]) -> Result<()> {
        let key = Journal::pattern_key(pattern);
        if self.journal.is_writable() && self.journal.get(key)?.is_none() {
            self.journal.keep_pattern(key, pattern)?;
        }
        Ok(())
    }

    /// Takes a photo with the rig in its state after the photo of stamp `after`.
    fn take(&mut self, request: &CaptureRequest, after: Option<Stamp>) -> Result<(RawFrame, Stamp)> {
        if self.inner.as_ref().is_none_or(|(_, stamp)| *stamp != after) {
            // The old rig is closed before the new rig is opened.
            if let Some((inner, _)) = self.inner.take() {
                self.effort = journal_records::sum(&self.effort, &inner.effort());
            }
            self.inner = Some((self.open(request, after)?, after));
        }
        let Some((inner, last)) = &mut self.inner else { return Err(self.missing(request)) };
        let frame = inner.capture(request)?;
        let stamp = Stamp::of(&frame);
        *last = Some(stamp);
        Ok((frame, stamp))
    }

    /// Opens the rig in its state after the photo of stamp `after`.
    fn open(&mut self, request: &CaptureRequest, after: Option<Stamp>) -> Result<Box<dyn FrameSource + 'a>> {
        let Some(opener) = &mut self.opener else { return Err(self.missing(request)) };
        let mut inner = opener(after)?;
        let found = journal_records::encode_devices(inner.projector(), inner.camera());
        if found != journal_records::encode_devices(&self.projector, &self.camera) {
            return Err(Error::rig(
                "rig",
                format!(
                    "its projector and camera ({}, {}) are not those of the journal ({}, {})",
                    inner.projector().name,
                    inner.camera().name,
                    self.projector.name,
                    self.camera.name
                ),
            )
            .help("attach the rig that the run was started with, or give another folder"));
        }
        if let Some(settle) = self.settle {
            inner.set_settle(settle);
        }
        let before = after.and_then(|stamp| self.order.key(stamp.id));
        if let Some(key) = before
            && let Some(pair) = JournaledPhoto::read(&mut self.journal, key)?
        {
            inner.follow(&pair.shot, &pair.seen)?;
        }
        Ok(inner)
    }

    fn missing(&self, request: &CaptureRequest) -> Error {
        let path = self.journal.path();
        let folder = path.parent().and_then(|journal| journal.parent()).unwrap_or(path);
        Error::not_taken(path, format!(
                "take {} at {} s of a frame with mean level {:.1} is not among its {} photos, and no rig is attached",
                request.take,
                request.exposure,
                mean(&request.frame),
                self.journal.photos()
            )).help(format!(
                "ask for no more photos than the run took (--photos), or attach the rig: krylux VERB rig.toml --resume -o {}",
                folder.display()
            ))
    }
}

impl FrameSource for JournaledFrames<'_> {
    fn projector(&self) -> &ProjectorInfo {
        &self.projector
    }

    fn camera(&self) -> &CameraInfo {
        &self.camera
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        let pattern = journal_records::encode_frame(&request.frame);
        let key = self.key(request, &pattern);
        if let Some(frame) = self.replayed(key)? {
            self.repair_pattern(&pattern)?;
            return Ok(frame);
        }
        let (after, before) = self.order.place(key, self.last);
        let (mut frame, mut stamp) = self.take(request, after)?;
        if before.is_some_and(|next| stamp.id >= next) {
            // The new frame number does not fit into the gap, so the new photo cannot replace the lost photo. The photo is taken once more,
            // after the last photo of the journal.
            (frame, stamp) = self.take(request, self.order.last())?;
        }
        frame.check()?;
        let pattern = self.journal.pattern(&pattern)?;
        let note = PhotoMetadata::new(request, pattern, &frame, self.effort());
        self.journal.append(Kind::Photo, key, &note.encode(), &journal_records::encode_counts(&frame))?;
        self.order.insert(stamp, key);
        self.last = Some(stamp);
        Ok(frame)
    }

    fn set_settle(&mut self, seconds: f64) {
        self.settle = Some(seconds);
        if let Some((inner, _)) = &mut self.inner {
            inner.set_settle(seconds);
        }
    }

    fn effort(&self) -> Effort {
        match &self.inner {
            Some((inner, _)) => journal_records::sum(&self.effort, &inner.effort()),
            None => self.effort,
        }
    }
}

fn mean(frame: &Arc<Frame>) -> f64 {
    let levels = frame.levels();
    levels.iter().map(|&level| f64::from(level)).sum::<f64>() / levels.len() as f64
}

/// The photos of a journal, ordered by the camera's frame number.
pub(crate) struct CaptureOrder {
    /// All photos with a known stamp, including those whose content is damaged.
    photos: BTreeMap<u64, (Stamp, Key)>,
    /// The places of lost records that may have been photos: the frame numbers before the gap (`None` at the beginning) and after it.
    gaps: Vec<(Option<u64>, u64)>,
}

impl CaptureOrder {
    pub(crate) fn of(journal: &Journal) -> Self {
        let photo = |entry| PhotoMetadata::of(entry).map(|note| (entry.offset, note.stamp(), entry.key));
        let photos: Vec<(u64, Stamp, Key)> = journal.entries().iter().filter_map(photo).collect();
        let lost = journal.damages().iter().filter(|damage| damage.entry.is_none());
        let gaps = lost.filter_map(|damage| {
            let before = photos.iter().rfind(|(offset, ..)| *offset < damage.offset);
            let from = before.map(|(_, stamp, _)| stamp.id);
            let later = photos.iter().filter(|(offset, stamp, _)| {
                *offset > damage.offset && from.is_none_or(|from| stamp.id > from)
            });
            // A lost record at the end does not make a gap, because the next photo comes after it in any case.
            Some((from, later.map(|(_, stamp, _)| stamp.id).next()?))
        });
        let gaps = gaps.collect();
        Self { photos: photos.into_iter().map(|(_, stamp, key)| (stamp.id, (stamp, key))).collect(), gaps }
    }

    pub(crate) fn insert(&mut self, stamp: Stamp, key: Key) {
        self.photos.insert(stamp.id, (stamp, key));
    }

    /// The keys in the order of the photos, each once.
    pub(crate) fn keys(&self) -> Vec<Key> {
        let mut seen = HashSet::new();
        self.photos.values().map(|(_, key)| *key).filter(|key| seen.insert(*key)).collect()
    }

    pub(crate) fn key(&self, id: u64) -> Option<Key> {
        self.photos.get(&id).map(|(_, key)| *key)
    }

    /// The stamp of the photo that was taken last.
    pub(crate) fn last(&self) -> Option<Stamp> {
        self.photos.values().next_back().map(|(stamp, _)| *stamp)
    }

    /// The place of a missing photo: the stamp of the photo before it, and an upper bound of the missing photo's frame number. `last` is
    /// the photo that was returned last.
    ///
    /// A damaged photo with a known stamp keeps its place after the photo before it. If `last` is followed by a gap, the missing photo is
    /// assumed to be the photo that was lost there, because a repeated run asks for its photos in the order in which they were taken. Any
    /// other photo is new and comes after all others.
    pub(crate) fn place(&self, key: Key, last: Option<Stamp>) -> (Option<Stamp>, Option<u64>) {
        let lost = self.photos.values().find(|(_, known)| *known == key).map(|(stamp, _)| stamp.id);
        if let Some(id) = lost {
            let before = self.photos.range(..id).next_back().map(|(_, (stamp, _))| *stamp);
            let after = self.photos.range(id + 1..).next().map(|(&id, _)| id);
            return (before, after);
        }
        let here = last.map(|stamp| stamp.id);
        let next = match here {
            Some(id) => self.photos.range(id + 1..).next(),
            None => self.photos.iter().next(),
        };
        let next = next.map(|(&id, _)| id);
        let in_gap = self.gaps.iter().any(|&(from, to)| from <= here && Some(to) == next);
        if in_gap { (last, next) } else { (self.last(), None) }
    }
}
