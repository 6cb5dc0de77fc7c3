//! The light transport matrix as sparse matrices in files, either from one machine or joined from the shards of several machines.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::options::{LightPart, count};
use crate::error::Result;
use crate::finding::Grade;
use crate::io::name::Name;
use crate::io::sparse::{Beside, Pictures};
use crate::io::{manifest, sparse};
use crate::lab::{
    CacheChoice, ExportedMatrix, Lab, SharedObserver, SourceKind, TracedShard, join_shards, text,
};
use crate::report::content::Content;
use crate::transport::{Channels, MOST_PARTS, Noise};

/// Write the light transport matrix as a sparse matrix: a scene's is traced once, a rig's photographed pixel by pixel
#[derive(clap::Args, Clone, Debug, Serialize, Deserialize)]
pub struct WriteMatrix {
    /// Which light: all of it, one bounce (a diagonal), or two bounces and more
    #[arg(long, value_enum, default_value = "full")]
    pub part: LightPart,
    /// Write three matrices, which add up to the whole: FILE_direct, FILE_second (bounce) and FILE_rest
    #[arg(long, conflicts_with = "part")]
    pub split_bounces: bool,
    /// Trace only part K of N (from 1 to N) of a scene's light paths into the file -o, for `krylux matrix join`. Where the file has this part
    /// already, nothing is done; another shard in it is replaced
    #[arg(long, value_name = "K/N", requires = "file", conflicts_with_all = ["part", "photos", "folder"])]
    pub shard: Option<ShardOf>,
    /// Photos that a rig may take: one for each of its projector's pixels, and a few more [default: 4096]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
    /// One matrix weighted by luminance, or three, in files named FILE.r, FILE.g and FILE.b
    #[arg(long, value_enum, default_value = "luma")]
    pub channels: Channels,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market); with --shard any name
    /// [default: matrix.npz, or the first free one of matrix-2.npz, matrix-3.npz, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    pub file: Option<PathBuf>,
}

/// Join all parts that `krylux matrix SOURCE --shard K/N` traced to the matrix, with the bits of a single run on the processor
#[derive(clap::Args, Clone, Debug, Serialize, Deserialize)]
#[command(
    after_help = "Example:\n  krylux matrix join shard-*.krylux -o matrix.npz # later verbs on this scene find it in the cache, too"
)]
pub struct JoinShards {
    /// The files of all parts, in any order
    #[arg(value_name = "SHARDS", required = true)]
    pub shards: Vec<PathBuf>,
    /// Which light: all of it, one bounce (a diagonal), or two bounces and more [default: full, or three matrices if the shards were
    /// traced with --split-bounces]
    #[arg(long, value_enum)]
    pub part: Option<LightPart>,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market)
    /// [default: matrix.npz, or the first free one of matrix-2.npz, matrix-3.npz, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    pub file: Option<PathBuf>,
}

/// Part `K` of `N` parts of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShardOf(pub usize, pub usize);

impl FromStr for ShardOf {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |digits: &str| digits.parse::<usize>().ok();
        let numbers = text.split_once('/').and_then(|(part, parts)| Some((number(part)?, number(parts)?)));
        match numbers {
            Some((part, parts)) if (1..=parts).contains(&part) && parts <= MOST_PARTS => {
                Ok(Self(part, parts))
            }
            _ => Err(format!(
                "`{text}` is not a part and the number of parts: write 1/16 to 16/16, with at most {MOST_PARTS} parts"
            )),
        }
    }
}

impl WriteMatrix {
    /// Traces or photographs the matrix, writes it into `file`, and ends the open run. The returned flag is false if a finding about the
    /// rig fails. Fails as [`Lab::matrices`] and if a file cannot be written.
    pub fn ask(&self, lab: &mut Lab, file: &Path) -> Result<(Content<'static>, bool)> {
        let matrices = lab.matrices(self.part.into(), self.split_bounces, self.photos)?;
        let [camera, projector] = [lab.resolution(), lab.projector_resolution()];
        let pictures = lab.has_pictures().then_some(Pictures { camera, projector });
        let (paths, noise, costs) = match lab.kind() {
            SourceKind::Scene => (lab.trace_summary()?.map(|of| of.paths), lab.noise()?, None),
            _ => (None, None, Some(lab.costs()?)),
        };
        let mut content = write(file, &matrices, (lab.channels(), pictures))?;
        match costs {
            None => of_paths(&mut content, paths, noise.as_ref()),
            Some(costs) => content.fact("rig", costs),
        }
        lab.end_run(lab.resolution().pixels() * lab.channels().count(), "every column photographed")?;
        for finding in lab.findings().iter().filter(|finding| finding.grade != Grade::Ok) {
            content.line(format_args!("finding   {finding}"));
        }
        Ok((content, lab.findings().iter().all(|finding| finding.grade != Grade::Fails)))
    }
}

impl ShardOf {
    /// Traces the shard, unless its file already holds it. Fails as [`Lab::trace_shard`].
    pub fn ask(self, lab: &mut Lab, file: &Path) -> Result<Content<'static>> {
        let Self(part, parts) = self;
        let TracedShard { record, bytes, is_new } = lab.trace_shard((part, parts), file)?;
        let (what, name) = (format!("part {part} of {parts}, {}", text::bytes(bytes)), file.display());
        let mut content = Content::default();
        match is_new {
            true => content.line(format_args!("wrote     {name}: {what}")),
            false => content.line(format_args!("there     {name}: {what}; nothing is traced")),
        }
        content.fact("files", [file]);
        content.fact("shard", json!({ "part": part, "parts": parts, "is_new": is_new, "bytes": bytes }));
        content.fact("resolution", lab.resolution());
        content.fact("projector_resolution", lab.projector_resolution());
        content.fact("paths", record.summary.paths);
        content.fact("seconds_of_tracing", record.summary.tracing.as_secs_f64());
        Ok(content)
    }
}

impl JoinShards {
    /// Joins the shards and writes the matrix into `file`. Fails as [`join_shards`] and if a file cannot be written.
    pub fn ask(
        &self,
        cache: &CacheChoice,
        observer: &SharedObserver,
        file: &Path,
    ) -> Result<Content<'static>> {
        let joined = join_shards(&self.shards, cache, observer)?;
        let traced = &joined.traced;
        let (matrix, paths) = (&traced.matrix, traced.summary.paths);
        let pictures = Pictures { camera: matrix.resolution(), projector: matrix.projector_resolution() };
        let matrices = joined.matrices(self.part.map(Into::into))?;
        let mut content = write(file, &matrices, (matrix.channels(), Some(pictures)))?;
        of_paths(&mut content, Some(paths), traced.noise.as_ref());
        content.fact("shards", self.shards.len());
        Ok(content)
    }
}

/// Adds the facts about the light paths to `content`.
fn of_paths(content: &mut Content<'_>, paths: Option<u64>, noise: Option<&Noise>) {
    content.fact("paths", paths);
    content.fact("noise", noise.map(manifest::Noise::from));
}

/// Writes the matrices of each channel.
fn write(
    named: &Path,
    matrices: &[Vec<ExportedMatrix>],
    (channels, pictures): (Channels, Option<Pictures>),
) -> Result<Content<'static>> {
    let (mut content, mut files, mut nonzeros) = (Content::default(), Vec::new(), Vec::new());
    let mut shape = [0; 2];
    let suffixes: &[&str] = if channels == Channels::Luma { &[""] } else { &sparse::COLORS };
    for (channel, suffix) in matrices.iter().zip(suffixes) {
        for ExportedMatrix { suffix: bounces, matrix, direct, noise } in channel {
            let file = sparse::with_suffix(named, &format!("{bounces}{suffix}"));
            let beside = Beside { direct: direct.as_ref(), pictures, noise: *noise };
            sparse::write_channel(&file, matrix, &beside)?;
            nonzeros.push(matrix.weights().len());
            shape = [matrix.rows(), matrix.cols()];
            content.line(format_args!("wrote     {}", file.display()));
            files.push(Name::from(&file));
        }
    }
    content.fact("files", files);
    if let Some(pictures) = pictures {
        content.fact("resolution", pictures.camera);
        content.fact("projector_resolution", pictures.projector);
    }
    content.fact("rows", shape[0]);
    content.fact("columns", shape[1]);
    content.fact("nonzeros", nonzeros);
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_count_from_one() {
        assert_eq!("3/16".parse(), Ok(ShardOf(3, 16)));
        assert_eq!("1/1".parse(), Ok(ShardOf(1, 1)));
        for wrong in ["", "0/16", "17/16", "3", "3/", "/3", "-1/3", "1/65537", "1/99999999999999999999"] {
            assert!(wrong.parse::<ShardOf>().is_err(), "{wrong}");
        }
    }
}
