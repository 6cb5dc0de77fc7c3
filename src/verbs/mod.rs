//! The verbs, which are the questions to a laboratory. Each module has one verb: its request, its execution, its answer, and its page.
//!
//! A [request](crate::lab::Verb) is a struct with documented fields, declared once. The fields become the options of the command line, the
//! keyword arguments in Python and the record in `run.json`. An [answer](crate::lab::Answer) consists of named arrays and named facts. They
//! become files, summary, attributes in Python and lines on the terminal. [`VERBS`] lists the verbs that write a run's folder. The others
//! write single files, or are for a rig that is being set up.

pub mod audit;
pub mod compensate;
pub mod eigs;
pub mod import;
pub mod matrix;
pub mod options;
pub mod pattern;
pub mod photo;
pub mod plan;
pub mod probe;
pub mod relight;
pub mod rig;
pub mod segment;
pub mod separate;
pub mod solve;

use std::path::Path;

use clap::{ArgMatches, Args, Command};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::error::Result;
use crate::lab::{Answer, ChannelChoice, GivenArray, Lab, Verb};

pub use audit::Audit;
pub use compensate::{Compensate, Compensated};
pub use eigs::{Eigs, Spectrum};
pub use import::{Import, Imported};
pub use options::{Parameter, from_json, signature};
pub use plan::Plan;
pub use probe::{MaskChoice, Probe, ProbedLight};
pub use relight::{Relight, Relighting};
pub use segment::{Segment, Segmented};
pub use separate::{Separate, Separated};
pub use solve::{Solve, Solved};

/// Declares requests as [`VERBS`], and gives each of them its default.
macro_rules! declare {
    ($($request:ty),* $(,)?) => {
        /// The verbs that apply to any source and write a run's folder, in the order of the help.
        pub const VERBS: &[Declared] = &[$(Declared::of::<$request>()),*];

        options::default_values!($($request),*);
    };
}

// A new verb needs one more name here.
declare!(Segment, Compensate, Separate, Relight, Probe, Eigs, Audit, Solve, Import);

/// A request that is declared once, for the command line and for keyword arguments.
pub trait Request: Verb + Args + Serialize + DeserializeOwned + Default {}

impl<V: Verb + Args + Serialize + DeserializeOwned + Default> Request for V {}

/// A request of one of the verbs.
pub type AnyRequest = Box<dyn AnyVerb>;

/// The declaration of a verb: its name, and how requests are made from what a user gives.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    /// The name.
    pub name: &'static str,
    /// [`Verb::IS_CHECKED`].
    pub is_checked: bool,
    /// Adds the fields as options to a command.
    pub augment: fn(Command) -> Command,
    /// Makes the request from parsed options.
    pub from_matches: fn(&ArgMatches) -> std::result::Result<AnyRequest, clap::Error>,
    /// Makes the request from fields by name, as [`from_json`].
    pub from_json: fn(Map<String, Value>) -> Result<AnyRequest>,
    /// The purpose and the fields, as [`signature`].
    pub signature: fn() -> (String, Vec<Parameter>),
}

impl Declared {
    const fn of<V: Request + AnyVerb + 'static>() -> Self {
        Self {
            name: V::NAME,
            is_checked: V::IS_CHECKED,
            augment: V::augment_args,
            from_matches: |matches| Ok(Box::new(V::from_arg_matches(matches)?)),
            from_json: |fields| Ok(Box::new(from_json::<V>(fields)?)),
            signature: signature::<V>,
        }
    }

    /// The verb of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        VERBS.iter().find(|verb| verb.name == name)
    }
}

/// A request of any verb, as a trait object. The methods are those of [`Verb`], and return its constants.
#[allow(missing_docs, reason = "Verb explains them")]
pub trait AnyVerb: Send + Sync {
    fn not_resumed(&self) -> Option<&'static str>;
    fn splits_bounces(&self) -> bool;
    fn channels(&self, source: &Path) -> Result<ChannelChoice>;
    fn check(&self) -> Result<()>;
    fn check_on(&self, lab: &Lab) -> Result<()>;
    fn give(&mut self, given: Vec<GivenArray>) -> Result<()>;
    fn ask(&self, lab: &mut Lab) -> Result<Box<dyn Answer + Send>>;
}

impl<V: Verb<Answer: Send + 'static> + Send + Sync> AnyVerb for V {
    fn not_resumed(&self) -> Option<&'static str> {
        V::NOT_RESUMED
    }

    fn splits_bounces(&self) -> bool {
        Verb::splits_bounces(self)
    }

    fn channels(&self, source: &Path) -> Result<ChannelChoice> {
        Verb::channels(self, source)
    }

    fn check(&self) -> Result<()> {
        Verb::check(self)
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        lab.accept(self)
    }

    fn give(&mut self, given: Vec<GivenArray>) -> Result<()> {
        Verb::give(self, given)
    }

    fn ask(&self, lab: &mut Lab) -> Result<Box<dyn Answer + Send>> {
        Ok(Box::new(lab.ask(self)?))
    }
}

#[cfg(test)]
mod tests_of_runs;
#[cfg(test)]
mod tests_of_verification;
