//! The page of reproduced figures: the paper's statements, the measured numbers, and whether they agree.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::check::digits;
use super::{Check, Content, Figure, Limit, Panel, Reproduced, Rig, Strip};
use crate::error::{Error, Result};
use crate::io::name::Name;
use crate::io::raster::exposure;
use crate::lab::RunFolder;
use crate::measure::RunManifest;
use crate::report::colormap::robust_range;
use crate::report::contact_sheet::ContactSheet;
use crate::report::figure;
use crate::report::html::{
    Block, Figure as PageFigure, Measured, Number, Outcome, Report, Section, Sheet, Verdict,
};
use crate::report::run::{self, Files};
use crate::report::spectrum::narrowed;

/// Reproduced figures for one page. A figure may occur several times, from different rigs.
#[derive(Clone, Debug)]
pub struct Gallery<'a> {
    /// The reproductions.
    pub made: &'a [Reproduced],
    /// Whether the figures are smaller than full size. If so, the page states this.
    pub quick: bool,
}

impl Gallery<'_> {
    /// Writes `report.html`, `figures.json`, the table `figures.md` and every picture into `folder`. Returns the names of the files.
    /// `seconds` is the duration of the run so far.
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
        files.text("figures.json", format!("{json}\n"));
        let table = markdown(self.made, self.quick, &named(&manifest.command));
        files.text("figures.md", table);
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
        let path = files.path("report.html");
        let (written, page) = rayon::join(|| files.write(), || report.write(&path));
        written.and(page).map(|()| files.names)
    }

    /// Writes the same files into the folder of an open run, with the photos and time of each figure. Returns the page. Fails as
    /// [`Gallery::write`].
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

    /// A sentence about whether all numbers meet their bounds.
    pub fn verdict(&self) -> Verdict {
        let judged = || self.made.iter().flat_map(|made| &made.checks).filter(|check| is_judged(check));
        let (all, met) = (judged().count(), judged().filter(|check| check.is_met()).count());
        let mut sentence = format!("{met} of {all} numbers meet their bounds");
        let is_short =
            |figure: &Figure| self.made.iter().any(|made| made.figure == *figure && !made.is_met());
        let short: Vec<&str> =
            Figure::ALL.iter().filter(|figure| is_short(figure)).map(|of| of.name()).collect();
        if !short.is_empty() {
            sentence += &format!("; not so in {}", short.join(", "));
        }
        sentence += ".";
        if self.quick {
            // The bounds hold only for pictures of full size, so a quick run is not judged by them.
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
            let words = [made.figure.title(), made.rig.name(), &bounds_verdict(made).sentence];
            [words.map(str::to_owned), costs(made.photos as u64, made.frames, made.seconds)].concat()
        };
        let mut rows: Vec<Vec<String>> = self.made.iter().map(row).collect();
        let [photos, frames] = [|made: &Reproduced| made.photos as u64, |made: &Reproduced| made.frames]
            .map(|of| self.made.iter().map(of).sum::<u64>());
        let seconds = self.made.iter().map(|made| made.seconds).sum();
        rows.push([["All", "", ""].map(str::to_owned), costs(photos, frames, seconds)].concat());
        Section {
            title: "Overview".into(),
            text: "O'Toole and Kutulakos, Light Transport Analysis by Krylov Subspace Illumination, on scenes of our own, \
                   generated by code. What the paper says is told in our words, with its section. Its text has numbers of photos, pixels, \
                   groups and eigenvectors, but no measured value to compare with: all bounds are ours. Beside each bound stands what a wrong answer scores. \
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

/// Photos, frames and seconds.
fn costs(photos: u64, frames: u64, seconds: f64) -> [String; 3] {
    let frames = if frames == 0 { "–".into() } else { frames.to_string() };
    [photos.to_string(), frames, format!("{seconds:.1}")]
}

/// The command line, with the name of the program in place of its path.
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
            let name = format!("{}-{}-{}", figure.name(), made.rig.name(), panel.name);
            files.png(&name, picture.picture.clone());
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
        Content::Labels(labels) => Ok(figure::labels(resolution, labels, caption)),
        Content::Signed(values) => {
            figure::signed(resolution, values, robust_range(values, None), "", caption)
        }
        Content::Amounts(values) => figure::amounts(resolution, values, "", caption),
        Content::Light { values, white } => {
            let image = narrowed(resolution, values)?;
            let scale = white.map_or_else(|| exposure(&image), |white| (1.0 / white) as f32);
            Ok(figure::light(&image, scale, "", caption))
        }
    };
    Ok(painted?.named(&panel.name, ""))
}

fn sheet(strip: &Strip) -> Result<Sheet> {
    let mut photos = ContactSheet::new([strip.resolution; 2], 1);
    strip.photos.iter().try_for_each(|photo| photos.push(0, &photo.from, &photo.to, false))?;
    photos.sheet()
}

fn is_judged(check: &Check) -> bool {
    check.limit != Limit::Stated
}

/// `met`, or the number of missed bounds.
fn bounds_verdict(made: &Reproduced) -> Verdict {
    let judged = made.checks.iter().filter(|check| is_judged(check)).count();
    let missed = made.checks.iter().filter(|check| !check.is_met()).count();
    if missed == 0 {
        Verdict { outcome: Outcome::Good, sentence: "met".into() }
    } else {
        Verdict { outcome: Outcome::Short, sentence: format!("{missed} of {judged} not met") }
    }
}

fn number(check: &Check) -> Number {
    let mut bound = wanted(check);
    if let (true, Some((name, value))) = (is_judged(check), &check.wrong) {
        bound += &format!(" ({name}: {})", digits(*value));
    }
    let (wanted, outcome) = match (is_judged(check), check.is_met()) {
        (false, _) => (bound, None),
        (true, true) => (format!("{bound}: met"), Some(Outcome::Good)),
        (true, false) => {
            let missed = match check.is_idle() {
                true => format!("{bound}: counts as not met. {}", check.cause()),
                false => format!("{bound}: not met, by {}. {}", digits(check.shortfall()), check.cause()),
            };
            (missed, Some(Outcome::Short))
        }
    };
    Number { what: check.what.clone(), value: digits(check.value), wanted, outcome }
}

/// A reproduced figure as JSON, with its members in the order of their names. Values that are not finite are null.
#[derive(Serialize)]
struct FigureRecord<'a> {
    checks: Vec<CheckRecord<'a>>,
    figure: &'static str,
    frames: u64,
    met: bool,
    photos: usize,
    rig: &'static str,
    seconds: f64,
    setting: &'a str,
}

#[derive(Serialize)]
struct CheckRecord<'a> {
    bound: &'static str,
    cause: String,
    limit: Option<f64>,
    met: bool,
    value: f64,
    what: &'a str,
    wrong: Option<(&'a str, f64)>,
}

impl<'a> FigureRecord<'a> {
    fn of(made: &'a Reproduced) -> Self {
        let check = |check: &'a Check| {
            let (bound, limit) = match check.limit {
                Limit::AtLeast(limit) => ("at least", Some(limit)),
                Limit::AtMost(limit) => ("at most", Some(limit)),
                Limit::Stated => ("stated", None),
            };
            let (met, value) = (check.is_met(), check.value);
            let wrong = check.wrong.as_ref().map(|(name, value)| (name.as_str(), *value));
            CheckRecord { bound, cause: check.cause(), limit, met, value, what: &check.what, wrong }
        };
        Self {
            checks: made.checks.iter().map(check).collect(),
            figure: made.figure.name(),
            frames: made.frames,
            met: made.is_met(),
            photos: made.photos,
            rig: made.rig.name(),
            seconds: made.seconds,
            setting: &made.setting,
        }
    }
}

/// The page in Markdown. `quick` means that the figures are smaller than the paper's figures. `command` is the command of the run.
fn markdown(made: &[Reproduced], quick: bool, command: &str) -> String {
    let mut page = String::from("# The paper's figures, held to bounds\n\n");
    let version = env!("CARGO_PKG_VERSION");
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(
        page,
        "krylux {version} made this page by `{command}`, which leaves it as `figures.md` in the run's folder, beside `report.html` with the \
         pictures and plots. The paper is O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*. What it says is \
         told in our words, with its section. Its text has numbers of photos, pixels, groups and eigenvectors, but no measured value to compare with: all bounds are ours. *Ideal* \
         photos have no devices' faults. *Virtual* ones are of the projector and camera of `realistic.toml`, calibrated from captures. **Bold** \
         numbers miss their bound. A *wrong answer* is scored for each rig, and the score of the ideal one is shown where there is one. A bound that it met would prove \
         nothing, and would count as missed. Numbers of photos count products with the light transport matrix, white included. Ideal segmentations get their global \
         light from the simulator, which takes the direct light away at no photo. On the virtual rig the direct light is measured, and its \
         photos are counted. A frame is one exposure of the virtual camera: patterns of both signs, takes, exposures, black, white and \
         sentinels are counted, calibration is not.\n"
    );
    if quick {
        page += "This is a quick run of small pictures: it shows that everything works, not how well.\n\n";
    }
    page += "| figure | ideal | virtual | photos, ideal | photos, virtual | frames |\n|---|---|---|---|---|---|\n";
    let figures = || Figure::ALL.into_iter().filter(|&figure| made.iter().any(|one| one.figure == figure));
    for figure in figures() {
        let [ideal, virtual_rig] = rigs(made, figure);
        let photos = [ideal, virtual_rig].map(|made| made.map_or("–".into(), |one| one.photos.to_string()));
        let frames = virtual_rig.map_or("–".into(), |one| one.frames.to_string());
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {frames} |",
            figure.title(),
            met(ideal.into_iter()),
            met(virtual_rig.into_iter()),
            photos.join(" | "),
        );
    }
    let of_rig = |at: usize| met(figures().filter_map(|figure| rigs(made, figure)[at]));
    let _ = writeln!(page, "| **All** | **{}** | **{}** | | | |", of_rig(0), of_rig(1));
    for figure in figures() {
        table_of(&mut page, figure, rigs(made, figure));
    }
    page
}

fn rigs(made: &[Reproduced], figure: Figure) -> [Option<&Reproduced>; 2] {
    [Rig::Ideal, Rig::Virtual].map(|rig| made.iter().find(|one| one.figure == figure && one.rig == rig))
}

fn met<'a>(made: impl Iterator<Item = &'a Reproduced>) -> String {
    let judged: Vec<&Check> = made.flat_map(|one| &one.checks).filter(|check| is_judged(check)).collect();
    let met = judged.iter().filter(|check| check.is_met()).count();
    if judged.is_empty() { "–".into() } else { format!("{met} of {}", judged.len()) }
}

fn table_of(page: &mut String, figure: Figure, rigs: [Option<&Reproduced>; 2]) {
    let checks = rigs.map(|one| one.map_or(&[][..], |one| &one.checks));
    let setting = rigs.iter().flatten().next().map_or("", |one| one.setting.as_str());
    let _ = writeln!(page, "\n## {}\n\n{}\n\nHere: {setting}.\n", figure.title(), figure.statement());
    *page += "| number | wanted | a wrong answer | ideal | virtual |\n|---|---|---|---|---|\n";
    // Each number has one row, in the order of the first rig. Some numbers exist for one rig only.
    let mut rows: Vec<&Check> = checks[0].iter().collect();
    rows.extend(checks[1].iter().filter(|check| find(checks[0], &check.what).is_none()));
    for row in rows {
        let [ideal, virtual_rig] = checks.map(|of| find(of, &row.what).map_or("–".into(), value));
        let wrong = row.wrong.as_ref().filter(|_| is_judged(row));
        let wrong = wrong.map_or(String::new(), |(name, value)| format!("{name}: {}", digits(*value)));
        let _ = writeln!(page, "| {} | {} | {wrong} | {ideal} | {virtual_rig} |", row.what, wanted(row));
    }
    let mut missed = String::new();
    for (name, of) in ["ideal", "virtual"].into_iter().zip(checks) {
        for check in of.iter().filter(|check| !check.is_met()) {
            let _ = writeln!(missed, "* *{}*, {name}: {}", check.what, check.cause());
        }
    }
    if !missed.is_empty() {
        let _ = writeln!(page, "\nWhere it misses its bounds, and why:\n\n{}", missed.trim_end());
    }
}

fn find<'a>(checks: &'a [Check], what: &str) -> Option<&'a Check> {
    checks.iter().find(|check| check.what == what)
}

fn wanted(check: &Check) -> String {
    match check.limit {
        Limit::AtLeast(limit) => format!("at least {}", digits(limit)),
        Limit::AtMost(limit) => format!("at most {}", digits(limit)),
        Limit::Stated => String::new(),
    }
}

fn value(check: &Check) -> String {
    let value = digits(check.value);
    if check.is_met() { value } else { format!("**{value}**") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missed_says_by_how_much_and_what_is_stated_says_nothing() {
        let missed = number(&Check::of("purity").at_least(0.75, 0.99));
        assert_eq!(
            (missed.outcome, missed.wanted.as_str()),
            (Some(Outcome::Short), "at least 0.99: not met, by 0.24. The cause is not proven.")
        );
        let met = number(&Check::of("photos").at_most(9.0, 12.0).refutes("random labels", f64::INFINITY));
        assert_eq!(
            (met.outcome, met.wanted.as_str()),
            (Some(Outcome::Good), "at most 12 (random labels: ∞): met")
        );
        let idle = number(&Check::of("index").at_most(0.25, 0.9).refutes("random labels", 0.0));
        assert!(
            idle.outcome == Some(Outcome::Short)
                && idle.wanted.contains("counts as not met. The bound proves"),
            "{}",
            idle.wanted
        );
        let stated = number(&Check::of("optimum, %").stated(4.2));
        assert_eq!((stated.outcome, stated.wanted.as_str()), (None, ""));
    }

    fn of(rig: Rig, checks: Vec<Check>) -> Reproduced {
        Reproduced {
            checks,
            setting: "a wall".into(),
            photos: 50,
            frames: 120,
            ..Reproduced::of(Figure::Fig5, rig)
        }
    }

    #[test]
    fn numbers_of_both_rigs_stand_in_one_row_and_misses_have_their_cause() {
        let nearer = |value: f64| {
            Check::of("nearer")
                .at_least(value, 0.99)
                .refutes("the picture", 0.75)
                .without("Without noise", 1.0)
        };
        let made = [
            of(Rig::Ideal, vec![nearer(1.0)]),
            of(Rig::Virtual, vec![nearer(0.5), Check::of("frames of it").stated(7.0)]),
        ];
        let page = markdown(&made, false, "krylux reproduce fig5 --rig both");
        for line in [
            "| Figure 5: pixels by their eigenvector entries | 1 of 1 | 0 of 1 | 50 | 50 | 120 |",
            "| **All** | **1 of 1** | **0 of 1** | | | |",
            "| nearer | at least 0.99 | the picture: 0.75 | 1 | **0.5** |",
            "| frames of it |  |  | – | 7 |",
            "* *nearer*, virtual: Without noise it is 1, which meets the bound.",
        ] {
            assert!(page.lines().any(|found| found == line), "{line}\n{page}");
        }
        assert!(!page.contains("quick"));
    }

    #[test]
    fn one_rig_leaves_the_column_of_the_other_empty() {
        let made = [of(Rig::Virtual, vec![Check::of("off").at_most(2.0, 1.0)])];
        let page = markdown(&made, true, "krylux reproduce fig5 --quick");
        assert!(page.contains("| off | at most 1 |  | – | **2** |"), "{page}");
        assert!(
            page.contains("* *off*, virtual: The cause is not proven.") && page.contains("quick run"),
            "{page}"
        );
    }
}
