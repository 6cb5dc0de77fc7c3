//! A camera that another program has open, which every kind of camera reports in its own way.

use std::error::Error as Why;
use std::io::{self, ErrorKind};

use super::camera_fault;
use crate::error::Error;

/// Words by which libraries say so whose errors have no code for it: nusb ("interface is busy") and gphoto2 ("Could not claim the USB device").
const WORDS: [&str; 3] = ["is busy", "resource busy", "could not claim"];

/// An error, what caused it, and so on.
pub(super) fn causes<'a>(why: &'a (dyn Why + 'static)) -> impl Iterator<Item = &'a (dyn Why + 'static)> {
    let mut next = Some(why);
    std::iter::from_fn(move || {
        let why = next?;
        next = why.source();
        Some(why)
    })
}

/// Whether an error, or what caused it, says that another program has the device open.
pub(super) fn is_busy(why: &(dyn Why + 'static)) -> bool {
    causes(why).any(|why| {
        let text = why.to_string().to_lowercase();
        let code = why.downcast_ref::<io::Error>().map(io::Error::kind);
        code == Some(ErrorKind::ResourceBusy) || WORDS.iter().any(|words| text.contains(words))
    })
}

/// The error of such a camera. `place` is e.g. `at 192.168.1.20`.
pub(super) fn in_use(place: &str) -> Error {
    camera_fault(
        format!("the camera {place} is in use by another program"),
        "end that program: the maker's viewer, a video call, a desktop that has mounted the camera, another krylux; after a crash the camera is free \
         again in a few seconds",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error with a cause.
    #[derive(Debug, thiserror::Error)]
    #[error("claim the control interface (0)")]
    struct Caused(#[source] io::Error);

    #[test]
    fn a_busy_device_is_known_by_its_code_or_by_words_of_the_cause() {
        let busy = |why: io::Error| is_busy(&Caused(why));
        assert!(busy(ErrorKind::ResourceBusy.into()));
        assert!(busy(io::Error::other("interface is busy (error 16)")));
        assert!(busy(io::Error::other(
            "*** Error ***\nAn error occurred in the io-library ('Could not claim the USB device'): …"
        )));
        for kind in [ErrorKind::TimedOut, ErrorKind::PermissionDenied, ErrorKind::NotFound] {
            assert!(!busy(kind.into()), "{kind}");
        }
        #[cfg(target_os = "linux")]
        assert!(busy(io::Error::from_raw_os_error(16)), "EBUSY");
    }
}
