//! What the leader tells the other processes, and how they answer.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::render::{StartPixels, TraceSettings};
use crate::scene::Scene;
use crate::team::Comm;
use crate::transport::Channels;
use crate::transport::matrix::Product;
use crate::transport::wire::Garbled;

/// A command about an object: a scene, or the rows of a matrix.
#[derive(Serialize, Deserialize)]
pub(super) enum Command {
    /// Moves this scene to the device whose name contains `adapter`. The answer is an [`crate::render::AdapterSummary`].
    Open { scene: Box<Scene>, adapter: Option<String> },
    /// Traces the paths of each range of pixels of a scene that the leader asks for.
    Trace { settings: TraceSettings },
    /// Assembles rows of the matrix of a scene: `pixels` has the rows of each process, by rank.
    Assemble {
        scene: u64,
        settings: TraceSettings,
        channels: Channels,
        split: bool,
        pixels: Vec<StartPixels>,
    },
    /// Multiplies the own rows of a matrix with a vector, or with four interleaved ones, which follow.
    Multiply { product: Product, interleaved: bool },
    /// Makes the own rows of the transpose.
    Transpose,
    /// Sends the own rows of a layer.
    Rows { layer: usize },
    /// Adds the squares of the own entries of a layer to a sum, which follows.
    Squares { layer: usize, channel: usize },
}

impl Command {
    pub(super) fn to_bytes(&self) -> Result<Vec<u8>> {
        to_bytes(self)
    }
}

/// The bytes of a value, for another process of the same program.
pub(super) fn to_bytes<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    postcard::to_allocvec(value).map_err(|error| Error::Team {
        fault: format!("something cannot be sent to the other processes: {error}"),
        help: "give file names in UTF-8".into(),
    })
}

/// The value of these bytes.
pub(super) fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    postcard::from_bytes(bytes).map_err(|error| garbled(&error.to_string()))
}

/// The error for a message that cannot be read.
pub(super) fn garbled(why: &str) -> Error {
    Error::Team {
        fault: format!("a message of another process cannot be read ({why})"),
        help: "start the same program on every machine; if it is, this is a fault in krylux".into(),
    }
}

/// As [`garbled`], for arrays.
pub(super) fn unread(Garbled(why): Garbled) -> Error {
    garbled(&why)
}

/// Sends an answer to the leader: a value, or why there is none.
pub(super) fn answer<T: Serialize>(comm: &dyn Comm, answer: std::result::Result<T, impl ToString>) {
    let answer = answer.map_err(|error| error.to_string());
    // An answer has no file names, so that it can be sent.
    comm.send(0, &to_bytes(&answer).unwrap_or_default());
}

/// The answer of process `rank`.
pub(super) fn read_answer<T: DeserializeOwned>(rank: usize, bytes: &[u8]) -> Result<T> {
    let answer: std::result::Result<T, String> = from_bytes(bytes)?;
    answer.map_err(|why| {
        let (fault, help) =
            why.split_once("\n  help: ").unwrap_or((&why, "look at the machine that it runs on"));
        Error::Team { fault: format!("process {rank}: {fault}"), help: help.into() }
    })
}
