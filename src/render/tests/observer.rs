//! A trace tells the tracer's observer how far it is, and stops where that asks for it.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

use crate::error::Error;
use crate::image::Resolution;
use crate::observer::{Observer, Step};
use crate::render::{TraceSettings, Tracer};
use crate::scene::builtin;

/// Notes the paths done and the paths in all of each step, and breaks at the step of this number, counted from 1.
struct Notes {
    steps: Mutex<Vec<(u64, u64)>>,
    breaks_at: usize,
}

impl Observer for Notes {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        assert_eq!(step.stage, "tracing");
        let mut steps = self.steps.lock().expect("no step panics");
        steps.push((step.done, step.total));
        if steps.len() == self.breaks_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// The steps of a trace of 16 × 16 pixels at 4 paths each, and how it ended.
fn observed(tracer: &mut Tracer, breaks_at: usize) -> (Vec<(u64, u64)>, crate::Result<u64>) {
    let notes = Arc::new(Notes { steps: Mutex::default(), breaks_at });
    tracer.observe(Arc::clone(&notes) as Arc<_>);
    let settings = TraceSettings::new(Resolution::new(16, 16), 4);
    let outcome = tracer.trace(&settings, &mut |_| Ok(())).map(|summary| summary.paths);
    let steps = notes.steps.lock().expect("no step panics").clone();
    (steps, outcome)
}

#[test]
fn the_observer_sees_each_dispatch_and_may_stop_the_trace() {
    let mut tracer = Tracer::new(&builtin::corner().to_scene(), None)
        .expect("the README's test command installs a Vulkan driver");
    let (steps, outcome) = observed(&mut tracer, 0);
    assert!(matches!(outcome, Ok(1024)));
    assert_eq!((steps.first(), steps.last()), (Some(&(0, 1024)), Some(&(1024, 1024))));
    assert!(steps.is_sorted() && steps.iter().all(|&(_, total)| total == 1024), "{steps:?}");

    let (stopped, outcome) = observed(&mut tracer, 1);
    assert!(matches!(outcome, Err(Error::Interrupted)) && stopped == [(0, 1024)]);

    // At the last step everything has been traced, so that a break changes nothing.
    let (_, outcome) = observed(&mut tracer, steps.len());
    assert!(matches!(outcome, Ok(1024)));
}
