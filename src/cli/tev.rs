//! `--tev`: shows every pattern and photo in an image viewer.

use std::str::FromStr;

use super::console::Console;
use super::progress::Display;
use crate::image::Resolution;
use crate::lab::Lab;
use crate::report::viewer::Viewer;

/// Options for watching a run in an image viewer.
#[derive(clap::Args, Default)]
pub(super) struct LiveArgs {
    /// Show every pattern and photo in the image viewer tev that listens there, as they come
    #[arg(long, value_name = "HOST:PORT")]
    tev: Option<Address>,
}

/// An address `HOST:PORT`.
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
    /// The viewer, if the option names one.
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

    /// Shows the photos of a laboratory in the viewer from now on, if the option names a viewer.
    pub(super) fn show(&self, lab: &Lab, console: &Console) {
        let sizes: [Resolution; 2] = [lab.projector_resolution(), lab.resolution()];
        let display = self.viewer(console).map(|viewer| Display {
            viewer,
            name: lab.name(),
            sizes,
            channels: lab.channels().count(),
        });
        console.progress().show_in(display);
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
