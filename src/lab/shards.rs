//! A scene's matrix on several machines: independently traced shards, their joined matrix, and predicted costs of several processes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::matrix::{ExportedMatrix, bounces_apart};
use crate::cache::{ShardFile, ShardOrigin, write_shard};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::lab::source::{SceneSource, Source};
use crate::lab::text;
use crate::lab::traced::{report_matrix, report_trace, store};
use crate::lab::{CacheChoice, Lab, Log, SharedObserver};
use crate::machine;
use crate::transport::{self, Assembled, Channels, Network, Part, Probe, Scaled, Shard, ShardRecord};

/// A shard and its file.
#[derive(Clone, Debug)]
pub struct TracedShard {
    /// The record of the shard.
    pub record: ShardRecord,
    /// The size of the file in bytes.
    pub bytes: u64,
    /// Whether the shard was traced now. Otherwise it existed already.
    pub is_new: bool,
}

impl Lab {
    /// Traces part `of.0` (from 1) of `of.1` parts of a scene's matrix into a file for [`join_shards`]. If the file already holds this
    /// shard, nothing is traced. A different or damaged shard is replaced.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--shard` for other sources than a scene, and for a part that does not exist; [`Error::Data`] for an
    /// existing file that is not a shard; [`Error::Write`]; errors of tracing.
    pub fn trace_shard(&mut self, of: (usize, usize), file: &Path) -> Result<TracedShard> {
        let refused = |fault: String, help: &str| Err(Error::option("--shard", fault).help(help));
        let Source::Scene(scene) = &self.source else {
            let fault = format!("{} is not traced: only a scene has shards", self.name());
            return refused(fault, "leave it out, or give a scene");
        };
        if let Some(team) = self.settings.team.as_ref().filter(|team| team.size() > 1) {
            let fault = format!("{} processes work together, and trace the whole matrix", team.size());
            return refused(fault, "leave it out, or start one process for each shard");
        }
        scene.trace_shard(self.channels, self.settings.split_bounces, of, file)
    }
}

impl SceneSource {
    fn trace_shard(
        &self,
        channels: Channels,
        split: bool,
        of: (usize, usize),
        file: &Path,
    ) -> Result<TracedShard> {
        let origin = self.shard_origin(channels, split);
        atomic::check_writable(file)?;
        if file.exists() {
            if !ShardFile::is_begun(file)? {
                return Err(Error::data(file, "the file is there, and is not a shard")
                    .help("name another file by -o, or remove this one"));
            }
            if let Some(there) = self.whole_shard(file, &origin, of) {
                return Ok(there);
            }
        }
        let shard = transport::trace_shard(&mut self.tracer(), &self.settings, channels, split, of)?;
        report_trace(&shard.record().summary, &self.observer);
        let bytes = write_shard(file, &origin, &shard)?;
        Ok(TracedShard { record: shard.record().clone(), bytes, is_new: true })
    }

    /// The facts in which all shards of a matrix agree.
    fn shard_origin(&self, channels: Channels, split: bool) -> ShardOrigin {
        let settings = &self.settings;
        let projector = settings.projector.unwrap_or(settings.resolution);
        let more = [
            ("program", format!("krylux {}", env!("CARGO_PKG_VERSION"))),
            ("camera", self.scene.camera.name.clone()),
            ("projector's size", projector.to_string()),
            ("sampler", format!("{:?}", settings.sampler)),
            ("Russian roulette", settings.russian_roulette.to_string()),
            ("number of chains through mirrors", settings.gather.photons.to_string()),
            ("radius of chains through mirrors", settings.gather.radius.to_string()),
            ("splitting of bounces", split.to_string()),
        ];
        let facts = self.facts(channels).into_iter().chain(more);
        ShardOrigin {
            key: self.key(channels, split),
            facts: facts.map(|(name, fact)| (name.to_owned(), fact)).collect(),
        }
    }

    /// The requested shard, if the file already holds it. Otherwise, a note reports why the file is replaced.
    fn whole_shard(&self, file: &Path, origin: &ShardOrigin, of: (usize, usize)) -> Option<TracedShard> {
        let found = ShardFile::open(file).and_then(|there| {
            let record = there.record();
            let mut differences = origin.differences(there.origin());
            if (record.part, record.parts) != of {
                differences.push(format!("it is part {} of {}", record.part, record.parts));
            }
            Ok((differences, there.read()?))
        });
        let replaced = |why: &str| {
            self.observer.note(format_args!("note: {} is replaced: {why}", file.display()));
            None
        };
        match found {
            Ok((differences, shard)) if differences.is_empty() => {
                let bytes = std::fs::metadata(file).map_or(0, |about| about.len());
                Some(TracedShard { record: shard.record().clone(), bytes, is_new: false })
            }
            Ok((differences, _)) => replaced(&differences.join("; ")),
            Err(Error::Data { fault, .. }) => replaced(&fault),
            Err(error) => replaced(&error.to_string()),
        }
    }
}

/// The matrix joined from all shards.
#[derive(Debug)]
pub struct JoinedShards {
    /// The matrix.
    pub traced: Assembled,
    /// Whether the first bounce, the second bounce and all later bounces are separate matrices.
    pub splits_bounces: bool,
}

impl JoinedShards {
    /// The matrices of every channel, `[channel]`, as [`Lab::matrices`](crate::lab::Lab::matrices). `part`
    /// selects a part of the light; `None` means all light.
    ///
    /// # Errors
    /// [`Error::Option`] for a part if the bounces are separate matrices.
    pub fn matrices(&self, part: Option<Part>) -> Result<Vec<Vec<ExportedMatrix>>> {
        match part {
            None if self.splits_bounces => bounces_apart(&self.traced),
            Some(_) if self.splits_bounces => Err(Error::option(
                "--part",
                "these shards were traced with --split-bounces, and make three matrices",
            )
            .help("leave it out, or trace shards without --split-bounces")),
            part => {
                let part = part.unwrap_or(Part::Full);
                let matrix = |channel| Ok(vec![ExportedMatrix::of(&self.traced, part, channel)?]);
                (0..self.traced.matrix.channels().count()).map(matrix).collect()
            }
        }
    }
}

/// Joins all shards, in any order, to one matrix. The result equals [`Lab::matrices`](crate::lab::Lab::matrices) on one machine bit for
/// bit. The cache keeps the matrix, so that later requests need not trace it.
///
/// # Errors
/// [`Error::Read`] and [`Error::Data`] naming a file that is damaged, or whose shard belongs to another matrix; [`Error::Option`] naming
/// the missing parts, or if the memory cannot hold all shards.
pub fn join_shards(
    files: &[PathBuf],
    cache: &CacheChoice,
    observer: &SharedObserver,
) -> Result<JoinedShards> {
    let start = Instant::now();
    let files: Vec<ShardFile> = files.iter().map(|file| ShardFile::open(file)).collect::<Result<_>>()?;
    let files = require_one_matrix(files)?;
    require_all_parts(&files)?;
    require_memory(&files)?;
    let mut shards: BTreeMap<usize, (PathBuf, Shard)> = BTreeMap::new();
    let mut origin = None;
    for file in files {
        let path = file.path().to_path_buf();
        origin.get_or_insert_with(|| file.origin().clone());
        let shard = file.read()?;
        match shards.get(&shard.record().part) {
            None => drop(shards.insert(shard.record().part, (path, shard))),
            Some((first, same)) if same.has_bits_of(&shard) => observer.note(format_args!(
                "note: {} is left out: {} has the same light paths",
                path.display(),
                first.display()
            )),
            Some((first, _)) => return Err(contradiction(path, first, shard.record())),
        }
    }
    let (count, splits_bounces) = (shards.len(), shards.values().any(|(_, shard)| shard.record().split));
    let traced = transport::join_shards(shards.into_values().map(|(_, shard)| shard).collect())?;
    observer.info(format_args!(
        "joined    {count} shards of {} light paths",
        text::grouped(traced.summary.paths)
    ));
    report_matrix(&traced, start, observer);
    if let (Some(cache), Some(origin)) = (cache.open(), origin) {
        store(&cache, &origin.key, &traced, observer);
    }
    Ok(JoinedShards { traced, splits_bounces })
}

fn require_one_matrix(files: Vec<ShardFile>) -> Result<Vec<ShardFile>> {
    let Some(first) = files.first() else { return Ok(files) };
    let parts = first.record().parts;
    let differences = |file: &ShardFile| {
        let mut found = first.origin().differences(file.origin());
        if file.record().parts != parts {
            found.push(format!("it is one of {} parts, not of {parts}", file.record().parts));
        }
        found
    };
    let Some((at, found)) = files.iter().map(differences).enumerate().find(|(_, found)| !found.is_empty())
    else {
        return Ok(files);
    };
    let fault = format!("it is not of the same matrix as {}: {}", first.path().display(), found.join("; "));
    let error = Error::data(files[at].path(), fault)
        .help("join shards of the same scene, traced with equal options, drivers and programs");
    // The record of a damaged file may be wrong, so both files are checked for damage before the mismatch is reported.
    files
        .into_iter()
        .enumerate()
        .filter(|(index, _)| [0, at].contains(index))
        .try_for_each(|(_, file)| file.read().map(drop))?;
    Err(error)
}

fn require_all_parts(files: &[ShardFile]) -> Result<()> {
    let parts = files.first().map_or(0, |file| file.record().parts);
    let there: BTreeSet<usize> = files.iter().map(|file| file.record().part).collect();
    let missing: Vec<usize> = (1..=parts).filter(|part| !there.contains(part)).collect();
    let Some(first) = missing.first() else { return Ok(()) };
    let [what, is, them, and] = match missing.len() {
        1 => ["part", "is", "it", ""],
        _ => ["parts", "are", "them", ", and so on"],
    };
    let fault = format!("{what} {} of {parts} {is} missing", ranges(&missing));
    Err(Error::option("SHARDS", fault)
        .help(format!("trace {them} as the others, with --shard {first}/{parts}{and}, and join all files")))
}

/// Formats numbers for people: `3, 5 to 9 and 12`.
fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b).flat_map(|run| match run {
        [first, .., last] if run.len() > 2 => vec![format!("{first} to {last}")],
        few => few.iter().map(usize::to_string).collect(),
    });
    let runs: Vec<String> = runs.collect();
    match runs.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => runs.concat(),
    }
}

fn require_memory(files: &[ShardFile]) -> Result<()> {
    let (bytes, memory) =
        (files.iter().map(ShardFile::bytes).fold(0, u64::saturating_add), machine::memory());
    if bytes <= memory {
        return Ok(());
    }
    let fault = format!(
        "they take {} together, and this machine has {} of memory",
        text::bytes(bytes),
        text::bytes(memory)
    );
    Err(Error::option("SHARDS", fault)
        .help("join them on a machine with more memory, or let a team of processes keep the matrix (MPI)"))
}

/// The error for two shards of the same part with different light paths.
fn contradiction(path: PathBuf, first: &Path, record: &ShardRecord) -> Error {
    let ShardRecord { part, parts, .. } = record;
    let fault = format!("it is part {part} of {parts} as {} is, but with other light paths", first.display());
    Error::data(path, fault)
        .help(format!("one of them is wrong: trace both again, with --shard {part}/{parts}, and join one"))
}

/// The predicted time and memory of several processes, from a probe of this machine.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Scaling {
    /// The measured constants.
    pub probe: Probe,
    /// The network that the prediction assumes.
    pub network: Network,
    /// A prediction for each number of processes.
    pub processes: Vec<Scaled>,
}

impl Lab {
    /// Predicts memory and time of `photos` photos of a scene by a Krylov method, for each of these numbers of processes. All machines are
    /// assumed to equal this one. The prediction takes seconds, since it traces a small matrix and multiplies with it.
    ///
    /// # Errors
    /// [`Error::Option`] for other sources than a scene; errors of tracing.
    pub fn scaling(&self, processes: &[usize], photos: usize, network: Network) -> Result<Scaling> {
        let Source::Scene(scene) = &self.source else {
            return Err(Error::option("--ranks", "only scenes are traced by several processes")
                .help("give a scene (.glb, .gltf, .obj)"));
        };
        let (settings, channels) = (&scene.settings, self.channels);
        let probe = Probe::measure(&mut scene.tracer(), settings)?;
        let symmetric = scene.is_symmetric();
        let scaled = |&count: &usize| probe.scaled(settings, channels, symmetric, photos, (count, network));
        Ok(Scaling { probe, network, processes: processes.iter().map(scaled).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn missing_parts_are_listed_as_people_do() {
        for (numbers, listed) in [
            (&[3][..], "3"),
            (&[3, 7], "3 and 7"),
            (&[3, 4, 9], "3, 4 and 9"),
            (&[1, 2, 3, 4, 8, 10, 11, 12], "1 to 4, 8 and 10 to 12"),
        ] {
            assert_eq!(ranges(numbers), listed);
        }
    }
}
