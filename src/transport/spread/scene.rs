//! A scene that every process of a team has on its device.

use std::sync::Arc;

use super::command::{Command, read_answer};
use crate::error::{Error, Result};
use crate::render::{AdapterSummary, Tracer};
use crate::scene::Scene;
use crate::team::Team;

/// Lets the other processes of the team help to trace `scene`, which is that of the tracer. They get the scene from this process, and open the
/// adapter whose name contains `adapter`, or the fastest one for `None`.
///
/// # Errors
/// [`Error::Team`] where a process has no such adapter, or one with another driver: its light paths would have other bits.
pub fn share_scene(
    tracer: &mut Tracer,
    scene: &Scene,
    adapter: Option<&str>,
    team: &Arc<Team>,
) -> Result<()> {
    let remote = team.remote();
    let command = Command::Open { scene: Box::new(scene.clone()), adapter: adapter.map(Into::into) };
    let turn = remote.command(&command.to_bytes()?);
    let answers = turn.others().zip(turn.receive_all());
    let opened: Vec<Result<(String, AdapterSummary)>> =
        answers.map(|(rank, bytes)| read_answer(rank, &bytes)).collect();
    drop(turn);
    for (rank, opened) in (1..).zip(opened) {
        let (host, theirs) = opened?;
        let of = |adapter: &AdapterSummary| {
            format!("{} with the driver {} {}", adapter.name, adapter.driver, adapter.driver_version)
        };
        let (theirs, ours) = (of(&theirs), of(tracer.adapter()));
        if theirs != ours {
            return Err(Error::Team {
                fault: format!("process {rank} on {host} traces on {theirs}, and process 0 on {ours}"),
                help: "use machines with the same adapter and driver, or name a common one by --adapter; \
                       light paths of different drivers have different bits"
                    .into(),
            });
        }
    }
    tracer.share(remote);
    Ok(())
}
