//! Light paths that several processes trace and one adds up, in the order of the paths.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::command::{Command, answer, from_bytes, garbled, read_answer, to_bytes};
use crate::error::Result;
use crate::observer::{Observer, Step};
use crate::render::{Batch, Recorded, StartPixels, TraceSettings, Tracer};
use crate::team::{Comm, Turn};

/// About how many light paths a process traces at a time.
const PATHS: u64 = 1 << 16;
/// Ranges of pixels that each process has been asked for and that the leader has not taken yet, so that it never waits for the leader.
const AHEAD: usize = 2;

/// As [`Tracer::trace`], with the help of the team of the tracer, if it has one. Ranges of pixels go round: while the leader adds up one, the
/// others trace the next ones.
///
/// # Errors
/// As [`Tracer::trace`]; [`Error::Team`](crate::Error::Team) where another process failed.
pub(in crate::transport) fn trace(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
) -> Result<()> {
    let Some(remote) = tracer.remote().cloned() else { return tracer.trace(settings, visit).map(drop) };
    settings.check()?;
    let ranges = ranges(tracer, settings);
    let turn = remote.command(&Command::Trace { settings: *settings }.to_bytes()?);
    let mut asked = Asked { turn: &turn, ranges: &ranges, size: remote.team().size(), next: Vec::new() };
    let traced = asked.trace(tracer, settings, visit);
    // Whatever happened, the others end the command, and nothing that they sent is left over.
    asked.end();
    traced
}

/// The pixels of the camera and then those of a projector that stands apart, in ranges.
fn ranges(tracer: &Tracer, settings: &TraceSettings) -> Vec<StartPixels> {
    let StartPixels { camera, projector } = tracer.start_pixels(settings);
    let of_one = |camera, projector| {
        let all = StartPixels { camera, projector };
        let pixels = all.camera.len() + all.projector.len();
        let parts = paths(&all, settings).div_ceil(PATHS).clamp(1, pixels.max(1) as u64);
        all.split(parts as usize)
    };
    [of_one(camera, 0..0), of_one(0..0, projector)]
        .concat()
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect()
}

/// The light paths from a range of pixels. (Those of a projector that stands apart are about as many as the camera's.)
fn paths(range: &StartPixels, settings: &TraceSettings) -> u64 {
    (range.camera.len() + range.projector.len()) as u64 * u64::from(settings.samples)
}

/// Tells an observer of all ranges what is done within one.
struct Within {
    all: Arc<dyn Observer + Send + Sync>,
    /// Paths of the ranges before.
    done: u64,
    /// Paths of all ranges.
    total: u64,
}

impl Observer for Within {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        let done = (self.done + step.done).min(self.total);
        self.all.step(&Step { done, total: self.total, ..*step })
    }
}

/// The ranges that the others were asked for.
struct Asked<'a> {
    turn: &'a Turn<'a>,
    ranges: &'a [StartPixels],
    size: usize,
    /// Of each of the others: the first range that it was not asked for yet, and the number of answers that it owes.
    next: Vec<(usize, usize)>,
}

impl Asked<'_> {
    fn trace(
        &mut self,
        tracer: &mut Tracer,
        settings: &TraceSettings,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<()> {
        self.next = self.turn.others().map(|rank| (rank, 0)).collect();
        for _ in 0..AHEAD {
            self.turn.others().try_for_each(|rank| self.ask(rank))?;
        }
        let watched = tracer.observer();
        let total = self.ranges.iter().map(|range| paths(range, settings)).sum();
        let mut done = 0;
        for (at, range) in self.ranges.iter().enumerate() {
            match at % self.size {
                0 => {
                    tracer.observe(Arc::new(Within { all: Arc::clone(&watched), done, total }));
                    let traced = tracer.trace_from(settings, range, visit);
                    tracer.observe(Arc::clone(&watched));
                    traced?;
                }
                rank => {
                    let bytes = self.turn.comm().receive(rank);
                    self.next[rank - 1].1 -= 1;
                    self.ask(rank)?;
                    let batches: Vec<Recorded> = read_answer(rank, &bytes)?;
                    batches.iter().try_for_each(|batch| visit(&batch.batch()))?;
                }
            }
            done += paths(range, settings);
        }
        Ok(())
    }

    /// Asks a process for its next range, if there is one.
    fn ask(&mut self, rank: usize) -> Result<()> {
        let (next, owed) = &mut self.next[rank - 1];
        if let Some(range) = self.ranges.get(*next) {
            self.turn.comm().send(rank, &to_bytes(range)?);
            *next += self.size;
            *owed += 1;
        }
        Ok(())
    }

    /// Takes what is owed, and ends the command: no pixels are left.
    fn end(&mut self) {
        for (rank, (_, owed)) in self.turn.others().zip(&self.next) {
            (0..*owed).for_each(|_| drop(self.turn.comm().receive(rank)));
        }
        self.turn.send_all(&[]);
    }
}

/// Traces ranges of pixels for the leader until it sends none.
pub(super) fn trace_part(comm: &dyn Comm, tracer: Option<&mut Tracer>, settings: &TraceSettings) {
    let mut tracer = tracer;
    loop {
        let range = comm.receive(0);
        if range.is_empty() {
            return;
        }
        let traced = from_bytes(&range).and_then(|range: StartPixels| {
            let tracer = tracer.as_deref_mut().ok_or_else(|| garbled("no such scene"))?;
            let mut batches = Vec::new();
            tracer.trace_from(settings, &range, &mut |batch| {
                batches.push(batch.recorded());
                Ok(())
            })?;
            Ok(batches)
        });
        answer(comm, traced);
    }
}
