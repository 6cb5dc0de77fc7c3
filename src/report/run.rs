//! What the pages and folders of all runs have in common.

use std::path::{Path, PathBuf};

use super::manifest::Manifest;

/// The files of a run's folder, noted by name as they are asked for.
pub(super) struct Files<'a> {
    folder: &'a Path,
    pub(super) names: Vec<String>,
}

impl<'a> Files<'a> {
    pub(super) fn new(folder: &'a Path) -> Self {
        Self { folder, names: Vec::new() }
    }

    pub(super) fn path(&mut self, name: &str) -> PathBuf {
        self.names.push(name.to_owned());
        self.folder.join(name)
    }
}

/// The facts of a run, as far as its record has them, with `more` of its own after those of the scene.
pub(super) fn facts(
    manifest: &Manifest,
    photos: usize,
    more: impl IntoIterator<Item = (&'static str, String)>,
    seconds: f64,
) -> Vec<(String, String)> {
    let mut facts = vec![("Photos", photos.to_string())];
    facts.extend(manifest.scene.as_ref().map(|scene| ("Scene", scene.path.clone())));
    facts.extend(manifest.resolution.map(|resolution| ("Pixels", resolution.to_string())));
    facts.extend(manifest.samples_per_pixel.map(|samples| ("Samples per pixel", samples.to_string())));
    facts.extend(manifest.max_bounces.map(|bounces| ("Bounces at most", bounces.to_string())));
    facts.extend(manifest.noise.map(|noise| {
        let [matrix, global] = [noise.operator, noise.global].map(|share| 100.0 * share);
        ("Noise of the matrix", format!("{matrix:.2} %, {global:.2} % without direct light"))
    }));
    facts.extend(more);
    facts.extend(manifest.seed.map(|seed| ("Seed", seed.to_string())));
    facts.extend(manifest.adapter.as_ref().map(|adapter| ("Adapter", adapter.name.clone())));
    facts.push(("Time", format!("{seconds:.1} s")));
    facts.push(("Started", manifest.started.clone()));
    facts.push(("krylux", manifest.version.clone()));
    facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}
