//! `krylux completions` and `krylux man`: shell scripts and manual pages, generated from the command line itself.

use std::path::{Path, PathBuf};

use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use serde_json::json;

use super::console::Console;
use super::{Cli, Outcome};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::io::name::Name;

/// Print the script by which a shell completes verbs and options
#[derive(clap::Args)]
#[command(after_help = INSTALLING)]
pub(super) struct Completions {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
    /// Write the script into this file [default: print it]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    file: Option<PathBuf>,
}

const INSTALLING: &str = "Examples, with where the shells look for it:
  krylux completions bash -o ~/.local/share/bash-completion/completions/krylux
  krylux completions zsh -o DIR/_krylux # DIR is in $fpath
  krylux completions fish -o ~/.config/fish/completions/krylux.fish
  krylux completions elvish # to be added to ~/.config/elvish/rc.elv
  krylux completions powershell # to be added to $PROFILE";

pub(super) fn completions(args: &Completions, console: &Console) -> Result<Outcome> {
    let script = script(args.shell);
    match &args.file {
        Some(file) => {
            atomic::write_bytes(file, script.as_bytes())?;
            console.say(format_args!("wrote     {}", file.display()))?;
        }
        None => console.print(&script)?,
    }
    console.summary(&json!({
        "verb": "completions",
        "shell": args.shell.to_string(),
        "file": args.file.as_ref().map(Name::from),
        "script": args.file.is_none().then_some(script),
    }))?;
    Ok(Outcome::Done)
}

fn script(shell: Shell) -> String {
    let mut command = visible(&Cli::command());
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, "krylux", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// The command without its hidden verbs. Only krylux itself runs hidden verbs.
fn visible(command: &Command) -> Command {
    let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set()).cloned();
    Command::new("krylux").args(command.get_arguments().cloned()).subcommands(verbs)
}

/// Print the manual page of krylux, or write those of all verbs into a folder
#[derive(clap::Args)]
#[command(after_help = READING)]
pub(super) struct Manual {
    /// Write krylux.1 and the page of each verb, such as krylux-segment.1, into this folder, which is made where it is missing
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    folder: Option<PathBuf>,
}

const READING: &str = "Examples:
  krylux man # to be read by: krylux man | man -l -
  krylux man -o ~/.local/share/man/man1 # then: man krylux-segment";

pub(super) fn manual(args: &Manual, console: &Console) -> Result<Outcome> {
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

/// The manual page of the program.
fn main_page() -> Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(Cli::command().disable_help_subcommand(true))
        .render(&mut page)
        .map_err(Error::writing("the manual page"))?;
    Ok(page)
}

/// Writes all manual pages and returns their names, sorted.
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
