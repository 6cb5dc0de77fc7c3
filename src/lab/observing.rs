//! The observer that a laboratory and everything that it opens share.

use std::fmt;
use std::sync::Arc;

use super::text::percent;
use crate::measure::RigRecord;
use crate::observer::{Level, Observer};

/// An observer shared by a laboratory, its tracer and its operators.
#[derive(Clone)]
pub struct SharedObserver(pub Arc<dyn Observer + Send + Sync>);

impl Default for SharedObserver {
    fn default() -> Self {
        Self(Arc::new(()))
    }
}

impl<O: Observer + Send + Sync + 'static> From<Arc<O>> for SharedObserver {
    fn from(observer: Arc<O>) -> Self {
        Self(observer)
    }
}

pub(crate) trait Log {
    fn log(&self, level: Level, message: &str);

    fn note(&self, message: fmt::Arguments<'_>) {
        self.log(Level::Note, &message.to_string());
    }

    fn info(&self, message: fmt::Arguments<'_>) {
        self.log(Level::Info, &message.to_string());
    }

    fn costs(&self, rig: &RigRecord) {
        let effort = &rig.effort;
        self.info(format_args!(
            "rig       {} patterns, {} frames shown, {} taken, {} from the journal, in {:.1} s of the rig's time",
            rig.patterns, effort.shown, effort.taken, effort.replayed, effort.seconds
        ));
        if effort.taken > 0 {
            self.info(format_args!("time      {} (each photo)", effort.times.each(effort.taken)));
        }
        let refused = effort.dropped + effort.incomplete + effort.repeated + effort.late + effort.restarts;
        if refused > 0 {
            self.info(format_args!(
                "faults    {} frames dropped, {} incomplete, {} repeated, {} late, {} restarts of the camera",
                effort.dropped, effort.incomplete, effort.repeated, effort.late, effort.restarts
            ));
        }
        if effort.resent + effort.missing > 0 {
            self.info(format_args!(
                "network   {} packets were lost, and sent again; {} never came",
                effort.resent, effort.missing
            ));
        }
        if let Some(noise) = rig.noise {
            self.info(format_args!("noise     {} % of the white photo", percent(noise)));
        }
        if let Some(drift) = rig.drift {
            self.info(format_args!("drift     {} % of white at most", percent(drift)));
        }
    }

    fn detail(&self, message: fmt::Arguments<'_>) {
        self.log(Level::Detail, &message.to_string());
    }
}

impl Log for SharedObserver {
    fn log(&self, level: Level, message: &str) {
        self.0.log(level, message);
    }
}
