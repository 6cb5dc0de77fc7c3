//! The projected pattern and its photo, which all pages of a server have in common.

use tokio_tungstenite::tungstenite::Message;

use super::canvas::{Canvas, Light};
use super::message::{Client, MessageKind, NumberedQuestion, Pending, write, write_answer};
use super::question::PageQuestion;
use crate::analysis::planes::Planes;
use crate::error::{Error, Result};

/// A pattern that is painted, with its photo.
pub struct Session<'a> {
    canvas: Canvas<'a>,
    light: usize,
    pattern: Planes,
    photo: Planes,
    /// Whether the photo is a full product. Otherwise it is a sum of the updates by strokes.
    is_exact: bool,
    /// The number of full photos so far.
    photos: usize,
}

/// The pages that receive an event.
#[derive(Clone, Copy, Debug)]
pub enum Recipients {
    /// All pages, except the page of the author, if there is one.
    AllBut(Option<Client>),
    Only(Client),
}

/// A message to pages. An error is a text message of kind [`MessageKind::Answer`].
#[derive(Clone, Debug)]
pub struct Event {
    pub to: Recipients,
    pub kind: MessageKind,
    pub message: Message,
}

impl Event {
    fn new(to: Recipients, kind: MessageKind, bytes: Vec<u8>) -> Self {
        Self { to, kind, message: Message::binary(bytes) }
    }

    fn failed(client: Client, number: Option<u32>, error: &Error) -> Self {
        let message = Message::text(error_text(number, &error.to_string()));
        Self { to: Recipients::Only(client), kind: MessageKind::Answer, message }
    }
}

impl<'a> Session<'a> {
    /// A session with a black pattern, whose photo is taken at once.
    pub fn new(mut canvas: Canvas<'a>) -> Result<Self> {
        let pattern = vec![vec![0.0; canvas.projector().pixels()]; canvas.channels()];
        let photo = canvas.photo(Light::All, &pattern)?;
        Ok(Self { canvas, light: 0, pattern, photo, is_exact: true, photos: 1 })
    }

    /// The canvas with the source.
    pub fn canvas(&mut self) -> &mut Canvas<'a> {
        &mut self.canvas
    }

    /// The number of full photos. Updates by strokes do not count.
    pub fn photos(&self) -> usize {
        self.photos
    }

    /// The pattern and its photo.
    pub fn shown(&self) -> (&Planes, &Planes) {
        (&self.pattern, &self.photo)
    }

    /// Changes single pixels of the pattern. If there are few changes, and the columns of the matrix are in memory, the photo is updated by
    /// these columns. Otherwise a new photo is taken.
    pub fn change(&mut self, changes: impl IntoIterator<Item = (u32, Vec<f32>)>) -> Result<()> {
        let changes: Vec<(u32, Vec<f32>)> = changes.into_iter().collect();
        let (light, few) = (self.light(), self.canvas.pixels_of_a_product());
        let is_incremental = changes.len() < few;
        for (pixel, values) in changes {
            let pixel = pixel as usize;
            let values: Vec<f64> = values.into_iter().map(f64::from).collect();
            let old = self.pattern.iter().map(|plane| plane[pixel]);
            let change: Vec<f64> = values.iter().zip(old).map(|(new, old)| new - old).collect();
            self.pattern.iter_mut().zip(values).for_each(|(plane, value)| plane[pixel] = value);
            if is_incremental {
                self.canvas.add_pixel(light, pixel, &change, &mut self.photo);
            }
        }
        self.is_exact = false;
        if is_incremental { Ok(()) } else { self.finish() }
    }

    /// Takes a full photo of the pattern, unless the photo is already exact.
    pub fn finish(&mut self) -> Result<()> {
        if !self.is_exact {
            self.photo = self.canvas.photo(self.light(), &self.pattern)?;
            self.is_exact = true;
            self.photos += 1;
        }
        Ok(())
    }

    /// Shows another pattern.
    pub fn replace(&mut self, pattern: Planes) -> Result<()> {
        self.pattern = pattern;
        self.is_exact = false;
        self.finish()
    }

    /// Shows the light with this index. An index beyond the last light is ignored.
    pub fn choose(&mut self, light: usize) -> Result<()> {
        if light < self.canvas.lights().len() && light != self.light {
            self.light = light;
            self.is_exact = false;
        }
        self.finish()
    }

    fn light(&self) -> Light {
        self.canvas.lights()[self.light]
    }

    /// Handles the waiting requests. `send` passes the results to the pages. A failure is reported to the page that sent the request.
    pub(super) fn work(&mut self, pending: Pending, send: &mut dyn FnMut(Event)) {
        let author = pending.author;
        let is_new = author.is_some() || pending.light.is_some();
        let failed = if is_new { self.paint(&pending).err() } else { None };
        let writer = author.map(|(client, _)| client);
        if is_new || !pending.newcomers.is_empty() {
            let number = author.map_or(0, |(_, number)| number);
            for (to, kind, number, planes) in [
                (Recipients::AllBut(writer), MessageKind::Pattern, 0, &self.pattern),
                (Recipients::AllBut(None), MessageKind::Photo, number, &self.photo),
            ] {
                send(Event::new(to, kind, write(kind, self.is_exact, self.light, number, planes)));
            }
        }
        if let (Some(error), Some(client)) = (failed, writer) {
            send(Event::failed(client, None, &error));
        }
        for ((client, kind), pixel) in pending.looks {
            match self.look(kind, pixel) {
                Ok(Some(bytes)) => send(Event::new(Recipients::Only(client), kind, bytes)),
                Ok(None) => {}
                Err(error) => send(Event::failed(client, None, &error)),
            }
        }
        for (client, NumberedQuestion { number, question }) in pending.questions {
            send(match self.answer(number, &question) {
                Ok(bytes) => Event::new(Recipients::Only(client), MessageKind::Answer, bytes),
                Err(error) => Event::failed(client, Some(number), &error),
            });
        }
    }

    fn paint(&mut self, pending: &Pending) -> Result<()> {
        if let Some(light) = pending.light {
            self.choose(light)?;
        }
        if let Some(pattern) = &pending.replace {
            self.replace(pattern.clone())?;
        }
        if !pending.changes.is_empty() {
            self.change(pending.changes.clone())?;
        }
        if pending.is_finished { self.finish() } else { Ok(()) }
    }

    /// The column or row of a pixel. `None` if the pixel does not exist or the row cannot be photographed.
    fn look(&mut self, kind: MessageKind, pixel: u32) -> Result<Option<Vec<u8>>> {
        let light = self.light();
        let is_row = kind == MessageKind::Row;
        let pixels = if is_row { self.canvas.camera() } else { self.canvas.projector() }.pixels();
        if pixel as usize >= pixels {
            return Ok(None);
        }
        let found = match is_row {
            true => self.canvas.row(light, pixel as usize)?,
            false => Some(self.canvas.column(light, pixel as usize)?),
        };
        Ok(found.map(|planes| write(kind, true, self.light, pixel, &planes)))
    }

    fn answer(&mut self, number: u32, question: &PageQuestion) -> Result<Vec<u8>> {
        let found = self.canvas.answer(question)?;
        let text = serde_json::to_string(&found).unwrap_or_default();
        Ok(write_answer(number, &text, &found.planes))
    }
}

/// The text of an error for the page, with the number of the failed question.
pub(super) fn error_text(number: Option<u32>, message: &str) -> String {
    serde_json::json!({ "error": message, "number": number }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::{Lab, LabBuilder, Settings};
    use crate::transport::Channels;

    /// The largest difference of two photos, relative to the brightest pixel.
    fn difference(a: &Planes, b: &Planes) -> f64 {
        let pixels = || a.iter().flatten().zip(b.iter().flatten());
        let brightest = pixels().fold(0.0, |most: f64, (_, b)| most.max(b.abs()));
        pixels().fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / brightest
    }

    fn split(scene: &str) -> LabBuilder {
        Lab::builder(scene).settings(Settings { split_bounces: true, ..Settings::default() })
    }

    #[test]
    fn strokes_add_up_to_the_photo_of_the_pattern_for_every_light() -> Result<()> {
        let mut lab = split("assets/scenes/corner/scene.glb")
            .size(16, 16)
            .samples(16)
            .channels(Channels::Rgb)
            .open()?;
        let mut session = Session::new(Canvas::new(&mut lab)?)?;
        assert_eq!(session.canvas().lights().len(), 5);
        for light in 0..5 {
            session.choose(light)?;
            for step in 0..60_u32 {
                let values = [0, 7, 13].map(|shift| ((step * 31 + shift) % 17) as f32 / 16.0);
                session.change([((step * 37) % 256, values.to_vec())])?;
            }
            let by_strokes = session.shown().1.clone();
            assert!(!session.is_exact);
            session.finish()?;
            let (pattern, exact) = session.shown();
            let (pattern, exact) = (pattern.clone(), exact.clone());
            // The two photos add up sixty columns in different orders, hence the tolerance.
            assert!(difference(&by_strokes, &exact) < 1e-12);
            let light = session.light();
            assert_eq!(session.canvas().photo(light, &pattern)?, exact);
        }
        Ok(())
    }

    #[test]
    fn all_light_is_the_photo_of_the_laboratory() -> Result<()> {
        let mut lab = Lab::builder("assets/scenes/cornell/scene.glb").size(12, 12).samples(8).open()?;
        let pattern = crate::image::Image::filled(lab.projector_resolution(), 1, 0.5);
        let photo = lab.photo(&pattern)?.planes();
        let mut session = Session::new(Canvas::new(&mut lab)?)?;
        session.replace(pattern.planes())?;
        assert!(difference(session.shown().1, &photo) < 1e-7);
        Ok(())
    }

    #[test]
    fn a_row_and_a_column_of_a_symmetric_matrix_are_the_same() -> Result<()> {
        let mut lab = Lab::builder("assets/scenes/zigzag/scene.glb").size(12, 12).samples(16).open()?;
        let mut canvas = Canvas::new(&mut lab)?;
        let column = canvas.column(Light::All, 30)?;
        assert_eq!(canvas.row(Light::All, 30)?, Some(column));
        Ok(())
    }

    #[test]
    fn light_is_added_up_from_its_parts() -> Result<()> {
        let mut lab = split("assets/scenes/corner/scene.glb").size(12, 12).samples(8).open()?;
        let mut canvas = Canvas::new(&mut lab)?;
        let white = vec![vec![1.0; 144]];
        let mut photo = |light| canvas.photo(light, &white);
        let [all, direct, global] = [photo(Light::All)?, photo(Light::Direct)?, photo(Light::Global)?];
        let [second, later] = [photo(Light::Second)?, photo(Light::Later)?];
        let sum = |a: &Planes, b: &Planes| crate::analysis::planes::sum(a, b);
        assert!(difference(&sum(&second, &later), &global) < 1e-6);
        assert!(difference(&sum(&direct, &global), &all) < 1e-6);
        Ok(())
    }
}
