//! The library's one error type. Each message names the file or the option, says what was expected, and what to do.

use std::path::PathBuf;

/// A result with krylux's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong, by what the caller should check.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene file is malformed or asks for something that is not supported.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    Scene {
        /// The file at fault (the scene, or a buffer or picture that it names).
        path: PathBuf,
        /// What is wrong with it.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// A data file (pattern, image, matrix) is malformed or of the wrong shape.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    Data {
        /// The file at fault.
        path: PathBuf,
        /// What is wrong with it.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// An option's value cannot be used.
    #[error("{option}: {fault}\n  help: {help}")]
    Option {
        /// The option as the caller knows it, e.g. `--size`.
        option: String,
        /// What is wrong with its value.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// No Vulkan adapter: neither a GPU's driver nor the software one is installed.
    #[error("no Vulkan adapter found{detail}\n  help: {help}")]
    NoAdapter {
        /// What was looked for, or empty.
        detail: String,
        /// What to install, or which adapters there are.
        help: String,
    },
    /// The graphics device refused a request, ran out of memory or was lost.
    #[error("graphics device: {fault}\n  help: {help}")]
    Device {
        /// What happened.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// A projector or camera refused a request, gave nothing usable, or is gone.
    #[error("{device}: {fault}\n  help: {help}")]
    Rig {
        /// The device as the rig file names it, e.g. `camera` or `projector`.
        device: String,
        /// What happened.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// A camera counts no further: some pixel is at its highest count in every exposure that it can be given.
    #[error("{device}: {fault}\n  help: {help}")]
    Saturated {
        /// The camera as the rig file names it.
        device: String,
        /// Which pixels, at which exposure.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// A journal of photos cannot be read or written, is in use, or lacks what is asked of it. Photos in it stay as they are.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    Journal {
        /// The file at fault.
        path: PathBuf,
        /// What happened.
        fault: String,
        /// What to do about it.
        help: String,
    },
    /// The tracer's canary: a path did not report that it finished, so its photo would be wrong.
    #[error(
        "{unfinished} of {total} light paths never finished: the driver stopped them silently, and the photo would be wrong\n  help: lower --max-bounces, or use another --adapter"
    )]
    UnfinishedPaths {
        /// Paths without the mark of completion.
        unfinished: u64,
        /// Paths traced.
        total: u64,
    },
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// Two things that must agree in size do not.
    #[error("{what}: {expected} expected, but there are {found}")]
    Dimension {
        /// What was being matched.
        what: &'static str,
        /// The size that fits.
        expected: String,
        /// The size that came.
        found: String,
    },
    /// A numerical method was given, or met, something that it cannot work with (NaN, a breakdown without way out).
    #[error("{0}")]
    Numerical(String),
}

impl Error {
    /// A function for `map_err` that names the file which could not be read.
    pub fn reading(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |reason| Self::Read { path, reason }
    }

    /// A function for `map_err` that names the file which could not be written.
    pub fn writing(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |reason| Self::Write { path, reason }
    }
}
