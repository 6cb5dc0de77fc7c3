//! The options of the tracer, of the adapter and of the cache.

use std::path::PathBuf;

use clap::Args;

use crate::image::Resolution;
use crate::lab::{CacheChoice, TraceOverrides};

/// How the light is traced, and where matrices are kept.
#[derive(Args, Default)]
pub(super) struct TraceArgs {
    #[command(flatten)]
    pub(super) overrides: TraceOverrides,
    /// The graphics adapter whose name contains this; `krylux info` lists them. all: every adapter that is equal to the fastest one; they share the
    /// light paths of a matrix
    #[arg(long, value_name = "NAME")]
    pub(super) adapter: Option<String>,
    #[command(flatten)]
    pub(super) cache: CacheArgs,
}

impl TraceArgs {
    /// Options for a verb that only loads a scene and traces nothing.
    pub(super) fn for_looking(resolution: Option<Resolution>, adapter: Option<String>) -> Self {
        let overrides = TraceOverrides { resolution, ..TraceOverrides::default() };
        Self { overrides, adapter, ..Self::default() }
    }
}

/// `--cache` and `--no-cache`.
#[derive(Args, Default)]
pub(super) struct CacheArgs {
    /// Where matrices are kept for later runs [default: KRYLUX_CACHE, or krylux in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Neither look for a matrix nor keep one; so does an empty KRYLUX_CACHE
    #[arg(long, conflicts_with = "cache")]
    no_cache: bool,
}

impl CacheArgs {
    /// The cache to use.
    pub(super) fn choice(&self) -> CacheChoice {
        match &self.cache {
            _ if self.no_cache => CacheChoice::Off,
            Some(folder) => CacheChoice::Folder(folder.clone()),
            None => CacheChoice::Default,
        }
    }
}
