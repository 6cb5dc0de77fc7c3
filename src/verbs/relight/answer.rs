//! The answer of a relighting.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::json;

use super::Relight;
use crate::analysis::low_rank::{Dual, RankRow, Reduced, Relit, SavedModel};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::lab::text::{self, decimal};
use crate::lab::{Answer, Lab, Verb, Verified};
use crate::report::content::{Content, Values};
use crate::report::run::AnswerPage;
use crate::report::text::percentage;

/// A captured model and the photos that it predicts.
#[derive(Clone, Debug)]
pub struct Relighting {
    /// The model.
    pub model: SavedModel,
    /// The number of photos that this run took.
    pub photos: usize,
    /// The scene relit with each pattern.
    pub relit: Vec<Relit>,
    /// Dual photographs.
    pub duals: Vec<Dual>,
    /// Photos without interreflections.
    pub reduced: Vec<Reduced>,
    /// The model's error after each number of photos, if the matrix is known.
    pub curve: Vec<RankRow>,
    /// The largest acceptable error of a relit photo, if one is given.
    pub(super) max_error: Option<f64>,
    pub(super) place: ModelPlace,
}

/// The place where the model is stored at present.
#[derive(Clone, Debug)]
pub(super) enum ModelPlace {
    /// The model is only in memory, and is written with the answer.
    Memory,
    /// The model is in the source folder, and is not copied.
    Source,
    /// The model is in this folder, in these files. If the answer is written to another folder, the model is copied to that folder.
    Folder(PathBuf, Vec<String>),
}

impl Relighting {
    pub(super) fn new(asked: &Relight, model: SavedModel) -> Self {
        Self {
            model,
            photos: 0,
            relit: Vec::new(),
            duals: Vec::new(),
            reduced: Vec::new(),
            curve: Vec::new(),
            max_error: asked.max_error,
            place: ModelPlace::Memory,
        }
    }

    /// The largest error of a relit photo, if the errors are known.
    pub fn worst(&self) -> Option<f64> {
        self.relit.iter().filter_map(|relit| relit.errors.last().copied()).reduce(f64::max)
    }

    /// The number of patterns in words.
    fn patterns(&self) -> String {
        match self.relit.len() {
            1 => "1 pattern".to_owned(),
            count => format!("{count} patterns"),
        }
    }

    /// The largest error of a relit photo and the largest acceptable error, if both are known.
    fn judged(&self) -> Option<[f64; 2]> {
        Some([self.worst()?, self.max_error?])
    }

    fn arrays<'a>(&'a self, content: &mut Content<'a>) {
        for (index, relit) in self.relit.iter().enumerate() {
            content.picture("relit", &relit.relit).key = Some(index);
            if let Some(truth) = &relit.truth {
                content.picture("truth", truth).key = Some(index);
            }
        }
        for (index, dual) in self.duals.iter().enumerate() {
            content.picture("duals", &dual.image).key = Some(index);
        }
        for (index, reduced) in self.reduced.iter().enumerate() {
            content.picture("direct", &reduced.direct).key = Some(index);
        }
        content.picture("ambient", &self.model.ambient);
        let [projector, camera] = [self.model.projector, self.model.resolution].map(|size| size.pixels());
        for (channel, model) in self.model.channels.iter().enumerate() {
            for (name, rows, length) in
                [("basis", model.basis(), projector), ("basis_photos", model.photos(), camera)]
            {
                content.attribute(name, &[rows.len(), length], Values::Rows(rows)).key = Some(channel);
            }
        }
    }

    fn facts(&self, content: &mut Content<'_>) {
        content.fact("photos", self.photos);
        content.fact("rank", self.model.rank());
        let relit = self.relit.iter().map(|relit| {
            json!({
                "pattern": relit.name,
                "relative_error": relit.errors.last(),
                "stated_error": relit.stated,
            })
        });
        content.fact("relit", relit.collect::<Vec<_>>());
        let duals =
            self.duals.iter().map(|dual| json!({ "pattern": dual.name, "relative_error": dual.error }));
        content.fact("dual", duals.collect::<Vec<_>>());
        let reduced = self.reduced.iter().map(|reduced| {
            json!({
                "photo": reduced.name,
                "residual": reduced.residual,
                "relative_error": reduced.error,
            })
        });
        content.fact("inverse", reduced.collect::<Vec<_>>());
        content.fact("matrix", self.curve.last());
        content.detail("curve", &self.curve);
        content.detail("good", self.judged().is_none_or(|[worst, most]| worst <= most));
    }

    fn lines(&self, content: &mut Content<'_>) {
        for Relit { name, errors, stated, .. } in &self.relit {
            let stated = text::percent(*stated);
            match errors.last() {
                Some(error) => content.line(format_args!(
                    "relit     {name}: within {} % of independent light; the photos leave about {stated} % open",
                    text::percent(*error)
                )),
                None => content
                    .line(format_args!("relit     {name}: about {stated} % off, by what the photos leave open")),
            }
        }
        for Reduced { name, error, .. } in &self.reduced {
            let error = error.map(|error| format!(", within {} %", text::percent(error)));
            content.line(format_args!("direct    of {name}{}", error.unwrap_or_default()));
        }
        if let Some(row) = self.curve.last() {
            let optimal = row.optimal.map(|optimal| {
                let (of, best) = (Ratio::of(row.error, optimal, 0.0), text::percent(optimal));
                format!("; the best of rank {} {best} %, of which it is {of}", row.photos)
            });
            let error = text::percent(row.error);
            content.line(format_args!("matrix    within {error} %{}", optimal.unwrap_or_default()));
        }
    }
}

impl Answer for Relighting {
    fn names(&self) -> [&'static str; 2] {
        [Relight::NAME, "low-rank light transport"]
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn headline(&self) -> String {
        let (patterns, rank) = (self.patterns(), self.model.rank());
        let within = self.worst().map(|worst| format!(" within {} of the true photos", percentage(worst)));
        let within = within.unwrap_or_default();
        format!("{patterns} relit{within}, by a model of rank {rank}; {} photos", self.photos)
    }

    fn sentence(&self) -> String {
        let mut text = format!("A model from {} photos relit {}", self.model.rank(), self.patterns());
        if self.photos == 0 {
            text += " at no further photo";
        }
        match self.worst() {
            Some(worst) => {
                let _ = write!(text, ", at worst within {} of the true photo.", percentage(worst));
            }
            None => text.push('.'),
        }
        if let Some((row, optimal)) = self.curve.last().and_then(|row| Some((row, row.optimal?))) {
            let of = Ratio::of(row.error, optimal, 0.0);
            let _ =
                write!(text, " Its error as a matrix is {of} of the best that any matrix of that rank has.");
        }
        text
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        self.arrays(&mut content);
        self.facts(&mut content);
        self.lines(&mut content);
        if let Some([worst, most]) = self.judged().filter(|[worst, most]| worst > most) {
            content.note(format_args!("the error of a relit photo, {}, is above {most}", decimal(worst, 5)));
        }
        content
    }

    fn findings(&self) -> Vec<Finding> {
        let finding = |[worst, most]: [f64; 2]| {
            let grade = if worst <= most { Grade::Ok } else { Grade::Fails };
            let [found, expected] = [worst, most].map(|error| format!("within {}", percentage(error)));
            let found = format!("{found} of the true photos");
            Finding::graded("relit photos", grade, found, expected, "give more --photos")
        };
        self.judged().map(finding).into_iter().collect()
    }

    fn verify(&mut self, lab: &mut Lab) -> Result<Option<Verified>> {
        Ok(lab.verify_relighting(&self.model, &self.relit)?.map(Verified::from))
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let folder = page.files.folder;
        page.files.names.extend(match &self.place {
            ModelPlace::Source => Vec::new(),
            ModelPlace::Folder(run, files) if folder.parent() == Some(run) => files.clone(),
            ModelPlace::Folder(..) | ModelPlace::Memory => self.model.write(folder)?,
        });
        page.title = format!("{} · {}", self.model.source, self.names()[1]);
        page.unit.clone_from(&self.model.unit);
        page.strip.take_if(|_| self.photos == 0);
        self.show_on(page)
    }
}
