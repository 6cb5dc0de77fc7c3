//! Divides the cores of a machine among the processes of a team that run on it.
//!
//! Software Vulkan and the threads of a process use all cores on which the process may run. Without a division, every process would start
//! as many threads as its machine has cores.

use super::Comm;

/// The machine and the cores on which a process of a team runs.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Placement {
    /// The machine's name.
    pub host: String,
    /// The number of this process among the team's processes on the same machine, starting at 0.
    pub local_rank: usize,
    /// The number of processes of the team on this machine.
    pub local_size: usize,
    /// The cores on which this process may run.
    pub cores: Vec<usize>,
}

/// The part of `cores` for process `rank` of the `size` processes that share these cores. If there are fewer cores than processes,
/// processes share a core.
fn share(cores: &[usize], rank: usize, size: usize) -> Vec<usize> {
    let first = rank * cores.len() / size;
    let end = ((rank + 1) * cores.len() / size).max(first + 1);
    cores[first.min(cores.len())..end.min(cores.len())].to_vec()
}

/// Divides the cores of each machine among the processes of the team that run on it and may use the same cores, and binds this process to
/// its part. Returns the placement of each process, by rank. Every process of the team must call this function before it starts threads,
/// because threads inherit the binding. By default, Open MPI binds each process to one core. This function lifts that default binding, but
/// keeps a binding that the user chose.
pub fn share_cores(comm: &dyn Comm) -> Vec<Placement> {
    keep_cores();
    let (host, cores) = (system::host(), system::cores());
    let all = exchange_text(comm, &text(&host, &cores));
    let equal = |to: usize| all[..to].iter().filter(|other| **other == all[comm.rank()]).count();
    let own = share(&cores, equal(comm.rank()), equal(comm.size()));
    let own = if own.len() < cores.len() && system::bind(&own) { own } else { cores };
    placements(&exchange_text(comm, &text(&host, &own)))
}

/// Lifts Open MPI's default binding of this process to one core. It must be called before any thread is started.
pub fn keep_cores() {
    if is_bound_by_default() {
        system::unbind();
    }
}

/// Sends a text to every process of the team. Returns the texts of all processes, by rank.
pub(super) fn exchange_text(comm: &dyn Comm, text: &str) -> Vec<String> {
    let all = comm.exchange(vec![text.as_bytes().to_vec(); comm.size()]);
    all.iter().map(|text| String::from_utf8_lossy(text).into_owned()).collect()
}

fn placements(texts: &[String]) -> Vec<Placement> {
    let parts: Vec<(&str, &str)> =
        texts.iter().map(|text| text.split_once(' ').unwrap_or((text, ""))).collect();
    let count = |host: &str, to: usize| parts[..to].iter().filter(|(other, _)| *other == host).count();
    let placement = |(rank, (host, cores)): (usize, &(&str, &str))| Placement {
        host: (*host).to_owned(),
        local_rank: count(host, rank),
        local_size: count(host, parts.len()),
        cores: cores.split(',').filter_map(|core| core.parse().ok()).collect(),
    };
    parts.iter().enumerate().map(placement).collect()
}

/// The machine's name and the cores, as a text that every process of the team can read.
fn text(host: &str, cores: &[usize]) -> String {
    let cores: Vec<String> = cores.iter().map(usize::to_string).collect();
    format!("{host} {}", cores.join(","))
}

fn is_bound_by_default() -> bool {
    let is_set = |name| std::env::var_os(name).is_some();
    is_set("OMPI_COMM_WORLD_SIZE")
        && !is_set("OMPI_MCA_hwloc_base_binding_policy")
        && !is_set("SLURM_CPU_BIND")
}

#[cfg(target_os = "linux")]
mod system {
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

    /// The name of this machine, with spaces replaced by `_`.
    pub(super) fn host() -> String {
        rustix::system::uname().nodename().to_string_lossy().replace(' ', "_")
    }

    pub(super) fn cores() -> Vec<usize> {
        let allowed = sched_getaffinity(None).unwrap_or_default();
        (0..CpuSet::MAX_CPU).filter(|&core| allowed.is_set(core)).collect()
    }

    /// Binds this process to cores. Returns whether the system did so.
    pub(super) fn bind(cores: &[usize]) -> bool {
        let mut set = CpuSet::new();
        cores.iter().for_each(|&core| set.set(core));
        sched_setaffinity(None, &set).is_ok()
    }

    /// Lets this process run on every core that its container and its job allow.
    pub(super) fn unbind() {
        let all: Vec<usize> = (0..CpuSet::MAX_CPU).collect();
        // If the system refuses, the binding stays unchanged.
        let _ = bind(&all);
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    pub(super) fn host() -> String {
        String::new()
    }

    pub(super) fn cores() -> Vec<usize> {
        (0..std::thread::available_parallelism().map_or(1, std::num::NonZero::get)).collect()
    }

    /// Does nothing, because this system cannot bind processes to cores.
    pub(super) fn bind(_cores: &[usize]) -> bool {
        false
    }

    pub(super) fn unbind() {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processes_of_a_machine_are_counted() {
        let found = placements(&[text("a", &[0, 1]), text("b", &[0]), text("a", &[2])]);
        let of = |placement: &Placement| {
            (placement.host.clone(), placement.local_rank, placement.local_size, placement.cores.clone())
        };
        assert_eq!(of(&found[0]), ("a".into(), 0, 2, vec![0, 1]));
        assert_eq!(of(&found[1]), ("b".into(), 0, 1, vec![0]));
        assert_eq!(of(&found[2]), ("a".into(), 1, 2, vec![2]));
    }

    #[test]
    fn cores_are_divided_and_shared_where_there_are_too_few() {
        let cores = [4, 5, 6, 7, 9];
        assert_eq!(
            (0..2).map(|rank| share(&cores, rank, 2)).collect::<Vec<_>>(),
            [vec![4, 5], vec![6, 7, 9]]
        );
        assert_eq!(share(&cores, 0, 1), cores);
        let crowded: Vec<_> = (0..4).map(|rank| share(&cores[..2], rank, 4)).collect();
        assert_eq!(crowded, [[4], [4], [5], [5]]);
        assert_eq!(share(&[], 0, 2), [0; 0]);
    }
}
