//! In which order photos were taken, and where a lost one stood.

use std::collections::{BTreeMap, HashSet};

use super::photo::PhotoMetadata;
use crate::journal::{Journal, Key, Kind};
use crate::rig::Stamp;

/// The photos of a journal by the camera's number.
pub(super) struct CaptureOrder {
    /// All whose stamp is known, also those whose content is damaged.
    photos: BTreeMap<u64, (Stamp, Key)>,
    /// Where records of unknown kind are lost: after which number, and before which.
    gaps: Vec<(Option<u64>, u64)>,
}

impl CaptureOrder {
    pub(super) fn of(journal: &Journal) -> Self {
        let note = |entry| PhotoMetadata::of(entry).map(|note| (note.stamp(), entry.key));
        let photos: Vec<(u64, Stamp, Key)> = journal
            .entries()
            .iter()
            .filter(|entry| entry.kind == Kind::Photo)
            .filter_map(|entry| note(entry).map(|(stamp, key)| (entry.offset, stamp, key)))
            .collect();
        let lost = journal.damages().iter().filter(|damage| damage.entry.is_none());
        let gaps = lost.filter_map(|damage| {
            let before = photos.iter().rfind(|(offset, ..)| *offset < damage.offset);
            let from = before.map(|(_, stamp, _)| stamp.id);
            let later = photos.iter().filter(|(offset, stamp, _)| {
                *offset > damage.offset && from.is_none_or(|from| stamp.id > from)
            });
            // What was taken last needs no gap: the next photo comes after it anyway.
            Some((from, later.map(|(_, stamp, _)| stamp.id).next()?))
        });
        let gaps = gaps.collect();
        Self { photos: photos.into_iter().map(|(_, stamp, key)| (stamp.id, (stamp, key))).collect(), gaps }
    }

    /// One photo more.
    pub(super) fn insert(&mut self, stamp: Stamp, key: Key) {
        self.photos.insert(stamp.id, (stamp, key));
    }

    /// The keys in order, each once.
    pub(super) fn keys(&self) -> Vec<Key> {
        let mut seen = HashSet::new();
        self.photos.values().map(|(_, key)| *key).filter(|key| seen.insert(*key)).collect()
    }

    /// The photo of this number.
    pub(super) fn key(&self, id: u64) -> Option<Key> {
        self.photos.get(&id).map(|(_, key)| *key)
    }

    /// The stamp of the photo taken last.
    pub(super) fn last(&self) -> Option<Stamp> {
        self.photos.values().next_back().map(|(stamp, _)| *stamp)
    }

    /// After which photo a missing one is to be taken, and which number it must stay below.
    ///
    /// One whose record is damaged but whose stamp is known comes after the photo before it. If the photo
    /// handed out last, `last`, is followed by a gap, it is taken for the one that is missing there: a run
    /// that is repeated asks for its photos in the order in which they were taken. Any other is new, and
    /// comes after all.
    pub(super) fn place(&self, key: Key, last: Option<Stamp>) -> (Option<Stamp>, Option<u64>) {
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
