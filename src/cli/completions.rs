//! `krylux completions`: scripts by which a shell completes krylux's verbs and options.

use std::path::PathBuf;

use clap::{Command, CommandFactory};
use clap_complete::Shell;
use serde_json::json;

use super::console::Console;
use super::{Cli, Outcome};
use crate::error::Result;
use crate::io::atomic;
use crate::io::name::Name;

/// Print the script by which a shell completes verbs and options
#[derive(clap::Args)]
#[command(after_help = INSTALLING)]
pub(super) struct Args {
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

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
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

/// A command without its hidden verbs, which krylux starts itself.
fn visible(command: &Command) -> Command {
    let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set()).cloned();
    Command::new("krylux").args(command.get_arguments().cloned()).subcommands(verbs)
}
