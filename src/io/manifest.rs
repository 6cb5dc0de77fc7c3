//! `run.json`: how a run's results came about, written when it starts and again when it ends.

use std::path::Path;
use std::time::{Duration, SystemTime};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{atomic, clock};
use crate::error::{Error, Result};

/// The version of the record's own format.
pub const FORMAT: u32 = 1;

/// Everything that a run depended on, and what became of it. What does not apply (a rig has no samples) is absent.
///
/// `R` records what a run on a rig cost; the room that drives rigs defines it
/// ([`RigRecord`](crate::measure::RigRecord)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "R: Serialize + DeserializeOwned")]
pub struct Manifest<R> {
    /// [`FORMAT`].
    pub krylux_format: u32,
    /// The program's version.
    pub version: String,
    /// The command line, word by word.
    pub command: Vec<String>,
    /// Where the run stands.
    pub status: Status,
    /// The status as a sentence, e.g. `reached rtol` or the error's text.
    pub message: String,
    /// When it started, RFC 3339 in UTC.
    pub started: String,
    /// Seeds the random numbers of the tracer and of starting vectors.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub seed: Option<u64>,
    /// What traced the light.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub adapter: Option<Adapter>,
    /// What was photographed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scene: Option<Scene>,
    /// Size of patterns and photos.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub resolution: Option<crate::image::Resolution>,
    /// Light paths per camera pixel.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub samples_per_pixel: Option<u32>,
    /// Surface hits of a path at most.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub max_bounces: Option<u32>,
    /// `luma` or `rgb`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub channels: Option<String>,
    /// How far the matrix is from the true one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub noise: Option<Noise>,
    /// Where products with the matrix were taken.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub products: Option<ProductsOn>,
    /// What a run on a rig cost, and how its photos were made.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub rig: Option<R>,
    /// Photos that it was allowed to take, of its method: what another question asked of the same photos may count on.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub photos_allowed: Option<usize>,
    /// Photos taken.
    pub photos: u64,
    /// What took how long, in the order in which it happened.
    pub timings: Vec<Timing>,
    /// Files written, relative to the run's folder.
    pub outputs: Vec<String>,
}

/// Where a run stands. `running` in a record that nobody updates any more tells of a killed run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Started, not ended.
    Running,
    /// Ended by itself; the message says how well.
    Done,
    /// Stopped by the user; what was had until then is there.
    Interrupted,
    /// Stopped by an error, which is the message.
    Failed,
}

/// Where products were taken: the same to the rounding of sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProductsOn {
    /// On the processor.
    Cpu,
    /// On the adapter.
    Device,
}

/// The matrix's relative errors, told from two independent halves of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Of the whole matrix, in the Frobenius norm.
    pub operator: f64,
    /// The same, of the light of two bounces and more.
    pub global: f64,
    /// Of the photo under an all-ones pattern, as a root mean square.
    pub white: f64,
}

/// The graphics adapter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// Its driver, with the version.
    pub driver: String,
    /// The interface to it, e.g. `vulkan`.
    pub backend: String,
}

/// The scene, rig or matrix file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scene {
    /// As given on the command line.
    pub path: String,
    /// Of all bytes that it consists of, hexadecimal.
    pub hash: String,
}

/// A stage of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// What was done.
    pub name: String,
    /// Wall-clock time.
    pub seconds: f64,
}

impl<R: Serialize + DeserializeOwned> Manifest<R> {
    /// The record of a run that starts now, with the words of its command line.
    pub fn new(command: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self {
            krylux_format: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            command: command.into_iter().map(Into::into).collect(),
            status: Status::Running,
            message: "running".into(),
            started: clock::rfc3339(SystemTime::now()),
            seed: None,
            adapter: None,
            scene: None,
            resolution: None,
            samples_per_pixel: None,
            max_bounces: None,
            channels: None,
            noise: None,
            products: None,
            rig: None,
            photos_allowed: None,
            photos: 0,
            timings: Vec::new(),
            outputs: Vec::new(),
        }
    }

    /// Notes how long a stage took.
    pub fn record(&mut self, name: impl Into<String>, took: Duration) {
        self.timings.push(Timing { name: name.into(), seconds: took.as_secs_f64() });
    }

    /// Notes how the run ended; [`Manifest::write`] it afterwards.
    pub fn finish(&mut self, status: Status, message: impl Into<String>) {
        self.status = status;
        self.message = message.into();
    }

    /// Writes the record, whole: a reader finds the old one or the new.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text =
            serde_json::to_string_pretty(self).map_err(|error| Error::writing(path)(error.into()))?;
        text.push('\n');
        atomic::write_bytes(path, text.as_bytes())
    }

    /// Reads a record back.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Data`] when it is no such record.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(Error::reading(path))?;
        let unusable = |fault: String| Error::Data {
            path: path.to_path_buf(),
            fault,
            help: "give the run.json of a krylux run".into(),
        };
        let manifest: Self = serde_json::from_slice(&bytes).map_err(|error| unusable(error.to_string()))?;
        match manifest.krylux_format {
            FORMAT => Ok(manifest),
            other => Err(unusable(format!("its format is {other}, but this krylux knows {FORMAT}"))),
        }
    }
}
