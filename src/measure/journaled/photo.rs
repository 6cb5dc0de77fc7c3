//! Raw frames, patterns and devices as bytes.
//!
//! Numbers of 64-bit precision are texts in the JSON, the shortest that reads back as the same bits.

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::journal::{Entry, Journal, Key, Kind};
use crate::measure::{CaptureRequest, Effort};
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame, Stamp};

/// What stands beside a photo's counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PhotoMetadata {
    /// The key of the frame that was shown.
    pattern: String,
    take: u32,
    #[serde(with = "exact")]
    asked_exposure: f64,
    #[serde(with = "exact")]
    exposure: f64,
    resolution: Resolution,
    channels: usize,
    pub(super) id: u64,
    #[serde(with = "exact")]
    started: f64,
    /// The wall's, in seconds since 1970.
    at: u64,
    /// What the session had cost by then.
    pub(super) effort: Effort,
}

impl PhotoMetadata {
    pub(super) fn new(request: &CaptureRequest, pattern: Key, frame: &RawFrame, effort: Effort) -> Self {
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

    pub(super) fn of(entry: &Entry) -> Option<Self> {
        (entry.kind == Kind::Photo).then(|| Self::parse(&entry.metadata)).flatten()
    }

    pub(super) fn parse(metadata: &[u8]) -> Option<Self> {
        serde_json::from_slice(metadata).ok()
    }

    pub(super) fn encode(&self) -> Vec<u8> {
        // Texts, integers and finite numbers always have a JSON form.
        serde_json::to_vec(self).unwrap_or_default()
    }

    pub(super) fn stamp(&self) -> Stamp {
        Stamp { id: self.id, time: self.started + self.exposure }
    }

    pub(super) fn frame(&self, payload: &[u8]) -> Option<RawFrame> {
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

/// What was shown, and what was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct JournaledPhoto {
    /// The frame on the projector, and how it was to be photographed.
    pub shot: CaptureRequest,
    /// The camera's frame.
    pub seen: RawFrame,
}

impl JournaledPhoto {
    /// None when either is damaged.
    pub(super) fn read(journal: &mut Journal, key: Key) -> Result<Option<Self>> {
        let Some(stored) = journal.get(key)? else { return Ok(None) };
        let note =
            PhotoMetadata::parse(&stored.metadata).ok_or_else(|| unknown_format(journal, "a photo"))?;
        let seen = note.frame(&stored.payload).ok_or_else(|| unknown_format(journal, "a photo"))?;
        let pattern = Key::from_hex(&note.pattern).ok_or_else(|| unknown_format(journal, "a photo"))?;
        let Some(pattern) = journal.get(pattern)? else { return Ok(None) };
        let shown = decode_frame(&pattern.payload).ok_or_else(|| unknown_format(journal, "a pattern"))?;
        let shot = CaptureRequest { frame: Arc::new(shown), exposure: note.asked_exposure, take: note.take };
        Ok(Some(Self { shot, seen }))
    }
}

/// A record is whole, but not in this version's form.
pub(super) fn unknown_format(journal: &Journal, what: &str) -> Error {
    Error::Journal {
        path: journal.path().into(),
        fault: format!("the record of {what} is whole, but not in a form that this version knows"),
        help: "open it with the version of krylux that wrote it".into(),
    }
}

/// Width, height and channels, and then the levels.
pub(super) fn encode_frame(frame: &Frame) -> Vec<u8> {
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

pub(super) fn encode_counts(frame: &RawFrame) -> Vec<u8> {
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

pub(super) fn encode_devices(projector: &ProjectorInfo, camera: &CameraInfo) -> Vec<u8> {
    let [shortest_exposure, longest_exposure] = camera.exposures;
    let (projector, camera) = (projector.clone(), camera.clone());
    let frame_time = projector.frame_time;
    let devices = DeviceInfos { projector, frame_time, camera, shortest_exposure, longest_exposure };
    // As for a note.
    serde_json::to_vec(&devices).unwrap_or_default()
}

pub(super) fn decode_devices(bytes: &[u8]) -> Option<(ProjectorInfo, CameraInfo)> {
    let devices: DeviceInfos = serde_json::from_slice(bytes).ok()?;
    let exposures = [devices.shortest_exposure, devices.longest_exposure];
    Some((
        ProjectorInfo { frame_time: devices.frame_time, ..devices.projector },
        CameraInfo { exposures, ..devices.camera },
    ))
}

/// What two sessions have cost together; the clock is the later one's.
pub(super) fn sum(first: &Effort, second: &Effort) -> Effort {
    Effort {
        shown: first.shown + second.shown,
        taken: first.taken + second.taken,
        replayed: first.replayed + second.replayed,
        dropped: first.dropped + second.dropped,
        repeated: first.repeated + second.repeated,
        late: first.late + second.late,
        restarts: first.restarts + second.restarts,
        resent: first.resent + second.resent,
        seconds: second.seconds.max(first.seconds),
        times: first.times + second.times,
    }
}

mod exact {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}
