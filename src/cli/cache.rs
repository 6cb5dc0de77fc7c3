//! `krylux cache`: the matrices that earlier runs stored on disk.

use std::time::SystemTime;

use clap::Subcommand;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::trace::CacheArgs;
use crate::cache::Cache;
use crate::error::{Error, Result};
use crate::io::name::Name;
use crate::lab::text;

/// Show or empty the cache of traced matrices
#[derive(Subcommand)]
#[command(after_help = "Examples:\n  krylux cache list\n  krylux cache clear")]
pub(super) enum Action {
    /// List the matrices, those used last first
    #[command(after_help = "Example:\n  krylux cache list --json")]
    List(CacheArgs),
    /// Remove all of them
    #[command(after_help = "Example:\n  krylux cache clear")]
    Clear(CacheArgs),
}

pub(super) fn run(action: &Action, console: &Console) -> Result<Outcome> {
    let (Action::List(of) | Action::Clear(of)) = action;
    let cache = of.choice().open().ok_or_else(|| {
        Error::option("--cache", "there is no cache to look at")
            .help("name its folder by --cache DIR or KRYLUX_CACHE")
    })?;
    match action {
        Action::List(_) => list(&cache, console),
        Action::Clear(_) => clear(&cache, console),
    }
}

fn list(cache: &Cache, console: &Console) -> Result<Outcome> {
    let mut entries = cache.entries()?;
    entries.sort_by_key(|entry| std::cmp::Reverse(entry.used));
    let bytes: u64 = entries.iter().map(|entry| entry.bytes).sum();
    for entry in &entries {
        let label = entry.label.as_deref().unwrap_or("damaged; a run that needs it will make it anew");
        console.say(format_args!("{}  {:>10}  {label}", &entry.key[..12], text::bytes(entry.bytes)))?;
    }
    console.say(format_args!(
        "cache     {}: {} matrices, {}",
        cache.folder().display(),
        entries.len(),
        text::bytes(bytes)
    ))?;
    let seconds =
        |used: SystemTime| used.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let listed = entries.iter().map(|entry| {
        json!({ "key": entry.key, "label": entry.label, "bytes": entry.bytes, "used": seconds(entry.used) })
    });
    console.summary(&json!({
        "verb": "cache list",
        "folder": Name::from(cache.folder()),
        "bytes": bytes,
        "matrices": listed.collect::<Vec<_>>(),
    }))?;
    Ok(Outcome::Done)
}

fn clear(cache: &Cache, console: &Console) -> Result<Outcome> {
    let (count, bytes) = cache.clear()?;
    console.say(format_args!(
        "cache     {}: removed {count} matrices, {}",
        cache.folder().display(),
        text::bytes(bytes)
    ))?;
    console.summary(&json!({
        "verb": "cache clear",
        "folder": Name::from(cache.folder()),
        "removed": count,
        "bytes": bytes,
    }))?;
    Ok(Outcome::Done)
}
