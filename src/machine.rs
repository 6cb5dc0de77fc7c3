//! The memory and the threads that this machine grants to this process.

use std::cell::Cell;
use std::fs;
use std::io;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;
use std::thread::{self, JoinHandle};

/// The bytes of memory that this process may use: the machine's memory (8 GiB if it is unknown), or the limit of a container or of
/// `ulimit -v` if this limit is lower.
pub(crate) fn memory() -> u64 {
    let of_container = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    let stated = of_container.iter().filter_map(|path| fs::read_to_string(path).ok()?.trim().parse().ok());
    let total = total_memory().unwrap_or(8 << 30);
    stated.chain(address_space()).fold(total, u64::min)
}

fn total_memory() -> Option<u64> {
    let about = fs::read_to_string("/proc/meminfo").ok()?;
    let total = about.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(total.trim().trim_end_matches(" kB").parse::<u64>().ok()? * 1024)
}

/// The bytes of address space that `ulimit -v` allows this process; `None` if there is no limit.
pub(crate) fn address_space() -> Option<u64> {
    address_space_in(&fs::read_to_string("/proc/self/limits").ok()?)
}

/// Finds [`address_space`] in the text of `/proc/self/limits`.
fn address_space_in(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// The maximum number of threads that share computations: in total, and for each core. Larger requests are reduced to these numbers.
const MOST_THREADS: usize = 1024;
const MOST_OF_CORE: usize = 4;

/// Returns the result of `work`, or `None` if `work` panics. The panic is not printed. `work` must not leave half-changed data that is used
/// later.
pub(crate) fn unless_panics<T>(work: impl FnOnce() -> T) -> Option<T> {
    thread_local!(static IS_SILENT: Cell<bool> = const { Cell::new(false) });
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_SILENT.get() {
                others(info);
            }
        }));
    });
    let before = IS_SILENT.replace(true);
    let outcome = panic::catch_unwind(AssertUnwindSafe(work));
    IS_SILENT.set(before);
    outcome.ok()
}

/// Starts the threads that share computations: one for each core, or as many as `RAYON_NUM_THREADS` states, up to [`MOST_OF_CORE`] for each
/// core. Fewer threads start if there is a limit on processes or address space. Without this function, the process would end at the first
/// computation if some threads could not be started.
pub(crate) fn start_threads() {
    let cores = thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let wanted = wanted(rayon_threads(), cores);
    let started = started(wanted, || thread::Builder::new().spawn(thread::park));
    let builder = match started {
        // If not all threads can start, half of them are left for the graphics driver and for the thread that waits for Ctrl-C.
        all if all == wanted => rayon::ThreadPoolBuilder::new().num_threads(wanted),
        some if some > 3 => rayon::ThreadPoolBuilder::new().num_threads(some / 2),
        _ => rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread(),
    };
    // The call fails if a program that uses this library has already started a pool. That pool is then used.
    let _ = builder.build_global();
}

/// The number of threads that should share computations. `asked` is the number that the user requested.
fn wanted(asked: Option<usize>, cores: usize) -> usize {
    asked.unwrap_or(cores).min(MOST_OF_CORE.saturating_mul(cores)).min(MOST_THREADS)
}

/// Whether one more thread can be started. Some libraries start a thread unconditionally, and end the process if this fails.
pub(crate) fn has_thread() -> bool {
    started(1, || thread::Builder::new().spawn(thread::park)) == 1
}

fn rayon_threads() -> Option<usize> {
    std::env::var("RAYON_NUM_THREADS").ok()?.parse().ok().filter(|&threads| threads > 0)
}

/// The number of threads, at most `wanted`, that can exist at the same time. They are parked, and end before this function returns.
fn started(wanted: usize, spawn: impl Fn() -> io::Result<JoinHandle<()>>) -> usize {
    let threads: Vec<JoinHandle<()>> = (0..wanted).map_while(|_| spawn().ok()).collect();
    let count = threads.len();
    for thread in threads {
        thread.thread().unpark();
        // A parked thread does nothing that could panic.
        let _ = thread.join();
    }
    count
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn the_limit_of_address_space_is_read_from_the_systems_table() {
        let table = |limit: &str| {
            format!(
                "Limit                     Soft Limit           Hard Limit           Units\n\
                 Max cpu time              unlimited            unlimited            seconds\n\
                 Max address space         {limit}            unlimited            bytes\n"
            )
        };
        assert_eq!(address_space_in(&table("409600000")), Some(409_600_000));
        assert_eq!(address_space_in(&table("unlimited")), None);
        assert_eq!(address_space_in(""), None);
    }

    #[test]
    fn no_number_that_is_asked_for_starts_threads_without_end() {
        let cases = [(None, 2), (Some(1), 2), (Some(8), 2), (Some(99_999), 2), (Some(99_999), 512)];
        assert_eq!(cases.map(|(asked, cores)| wanted(asked, cores)), [2, 1, 8, 8, 1024]);
    }

    #[test]
    fn only_threads_that_the_system_starts_are_counted() {
        let left = Cell::new(3);
        let spawn = || match left.get() {
            0 => Err(io::ErrorKind::WouldBlock.into()),
            more => {
                left.set(more - 1);
                thread::Builder::new().spawn(thread::park)
            }
        };
        assert_eq!(started(8, spawn), 3);
        left.set(3);
        assert_eq!(started(2, spawn), 2);
    }
}
