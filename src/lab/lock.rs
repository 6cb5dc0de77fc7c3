//! Mutexes of which every change is one assignment.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a thread that panicked left behind is still whole: every change is one assignment.
pub(super) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
