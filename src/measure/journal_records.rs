//! The records of a journal: raw frames, patterns and devices as bytes.
//!
//! The metadata is JSON. In this JSON, 64-bit floating-point numbers are strings: the shortest decimals that read back as the same bits.

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::{CaptureRequest, Effort};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::journal::{Entry, Journal, Key, Kind, Stored};
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame, Stamp};

/// The metadata of a photo, which is stored beside its counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PhotoMetadata {
    /// The key of the frame that was shown.
    pattern: String,
    take: u32,
    #[serde(with = "exact")]
    asked_exposure: f64,
    #[serde(with = "exact")]
    exposure: f64,
    resolution: Resolution,
    channels: usize,
    pub(crate) id: u64,
    #[serde(with = "exact")]
    started: f64,
    /// The time of the photo, in seconds since 1970.
    at: u64,
    /// The costs of the session up to this photo.
    pub(crate) effort: Effort,
}

impl PhotoMetadata {
    pub(crate) fn new(request: &CaptureRequest, pattern: Key, frame: &RawFrame, effort: Effort) -> Self {
        Self {
            pattern: pattern.to_string(),
            take: request.take,
            asked_exposure: request.exposure,
            exposure: frame.exposure,
            resolution: frame.resolution,
            channels: frame.channels,
            id: frame.id,
            started: frame.started,
            at: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
            effort,
        }
    }

    pub(crate) fn of(entry: &Entry) -> Option<Self> {
        (entry.kind == Kind::Photo).then(|| Self::parse(&entry.metadata)).flatten()
    }

    pub(crate) fn parse(metadata: &[u8]) -> Option<Self> {
        serde_json::from_slice(metadata).ok()
    }

    pub(crate) fn encode(&self) -> Vec<u8> {
        // Strings, integers and finite numbers can always be written as JSON.
        serde_json::to_vec(self).unwrap_or_default()
    }

    pub(crate) fn stamp(&self) -> Stamp {
        Stamp { id: self.id, time: self.started + self.exposure }
    }

    pub(crate) fn frame(&self, payload: &[u8]) -> Option<RawFrame> {
        let counts = integers(payload)?;
        let frame = RawFrame {
            resolution: self.resolution,
            channels: self.channels,
            counts,
            exposure: self.exposure,
            id: self.id,
            started: self.started,
        };
        frame.check().is_ok().then_some(frame)
    }
}

/// A photo in a journal: the request and the camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct JournaledPhoto {
    /// The frame on the projector, and how it was photographed.
    pub shot: CaptureRequest,
    /// The frame of the camera.
    pub seen: RawFrame,
}

impl JournaledPhoto {
    /// Reads the photo with this key. The result is `None` when its record or the record of its pattern is damaged.
    pub(crate) fn read(journal: &mut Journal, key: Key) -> Result<Option<Self>> {
        let Some(stored) = journal.get(key)? else { return Ok(None) };
        let (note, seen) = photo(journal, &stored)?;
        let pattern = Key::from_hex(&note.pattern).ok_or_else(|| unknown_format(journal, "a photo"))?;
        let Some(pattern) = journal.get(pattern)? else { return Ok(None) };
        let shown = decode_frame(&pattern.payload).ok_or_else(|| unknown_format(journal, "a pattern"))?;
        let shot = CaptureRequest { frame: Arc::new(shown), exposure: note.asked_exposure, take: note.take };
        Ok(Some(Self { shot, seen }))
    }
}

/// The metadata and the frame of a photo's record.
pub(crate) fn photo(journal: &Journal, stored: &Stored) -> Result<(PhotoMetadata, RawFrame)> {
    let note = PhotoMetadata::parse(&stored.metadata);
    let photo = note.and_then(|note| note.frame(&stored.payload).map(|frame| (note, frame)));
    photo.ok_or_else(|| unknown_format(journal, "a photo"))
}

/// The error for a record that is intact but not in the format of this version.
pub(crate) fn unknown_format(journal: &Journal, what: &str) -> Error {
    Error::journal(
        journal.path(),
        format!("the record of {what} is intact, but this version does not know its format"),
    )
    .help("open it with the version of krylux that wrote it")
}

/// Encodes a frame: width, height and channels as 64-bit integers, then the levels as 16-bit integers.
pub(crate) fn encode_frame(frame: &Frame) -> Vec<u8> {
    let Resolution { width, height } = frame.resolution();
    let shape = [width as u64, height as u64, frame.channels() as u64];
    let mut bytes: Vec<u8> = shape.iter().flat_map(|side| side.to_le_bytes()).collect();
    bytes.extend(frame.levels().iter().flat_map(|level| level.to_le_bytes()));
    bytes
}

fn decode_frame(bytes: &[u8]) -> Option<Frame> {
    let side = |index: usize| -> Option<usize> {
        let bytes = bytes.get(8 * index..8 * index + 8)?;
        u64::from_le_bytes(bytes.try_into().ok()?).try_into().ok()
    };
    let resolution = Resolution::new(side(0)?, side(1)?);
    Frame::new(resolution, side(2)?, integers(bytes.get(24..)?)?).ok()
}

pub(crate) fn encode_counts(frame: &RawFrame) -> Vec<u8> {
    frame.counts.iter().flat_map(|count| count.to_le_bytes()).collect()
}

fn integers(bytes: &[u8]) -> Option<Vec<u16>> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|&pair| u16::from_le_bytes(pair)).collect())
}

#[derive(Serialize, Deserialize)]
struct DeviceInfos {
    projector: ProjectorInfo,
    #[serde(with = "exact")]
    frame_time: f64,
    camera: CameraInfo,
    #[serde(with = "exact")]
    shortest_exposure: f64,
    #[serde(with = "exact")]
    longest_exposure: f64,
}

pub(crate) fn encode_devices(projector: &ProjectorInfo, camera: &CameraInfo) -> Vec<u8> {
    let [shortest_exposure, longest_exposure] = camera.exposures;
    let (projector, camera) = (projector.clone(), camera.clone());
    let frame_time = projector.frame_time;
    let devices = DeviceInfos { projector, frame_time, camera, shortest_exposure, longest_exposure };
    // Strings, integers and finite numbers can always be written as JSON.
    serde_json::to_vec(&devices).unwrap_or_default()
}

pub(crate) fn decode_devices(bytes: &[u8]) -> Option<(ProjectorInfo, CameraInfo)> {
    let devices: DeviceInfos = serde_json::from_slice(bytes).ok()?;
    let exposures = [devices.shortest_exposure, devices.longest_exposure];
    Some((
        ProjectorInfo { frame_time: devices.frame_time, ..devices.projector },
        CameraInfo { exposures, ..devices.camera },
    ))
}

/// The sum of the costs of two sessions. `seconds` is the larger of the two values, because the clock of the first session continues in the
/// second.
pub(crate) fn sum(first: &Effort, second: &Effort) -> Effort {
    Effort {
        shown: first.shown + second.shown,
        taken: first.taken + second.taken,
        replayed: first.replayed + second.replayed,
        dropped: first.dropped + second.dropped,
        repeated: first.repeated + second.repeated,
        late: first.late + second.late,
        restarts: first.restarts + second.restarts,
        resent: first.resent + second.resent,
        incomplete: first.incomplete + second.incomplete,
        missing: first.missing + second.missing,
        seconds: second.seconds.max(first.seconds),
        times: first.times + second.times,
    }
}

/// Numbers as strings: the shortest decimals that read back as the same bits.
mod exact {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(crate) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    /// The comparison is exact to the last bit, which JSON numbers may lose.
    #[test]
    fn devices_are_read_as_they_were_written() {
        let resolution = Resolution::new(8, 6);
        let projector =
            ProjectorInfo { name: "beamer".into(), resolution, channels: 3, bits: 8, frame_time: 1.0 / 3.0 };
        for step in 1..1000 {
            let exposures = [1e-4 / f64::from(step), f64::from(step).sqrt()];
            let camera = CameraInfo { name: "eye".into(), resolution, channels: 1, bits: 14, exposures };
            let found = decode_devices(&encode_devices(&projector, &camera));
            assert_eq!(found, Some((projector.clone(), camera)));
        }
    }
}
