//! `krylux man`: the manual pages, made from the command line itself.

use std::path::{Path, PathBuf};

use clap::CommandFactory;
use clap_mangen::Man;
use serde_json::json;

use super::console::Console;
use super::{Cli, Outcome};
use crate::error::{Error, Result};
use crate::io::name::Name;

/// Print the manual page of krylux, or write those of all verbs into a folder
#[derive(clap::Args)]
#[command(after_help = READING)]
pub(super) struct Args {
    /// Write krylux.1 and the page of each verb, such as krylux-segment.1, into this folder, which is made where it is missing
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    folder: Option<PathBuf>,
}

const READING: &str = "Examples:
  krylux man # to be read by: krylux man | man -l -
  krylux man -o ~/.local/share/man/man1 # then: man krylux-segment";

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let pages = match &args.folder {
        Some(folder) => {
            let pages = write_all(folder)?;
            console.say(format_args!("wrote     {} manual pages into {}", pages.len(), folder.display()))?;
            pages
        }
        None => {
            console.print(&String::from_utf8_lossy(&main_page()?))?;
            Vec::new()
        }
    };
    console
        .summary(&json!({ "verb": "man", "folder": args.folder.as_ref().map(Name::from), "pages": pages }))?;
    Ok(Outcome::Done)
}

/// The page of the program.
fn main_page() -> Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(Cli::command().disable_help_subcommand(true))
        .render(&mut page)
        .map_err(Error::writing("the manual page"))?;
    Ok(page)
}

/// Writes all pages and gives their names, sorted.
fn write_all(folder: &Path) -> Result<Vec<String>> {
    std::fs::create_dir_all(folder).map_err(Error::writing(folder))?;
    clap_mangen::generate_to(Cli::command(), folder).map_err(Error::writing(folder))?;
    let entries = std::fs::read_dir(folder).map_err(Error::reading(folder))?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut pages: Vec<String> =
        names.filter(|name| name.starts_with("krylux") && name.ends_with(".1")).collect();
    pages.sort();
    Ok(pages)
}
