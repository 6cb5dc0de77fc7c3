//! The reference of the command line, in Markdown: made from the command line itself.

use std::fmt::Write;

use clap::builder::StyledStr;
use clap::{Arg, ArgAction, Command};

/// The path of the page in the repository.
pub const PAGE: &str = "guide/src/reference/command-line.md";

const HEAD: &str = "# The command line

This page is generated from the program itself by `cargo run --release --example regenerate_guide`.
`krylux VERB --help` prints the same.

";

/// The page for this command line.
pub fn page(mut program: Command) -> String {
    program.build();
    let mut page = HEAD.to_owned();
    let verbs = leaves(&program, &[]);
    page += "| verb | does |\n|---|---|\n";
    for (name, verb) in &verbs {
        row(&mut page, &[format!("[`{name}`](#{})", name.replace(' ', "-")), sentence(verb.get_about())]);
    }
    let is_shared = |argument: &Arg| argument.is_global_set();
    page += "\n## Options of every verb\n\nThey stand before the verb or after it.\n\n";
    options(&mut page, program.get_arguments().filter(|argument| is_shared(argument)));
    for (name, verb) in &verbs {
        let _ = write!(page, "\n## {name}\n\n");
        let about = verb.get_long_about().or(verb.get_about()).map(ToString::to_string).unwrap_or_default();
        let _ = write!(page, "{}\n\n", plain(&about));
        let usage = Command::clone(verb).render_usage().to_string();
        let usage = usage.trim_start_matches("Usage: ").lines().map(str::trim).collect::<Vec<_>>();
        let _ = write!(page, "```text\n{}\n```\n\n", usage.join("\n"));
        options(
            &mut page,
            verb.get_arguments().filter(|argument| !is_shared(argument) && !is_help(argument)),
        );
        let examples = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
        let examples: Vec<&str> = examples.lines().filter_map(|line| line.strip_prefix("  ")).collect();
        let _ = write!(page, "\n```text\n{}\n```\n", examples.join("\n"));
    }
    let _ = write!(page, "\n## Exit status\n\n{}\n", sentence(program.get_after_help()));
    page
}

/// The verbs that do something, with their full names; those for the program's own use are left out.
fn leaves<'a>(command: &'a Command, before: &[&'a str]) -> Vec<(String, &'a Command)> {
    let mut found = Vec::new();
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set() && verb.get_name() != "help") {
        let name = [before, &[verb.get_name()]].concat();
        let below = leaves(verb, &name);
        // A verb with arguments of its own does something without the verbs below it.
        if below.is_empty() || verb.get_positionals().next().is_some() {
            found.push((name.join(" "), verb));
        }
        found.extend(below);
    }
    found
}

fn is_help(argument: &Arg) -> bool {
    matches!(
        argument.get_action(),
        ArgAction::Help | ArgAction::HelpShort | ArgAction::HelpLong | ArgAction::Version
    )
}

fn options<'a>(page: &mut String, arguments: impl Iterator<Item = &'a Arg>) {
    *page += "| option | meaning |\n|---|---|\n";
    for argument in arguments.filter(|argument| !argument.is_hide_set()) {
        row(page, &[name(argument), meaning(argument)]);
    }
}

/// `` `-o`, `--output DIR` ``.
fn name(argument: &Arg) -> String {
    let values = argument.get_value_names().unwrap_or_default();
    let values: Vec<&str> = values.iter().map(|value| value.as_str()).collect();
    let takes = argument.get_action().takes_values();
    let value = if takes && !values.is_empty() { format!(" {}", values.join(" ")) } else { String::new() };
    match (argument.get_short(), argument.get_long()) {
        (Some(short), Some(long)) => format!("`-{short}`, `--{long}{value}`"),
        (Some(short), None) => format!("`-{short}{value}`"),
        (None, Some(long)) => format!("`--{long}{value}`"),
        (None, None) => format!("`{}`", value.trim()),
    }
}

/// The meaning of an option, with its values and its default.
fn meaning(argument: &Arg) -> String {
    let mut text = plain(&argument.get_help().map(ToString::to_string).unwrap_or_default());
    if !text.is_empty() && !text.ends_with(['.', ']']) {
        text.push('.');
    }
    let takes = argument.get_action().takes_values();
    for value in argument.get_possible_values().iter().filter(|value| takes && !value.is_hide_set()) {
        let about =
            value.get_help().map(|help| format!(": {}", plain(&help.to_string()))).unwrap_or_default();
        let _ = write!(text, "<br>`{}`{about}", value.get_name());
    }
    let defaults: Vec<String> =
        argument.get_default_values().iter().map(|of| of.to_string_lossy().into_owned()).collect();
    // The name of a free file depends on the folder that the page is made in.
    if takes && !defaults.is_empty() && !argument.is_hide_default_value_set() {
        let _ = write!(text, "<br>Default: `{}`", stem_only(&defaults.join(" ")));
    }
    text
}

/// `photo.exr`, where the folder at hand would make it `photo-2.exr`.
fn stem_only(default: &str) -> String {
    match default.rsplit_once('.') {
        Some((stem, extension)) if ["png", "exr", "npz", "npy", "toml"].contains(&extension) => {
            let (name, number) = stem.rsplit_once('-').unwrap_or((stem, ""));
            let is_numbered = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
            format!("{}.{extension}", if is_numbered { name } else { stem })
        }
        _ => default.to_owned(),
    }
}

fn sentence(text: Option<&StyledStr>) -> String {
    plain(&text.map(ToString::to_string).unwrap_or_default())
}

/// Text that Markdown shows as it is.
fn plain(text: &str) -> String {
    text.replace('<', "&lt;").replace('*', "\\*").replace("\r", "")
}

fn row(page: &mut String, cells: &[String]) {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|").replace('\n', " ")).collect();
    let _ = writeln!(page, "| {} |", cells.join(" | "));
}
