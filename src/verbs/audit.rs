//! An audit of the assumption behind every other verb: a source is a linear, symmetric operator.

use serde::{Deserialize, Serialize};

use super::options::{count, number};
use crate::bench::audit::{AuditOptions, AuditReport, Exact, audit};
use crate::error::{Error, Result};
use crate::finding::Finding;
use crate::lab::{Answer, Lab, Verb};
use crate::report::colormap::{robust_range, sequential_color};
use crate::report::content::Content;
use crate::report::figure;
use crate::report::html::{Block, Legend, Swatch};
use crate::report::run::{AnswerPage, table};
use crate::transport::Part;

/// Check that a source is a linear, symmetric operator: exit 1 where it is not
#[derive(Clone, Debug, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(after_help = "Example:\n  krylux audit rig.toml")]
pub struct Audit {
    /// Random patterns; symmetry is judged by all pairs of them
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = count::<usize>)]
    pub patterns: usize,
    /// Relative deviation from additivity, homogeneity and repeatability that passes
    #[arg(long, value_name = "X", default_value_t = 0.01, value_parser = number::<f64>)]
    pub tolerance: f64,
    /// Asymmetry |A − Aᵀ|/|A| that passes
    #[arg(long, value_name = "X", default_value_t = 0.1, value_parser = number::<f64>)]
    pub asymmetry: f64,
}

impl Audit {
    fn options(&self, seed: u64) -> AuditOptions {
        let Self { patterns, tolerance, asymmetry } = *self;
        AuditOptions { patterns, tolerance, asymmetry, seed, ..AuditOptions::default() }
    }
}

impl Verb for Audit {
    const NAME: &'static str = "audit";
    const NEEDS_PICTURES: bool = true;
    const IS_CHECKED: bool = false;
    const NOT_RESUMED: Option<&'static str> =
        Some("an audit asks whether a photo taken twice is the same, so it keeps none");
    type Answer = AuditReport;

    fn check(&self) -> Result<()> {
        self.options(0).check()
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        let Some(folder) = lab.folder_of_run() else { return Ok(()) };
        Err(Error::data(folder, "its photos do not answer this verb").help("give the scene or the rig"))
    }

    /// Checks the operator and the devices of a rig. No photos are kept, since an audit compares two photos of the same pattern.
    fn answer(&self, lab: &mut Lab) -> Result<AuditReport> {
        let options = &self.options(lab.seed());
        lab.without_journal();
        lab.unexamined();
        let devices = lab.faults_of_devices()?;
        let measured = lab.photos_with(
            |found: &Option<AuditReport>| found.as_ref().is_some_and(Answer::has_white),
            |lab| lab.with_measurement(|measurement| audit(measurement, options)),
        )?;
        if let Some(found) = measured {
            return Ok(AuditReport { devices, ..found });
        }
        let (resolution, patterns) = (lab.resolution(), lab.projector_resolution());
        lab.photos(|lab| {
            let is_known = resolution == patterns || lab.knows_direct();
            let direct = if is_known { Some(lab.white_of(Part::Direct)?.swap_remove(0)) } else { None };
            let mut full = lab.reference_operators(Part::Full)?.swap_remove(0);
            audit(&mut Exact { full: &mut full, direct, resolution, patterns }, options)
        })
    }
}

impl Answer for AuditReport {
    fn names(&self) -> [&'static str; 2] {
        [Audit::NAME, "audit"]
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn headline(&self) -> String {
        self.sentence().trim_end_matches('.').to_owned()
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        let size = [self.resolution.height, self.resolution.width];
        for (name, values) in [("white", &self.white), ("direct-share", &self.direct_share)] {
            if !values.is_empty() {
                content.array(name, &size, values);
            }
        }
        if !self.additivity.is_empty() {
            content.attribute("additivity", &size, &self.additivity);
        }
        content.fact("passed", self.passed());
        content.fact("checks", &self.checks);
        content.fact("devices", &self.devices);
        self.checks.iter().chain(&self.devices).for_each(|finding| content.line(finding));
        content
    }

    fn findings(&self) -> Vec<Finding> {
        self.checks.clone()
    }

    /// The white photo is unknown if the audit failed by saturation. The noise is then unknown, too.
    fn has_white(&self) -> bool {
        !self.white.is_empty()
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let checks = serde_json::to_string_pretty(&self.checks);
        let checks = checks.map_err(|error| Error::writing("audit.json")(error.into()))?;
        page.files.text("audit.json", format!("{checks}\n"));
        let (size, mut figures) = (self.resolution, Vec::new());
        if !self.white.is_empty() {
            let top = self.white.iter().copied().fold(0.0, f64::max);
            let white = figure::sequential(size, &self.white, top, &page.unit, "The photo under white")?;
            figures.push(page.picture("white", white.named("white", "white.npy")));
        }
        if !self.additivity.is_empty() {
            let (range, caption) = (robust_range(&self.additivity, None), "Two halves of white less white");
            let additivity = figure::signed(size, &self.additivity, range, "of white's mean", caption)?;
            figures.push(page.picture("additivity", additivity.named("additivity", "")));
        }
        if !self.shadow.is_empty() {
            let shadow: Vec<f64> = self.shadow.iter().map(|&shadow| f64::from(u8::from(shadow))).collect();
            let caption = "Direct shadows: what the camera sees, but the projector does not light";
            let mut figure = figure::sequential(size, &shadow, 1.0, "", caption)?.named("shadow", "");
            let swatch =
                |(value, text): (f64, &str)| Swatch { color: sequential_color(value), text: text.into() };
            figure.legend = Legend::Swatches([(0.0, "lit"), (1.0, "in shadow")].map(swatch).to_vec());
            figures.push(page.picture("shadow", figure));
        }
        page.section("Pictures", "", [Block::Figures(figures)]);
        if !self.devices.is_empty() {
            let text = "What projector and camera do without being asked, and what is in the way of their light. It may be why a check fails; it does not fail the audit by itself.";
            page.section("Devices", text, [table(&self.devices)]);
        }
        Ok(())
    }
}
