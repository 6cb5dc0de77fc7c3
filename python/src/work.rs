//! Calls into krylux: without the interpreter's lock, with signals and exceptions of Python in their place.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use krylux::Error;
use pyo3::prelude::*;

use crate::errors;

thread_local! {
    /// The exception that Python code raised during the call that runs on this thread: code of a camera, of a callback, of a signal.
    static CAUGHT: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Keeps an exception until the call that runs on this thread ends: krylux itself knows only its own errors.
pub(crate) fn keep(error: PyErr) {
    CAUGHT.with(|caught| {
        caught.borrow_mut().get_or_insert(error);
    });
}

/// Whether an exception waits for the end of the call on this thread.
pub(crate) fn has_caught() -> bool {
    CAUGHT.with(|caught| caught.borrow().is_some())
}

/// Runs `call` in Python. An exception is kept, and the error stands for it; so it does where the interpreter ends.
pub(crate) fn in_python<T>(call: impl FnOnce(Python<'_>) -> PyResult<T>) -> krylux::Result<T> {
    let done = Python::try_attach(call).ok_or(Error::Interrupted)?;
    done.map_err(|error| {
        keep(error);
        Error::Interrupted
    })
}

/// Runs `body` without the interpreter's lock. An exception that Python code raised in it comes out unchanged; an error of krylux comes
/// out as `krylux.Error`, and so does a panic, which never ends the interpreter.
pub(crate) fn detached<T: Send>(
    py: Python<'_>,
    body: impl FnOnce() -> krylux::Result<T> + Send,
) -> PyResult<T> {
    let (done, caught) = py.detach(|| in_pool(|| guarded(body)));
    match (caught, done) {
        (Some(error), _) => Err(error),
        (None, Ok(done)) => done.map_err(|error| errors::raise(py, &error)),
        (None, Err(panic)) => Err(errors::internal(py, &text_of(panic.as_ref()))),
    }
}

type Guarded<T> = (std::thread::Result<krylux::Result<T>>, Option<PyErr>);

/// Runs `body`; a call within a call, from a callback of Python, has exceptions of its own.
fn guarded<T>(body: impl FnOnce() -> krylux::Result<T>) -> Guarded<T> {
    let outer = CAUGHT.with(RefCell::take);
    let done = catch_unwind(AssertUnwindSafe(body));
    let caught = CAUGHT.with(|caught| caught.replace(outer));
    (done, caught)
}

/// What a panic said.
fn text_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no reason given".into())
}

/// The threads for products in a process that was forked after this one had started its own.
static CHILD_POOL: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);

/// The process that imported the package.
static IMPORTED_BY: std::sync::OnceLock<u32> = std::sync::OnceLock::new();

/// Notes which process imports the package.
pub(crate) fn note_process() {
    IMPORTED_BY.get_or_init(std::process::id);
}

/// Runs `body` where its parallel loops find threads. A forked child has none of its parent's threads, and would wait for them without
/// end; it gets threads of its own.
fn in_pool<T: Send>(body: impl FnOnce() -> T + Send) -> T {
    let process = std::process::id();
    if IMPORTED_BY.get() == Some(&process) {
        return body();
    }
    let pool = {
        let mut known = CHILD_POOL.lock().unwrap_or_else(PoisonError::into_inner);
        match known.as_ref().filter(|(of, _)| *of == process) {
            Some((_, pool)) => Ok(Arc::clone(pool)),
            None => rayon::ThreadPoolBuilder::new().build().map(|pool| {
                let pool = Arc::new(pool);
                // The parent's pool, if this is a child of a child, has no threads here: it must not be joined.
                std::mem::forget(known.replace((process, Arc::clone(&pool))));
                pool
            }),
        }
    };
    match pool {
        Ok(pool) => pool.install(body),
        // Without threads the loops run one after the other on this one.
        Err(_) => body(),
    }
}

/// Something that threads use in turns until it is taken away. It is of the process that made it: in a forked child, what it stands for
/// belongs to the parent, and is neither used nor closed.
pub(crate) struct Held<T> {
    kept: Mutex<Option<T>>,
    process: u32,
}

impl<T> Held<T> {
    pub(crate) fn new(kept: T) -> Self {
        Self { kept: Mutex::new(Some(kept)), process: std::process::id() }
    }

    fn lock(&self) -> MutexGuard<'_, Option<T>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether it was taken away.
    pub(crate) fn is_taken(&self) -> bool {
        self.lock().is_none()
    }

    /// Takes it away; a forked child gets nothing.
    pub(crate) fn take(&self) -> Option<T> {
        if self.process == std::process::id() { self.lock().take() } else { None }
    }

    /// Lets `work` use it, without the interpreter's lock.
    pub(crate) fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut T) -> krylux::Result<R> + Send,
    ) -> PyResult<R>
    where
        T: Send,
    {
        if self.process != std::process::id() {
            return Err(errors::forked(py));
        }
        detached(py, || self.lock().as_mut().map(work).transpose())?.ok_or_else(|| errors::closed(py))
    }
}

impl<T> Drop for Held<T> {
    fn drop(&mut self) {
        if self.process != std::process::id() {
            std::mem::forget(self.kept.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        }
    }
}
