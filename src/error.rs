//! The library's error type. A message names the file or the option, the expected value and the remedy.

use std::path::PathBuf;

/// A result with krylux's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Every error of the library. The variants say what the caller should check.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene file is malformed or uses an unsupported feature.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    Scene {
        /// The file at fault: the scene, or a buffer or picture that it refers to.
        path: PathBuf,
        /// The fault.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// A data file (pattern, image, matrix) is malformed or has the wrong shape.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    Data {
        /// The file at fault.
        path: PathBuf,
        /// The fault.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// An option's value cannot be used.
    #[error("{option}: {fault}\n  help: {help}")]
    Option {
        /// The option's name, such as `--size`.
        option: String,
        /// The fault of the value.
        fault: String,
        /// The remedy.
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
    /// There is no Vulkan adapter: neither the driver of a GPU nor a software driver is installed.
    #[error("no Vulkan adapter found{detail}\n  help: {help}")]
    NoAdapter {
        /// The requested adapter; may be empty.
        detail: String,
        /// The packages to install, or the adapters that exist.
        help: String,
    },
    /// The GPU device refused a request, ran out of memory or was lost.
    #[error("graphics device: {fault}\n  help: {help}")]
    Device {
        /// The fault.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// A projector or camera refused a request, returned no usable data, or was disconnected.
    #[error("{device}: {fault}\n  help: {help}")]
    Rig {
        /// The device as the rig file names it, such as `camera` or `projector`.
        device: String,
        /// The fault.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// A camera is saturated: some pixel has the highest count at every available exposure.
    #[error("{device}: {fault}\n  help: {help}")]
    Saturated {
        /// The camera as the rig file names it.
        device: String,
        /// The pixels and the exposure.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// A journal of photos cannot be read or written, is in use, or lacks a record. Its photos are unchanged.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    Journal {
        /// The file at fault.
        path: PathBuf,
        /// The fault.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// A finished run lacks a photo that only the devices or the scene could take.
    #[error("{}: {fault}\n  help: {help}", path.display())]
    NotTaken {
        /// The journal of the run.
        path: PathBuf,
        /// The missing photo.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// Some light paths never finished, so the photo would be wrong. A driver may stop a shader silently.
    #[error(
        "{unfinished} of {total} light paths never finished: the driver stopped them silently, and the photo would be wrong\n  help: {help}"
    )]
    UnfinishedPaths {
        /// Number of paths that did not finish.
        unfinished: u64,
        /// Number of paths traced.
        total: u64,
        /// The remedy.
        help: String,
    },
    /// Processes that work together cannot continue: one process lacks a resource, or differs from the other processes.
    #[error("{fault}\n  help: {help}")]
    Team {
        /// The process and its fault.
        fault: String,
        /// The remedy.
        help: String,
    },
    /// The user or an observer stopped the computation.
    #[error("interrupted")]
    Interrupted,
    /// A size differs from the required size.
    #[error("{what}: {expected} expected, but there are {found}")]
    Dimension {
        /// The quantity that was counted or measured.
        what: &'static str,
        /// The required size.
        expected: String,
        /// The actual size.
        found: String,
    },
    /// A numerical method cannot continue, for example because of NaN or a breakdown.
    #[error("{0}")]
    Numerical(String),
}

impl Error {
    /// [`Error::Scene`] about the file at `path`. [`Error::help`] adds the remedy.
    pub fn scene(path: impl Into<PathBuf>, fault: impl Into<String>) -> Self {
        Self::Scene { path: path.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::Data`] about the file at `path`. [`Error::help`] adds the remedy.
    pub fn data(path: impl Into<PathBuf>, fault: impl Into<String>) -> Self {
        Self::Data { path: path.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::Journal`] about the file at `path`. [`Error::help`] adds the remedy.
    pub fn journal(path: impl Into<PathBuf>, fault: impl Into<String>) -> Self {
        Self::Journal { path: path.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::NotTaken`] about a photo that the journal at `path` lacks. [`Error::help`] adds the remedy.
    pub fn not_taken(path: impl Into<PathBuf>, fault: impl Into<String>) -> Self {
        Self::NotTaken { path: path.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::Option`] about the value of `option`. [`Error::help`] adds the remedy.
    pub fn option(option: impl Into<String>, fault: impl Into<String>) -> Self {
        Self::Option { option: option.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::Rig`] about `device`. [`Error::help`] adds the remedy.
    pub fn rig(device: impl Into<String>, fault: impl Into<String>) -> Self {
        Self::Rig { device: device.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::Saturated`] about the camera `device`. [`Error::help`] adds the remedy.
    pub fn saturated(device: impl Into<String>, fault: impl Into<String>) -> Self {
        Self::Saturated { device: device.into(), fault: fault.into(), help: String::new() }
    }

    /// [`Error::Device`] about the graphics device. [`Error::help`] adds the remedy.
    pub fn device(fault: impl Into<String>) -> Self {
        Self::Device { fault: fault.into(), help: String::new() }
    }

    /// [`Error::Team`] about processes that work together. [`Error::help`] adds the remedy.
    pub fn team(fault: impl Into<String>) -> Self {
        Self::Team { fault: fault.into(), help: String::new() }
    }

    /// [`Error::Dimension`] about the size `found`, where the size `expected` is required.
    pub fn dimension(what: &'static str, expected: impl ToString, found: impl ToString) -> Self {
        Self::Dimension { what, expected: expected.to_string(), found: found.to_string() }
    }

    /// Adds a remedy to the error. An error that has no remedy stays as it is.
    #[must_use]
    pub fn help(mut self, remedy: impl Into<String>) -> Self {
        if let Self::Scene { help, .. }
        | Self::Data { help, .. }
        | Self::Option { help, .. }
        | Self::NoAdapter { help, .. }
        | Self::Device { help, .. }
        | Self::Rig { help, .. }
        | Self::Saturated { help, .. }
        | Self::Journal { help, .. }
        | Self::NotTaken { help, .. }
        | Self::UnfinishedPaths { help, .. }
        | Self::Team { help, .. } = &mut self
        {
            *help = remedy.into();
        }
        self
    }

    /// A function for `map_err` that makes [`Error::Read`] for the file at `path`.
    pub fn reading(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |reason| Self::Read { path, reason }
    }

    /// A function for `map_err` that makes [`Error::Write`] for the file at `path`.
    pub fn writing(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |reason| Self::Write { path, reason }
    }

    /// Fails with [`Error::Dimension`] unless the size `found` equals the size `expected`. `what` names the quantity.
    pub fn check_size<T: PartialEq + ToString>(what: &'static str, expected: T, found: T) -> Result<()> {
        if expected == found {
            return Ok(());
        }
        Err(Self::dimension(what, expected, found))
    }
}
