//! The parts that the pages and folders of all runs have in common.

use std::borrow::Cow;
use std::fmt::{self, Write};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::colormap::robust_range;
use super::contact_sheet::ContactSheet;
use super::content::{Content, Values, shape};
use super::figure;
use super::figure::{difference, mean};
use super::html::{Block, Figure, FileLink, Outcome, Report, Section, Verdict};
use super::print::printed;
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio, merge, worst};
use crate::image::{Image, Resolution};
use crate::io::manifest::{Independent, ProductsOn};
use crate::io::raster::Raster;
use crate::io::{atomic, npy, picture};
use crate::measure::{DirectBy, MeasureOptions, RigRecord, RunManifest};

/// The page of an answer, and the files beside it. Both are still being written.
#[derive(Debug)]
pub struct AnswerPage<'a> {
    /// The title.
    pub title: String,
    /// The result in one sentence.
    pub sentence: String,
    /// The number of photos.
    pub photos: usize,
    /// The resolution of photos.
    pub resolution: Resolution,
    /// The unit of the photos' values.
    pub unit: String,
    /// The contact sheet of all photos; `None` if there are no photos to show.
    pub strip: Option<ContactSheet>,
    /// Whether a page with the matrix exists beside this page, or will be written. That page shows rows of the matrix, for which this page
    /// is too small.
    pub has_paint: bool,
    pub(crate) files: Files<'a>,
    /// Facts of the verb itself. They are placed after the facts of the rig.
    pub(crate) facts: Vec<(&'static str, String)>,
    pub(crate) sections: Vec<Section>,
}

impl AnswerPage<'_> {
    /// Adds a section.
    pub fn section(
        &mut self,
        title: impl Into<String>,
        text: impl Into<String>,
        blocks: impl Into<Vec<Block>>,
    ) {
        self.sections.push(Section { title: title.into(), text: text.into(), blocks: blocks.into() });
    }

    /// Adds the section with the contact sheet. `order` explains the order of the photos.
    pub fn contact_sheet(&mut self, order: &str) -> Result<()> {
        if let Some(strip) = &self.strip {
            self.sections.extend(strip.section(&self.unit, order)?);
        }
        Ok(())
    }

    /// Adds a fact of the verb itself.
    pub fn fact(&mut self, name: &'static str, value: impl ToString) {
        self.facts.push((name, value.to_string()));
    }

    /// Adds a picture for people as the file `FILE.png`: enlarged, with the name and the legend of the figure.
    pub fn picture(&mut self, file: &str, figure: Figure) -> Figure {
        self.files.png(file, printed(&figure));
        figure
    }

    /// Adds files of light in all three formats, and gives the figure the name of the files. `scale` is the exposure of the `.png`.
    pub fn light(&mut self, file: &str, image: &Image, scale: f32, caption: impl Into<String>) -> Figure {
        self.files.image(file, Arc::new(image.clone()));
        let figure = figure::light(image, scale, &self.unit, caption);
        self.picture(file, figure.named(file, format!("{file}.npy")))
    }

    /// A figure of the standard errors of light. Each pixel shows the mean over the channels.
    pub fn errors(&self, errors: &[Vec<f64>], caption: impl Into<String>) -> Result<Figure> {
        figure::amounts(self.resolution, &mean(errors), &self.unit, caption)
    }

    /// A figure of the difference of light. Each pixel shows the mean over the channels.
    pub fn difference(
        &self,
        found: &[Vec<f64>],
        truth: &[Vec<f64>],
        caption: impl Into<String>,
    ) -> Result<Figure> {
        let error = difference(found, truth);
        figure::signed(self.resolution, &error, robust_range(&error, None), &self.unit, caption)
    }

    /// Writes the page and all files, and returns their names. The findings of the answer and of the run determine the colour of the page.
    pub(crate) fn finish(
        mut self,
        findings: Vec<Finding>,
        manifest: &RunManifest,
        seconds: f64,
    ) -> Result<Vec<String>> {
        let mut all = manifest.findings.clone();
        merge(&mut all, findings);
        let found = Section {
            title: "What was found".into(),
            text: "The colour of this page and the exit status follow from these findings.".into(),
            blocks: vec![table(&all)],
        };
        match outcome(&all) {
            _ if all.is_empty() => {}
            Outcome::Good => self.sections.push(found),
            _ => self.sections.insert(0, found),
        }
        let mut files = self.files.links();
        if self.has_paint {
            files.push(FileLink::new(PAINT, "the light transport matrix, to paint with"));
        }
        let page = Report {
            title: self.title,
            verdict: Verdict { outcome: outcome(&all), sentence: sentence_of(self.sentence, &all) },
            facts: facts(manifest, self.photos, self.facts, seconds),
            sections: self.sections,
            files,
            paint: if self.has_paint { PAINT.to_owned() } else { String::new() },
            footer: manifest.command_line(),
        };
        let path = self.files.path("report.html");
        let (files, page) = rayon::join(|| self.files.write(), || page.write(&path));
        files.and(page).map(|()| self.files.names)
    }
}

/// The colour of the page for these findings. It is good if all findings are as expected.
pub(crate) fn outcome(findings: &[Finding]) -> Outcome {
    if worst(findings) == Grade::Ok { Outcome::Good } else { Outcome::Short }
}

/// The sentence of an answer, followed by the findings that fail.
fn sentence_of(mut sentence: String, findings: &[Finding]) -> String {
    for finding in findings.iter().filter(|finding| finding.grade == Grade::Fails) {
        let _ = write!(sentence, " {} fails: {}.", finding.name, finding.found);
    }
    sentence
}

pub(crate) fn table(findings: &[Finding]) -> Block {
    let row = |finding: &Finding| {
        let cells = [&*finding.name, finding.grade.word(), &finding.found, &finding.expected, &finding.help];
        cells.map(str::to_owned).to_vec()
    };
    let headers = ["Examined", "Verdict", "Found", "Expected", "What to do"];
    Block::table(headers, findings.iter().map(row).collect(), "")
}

/// The files in a run's folder. They wait, and are written by all cores, many at a time.
pub(crate) struct Files<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) names: Vec<String>,
    /// Descriptions of some files, by name.
    about: Vec<(String, String)>,
    /// The files that are not written yet, by name.
    waiting: Vec<(String, Job<'a>)>,
    /// The first error of the files that are written.
    error: Option<Error>,
}

/// So many files wait at most, because each one holds its content in memory.
const MOST_WAITING: usize = 32;

type Job<'a> = Box<dyn FnOnce() -> Result<()> + Send + 'a>;

impl<'a> Files<'a> {
    pub(crate) fn new(folder: &'a Path) -> Self {
        Self { folder, names: Vec::new(), about: Vec::new(), waiting: Vec::new(), error: None }
    }

    /// The arrays of an answer.
    pub(crate) fn of(folder: &'a Path, content: Content<'a>) -> Self {
        let mut files = Self::new(folder);
        for array in content.arrays.into_iter().filter(|array| array.is_saved) {
            let name = array.file();
            match array.values {
                Values::F64(values) => files.array(&name, array.shape, || values),
                Values::F32(values) => files.array(&name, array.shape, || values),
                Values::U8(values) => files.array(&name, array.shape, || values),
                Values::Bool(values) => files.array(&name, array.shape, || values),
                Values::Rows(rows) => files.array(&name, array.shape, || Cow::Owned(rows.concat())),
                Values::Image(image) => files.image(&name, image),
            }
        }
        files
    }

    /// Adds a file to the list.
    pub(crate) fn path(&mut self, name: &str) -> PathBuf {
        if !self.names.iter().any(|known| known == name) {
            self.names.push(name.to_owned());
        }
        self.folder.join(name)
    }

    /// Adds a file that [`Files::write`] will write by `write`. It replaces a file of the same name that waits.
    pub(crate) fn later(&mut self, name: &str, write: impl FnOnce(&Path) -> Result<()> + Send + 'a) {
        let path = self.path(name);
        self.waiting.retain(|(other, _)| other != name);
        self.waiting.push((name.to_owned(), Box::new(move || write(&path))));
        if self.waiting.len() >= MOST_WAITING {
            self.write_waiting();
        }
    }

    fn write_waiting(&mut self) {
        let jobs = std::mem::take(&mut self.waiting).into_par_iter();
        let written: Vec<Result<()>> = jobs.map(|(_, job)| job()).collect();
        self.error = self.error.take().or(written.into_iter().find_map(Result::err));
    }

    /// Adds a text.
    pub(crate) fn text(&mut self, name: &str, text: String) {
        self.later(name, move |path| atomic::write_bytes(path, text.as_bytes()));
    }

    fn array<T: npyz::AutoSerialize + Clone + 'static>(
        &mut self,
        name: &str,
        shape: Vec<usize>,
        values: impl FnOnce() -> Cow<'a, [T]> + Send + 'a,
    ) {
        let name = format!("{name}.npy");
        self.about.push((name.clone(), format!("{}, {}", sizes(&shape), element::<T>())));
        self.later(&name, move |path| npy::write_npy(path, &shape, &values()));
    }

    /// Adds an image as `NAME.npy` and `NAME.exr`.
    pub(crate) fn image(&mut self, name: &str, image: impl Deref<Target = Image> + Clone + Send + 'a) {
        let shape = shape(image.resolution(), image.channels());
        let [npy, exr] = ["npy", "exr"].map(|extension| format!("{name}.{extension}"));
        self.about.push((npy.clone(), format!("{}, float32", sizes(&shape))));
        let copy = image.clone();
        self.later(&npy, move |path| picture::write(path, &copy));
        self.later(&exr, move |path| picture::write(path, &image));
    }

    /// Adds a picture as `NAME.png`.
    pub(crate) fn png(&mut self, name: &str, picture: Raster) {
        self.later(&format!("{name}.png"), move |path| picture.write_png(path));
    }

    /// Writes all files that wait. Fails with the first error in the order of the files.
    pub(crate) fn write(&mut self) -> Result<()> {
        self.write_waiting();
        self.error.take().map_or(Ok(()), Err)
    }

    /// Links to the files so far: first the files with the results, then the record of the run.
    pub(crate) fn links(&self) -> Vec<FileLink> {
        let order = |name: &str| match name.rsplit('.').next() {
            Some("npy") => 0,
            Some("csv" | "json") => 1,
            Some("exr") => 2,
            _ => 3,
        };
        let mut names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        names.sort_by_key(|name| order(name));
        let about = |name: &str| {
            let found = self.about.iter().find(|(of, _)| of == name);
            found.map_or(String::new(), |(_, about)| about.clone())
        };
        let record = FileLink::new("run.json", "the record of the run");
        names.into_iter().map(|name| FileLink::new(name, about(name))).chain([record]).collect()
    }
}

impl fmt::Debug for Files<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Files")
            .field("folder", &self.folder)
            .field("names", &self.names)
            .finish_non_exhaustive()
    }
}

/// The page that contains the matrix of a run and computes photos of painted patterns.
pub const PAINT: &str = "paint.html";

/// A shape as text: `10 × 128 × 128`.
fn sizes(shape: &[usize]) -> String {
    shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" × ")
}

/// The name of an element type in NumPy.
fn element<T>() -> &'static str {
    match std::any::type_name::<T>() {
        "f32" => "float32",
        "f64" => "float64",
        "u8" => "uint8",
        other => other,
    }
}

/// The facts of the run from its record. `more` are facts of the command itself, which are placed after the facts of the rig.
pub(crate) fn facts(
    manifest: &RunManifest,
    photos: usize,
    more: impl IntoIterator<Item = (&'static str, String)>,
    seconds: f64,
) -> Vec<(String, String)> {
    let mut facts = vec![("Photos", photos.to_string())];
    facts.extend(manifest.scene.as_ref().map(|file| ("Source", file.path.to_string())));
    facts.extend(manifest.resolution.map(|resolution| ("Pixels", resolution.to_string())));
    facts.extend(manifest.samples_per_pixel.map(|samples| ("Samples per pixel", samples.to_string())));
    facts.extend(manifest.max_bounces.map(|bounces| ("Bounces at most", bounces.to_string())));
    facts.extend(manifest.noise.map(|noise| {
        let [matrix, global] = [noise.operator, noise.global].map(|share| 100.0 * share);
        ("Noise of the matrix", format!("{matrix:.2} %, {global:.2} % without direct light"))
    }));
    facts.extend(manifest.products.map(|on| {
        let on = match on {
            ProductsOn::Cpu => "on the processor",
            ProductsOn::Device => "on the adapter",
        };
        ("Products", on.to_owned())
    }));
    facts.extend(manifest.rig.iter().flat_map(rig_facts));
    facts.extend(manifest.verification.as_ref().map(|found| {
        let by = match found.by {
            Independent::AnotherSeed => "Checked by light paths of another seed",
            Independent::AnotherPhoto => "Checked by one more photo",
        };
        (by, found.sentence())
    }));
    facts.extend(more);
    facts.extend(manifest.seed.map(|seed| ("Seed", seed.to_string())));
    facts.extend(manifest.adapter.as_ref().map(|adapter| ("Adapter", adapter.name.clone())));
    facts.push(("Time", format!("{seconds:.1} s")));
    facts.push(("Started", manifest.started.clone()));
    facts.push(("krylux", manifest.version.clone()));
    facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// The facts of a rig: the effort and the method of its measurements.
fn rig_facts(rig: &RigRecord) -> Vec<(&'static str, String)> {
    let effort = &rig.effort;
    let mut facts = vec![
        ("Patterns", rig.patterns.to_string()),
        ("Frames", format!("{} shown, {} taken", effort.shown, effort.taken)),
        ("Time on the rig", format!("{:.1} s", effort.seconds)),
    ];
    if effort.taken > 0 {
        facts.push(("Time of a photo", effort.times.each(effort.taken).to_string()));
    }
    if effort.replayed > 0 {
        facts.push(("From the journal", format!("{} frames", effort.replayed)));
    }
    if effort.dropped + effort.incomplete + effort.repeated + effort.late + effort.restarts > 0 {
        facts.push((
            "Refused",
            format!(
                "{} dropped, {} incomplete, {} repeated, {} late; {} restarts",
                effort.dropped, effort.incomplete, effort.repeated, effort.late, effort.restarts
            ),
        ));
    }
    facts.push(("Calibration", rig.calibration.clone().unwrap_or("none: devices taken as ideal".into())));
    facts.push(("Stages", stages(&rig.measurement)));
    facts.extend(rig.noise.map(|noise| ("Noise of the white photo", Ratio::from(noise).to_string())));
    facts.extend(rig.drift.map(|drift| ("Drift of the lamp", Ratio::from(drift).to_string())));
    facts
}

/// The stages of processing from counts to light, in words.
pub(crate) fn stages(options: &MeasureOptions) -> String {
    let times = |count: u32, what: &str| (count > 1).then(|| format!("{count} {what}"));
    let named = |on: bool, name: &str| on.then(|| name.to_owned());
    let parts = [
        times(options.takes, "takes"),
        times(options.bit_planes, "bit planes"),
        match options.exposures.len() as u32 {
            0 => times(options.brackets, "exposures at most"),
            exposures => times(exposures, "exposures"),
        },
        named(options.ambient, "ambient light subtracted"),
        named(options.response, "responses undone"),
        named(options.registration, "registered"),
        named(options.direct == DirectBy::Patterns, "direct light by patterns"),
        (options.blur > 0.0).then(|| format!("blur of {} pixels", options.blur)),
        (options.sentinel_every > 0)
            .then(|| format!("white again every {} patterns", options.sentinel_every)),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More files than wait at once are all written and listed once. Of two with one name the later one counts, and the first error is told.
    #[test]
    fn files_that_wait_are_written_once() -> Result<()> {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let mut files = Files::new(folder.path());
        files.text("0.txt", "replaced".into());
        (0..70).for_each(|number| files.text(&format!("{number}.txt"), number.to_string()));
        files.write()?;
        assert_eq!(files.names.len(), 70);
        for number in [0, 31, 32, 69] {
            let text = std::fs::read_to_string(folder.path().join(format!("{number}.txt")));
            assert_eq!(text.ok(), Some(number.to_string()));
        }
        for name in ["first fault", "second fault"] {
            files.later(name, move |_| Err(Error::Numerical(name.into())));
        }
        (0..70).for_each(|number| files.text(&format!("{number}.txt"), String::new()));
        let error = files.write().expect_err("two files fail").to_string();
        assert!(error.contains("first fault"), "{error}");
        files.write()
    }
}
