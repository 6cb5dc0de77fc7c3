//! A writer whose first error is the last: what follows it is dropped in silence.

use std::io::{self, Seek, SeekFrom, Write};

/// Passes everything to `inner` until an operation fails. From then on operations succeed and do nothing: the crate `zip` finishes an archive
/// when it is dropped, even after an error that its caller knows of, and would print a second error on stderr.
pub(crate) struct FirstError<W> {
    inner: W,
    has_failed: bool,
}

impl<W> FirstError<W> {
    /// A writer on `inner`.
    pub(crate) fn new(inner: W) -> Self {
        Self { inner, has_failed: false }
    }

    /// The result of `work`, or `rest` after an error.
    fn unless_failed<T>(&mut self, rest: T, work: impl FnOnce(&mut W) -> io::Result<T>) -> io::Result<T> {
        if self.has_failed {
            return Ok(rest);
        }
        let done = work(&mut self.inner);
        self.has_failed = done.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        done
    }
}

impl<W: Write> Write for FirstError<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.unless_failed(bytes.len(), |inner| inner.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_failed((), Write::flush)
    }
}

impl<W: Seek> Seek for FirstError<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.unless_failed(0, |inner| inner.seek(to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_an_error_nothing_is_written_and_nothing_fails() {
        let mut writer = FirstError::new(io::Cursor::new(Vec::new()));
        assert!(writer.write_all(b"abc").is_ok() && writer.seek(SeekFrom::Start(1)).is_ok());
        assert_eq!(writer.inner.get_ref(), b"abc");
        let mut writer = FirstError::new(Refusing);
        assert!(
            FirstError::new(Refusing).flush().is_err()
                && FirstError::new(Refusing).seek(SeekFrom::End(0)).is_err()
        );
        assert!(writer.write(b"a").is_err());
        assert!(writer.write_all(b"b").is_ok() && writer.flush().is_ok());
        assert_eq!(writer.seek(SeekFrom::Start(7)).ok(), Some(0));
    }

    struct Refusing;

    impl Write for Refusing {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(io::ErrorKind::StorageFull.into())
        }
    }

    impl Seek for Refusing {
        fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
            Err(io::ErrorKind::StorageFull.into())
        }
    }
}
