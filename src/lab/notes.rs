//! The names in a run's journal, and the notes in it beside the photos.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::image::Resolution;
use crate::io::name;
use crate::transport::Part;

/// The names of a journal's notes.
pub(super) const SOURCE: &str = "source";
pub(super) const RIG_FILE: &str = "rig file";
pub(super) const TRUTH: &str = "truth";
pub(super) const DIRECT: &str = "direct light";
pub(super) const NOISE: &str = "noise of products";
/// In the journal of a run whose vectors were on a device.
pub(super) const ON_DEVICE: &str = "vectors on a device";

pub(super) fn product_name(part: Part, channel: usize) -> String {
    format!("{part:?}, channel {channel}")
}

/// The source of a journal's photos.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SourceNote {
    pub(super) kind: Kind,
    pub(super) name: String,
    #[serde(with = "name")]
    pub(super) path: PathBuf,
    pub(super) hash: String,
    pub(super) photos: Resolution,
    pub(super) patterns: Resolution,
    pub(super) symmetric: bool,
    pub(super) channels: usize,
}

/// The kind of source that gave the photos.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    Scene,
    Rig,
}

impl Kind {
    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Scene => "W/(m² sr)",
            Self::Rig => "DN/s",
        }
    }
}
