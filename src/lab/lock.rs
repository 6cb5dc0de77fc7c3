//! Mutexes in which every change is one assignment.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a mutex. Its value is intact even after a thread panicked, since every change is one assignment.
pub(super) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
