//! Errors of krylux as exceptions of Python.

use krylux::Error;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception for an error. It is a class of `krylux.errors`, whose attributes name the object to check.
pub(crate) fn raise(py: Python<'_>, error: &Error) -> PyErr {
    let path = |path: &std::path::Path| Some(("path", path.display().to_string()));
    let device = |device: &String| Some(("device", device.clone()));
    let (class, about) = match error {
        Error::Scene { path: of, .. } => ("SceneError", path(of)),
        Error::Data { path: of, .. } => ("DataError", path(of)),
        Error::Option { option, .. } => ("OptionError", Some(("option", in_python(option)))),
        Error::Read { path: of, .. } => ("ReadError", path(of)),
        Error::Write { path: of, .. } => ("WriteError", path(of)),
        Error::NoAdapter { .. } => ("NoAdapterError", None),
        Error::Device { .. } => ("DeviceError", None),
        Error::Rig { device: of, .. } => ("RigError", device(of)),
        Error::Saturated { device: of, .. } => ("SaturatedError", device(of)),
        Error::Journal { path: of, .. } | Error::NotTaken { path: of, .. } => ("JournalError", path(of)),
        Error::UnfinishedPaths { .. } => ("UnfinishedPathsError", None),
        Error::Interrupted => ("Interrupted", None),
        Error::Dimension { what, .. } => ("DimensionError", Some(("what", (*what).to_owned()))),
        Error::Numerical(_) => ("NumericalError", None),
        _ => ("Error", None),
    };
    make(py, class, &in_python(&error.to_string()), about)
}

/// The exception for a wrong argument of a function in this package.
pub(crate) fn option(py: Python<'_>, option: &str, fault: &str, help: &str) -> PyErr {
    let error = Error::option(option, fault).help(help);
    raise(py, &error)
}

/// The exception for a panic, which is a fault of krylux.
pub(crate) fn internal(py: Python<'_>, reason: &str) -> PyErr {
    let help = "please report it with the lines that led here; nothing else in this process is affected";
    make(py, "InternalError", &format!("krylux failed: {reason}\n  help: {help}"), None)
}

/// The exception for the use of a closed laboratory.
pub(crate) fn closed(py: Python<'_>) -> PyErr {
    make(py, "ClosedError", "the laboratory is closed\n  help: open the source again", None)
}

/// The exception for the use of a laboratory in a process that was forked after the laboratory was opened.
pub(crate) fn forked(py: Python<'_>) -> PyErr {
    let fault =
        "the laboratory was opened before this process was forked: devices and threads stay with the parent";
    let help = "open the source in the child, or start processes by multiprocessing's `spawn`";
    make(py, "ForkedError", &format!("{fault}\n  help: {help}"), None)
}

fn make(py: Python<'_>, class: &str, text: &str, about: Option<(&str, String)>) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let attributes = PyDict::new(py);
        if let Some((name, value)) = about {
            attributes.set_item(name, value)?;
        }
        attributes.set_item("help", text.split_once("\n  help: ").map(|(_, help)| help))?;
        let class = py.import("krylux.errors")?.getattr(class)?;
        Ok(PyErr::from_value(class.call((text,), Some(&attributes))?))
    };
    made().unwrap_or_else(|error| error)
}

/// A text in which command line options are replaced by Python arguments: `--max-bounces` becomes `max_bounces`.
pub(crate) fn in_python(text: &str) -> String {
    let named = match text {
        "-o" => return "folder".into(),
        "SOURCE" | "RIG" => return "source".into(),
        text => text.strip_prefix("-o: ").map(|rest| format!("folder: {rest}")),
    };
    let text = named.unwrap_or_else(|| text.to_owned());
    let text = text.strip_prefix("SOURCE: ").map(|rest| format!("source: {rest}")).unwrap_or(text);
    let mut parts = text.split("--");
    let mut found = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(part.len());
        let (option, rest) = part.split_at(end);
        if option.is_empty() {
            found.push_str("--");
        }
        found.push_str(&option.replace('-', "_"));
        found.push_str(rest);
    }
    found
}
