//! The page of reproduced figures: the paper's statements, the measured numbers, and whether they agree.

mod numbers;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use self::numbers::{FigureRecord, bounds_verdict, is_judged, markdown, number};
use super::{Content, Figure, Panel, Reproduced};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::io::name::Name;
use crate::io::raster::exposure;
use crate::lab::RunFolder;
use crate::measure::RunManifest;
use crate::report::colormap::robust_range;
use crate::report::contact_sheet::ContactSheet;
use crate::report::figure;
use crate::report::html::{Block, Figure as PageFigure, Measured, Outcome, Report, Section, Sheet, Verdict};
use crate::report::run::{self, Files};
use crate::report::spectrum::narrowed;

/// Reproduced figures for one page. A figure may occur several times, from different rigs.
#[derive(Clone, Debug)]
pub struct Gallery<'a> {
    /// The reproductions.
    pub made: &'a [Reproduced],
    /// Whether the figures are smaller than the paper's; the page says so.
    pub quick: bool,
}

impl Gallery<'_> {
    /// Writes `report.html`, `figures.json`, the table `figures.md` and every picture into `folder`; returns their names. The run took
    /// `seconds` so far.
    ///
    /// # Errors
    /// [`Error::Write`] naming the file; [`Error::Dimension`] when a picture's values do not match its resolution.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let mut sections = vec![self.overview()];
        for figure in Figure::ALL {
            let made: Vec<&Reproduced> = self.made.iter().filter(|made| made.figure == figure).collect();
            if !made.is_empty() {
                sections.push(section(figure, &made, &mut files)?);
            }
        }
        let json = serde_json::to_string_pretty(&self.summary())
            .map_err(|error| Error::Numerical(format!("figures.json: {error}")))?;
        atomic::write_bytes(&files.path("figures.json"), format!("{json}\n").as_bytes())?;
        let table = markdown(self.made, self.quick, &named(&manifest.command));
        atomic::write_bytes(&files.path("figures.md"), table.as_bytes())?;
        let photos = self.made.iter().map(|made| made.photos).sum();
        let report = Report {
            title: "The paper's figures, made again".into(),
            verdict: self.verdict(),
            facts: run::facts(manifest, photos, [], seconds),
            sections,
            files: files.links(),
            footer: manifest.command_line(),
            ..Report::default()
        };
        report.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// Writes the same into the folder of an open run, with the photos and time of each figure. Returns the page. Fails as
    /// [`Gallery::write`] does.
    pub fn write_into(&self, run: &mut RunFolder) -> Result<PathBuf> {
        for made in self.made {
            let took = Duration::try_from_secs_f64(made.seconds).unwrap_or_default();
            run.manifest.record(format!("{}, {}", made.figure.name(), made.rig.name()), took);
        }
        run.manifest.photos = self.made.iter().map(|made| made.photos as u64).sum();
        let start = Instant::now();
        run.answer(|run| self.write(&run.answer, &run.manifest, run.seconds()))?;
        run.manifest.record("files", start.elapsed());
        Ok(run.path.join("report.html"))
    }

    /// Whether all numbers meet their bounds, in a sentence.
    pub fn verdict(&self) -> Verdict {
        let judged = || self.made.iter().flat_map(|made| &made.checks).filter(|check| is_judged(check));
        let (all, met) = (judged().count(), judged().filter(|check| check.is_met()).count());
        let mut sentence =
            format!("{met} of {all} numbers are as the paper's figures, and our bounds, want them");
        let is_short =
            |figure: &Figure| self.made.iter().any(|made| made.figure == *figure && !made.is_met());
        let short: Vec<&str> =
            Figure::ALL.iter().filter(|figure| is_short(figure)).map(|of| of.name()).collect();
        if !short.is_empty() {
            sentence += &format!("; not so in {}", short.join(", "));
        }
        sentence += ".";
        if self.quick {
            // The bounds hold for pictures of full size.
            sentence = "A quick run of small pictures: it shows that everything works, not how well.".into();
        }
        let is_good = short.is_empty() || self.quick;
        Verdict { outcome: if is_good { Outcome::Good } else { Outcome::Short }, sentence }
    }

    /// All numbers, for JSON.
    pub fn summary(&self) -> impl Serialize {
        self.made.iter().map(FigureRecord::of).collect::<Vec<_>>()
    }

    fn overview(&self) -> Section {
        let row = |made: &Reproduced| {
            vec![
                made.figure.title().to_owned(),
                made.rig.name().to_owned(),
                bounds_verdict(made).sentence,
                made.photos.to_string(),
                frames(made.frames),
                format!("{:.1}", made.seconds),
            ]
        };
        let mut rows: Vec<Vec<String>> = self.made.iter().map(row).collect();
        rows.push(vec![
            "All".into(),
            String::new(),
            String::new(),
            self.made.iter().map(|made| made.photos).sum::<usize>().to_string(),
            frames(self.made.iter().map(|made| made.frames).sum()),
            format!("{:.1}", self.made.iter().map(|made| made.seconds).sum::<f64>()),
        ]);
        Section {
            title: "Overview".into(),
            text: "O'Toole and Kutulakos, Light Transport Analysis by Krylov Subspace Illumination, on scenes of our own, \
                   generated by code. What the paper says is told in our words; bounds are ours where it gives none. \
                   Frames are exposures of the virtual camera, those of comparisons included and those of calibrations not. \
                   Seconds include tracing; a scene is traced once for all figures that show it."
                .into(),
            blocks: vec![Block::Table {
                headers: ["Figure", "Rig", "Verdict", "Photos", "Frames", "Seconds"].map(String::from).to_vec(),
                rows,
                caption: String::new(),
            }],
        }
    }
}

fn frames(taken: u64) -> String {
    if taken == 0 { "–".into() } else { taken.to_string() }
}

/// The command, with the name of the program instead of its path.
fn named(command: &[Name]) -> String {
    let mut words: Vec<String> = command.iter().map(Name::to_string).collect();
    if let Some(program) = words.first_mut() {
        *program = Path::new(program)
            .file_name()
            .map_or("krylux".into(), |name| name.to_string_lossy().into_owned());
    }
    words.join(" ")
}

fn section(figure: Figure, made: &[&Reproduced], files: &mut Files<'_>) -> Result<Section> {
    let measured = made.iter().map(|made| Measured {
        title: format!("Ours, {} rig", made.rig.name()),
        text: format!("{}; {:.1} s", made.setting, made.seconds),
        verdict: bounds_verdict(made),
        numbers: made.checks.iter().map(number).collect(),
    });
    let mut blocks = vec![Block::Claim {
        statement: ["The paper, in our words".into(), figure.statement().into()],
        measured: measured.collect(),
    }];
    for made in made {
        let mut figures = Vec::new();
        for panel in &made.panels {
            let picture = painted(panel)?;
            let name = format!("{}-{}-{}.png", figure.name(), made.rig.name(), panel.name);
            atomic::write_bytes(&files.path(&name), &picture.png)?;
            figures.push(picture);
        }
        if !figures.is_empty() {
            blocks.push(Block::Figures(figures));
        }
        for plot in &made.plots {
            blocks.push(Block::Plot { svg: plot.lines.render(), caption: plot.caption.clone() });
        }
        for strip in &made.strips {
            blocks.push(Block::ContactSheet { caption: strip.caption.clone(), sheet: sheet(strip)? });
        }
    }
    Ok(Section { title: figure.title().into(), text: String::new(), blocks })
}

fn painted(panel: &Panel) -> Result<PageFigure> {
    let resolution = panel.resolution;
    let caption = panel.caption.as_str();
    let painted = match &panel.content {
        Content::Labels(labels) => figure::labels(resolution, labels, caption),
        Content::Signed(values) => {
            figure::signed(resolution, values, robust_range(values, None), "", caption)
        }
        Content::Amounts(values) => figure::amounts(resolution, values, "", caption),
        Content::Light { values, white } => {
            let image = narrowed(resolution, values)?;
            let scale = white.map_or_else(|| exposure(&image), |white| (1.0 / white) as f32);
            figure::light(&image, scale, "", caption)
        }
    };
    Ok(painted?.named(&panel.name, ""))
}

fn sheet(strip: &crate::paper::Strip) -> Result<Sheet> {
    let mut photos = ContactSheet::new([strip.resolution; 2], 1);
    strip.photos.iter().try_for_each(|photo| photos.push(0, &photo.from, &photo.to, false))?;
    photos.sheet()
}
