//! The processes that `mpirun` or `srun` started together with this process, and the helper that owns a projector's window.

use std::process::ExitCode;
use std::sync::Arc;

use super::Outcome;
use crate::error::{Error, Result};
use crate::rig;
use crate::team::Team;

/// The role of this process.
pub(super) enum Role {
    /// This process runs the program, with the help of the team if there is one.
    Leader(Option<Arc<Team>>),
    /// This process does not lead, its work is done, and it ends with this status.
    Ended(ExitCode),
}

/// The verbs with which the program starts helper processes. A helper does not join the team of the process that started it.
const HELPERS: [&str; 2] = ["projector", "describe-camera"];

/// Joins the other processes, if there are any. In a process that does not lead, this call returns after the leader has ended.
pub(super) fn join() -> Result<Role> {
    if std::env::args_os().nth(1).is_some_and(|verb| HELPERS.iter().any(|helper| verb == *helper)) {
        return Ok(Role::Leader(None));
    }
    joined()
}

#[cfg(feature = "mpi")]
fn joined() -> Result<Role> {
    use crate::team::{Comm, World, keep_cores, require_same_program, share_cores};
    use crate::transport::SceneWorker;

    if is_only_one() {
        // MPI is not started, because its start would take longer than the work of a single process.
        keep_cores();
        return Ok(Role::Leader(None));
    }
    let Some(world) = World::join()? else { return Ok(Role::Leader(None)) };
    let world: Arc<dyn Comm> = Arc::new(world);
    let placements = share_cores(&*world);
    let placement = placements[world.rank()].clone();
    let checked = require_same_program(&*world, &placements, &program());
    if world.rank() == 0 {
        checked?;
        return Ok(Role::Leader(Some(Team::lead(world, placements))));
    }
    if checked.is_err() {
        // The leader reports the error and its status. A failure here could make the launcher end the leader before it has spoken.
        return Ok(Role::Ended(ExitCode::SUCCESS));
    }
    crate::machine::start_threads();
    SceneWorker::new(Arc::clone(&world), placement.host, placement.local_rank).serve();
    world.close();
    Ok(Role::Ended(ExitCode::SUCCESS))
}

/// Whether Open MPI started only one process.
#[cfg(feature = "mpi")]
fn is_only_one() -> bool {
    std::env::var("OMPI_COMM_WORLD_SIZE").is_ok_and(|size| size == "1")
}

/// The version of this program, with a digest of its file if the file can be read.
#[cfg(feature = "mpi")]
fn program() -> String {
    let digest = std::env::current_exe().and_then(std::fs::read).map(|bytes| blake3::hash(&bytes).to_hex());
    let digest = digest.map(|digest| format!(" ({})", &digest[..12])).unwrap_or_default();
    format!("krylux {}{digest}", env!("CARGO_PKG_VERSION"))
}

/// Fails in the first of several processes and explains the reason: without MPI, each would do the same work and write the same files.
#[cfg(not(feature = "mpi"))]
fn joined() -> Result<Role> {
    let number = |of: &str| {
        let names = ["OMPI_COMM_WORLD", "PMI"].map(|launcher| format!("{launcher}_{of}"));
        names.iter().find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok())
    };
    match (number("SIZE"), number("RANK")) {
        (None | Some(0 | 1), _) => Ok(Role::Leader(None)),
        (Some(processes), None | Some(0)) => Err(Error::team(format!(
            "{processes} processes were started together, but this krylux was built without MPI"
        ))
        .help("build it with `--features mpi`, or start one process")),
        // A failure here could make the launcher end the first process before it has spoken.
        _ => Ok(Role::Ended(ExitCode::SUCCESS)),
    }
}

/// Show frames on a monitor, as the program says that started this one (by standard input and output)
#[derive(clap::Args)]
pub(super) struct Projector {}

/// Runs the helper process that owns a projector's window. Only krylux itself starts it.
pub(super) fn serve_projector() -> Result<Outcome> {
    rig::serve_projector(std::io::stdin().lock(), std::io::stdout().lock())
        .map_err(Error::writing("the pipe to krylux"))?;
    Ok(Outcome::Done)
}
