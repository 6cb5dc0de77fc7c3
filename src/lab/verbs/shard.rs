//! A shard of a matrix: a part of its light paths, traced by a machine that knows nothing of the others.

use std::path::Path;

use crate::cache::{ShardFile, ShardOrigin, write_shard};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::lab::source::SceneSource;
use crate::lab::source::Source;
use crate::lab::traced::report_trace;
use crate::lab::{Lab, Log};
use crate::transport::{self, Channels, ShardRecord};

/// A shard in its file.
#[derive(Clone, Debug)]
pub struct TracedShard {
    /// What is known of it beside its contributions.
    pub record: ShardRecord,
    /// The bytes of its file.
    pub bytes: u64,
    /// Whether it was traced now; otherwise it was there already.
    pub is_new: bool,
}

impl Lab {
    /// Traces part `of.0` (from 1) of `of.1` of a scene's matrix into a file for [`join_shards`](crate::lab::join_shards). Where the file has this shard
    /// already, nothing is traced; another shard, or a damaged one, is replaced.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--shard` for a source that is no scene, and where there is no such part; [`Error::Data`] where the file is there and is
    /// no shard; [`Error::Write`]; those of tracing.
    pub fn trace_shard(&mut self, of: (usize, usize), file: &Path) -> Result<TracedShard> {
        let refused = |fault: String, help: &str| {
            Err(Error::Option { option: "--shard".into(), fault, help: help.into() })
        };
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
                return Err(Error::Data {
                    path: file.into(),
                    fault: "the file is there, and is not a shard".into(),
                    help: "name another file by -o, or remove this one".into(),
                });
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

    /// What all shards of the matrix have in common.
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

    /// The shard that is asked for, if the file has it already. What else is there is said.
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
