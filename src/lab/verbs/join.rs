//! The matrix of all its shards, which were traced by machines that know nothing of each other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::matrix::bounces_apart;
use crate::cache::ShardFile;
use crate::error::{Error, Result};
use crate::lab::text;
use crate::lab::traced::{report_matrix, store};
use crate::lab::{CacheChoice, Log, SharedObserver};
use crate::machine;
use crate::sparse::Csr;
use crate::transport::{self, Assembled, Part, Shard, ShardRecord};

/// The matrix of all shards.
#[derive(Debug)]
pub struct JoinedShards {
    /// The matrix.
    pub traced: Assembled,
    /// Whether the first bounce, the second one and the rest are matrices of their own.
    pub splits_bounces: bool,
}

impl JoinedShards {
    /// The matrices of every channel, `[channel]`, each with a name for its file, as [`Lab::matrices`](crate::lab::Lab::matrices). `part` is which light; it is all light where
    /// it is `None`.
    ///
    /// # Errors
    /// [`Error::Option`] for a part where the bounces are matrices of their own.
    pub fn matrices(&self, part: Option<Part>) -> Result<Vec<Vec<(&'static str, Csr)>>> {
        match part {
            None if self.splits_bounces => bounces_apart(&self.traced),
            Some(_) if self.splits_bounces => Err(Error::Option {
                option: "--part".into(),
                fault: "these shards were traced with --split-bounces, and make three matrices".into(),
                help: "leave it out, or trace shards without --split-bounces".into(),
            }),
            part => {
                let matrix =
                    |channel| Ok(vec![("", self.traced.matrix.to_csr(part.unwrap_or(Part::Full), channel)?)]);
                (0..self.traced.matrix.channels().count()).map(matrix).collect()
            }
        }
    }
}

/// The matrix of all shards, in any order: the same bits as [`Lab::matrices`](crate::lab::Lab::matrices) of one machine. It is kept in the cache, so that it is not traced where
/// another question needs it.
///
/// # Errors
/// [`Error::Read`] and [`Error::Data`] naming a file that is damaged, or whose shard is of another matrix; [`Error::Option`] naming parts that are
/// missing, or where the memory does not hold all shards.
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

/// Checks that all shards are of the matrix of the first one.
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
    let error = Error::Data {
        path: files[at].path().into(),
        fault: format!("it is not of the same matrix as {}: {}", first.path().display(), found.join("; ")),
        help: "join shards of the same scene, traced with equal options, drivers and programs".into(),
    };
    // A damaged file may say anything of itself.
    files
        .into_iter()
        .enumerate()
        .filter(|(index, _)| [0, at].contains(index))
        .try_for_each(|(_, file)| file.read().map(drop))?;
    Err(error)
}

/// Checks that no part is missing.
fn require_all_parts(files: &[ShardFile]) -> Result<()> {
    let parts = files.first().map_or(0, |file| file.record().parts);
    let there: BTreeSet<usize> = files.iter().map(|file| file.record().part).collect();
    let missing: Vec<usize> = (1..=parts).filter(|part| !there.contains(part)).collect();
    let Some(first) = missing.first() else { return Ok(()) };
    let (what, them) = if missing.len() == 1 { ("part", "it") } else { ("parts", "them") };
    let fault = format!(
        "{what} {} of {parts} {} missing",
        ranges(&missing),
        if missing.len() == 1 { "is" } else { "are" }
    );
    let and = if missing.len() == 1 { "" } else { ", and so on" };
    Err(Error::Option {
        option: "SHARDS".into(),
        fault,
        help: format!("trace {them} as the others, with --shard {first}/{parts}{and}, and join all files"),
    })
}

/// Numbers as people list them: `3, 5 to 9 and 12`.
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

/// Checks that the shards fit the memory together.
fn require_memory(files: &[ShardFile]) -> Result<()> {
    let (bytes, memory) =
        (files.iter().map(ShardFile::bytes).fold(0, u64::saturating_add), machine::memory());
    if bytes <= memory {
        return Ok(());
    }
    Err(Error::Option {
        option: "SHARDS".into(),
        fault: format!(
            "they take {} together, and this machine has {} of memory",
            text::bytes(bytes),
            text::bytes(memory)
        ),
        help: "join them on a machine with more memory, or let a team of processes keep the matrix (MPI)"
            .into(),
    })
}

/// The error for two shards of the same part with other light paths.
fn contradiction(path: PathBuf, first: &Path, record: &ShardRecord) -> Error {
    let ShardRecord { part, parts, .. } = record;
    Error::Data {
        path,
        fault: format!("it is part {part} of {parts} as {} is, but with other light paths", first.display()),
        help: format!("one of them is wrong: trace both again, with --shard {part}/{parts}, and join one"),
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
