//! What can be seen of a run while it goes on: photos done and left, the residual so far, and images in a viewer; and the strip of
//! all photos that remains of it.

mod line;
mod watched;

use std::cell::RefCell;
use std::fmt::Display;
use std::ops::ControlFlow;
use std::str::FromStr;

use super::console::Console;
use super::source::Source;
use crate::image::Resolution;
use crate::operator::Adjoint;
use crate::report::contact_sheet::ContactSheet;
use crate::report::viewer::{Plane, Viewer};
use crate::transport::Channels;
use line::Line;
pub(super) use watched::Watched;

/// Who looks on.
#[derive(clap::Args)]
pub(super) struct LiveArgs {
    /// Show every pattern and photo in the image viewer tev that listens there, as they come
    #[arg(long, value_name = "HOST:PORT")]
    tev: Option<Address>,
}

/// `HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Address(String);

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts =
            text.rsplit_once(':').filter(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
        match parts {
            Some(_) => Ok(Self(text.to_owned())),
            None => Err(format!("`{text}` is no address; write localhost:14158, which is where tev listens")),
        }
    }
}

impl LiveArgs {
    /// The viewer, where one is to be told.
    pub(super) fn viewer(&self, console: &Console) -> Option<Viewer> {
        self.tev.as_ref().map(|Address(address)| {
            let (console, place) = (console.clone(), address.clone());
            Viewer::new(address, move |error| {
                console.note(format_args!(
                    "warning: --tev: no images are shown, since the viewer at {place} does not listen: {error}"
                ));
            })
        })
    }
}

/// The photos of a run, seen as they are taken.
pub(super) struct Live {
    console: Console,
    name: String,
    sizes: [Resolution; 2],
    channels: usize,
    viewer: Option<Viewer>,
    state: RefCell<State>,
}

struct State {
    line: Option<Line>,
    strip: ContactSheet,
    taken: u64,
    expected: u64,
}

impl Live {
    /// Looks on a run on `source`.
    pub(super) fn new(args: &LiveArgs, source: &Source, channels: Channels, console: &Console) -> Self {
        let sizes = [source.projector_resolution(), source.resolution()];
        let viewer = args.viewer(console);
        let channels = channels.count();
        let strip = ContactSheet::new(sizes, channels);
        let state = RefCell::new(State { line: None, strip, taken: 0, expected: 0 });
        Self { console: console.clone(), name: source.name(), sizes, channels, viewer, state }
    }

    /// Pixels of photos.
    pub(super) fn resolution(&self) -> Resolution {
        self.sizes[1]
    }

    /// From now on about so many photos, of all channels, are to be taken.
    pub(super) fn expect(&self, photos: usize) {
        let mut state = self.state.borrow_mut();
        state.expected = state.taken + (photos * self.channels) as u64;
        state.line = Some(Line::new(&self.console));
    }

    /// What is known of the answer so far: a residual, a bound. Says whether to go on.
    pub(super) fn so_far(&self, residual: impl Display) -> ControlFlow<()> {
        let mut state = self.state.borrow_mut();
        let (taken, expected) = (state.taken, state.expected.max(state.taken));
        if let Some(line) = &mut state.line {
            line.residual(residual.to_string());
            line.at(taken, expected);
        }
        self.console.check()
    }

    /// No more photos for now.
    pub(super) fn pause(&self) {
        self.state.borrow_mut().line = None;
    }

    /// All photos so far.
    pub(super) fn strip(self) -> ContactSheet {
        self.state.into_inner().strip
    }

    /// `operator`, looked at.
    pub(super) fn watch<'a, O: Adjoint + ?Sized>(
        &'a self,
        channel: usize,
        operator: &'a mut O,
    ) -> Watched<'a, O> {
        Watched { live: self, channel, operator }
    }

    /// All channels, looked at.
    pub(super) fn watch_all<'a, O: Adjoint>(&'a self, channels: &'a mut [O]) -> Vec<Watched<'a, O>> {
        channels.iter_mut().enumerate().map(|(channel, operator)| self.watch(channel, operator)).collect()
    }

    /// A photo more. If `dual`, the pattern is on the camera's side.
    fn seen(&self, channel: usize, pattern: &[f64], photo: &[f64], dual: bool) -> crate::Result<()> {
        let mut state = self.state.borrow_mut();
        state.taken += 1;
        let (taken, expected) = (state.taken, state.expected.max(state.taken));
        if let Some(line) = &mut state.line {
            line.at(taken, expected);
        }
        state.strip.push(channel, pattern, photo, dual)?;
        if self.viewer.is_some() {
            let [patterns, photos] = self.sizes;
            let [of_pattern, of_photo] = if dual { [photos, patterns] } else { [patterns, photos] };
            self.show("pattern", of_pattern, channel, pattern);
            self.show("photo", of_photo, channel, photo);
        }
        match self.console.check() {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(crate::Error::Interrupted),
        }
    }

    /// Shows a channel of an image in the viewer, if there is one.
    pub(super) fn show(&self, what: &str, size: Resolution, channel: usize, values: &[f64]) {
        let Some(viewer) = &self.viewer else { return };
        let channels: &[&str] = if self.channels == 3 { &["R", "G", "B"] } else { &["Y"] };
        viewer.show(Plane {
            name: format!("{} {what}", self.name),
            size,
            channels,
            channel,
            values: values.iter().map(|&value| value as f32).collect(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::Address;

    #[test]
    fn an_address_has_a_host_and_a_port() {
        for good in ["localhost:14158", "10.0.0.7:1", "[::1]:14158"] {
            assert!(good.parse::<Address>().is_ok(), "{good}");
        }
        for wrong in ["", "localhost", ":14158", "localhost:", "localhost:tev", "localhost:70000"] {
            assert!(wrong.parse::<Address>().is_err(), "{wrong}");
        }
    }
}
