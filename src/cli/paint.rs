//! `krylux paint`: a page on which the user paints light and sees its photo at once.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::embedded_page;
use super::opening::{builder, in_journal, settings};
use super::options::{ChannelsArg, KeepArgs, SourceArgs, count, time};
use super::trace::TraceArgs;
use crate::error::Result;
use crate::io::atomic;
use crate::lab::{Lab, Settings, byte_count};
use crate::paint::page::{EmbedOptions, Kept, Precision};
use crate::paint::{Canvas, Light, PageQuestion};

/// Paint patterns in a browser, and see the photo while the pen moves
///
/// Serves one page on this machine, behind an address that cannot be guessed, and opens it in the browser. With `-o` the page becomes one file that
/// holds the light transport matrix, needs no server, and works on a phone.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux paint scene.glb\n  krylux paint scene.glb --channels rgb --groups 2,4 -o paint.html # one file, without a server"
)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray pattern and photo, or three colours
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Keep the first bounce, the second and the later ones apart, to be shown alone (scenes only)
    #[arg(long)]
    split_bounces: bool,
    /// The interface and port to serve on; port 0 is any free one. Others than 127.0.0.1 let other machines paint, too
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:0")]
    listen: SocketAddr,
    /// End when no page was used for so many minutes
    #[arg(long, value_name = "MINUTES", value_parser = time)]
    idle: Option<f64>,
    /// Do not open the browser
    #[arg(long)]
    no_browser: bool,
    /// Write the page to this file instead of serving it
    #[arg(short = 'o', long = "output", value_name = "FILE.html")]
    file: Option<PathBuf>,
    #[command(flatten)]
    embed: EmbedArgs,
    #[command(flatten)]
    keep: KeepArgs,
}

/// How a page that is one file is made.
#[derive(clap::Args)]
struct EmbedArgs {
    /// How -o stores the matrix's values: 11 or 24 bits of precision
    #[arg(long, value_enum, default_value = "half", requires = "file")]
    precision: PrecisionArg,
    /// The largest file of -o; a matrix that takes more is thinned by chance so that every photo stays right on average, and the error is stated
    #[arg(long, value_name = "BYTES", default_value = "32M", value_parser = byte_count, requires = "file")]
    max_size: u64,
    /// Numbers of groups that the file of -o shows [default: the number of regions in the light]
    #[arg(long, value_name = "K,K,...", value_delimiter = ',', value_parser = count::<usize>, requires = "file")]
    groups: Vec<usize>,
    /// Eigenvectors that the file of -o shows [default: 8]
    #[arg(long, value_name = "N", value_parser = count::<usize>, requires = "file")]
    eigenvectors: Option<usize>,
}

#[derive(Clone, Copy, ValueEnum)]
enum PrecisionArg {
    Half,
    Single,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if let Some(file) = &args.file {
        atomic::check_writable(file)?;
    }
    let settings = Settings {
        channels: args.channels.into(),
        split_bounces: args.split_bounces,
        ..settings(&args.source.view, &args.trace)
    };
    let mut lab = builder(&args.source.source, settings, console).open()?;
    match &args.file {
        Some(file) => {
            let mut canvas = Canvas::new(&mut lab)?;
            write_page(&args.embed, file, &mut canvas, console)
        }
        None => in_journal(&mut lab, &args.keep, "paint", |lab| server::serve_page(args, lab, console)),
    }
}

fn write_page(args: &EmbedArgs, file: &Path, canvas: &mut Canvas<'_>, console: &Console) -> Result<Outcome> {
    let options = EmbedOptions {
        precision: match args.precision {
            PrecisionArg::Half => Precision::Half,
            PrecisionArg::Single => Precision::Single,
        },
        max_bytes: usize::try_from(args.max_size).ok(),
        kept: kept(args, canvas, console)?,
    };
    let mut summary = embedded_page::write(file, canvas, &options, console)?;
    summary["verb"] = json!("paint");
    console.summary(&summary)?;
    Ok(Outcome::Done)
}

/// Answers that the file contains, so that it shows them without a request. Answers that were not requested are left out if the source has
/// none. Without a matrix, there will be no file.
fn kept(args: &EmbedArgs, canvas: &mut Canvas<'_>, console: &Console) -> Result<Kept> {
    if canvas.layers().is_empty() {
        return Ok(Kept::default());
    }
    let light = if canvas.lights().contains(&Light::Global) { Light::Global } else { Light::All };
    let mut ask = |what, question, is_requested: bool| match canvas.answer(&question) {
        Err(why) if !is_requested => {
            console.go_on()?;
            console.note(format_args!("note: the page shows no {what}: {why}"));
            Ok(None)
        }
        answer => answer.map(Some),
    };
    let groups = PageQuestion::Groups { groups: args.groups.clone() };
    let eigenvectors = PageQuestion::Eigenvectors { light, count: args.eigenvectors.unwrap_or(8) };
    Ok(Kept {
        groups: ask("groups", groups, !args.groups.is_empty())?,
        eigenvectors: ask("eigenvectors", eigenvectors, args.eigenvectors.is_some())?,
    })
}

#[cfg(feature = "paint")]
mod server {
    use super::*;
    use crate::paint::{Ended, ServeOptions, Session, serve};

    pub(super) fn serve_page(args: &Args, lab: &mut Lab, console: &Console) -> Result<Outcome> {
        if !args.listen.ip().is_loopback() {
            console.note(format_args!(
                "warning: {} is no address of this machine alone: everyone who has the page's address can paint, and what is sent can be read on the way",
                args.listen
            ));
        }
        let mut session = Session::new(Canvas::new(lab)?)?;
        let idle = args.idle.map(|minutes| std::time::Duration::from_secs_f64(60.0 * minutes));
        let options = ServeOptions { listen: args.listen, idle };
        let mut said = Ok(());
        let ready = |url: &str| said = say_address(url, args, console);
        let notes = console.clone();
        let ended = serve(
            &mut session,
            &options,
            ready,
            || console.check(),
            std::sync::Arc::new(move |line| notes.note(line)),
        )?;
        said?;
        let photos = session.photos();
        console.summary(&json!({ "verb": "paint", "photos": photos, "ended": ended == Ended::Idle }))?;
        drop(session);
        lab.end_run(photos, "painted")?;
        Ok(Outcome::Done)
    }

    /// Prints the address of the page, and opens the page.
    fn say_address(url: &str, args: &Args, console: &Console) -> Result<()> {
        console.say(format_args!("page      {url}"))?;
        console.summary(&json!({ "verb": "paint", "url": url }))?;
        let port = url.rsplit(':').next().and_then(|rest| rest.split('/').next()).unwrap_or_default();
        let is_remote = ["SSH_CONNECTION", "SSH_TTY"].iter().any(|name| std::env::var_os(name).is_some());
        if is_remote && args.listen.ip().is_loopback() {
            console.say(format_args!(
                "          over SSH, forward the port: ssh -L {port}:127.0.0.1:{port} HOST"
            ))?;
        }
        console.say("          Ctrl-C ends it")?;
        if !args.no_browser && !is_remote {
            crate::cli::opener::open(url, console);
        }
        Ok(())
    }
}

#[cfg(not(feature = "paint"))]
mod server {
    use super::*;

    pub(super) fn serve_page(_: &Args, _: &mut Lab, _: &Console) -> Result<Outcome> {
        Err(crate::error::Error::option("paint", "this build of krylux has no server for the page")
            .help("write the page to a file: -o paint.html; or build krylux with its default features"))
    }
}
