//! Light whose photos are kept in a run's folder, or come from there.

use std::cell::RefCell;

use anyhow::Result;

use super::{Light, direct_diagonal};
use crate::cli::about::{self, About};
use crate::cli::console::Console;
use crate::error::Error;
use crate::image::Image;
use crate::journal::Journal;
use crate::transport::{Channels, Part};

/// Light whose photos are in a journal before they are used; without an inner one, only those that are there already.
pub(in crate::cli) struct Kept<'a> {
    pub(super) inner: Option<Light<'a>>,
    pub(super) journal: RefCell<Journal>,
    pub(super) about: About,
    pub(super) channels: usize,
}

impl<'a> Kept<'a> {
    /// Keeps the photos of `inner`.
    pub(in crate::cli) fn new(journal: Journal, about: About, inner: Light<'a>) -> Self {
        let channels = about.channels;
        Self { inner: Some(inner), journal: RefCell::new(journal), about, channels }
    }

    /// Hands out the photos of a run, of as many channels as it had.
    ///
    /// # Errors
    /// [`Error::Option`] when it had not as many.
    pub(in crate::cli) fn replay(journal: Journal, about: About, channels: Channels) -> Result<Self> {
        let channels = channels.count();
        if channels != about.channels {
            return Err(Error::Option {
                option: "--channels".into(),
                fault: format!("the run's photos have {} channels, not {channels}", about.channels),
                help: "give the channels of that run".into(),
            }
            .into());
        }
        Ok(Self { inner: None, journal: RefCell::new(journal), about, channels })
    }

    /// Keeps what a simulator knows beside its photos, so that the run's folder alone can be relit.
    pub(in crate::cli) fn keep_known(&mut self, console: &Console) -> Result<()> {
        let Some(traced) = self.inner.as_ref().and_then(Light::matrix) else { return Ok(()) };
        if let Some(direct) = direct_diagonal(traced) {
            let bytes: Vec<u8> = direct.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
            self.journal.get_mut().note(about::DIRECT, &bytes)?;
        }
        self.image("ambient", |inner| inner.ambient(console)).map(drop)
    }

    /// The image of this name: from the journal, or taken and kept.
    pub(super) fn image(
        &mut self,
        name: &str,
        take: impl FnOnce(&mut Light<'a>) -> Result<Image>,
    ) -> Result<Image> {
        let journal = self.journal.get_mut();
        let resolution = self.about.photos;
        if let Some(bytes) = journal.read_note(name)? {
            let (samples, _) = bytes.as_chunks::<4>();
            let samples: Vec<f32> = samples.iter().map(|&sample| f32::from_le_bytes(sample)).collect();
            return Ok(Image::new(resolution, samples.len() / resolution.pixels().max(1), samples)?);
        }
        let Some(inner) = &mut self.inner else {
            return Err(Error::Journal {
                path: journal.path().into(),
                fault: format!(
                    "the photo `{name}` is not among its {}, and there is no scene",
                    journal.photos()
                ),
                help: "give the scene, with -o and --resume".into(),
            }
            .into());
        };
        let image = take(inner)?;
        let bytes: Vec<u8> = image.samples().iter().flat_map(|sample| sample.to_le_bytes()).collect();
        journal.note(name, &bytes)?;
        Ok(image)
    }
}

/// What the products of a part and channel are called in a journal.
pub(in crate::cli) fn name(part: Part, channel: usize) -> String {
    format!("{part:?}, channel {channel}")
}
