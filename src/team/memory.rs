//! Memory of a process that shares its machine with others.

/// Lets arrays from 1 MiB on go back to the system as soon as they are dropped. The C library otherwise raises this size to 32 MiB as such arrays come and
/// go, and keeps what is freed for itself: while a matrix is put together, that is a third more than is in use.
#[cfg(all(feature = "mpi", target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "the C library has no other way to be told")]
pub fn return_freed_memory() {
    // SAFETY: `mallopt` only sets a number of the allocator, and takes any value.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, 1 << 20) };
}

/// Other systems and C libraries are left as they are.
#[cfg(all(feature = "mpi", not(all(target_os = "linux", target_env = "gnu"))))]
pub fn return_freed_memory() {}
