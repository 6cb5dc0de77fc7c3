//! Calls into krylux without the interpreter's lock. Signals and Python exceptions are passed on.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use krylux::Error;
use pyo3::prelude::*;

use crate::errors;

thread_local! {
    /// The exception that Python code (a camera, a callback or a signal handler) raised during the current call on this thread.
    static CAUGHT: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Keeps an exception until the current call on this thread ends, because krylux itself returns only its own errors.
pub(crate) fn keep(error: PyErr) {
    CAUGHT.with(|caught| {
        caught.borrow_mut().get_or_insert(error);
    });
}

/// Whether an exception is kept for the end of the current call on this thread.
pub(crate) fn has_caught() -> bool {
    CAUGHT.with(|caught| caught.borrow().is_some())
}

/// Runs `call` in Python. If it raises an exception, the exception is kept, and an error is returned in its place. If the interpreter is
/// ending, an error is returned, too.
pub(crate) fn in_python<T>(call: impl FnOnce(Python<'_>) -> PyResult<T>) -> krylux::Result<T> {
    let done = Python::try_attach(call).ok_or(Error::Interrupted)?;
    done.map_err(|error| {
        keep(error);
        Error::Interrupted
    })
}

/// Runs `body` without the interpreter's lock. An exception that Python code raises inside it is passed on unchanged. An error of krylux
/// becomes `krylux.Error`. A panic becomes an exception, too, and never ends the interpreter.
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

/// Runs `body`. A call that a Python callback makes inside another call keeps its exceptions separately.
fn guarded<T>(body: impl FnOnce() -> krylux::Result<T>) -> Guarded<T> {
    let outer = CAUGHT.with(RefCell::take);
    let done = catch_unwind(AssertUnwindSafe(body));
    let caught = CAUGHT.with(|caught| caught.replace(outer));
    (done, caught)
}

/// The message of a panic.
fn text_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no reason given".into())
}

/// The threads for products in a process that was forked after its parent had started threads.
static CHILD_POOL: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);

/// The process that imported the package.
static IMPORTED_BY: std::sync::OnceLock<u32> = std::sync::OnceLock::new();

/// Notes which process imports the package.
pub(crate) fn note_process() {
    IMPORTED_BY.get_or_init(std::process::id);
}

/// Runs `body` in a thread pool of this process. A forked child has none of its parent's threads, and would wait for them forever.
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
                // In a child of a child, the earlier pool is the parent's. It must not be dropped: this would wait for threads that do not
                // exist here.
                std::mem::forget(known.replace((process, Arc::clone(&pool))));
                pool
            }),
        }
    };
    match pool {
        Ok(pool) => pool.install(body),
        // Without a pool, parallel loops run on this thread.
        Err(_) => body(),
    }
}

/// A value that threads use in turns until it is taken away. In a forked child of its process, the value is neither used nor closed.
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

    /// Whether the value was taken away.
    pub(crate) fn is_taken(&self) -> bool {
        self.lock().is_none()
    }

    /// Takes the value away. A forked child gets `None`.
    pub(crate) fn take(&self) -> Option<T> {
        if self.process == std::process::id() { self.lock().take() } else { None }
    }

    /// Calls `work` with the value, without the interpreter's lock.
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
