//! The order in which the photos of a journal were taken, and the places of lost photos in it.

use std::collections::{BTreeMap, HashSet};

use super::photo::PhotoMetadata;
use crate::journal::{Journal, Key, Kind};
use crate::rig::Stamp;

/// The photos of a journal, ordered by the camera's frame number.
pub(crate) struct CaptureOrder {
    /// All photos whose stamp is known, including those whose content is damaged.
    photos: BTreeMap<u64, (Stamp, Key)>,
    /// The places where records were lost that may have been photos: the frame number before the gap (`None`
    /// at the beginning), and the one after it.
    gaps: Vec<(Option<u64>, u64)>,
}

impl CaptureOrder {
    pub(crate) fn of(journal: &Journal) -> Self {
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
            // A lost record at the end makes no gap: the next photo comes after it in any case.
            Some((from, later.map(|(_, stamp, _)| stamp.id).next()?))
        });
        let gaps = gaps.collect();
        Self { photos: photos.into_iter().map(|(_, stamp, key)| (stamp.id, (stamp, key))).collect(), gaps }
    }

    /// Adds a photo.
    pub(crate) fn insert(&mut self, stamp: Stamp, key: Key) {
        self.photos.insert(stamp.id, (stamp, key));
    }

    /// The keys in the order of the photos, each once.
    pub(crate) fn keys(&self) -> Vec<Key> {
        let mut seen = HashSet::new();
        self.photos.values().map(|(_, key)| *key).filter(|key| seen.insert(*key)).collect()
    }

    /// The key of the photo with this frame number.
    pub(crate) fn key(&self, id: u64) -> Option<Key> {
        self.photos.get(&id).map(|(_, key)| *key)
    }

    /// The stamp of the photo that was taken last.
    pub(crate) fn last(&self) -> Option<Stamp> {
        self.photos.values().next_back().map(|(stamp, _)| *stamp)
    }

    /// The place of a missing photo: the stamp of the photo before it, and the frame number that it must stay
    /// below. `last` is the photo that was returned last.
    ///
    /// A photo whose record is damaged but whose stamp is known comes after the photo before it. If `last` is
    /// followed by a gap, the missing photo is assumed to be the one that was lost there, because a repeated
    /// run asks for its photos in the order in which they were taken. Any other photo is new and comes after
    /// all others.
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
