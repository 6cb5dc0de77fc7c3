//! Several processes trace light paths, and one process sums them in the order of the paths.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::{Command, StopByLeader};
use crate::error::Result;
use crate::observer::{Observer, Step};
use crate::render::{Batch, Recorded, StartPixels, TraceSettings, Tracer};
use crate::team::{Comm, Turn, answer, garbled, read_answer};

/// The approximate number of light paths that a process traces at a time.
const PATHS: u64 = 1 << 16;

/// Works like [`Tracer::trace`], with the help of the tracer's team, if it has one. The processes take turns with ranges of pixels: while
/// the leader sums the paths of one range, the other processes trace the next ranges.
pub(in crate::transport) fn trace(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
) -> Result<()> {
    let Some(remote) = tracer.remote().cloned() else { return tracer.trace(settings, visit).map(drop) };
    settings.check()?;
    let turn = remote.command(&Command::Trace { settings: *settings })?;
    let traced = trace_all(&turn, tracer, settings, visit);
    // The other processes finish the command even after an error, so all their messages are received here.
    turn.send_all(&[]);
    for rank in turn.others() {
        while !turn.comm().receive(rank).is_empty() {}
    }
    traced
}

/// Traces the leader's ranges, and receives the paths of the other processes' ranges.
fn trace_all(
    turn: &Turn<'_>,
    tracer: &mut Tracer,
    settings: &TraceSettings,
    visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
) -> Result<()> {
    let (watched, ranges) = (tracer.observer(), ranges(tracer, settings));
    let total = ranges.iter().map(|range| paths(range, settings)).sum();
    let mut done = 0;
    for (at, range) in ranges.iter().enumerate() {
        match at % turn.comm().size() {
            0 => {
                tracer.observe(Arc::new(Within { all: Arc::clone(&watched), done, total }));
                let traced = tracer.trace_from(settings, range, visit);
                tracer.observe(Arc::clone(&watched));
                traced?;
            }
            rank => {
                let batches: Vec<Recorded> = read_answer(rank, &turn.comm().receive(rank))?;
                batches.iter().try_for_each(|batch| visit(&batch.batch()))?;
            }
        }
        done += paths(range, settings);
    }
    Ok(())
}

/// Traces this process's ranges for the leader, one range ahead of the leader. It stops when all ranges are done, or when the leader needs
/// no more.
pub(super) fn trace_part(comm: &Arc<dyn Comm>, tracer: Option<&mut Tracer>, settings: &TraceSettings) {
    match tracer {
        None => answer::<()>(&**comm, Err(garbled("no such scene"))),
        Some(tracer) => {
            tracer.observe(Arc::new(StopByLeader(Arc::clone(comm))));
            for range in ranges(tracer, settings).iter().skip(comm.rank()).step_by(comm.size()) {
                if comm.has_message(0) {
                    break;
                }
                let mut batches = Vec::new();
                let traced = tracer.trace_from(settings, range, &mut |batch| {
                    batches.push(batch.recorded());
                    Ok(())
                });
                answer(&**comm, traced.map(|_| batches));
            }
            tracer.observe(Arc::new(()));
        }
    }
    // An empty message ends this process's replies. Then the process receives the leader's last message.
    comm.send(0, &[]);
    comm.receive(0);
}

/// Divides the camera's pixels into ranges, and then the projector's pixels if the rig is not coaxial.
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

/// The number of light paths from a range of pixels. It is approximate for a projector that stands apart, because the number of paths from
/// a projector pixel is only about that of a camera pixel.
fn paths(range: &StartPixels, settings: &TraceSettings) -> u64 {
    (range.camera.len() + range.projector.len()) as u64 * u64::from(settings.samples)
}

/// Observes the tracing of one range, and reports it as progress within all ranges.
struct Within {
    all: Arc<dyn Observer + Send + Sync>,
    /// The number of paths in the earlier ranges.
    done: u64,
    total: u64,
}

impl Observer for Within {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        let done = (self.done + step.done).min(self.total);
        self.all.step(&Step { done, total: self.total, ..*step })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::sync::Mutex;

    use crate::image::Resolution;
    use crate::observer::Estimate;
    use crate::scene::{Scene, builtin};

    #[test]
    fn ranges_have_about_as_many_paths_as_a_process_traces_at_a_time() {
        let scene = builtin::corner().to_scene();
        let apart = Scene { projector: Some(scene.camera.clone()), ..scene };
        let tracer = Tracer::new(&apart, None).expect("the README's test command installs a Vulkan driver");
        let size = |width| Resolution::new(width, 100);
        // 12800 pixels and 6400 pixels, with 100 paths each, make about 20 and 10 times 65536 paths.
        let settings = TraceSettings { projector: Some(size(64)), ..TraceSettings::new(size(128), 100) };
        let found = ranges(&tracer, &settings);
        let camera = found.iter().take_while(|part| !part.camera.is_empty()).count();
        assert_eq!((camera, found.len()), (20, 30));
        let all: Vec<usize> = found[..camera].iter().flat_map(|part| part.camera.clone()).collect();
        assert_eq!(all, (0..12_800).collect::<Vec<_>>());
        let all: Vec<usize> = found[camera..].iter().flat_map(|part| part.projector.clone()).collect();
        assert_eq!(all, (0..6400).collect::<Vec<_>>());
        assert!(
            found[..camera].iter().all(|part| part.projector.is_empty()),
            "the camera's paths come first"
        );
        // A pixel with more paths than a range should have becomes a range of its own, and no range is empty.
        let few = TraceSettings {
            projector: Some(Resolution::new(1, 1)),
            ..TraceSettings::new(Resolution::new(2, 1), 1 << 18)
        };
        let found = ranges(&tracer, &few);
        assert_eq!(
            found.iter().map(|part| (part.camera.len(), part.projector.len())).collect::<Vec<_>>(),
            [(1, 0), (1, 0), (0, 1)]
        );
        assert_eq!(paths(&StartPixels { camera: 3..5, projector: 0..7 }, &few), 9 << 18);
    }

    /// Records, at each step, the number of finished paths and the total.
    #[derive(Default)]
    struct Seen(Mutex<Vec<(u64, u64)>>);

    impl Observer for Seen {
        fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
            self.0.lock().expect("no one panics").push((step.done, step.total));
            if step.done == 35 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }

    #[test]
    fn steps_within_a_range_count_in_all_of_them() {
        let seen = Arc::new(Seen::default());
        let within = Within { all: Arc::clone(&seen) as Arc<_>, done: 30, total: 40 };
        let step = |done| within.step(&Step { stage: "tracing", done, total: 10, estimate: Estimate::None });
        assert_eq!([step(0), step(5), step(10)].map(|flow| flow.is_break()), [false, true, false]);
        // A range of projector pixels may have more paths than estimated, so progress is limited to the total.
        assert!(step(12).is_continue());
        assert_eq!(*seen.0.lock().expect("no one panics"), [(30, 40), (35, 40), (40, 40), (40, 40)]);
    }
}
