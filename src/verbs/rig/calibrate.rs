//! The calibration of a rig from captures, stored in a folder with curves, pictures, a report and a page.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::calibrate::{CalibrateOptions, CalibrationReport, MapBy};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::io::name::Name;
use crate::lab::{Log, RigSource, RunFolder, RunOptions};
use crate::measure::{Calibration, Effort};
use crate::report::content::Content;
use crate::report::html::{Block, Outcome, Report, Section, Verdict};
use crate::report::plot::{LinePlot, Series};
use crate::report::{colormap, figure, run};

/// Measure a rig's devices from captures alone: responses, noise, pixel map, uneven brightness, latency, drift
#[derive(clap::Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(after_help = "Example:\n  krylux rig calibrate rig.toml --use")]
pub struct Calibrate {
    /// Frames averaged for each level and pattern
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub takes: u32,
    /// Levels of the projector that are shown at most; those between them are interpolated [default: 257, or 33 where more than
    /// half a second passes from one frame to the next]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(3..))]
    pub levels: Option<u16>,
    /// What the pixel map is made from [default: Gray codes, or a checkerboard where the camera has less than 1.5 pixels
    /// for each of the projector's along an axis]
    #[arg(long, value_enum)]
    pub map: Option<MapBy>,
    /// Where the calibration goes; --use, or the line `calibration = …` in the rig file, makes verbs use it [default: what the
    /// rig file names, or NAME-calibration beside it; with a number behind it where an earlier calibration is there, which stays as it is]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// Use it from now on: write the line `calibration = …` into the rig file as soon as the calibration is whole. Comments and all else in the file
    /// stay as they are
    #[arg(long = "use")]
    pub is_used: bool,
    /// Calibrate anew into a folder that holds a calibration's photos, and throw these away
    #[arg(long)]
    pub overwrite: bool,
    /// Go on with the calibration in the folder: no photo that is in its journal is taken again
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
}

/// A finished calibration.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The accuracy of the calibration.
    pub report: CalibrationReport,
    /// The number of photos and the time that the calibration took.
    pub effort: Effort,
    /// The folder.
    pub folder: PathBuf,
    /// Whether the rig file names the folder, and a line that reports this.
    used: (bool, Option<String>),
}

impl Calibrate {
    /// The options of the measurement.
    pub fn options(&self) -> CalibrateOptions {
        let levels = self.levels.map(usize::from);
        CalibrateOptions { takes: self.takes, levels, map: self.map, ..CalibrateOptions::default() }
    }

    /// Calibrates the devices, and writes the calibration and a report into a folder, with a journal of all photos.
    ///
    /// # Errors
    /// The errors of [`calibrate`](crate::calibrate::calibrate); [`Error::Write`]; [`Error::Option`] for a folder that holds a run.
    pub fn ask(&self, rig: &RigSource) -> Result<Calibrated> {
        let again = self.overwrite || self.resume;
        let folder = self.folder.clone().unwrap_or_else(|| rig.next_calibration_folder(again));
        let run = RunOptions { folder: Some(folder), overwrite: self.overwrite, resume: self.resume };
        let write = |run: &RunFolder, found: &Calibration, report: &CalibrationReport| {
            write_files(&run.answer, found, report)?;
            page(&rig.name(), run, found, report)?.write(&run.answer.join("report.html"))
        };
        let (report, effort, folder) = rig.calibrate_in(&run, &self.options(), write)?;
        let earlier = rig.file.calibration.as_deref();
        let used = if earlier == Some(folder.as_path()) {
            (true, None)
        } else if self.is_used {
            if let Err(error) = rig.name_calibration(&folder) {
                // The calibration is complete, so its figures and its folder are told before the error.
                let unnamed = Calibrated { report, effort, folder, used: (false, None) };
                unnamed.content().lines.iter().for_each(|line| rig.observer().info(format_args!("{line}")));
                return Err(error);
            }
            let before =
                earlier.map(|earlier| format!("; before, it was {}", earlier.display())).unwrap_or_default();
            (true, Some(format!("used      by {} from now on{before}", rig.file.path.display())))
        } else {
            let note = format!(
                "note: no verb uses it yet; name it in {} as `calibration = {:?}` (relative to that file), or give --use, which writes this line",
                rig.file.path.display(),
                folder.file_name().unwrap_or(folder.as_os_str())
            );
            (false, Some(note))
        };
        Ok(Calibrated { report, effort, folder, used })
    }
}

impl Calibrated {
    /// The figures of the calibration, and the path of its folder.
    pub fn content(&self) -> Content<'static> {
        let mut content = measured_figures(&self.report);
        content.line(format_args!("wrote     {}", self.folder.display()));
        match &self.used {
            (true, said) => said.iter().for_each(|line| content.line(line)),
            (false, said) => said.iter().for_each(|note| content.note(note)),
        }
        content.fact("folder", Name::from(&self.folder));
        content.fact("used", self.used.0);
        content.fact("effort", self.effort);
        content
    }
}

/// The figures of a calibration, and the lines that describe them.
pub fn measured_figures(report: &CalibrationReport) -> Content<'static> {
    let mut content = Content::default();
    report.lines().iter().for_each(|[of, text]| content.line(format_args!("{of:<9} {text}")));
    content.fact("report", report);
    content.detail("lines", content.lines.clone());
    content
}

/// Writes `report.json`, `projector-curve.svg`, `latency.svg`, `drift.svg` and `footprints.png` into `folder`. The last file shows the
/// number of camera pixels for each projector pixel; brighter is more. Fails with [`Error::Write`].
fn write_files(folder: &Path, calibration: &Calibration, report: &CalibrationReport) -> Result<()> {
    let path = folder.join("report.json");
    let text = serde_json::to_string_pretty(report).map_err(|error| Error::writing(&path)(error.into()))?;
    atomic::write_bytes(&path, (text + "\n").as_bytes())?;
    for (name, _, plot) in plots(calibration, report) {
        atomic::write_bytes(&folder.join(format!("{name}.svg")), plot.render().as_bytes())?;
    }
    let counts = footprints(calibration);
    let most = counts.iter().copied().fold(1.0, f64::max);
    colormap::paint_sequential(calibration.registration.projector, &counts, None, (0.0, most))?
        .write_png(&folder.join("footprints.png"))
}

fn page(
    name: &str,
    run: &RunFolder,
    calibration: &Calibration,
    report: &CalibrationReport,
) -> Result<Report> {
    let rows = report.lines().iter().map(|row| row.to_vec()).collect();
    let table = Block::table(["Of", "Measured"], rows, "");
    let map = figure::amounts(
        calibration.registration.projector,
        &footprints(calibration),
        "camera pixels",
        "Camera pixels that see each pixel of the projector",
    )?;
    let curves = plots(calibration, report)
        .map(|(_, caption, plot)| Block::Plot { svg: plot.render(), caption: caption.into() });
    let section =
        |title: &str, text: &str, blocks| Section { title: title.into(), text: text.into(), blocks };
    let taken = report.effort.frames();
    let sentence = format!("Calibrated from {taken} frames, from captures alone.");
    Ok(Report {
        title: format!("{name} · calibration"),
        verdict: Verdict { outcome: Outcome::Good, sentence },
        facts: run::facts(&run.manifest, usize::try_from(taken).unwrap_or(usize::MAX), [], run.seconds()),
        sections: vec![
            section("Figures", "Each with its standard error.", vec![table]),
            section("Curves", "", curves.into()),
            section("Pixel map", "", vec![Block::Figures(vec![map])]),
        ],
        footer: run.manifest.command_line(),
        ..Report::default()
    })
}

/// The plots with their file names and captions.
fn plots(
    calibration: &Calibration,
    report: &CalibrationReport,
) -> [(&'static str, &'static str, LinePlot); 3] {
    let curves = calibration.projector.iter().enumerate().map(|(channel, curve)| Series {
        name: format!("channel {channel}"),
        points: curve.iter().enumerate().map(|(level, &light)| (level as f64, light)).collect(),
    });
    let stability = &report.stability;
    let line = |points: &[(f64, f64)]| vec![Series { name: String::new(), points: points.to_vec() }];
    let plot = |x: &str, y: &str, series| LinePlot {
        x_label: x.into(),
        y_label: y.into(),
        series,
        ..LinePlot::default()
    };
    [
        (
            "projector-curve",
            "The projector's response: light by level, in shares of the light of white.",
            plot("level", "light, of white", curves.collect()),
        ),
        (
            "latency",
            "How much of a frame's light is there after a wait.",
            plot("seconds waited", "light, of white", line(&stability.sweep)),
        ),
        (
            "drift",
            "The lamp, by white photos in the course of the calibration.",
            plot("seconds", "white, relative to the first", line(&stability.whites)),
        ),
    ]
}

fn footprints(calibration: &Calibration) -> Vec<f64> {
    calibration.registration.starts.windows(2).map(|ends| (ends[1] - ends[0]) as f64).collect()
}
