//! The assembly of a matrix by a team. Each process traces its pixels, and merges the contributions of all processes to its rows.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::exchange::{self, Combined, Steps};
use super::{Command, Spread};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::observer::Level;
use crate::render::{StartPixels, TraceSettings, TraceSummary, Tracer};
use crate::team::{Comm, Team, answer, from_bytes, garbled, read_answer, threads, to_bytes};
use crate::transport::assembled::{Assembled, shape};
use crate::transport::contributions::Share;
use crate::transport::device;
use crate::transport::layer::{Bounces, Layer};
use crate::transport::noise::{EntrySquares, Estimates, Noise, relative};
use crate::transport::scaling::pilot;
use crate::transport::wire::{self, unread};
use crate::transport::{Channels, RigShape, TransportMatrix};

/// The leader's messages after the trace. With `GO_ON`, the processes continue. With `STOP`, they drop their contributions.
const GO_ON: u8 = 1;
const STOP: u8 = 0;

/// The part of the traced scene that this process holds. The leader's part receives everything from the other parts except their layers.
struct Own<const C: usize> {
    matrix: TransportMatrix,
    direct: Vec<Estimates<C>>,
    ambient: Vec<Estimates<C>>,
    /// The sums over rows and over all entries, from which the noise is computed.
    sums: Vec<Estimates<C>>,
    squares: EntrySquares,
    has_halves: bool,
    summary: TraceSummary,
}

/// Works like [`assemble_layers`](crate::transport::assemble_layers), on the tracer's team. Without a team, this process is a team of one.
pub(in crate::transport) fn assemble<const C: usize>(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
) -> Result<Assembled> {
    settings.check()?;
    let (scene, team) = match tracer.remote() {
        Some(remote) => (remote.id(), remote.team().clone()),
        None => (0, Team::alone()),
    };
    if team.size() == 1 && tracer.assembles_on_device() {
        match device::assemble(tracer, settings, channels, split) {
            Err(Error::Device { fault, .. }) if tracer.gpu().require_working().is_ok() => {
                let note = format!("note: the matrix is assembled on the processor: {fault}");
                tracer.observer().log(Level::Note, &note);
                tracer.release_buffers();
            }
            made => return made,
        }
    }
    let pixels = balanced(tracer, settings, team.size())?;
    let remote = team.remote();
    let command = Command::Assemble { scene, settings: *settings, channels, split, pixels: pixels.clone() };
    let turn = remote.command(&command)?;
    let own = Own::<C>::trace(turn.comm(), tracer, settings, (channels, split), &pixels)?;
    let own = own.ok_or_else(|| garbled("the leader has no share"))?;
    let (mut traced, [nonzeros, bytes]) = own.lead(turn.comm())?;
    drop(turn);
    if team.size() > 1 {
        let spread = Spread { remote, pixels, nonzeros, bytes, is_transposed: OnceLock::new() };
        traced.matrix.spread = Some(Arc::new(spread));
    }
    Ok(traced)
}

/// Assembles the traced scene from the contributions of all its pixels.
pub(in crate::transport) fn of_share<const C: usize>(
    share: Share<C>,
    rig: RigShape,
    channels: Channels,
    split: bool,
) -> Result<Assembled> {
    let comm = &threads(1)[0];
    let own = Own::merge(comm, rig, &Steps::one(rig), (channels, split), share)?;
    Ok(own.lead(comm)?.0)
}

/// Works like `assemble`, in a process that is not the leader. Returns `None` if another process failed, or if the leader was stopped.
pub(super) fn assemble_part<const C: usize>(
    comm: &dyn Comm,
    tracer: &mut Tracer,
    settings: &TraceSettings,
    of: (Channels, bool),
    pixels: &[StartPixels],
) -> Result<Option<TransportMatrix>> {
    let Some(mut own) = Own::<C>::trace(comm, tracer, settings, of, pixels)? else { return Ok(None) };
    comm.send(0, &own.to_bytes());
    own.retain(&comm.receive(0));
    let Own { mut matrix, direct, .. } = own;
    if matrix.is_symmetric() {
        // The pixels of other processes are set to zero. They are never requested here.
        let padded = |own: Vec<f32>| {
            let mut plane = vec![0.0; matrix.rig.camera.pixels()];
            plane[matrix.rows.clone()].copy_from_slice(&own);
            plane
        };
        matrix.direct = planes(&direct).into_iter().map(padded).collect();
    }
    Ok(Some(matrix))
}

/// Waits until every process has traced its paths. Returns the contributions that this process traced. In the leader, they come with the
/// total cost of all processes. If one process fails, the leader returns an error, and the others return `None`.
fn agree<const C: usize>(comm: &dyn Comm, share: Result<Share<C>>) -> Result<Option<Share<C>>> {
    if comm.rank() > 0 {
        answer(comm, share.as_ref().map(|share| share.summary));
        let goes_on = comm.receive(0) == [GO_ON];
        return Ok(share.ok().filter(|_| goes_on));
    }
    let others = 1..comm.size();
    let send_all = |word: u8| others.clone().for_each(|rank| comm.send(rank, &[word]));
    if share.is_err() {
        // The other processes stop tracing when they see this message.
        send_all(STOP);
    }
    let answers: Vec<Result<TraceSummary>> =
        others.clone().map(|rank| read_answer(rank, &comm.receive(rank))).collect();
    let mut share = share?;
    let all: Result<Vec<TraceSummary>> = answers.into_iter().collect();
    send_all(if all.is_ok() { GO_ON } else { STOP });
    all?.iter().for_each(|other| share.summary.add_parallel(other));
    Ok(Some(share))
}

impl<const C: usize> Own<C> {
    /// Traces this process's pixels, exchanges contributions, and merges the contributions to this process's rows. Returns `None` as
    /// [`agree`] does.
    fn trace(
        comm: &dyn Comm,
        tracer: &mut Tracer,
        settings: &TraceSettings,
        of: (Channels, bool),
        pixels: &[StartPixels],
    ) -> Result<Option<Self>> {
        let rig = shape(tracer, settings);
        let steps = exchange::steps(comm, rig, pixels)?;
        let several = (steps.count() > 1).then_some(&steps);
        let share = Share::<C>::trace(tracer, settings, &pixels[comm.rank()], of.1, several);
        let Some(share) = agree(comm, share)? else { return Ok(None) };
        Self::merge(comm, rig, &steps, of, share).map(Some)
    }

    fn merge(
        comm: &dyn Comm,
        rig: RigShape,
        steps: &Steps,
        (channels, split): (Channels, bool),
        share: Share<C>,
    ) -> Result<Self> {
        let Share { found, direct, ambient, has_halves, summary } = share;
        let classes = classes(split);
        let merged = exchange::merge(comm, rig, steps, found, classes.len(), &direct)?;
        let Combined { layers, rows: sums, squares } = merged;
        let layers = classes.iter().zip(layers).map(|(&bounces, tiles)| Layer::of_tiles(bounces, tiles));
        let rows = steps.rows().nth(comm.rank()).unwrap_or_default();
        let (layers, direct_planes) = (layers.collect(), vec![Vec::new(); C]);
        let matrix = TransportMatrix { rig, channels, direct: direct_planes, layers, rows, spread: None };
        Ok(Self { matrix, direct, ambient, sums, squares, has_halves, summary })
    }

    /// Returns the traced scene with the sums of all processes, and the numbers of entries and of bytes that the other processes hold.
    fn lead(mut self, comm: &dyn Comm) -> Result<(Assembled, [usize; 2])> {
        let (mut nonzeros, mut bytes) = (vec![0_u64; self.matrix.layers.len()], 0);
        for rank in 1..comm.size() {
            let (of_layers, of_part) = self.add_part(&comm.receive(rank))?;
            bytes += of_part;
            nonzeros.iter_mut().zip(of_layers).for_each(|(all, more)| *all += more);
        }
        // A coaxial pinhole rig has no layer of one bounce, because its direct light is the diagonal. All processes must keep the same
        // layers.
        let keeps = |(layer, &elsewhere): (&Layer, &u64)| {
            layer.bounces() != Bounces::One || layer.nonzeros() > 0 || elsewhere > 0
        };
        let keep: Vec<u8> = self.matrix.layers.iter().zip(&nonzeros).map(keeps).map(u8::from).collect();
        (1..comm.size()).for_each(|rank| comm.send(rank, &keep));
        self.retain(&keep);
        let camera = self.matrix.rig.camera;
        let ambient = image::<C>(camera, |pixel, channel| self.ambient[pixel][channel][0])?;
        let noise = if self.has_halves { Some(self.noise()?) } else { None };
        let Self { mut matrix, direct, summary, .. } = self;
        matrix.direct = planes(&direct);
        // A dropped layer has no entries, so these totals are unchanged.
        let elsewhere = [nonzeros.iter().sum::<u64>() as usize, bytes as usize];
        Ok((Assembled { matrix, ambient, noise, summary, gpu_matrix: None }, elsewhere))
    }

    fn noise(&self) -> Result<Noise> {
        let Self { sums, squares, .. } = self;
        let sum = |of: usize| {
            let of_row = |row: &Estimates<C>| row.iter().map(|value| value[of] * value[of]).sum::<f64>();
            sums.iter().map(of_row).sum::<f64>()
        };
        let of_entries = |[mean, error]: [f64; 2]| relative(error, mean);
        Ok(Noise {
            white: image::<C>(self.matrix.rig.camera, |pixel, channel| sums[pixel][channel][1].abs())?,
            white_relative: relative(sum(1), sum(0)),
            operator: of_entries(squares.whole()),
            global: of_entries(squares.global()),
        })
    }

    fn retain(&mut self, keep: &[u8]) {
        let mut keep = keep.iter();
        self.matrix.layers.retain(|_| keep.next() == Some(&1));
    }

    /// The message to the leader: the number of entries of each layer, the bytes of all layers, and the sums over pixels, rows and entries.
    fn to_bytes(&self) -> Vec<u8> {
        let nonzeros: Vec<u64> = self.matrix.layers.iter().map(|layer| layer.nonzeros() as u64).collect();
        // Numbers can always be encoded.
        let head = to_bytes(&(nonzeros, self.matrix.bytes() as u64, self.has_halves)).unwrap_or_default();
        wire::message(|to| {
            wire::put(to, &head)?;
            [&self.direct, &self.ambient, &self.sums]
                .into_iter()
                .try_for_each(|of| wire::put_estimates(to, of))?;
            wire::put(to, &self.squares.to_words())
        })
    }

    /// Adds the message of the process that has the next pixels. Returns the number of entries of each of its layers, and the size of all
    /// its layers in bytes.
    fn add_part(&mut self, bytes: &[u8]) -> Result<(Vec<u64>, u64)> {
        let mut from = wire::Reader::new(bytes);
        let (nonzeros, size, has_halves): (Vec<u64>, u64, bool) =
            from_bytes(&from.take::<u8>().map_err(unread)?)?;
        self.has_halves &= has_halves;
        for all in [&mut self.direct, &mut self.ambient, &mut self.sums] {
            all.extend(wire::take_estimates::<C>(&mut from).map_err(unread)?);
        }
        let squares = EntrySquares::from_words(&from.take::<u64>().map_err(unread)?);
        self.squares.add_all(&squares.ok_or_else(|| garbled("its sums of squares have another length"))?);
        Ok((nonzeros, size))
    }
}

/// The numbers of bounces of the layers, by class.
pub(in crate::transport) fn classes(split: bool) -> &'static [Bounces] {
    if split { &[Bounces::One, Bounces::Two, Bounces::Rest] } else { &[Bounces::One, Bounces::Global] }
}

/// The diagonal, indexed by `[channel][pixel]`.
fn planes<const C: usize>(direct: &[Estimates<C>]) -> Vec<Vec<f32>> {
    let plane = |channel: usize| direct.iter().map(|estimate| estimate[channel][0] as f32).collect();
    (0..C).map(plane).collect()
}

fn image<const C: usize>(resolution: Resolution, value: impl Fn(usize, usize) -> f64) -> Result<Image> {
    let plane = |channel| (0..resolution.pixels()).map(|pixel| value(pixel, channel)).collect();
    let planes: Vec<Vec<f64>> = (0..C).map(plane).collect();
    Image::from_planes(resolution, &planes)
}

/// Divides the pixels among `processes` processes. To estimate the work, one light path is traced from each of at most 64×64 pixels, and
/// the rays in each part of the picture are counted. Unlike measured seconds, counts repeat exactly.
fn balanced(tracer: &mut Tracer, settings: &TraceSettings, processes: usize) -> Result<Vec<StartPixels>> {
    let all = tracer.start_pixels(settings);
    if processes == 1 {
        return Ok(vec![all]);
    }
    let projector = tracer.projector_resolution(settings);
    let pilot = pilot(settings);
    let sizes = [pilot.resolution, tracer.projector_resolution(&pilot)];
    let mut rays = sizes.map(|size| vec![0_u64; size.height]);
    tracer.trace(&pilot, &mut |batch| {
        let end = usize::from(!batch.from_camera());
        for path in 0..batch.len() {
            rays[end][batch.pixel(path) as usize / sizes[end].width] += batch.rays(path);
        }
        Ok(())
    })?;
    let camera = divide(&all.camera, settings.resolution, &rays[0], processes);
    let projector = divide(&all.projector, projector, &rays[1], processes);
    Ok(camera
        .into_iter()
        .zip(projector)
        .map(|(camera, projector)| StartPixels { camera, projector })
        .collect())
}

/// Divides `pixels` of a picture of this size into ranges of about equal work. `rays` is the work of each pixel row of a smaller picture.
fn divide(pixels: &Range<usize>, size: Resolution, rays: &[u64], processes: usize) -> Vec<Range<usize>> {
    // Each row of pixels gets one additional ray, so that a picture without rays is divided into equal parts.
    let work: Vec<f64> = rays.iter().map(|&rays| 1.0 + rays as f64).collect();
    let total: f64 = work.iter().sum();
    let of_row = size.height as f64 / rays.len() as f64 * size.width as f64;
    let (mut cuts, mut done) = (vec![pixels.start], 0.0);
    for (row, &work) in work.iter().enumerate() {
        // Within a row of pixels, the work is assumed to be uniform.
        while cuts.len() < processes && done + work >= total * cuts.len() as f64 / processes as f64 {
            let share = (total * cuts.len() as f64 / processes as f64 - done) / work;
            cuts.push((((row as f64 + share) * of_row) as usize).min(pixels.end));
        }
        done += work;
    }
    cuts.resize(processes, pixels.end);
    cuts.push(pixels.end);
    cuts.windows(2).map(|ends| ends[0]..ends[1]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_equal_work_and_cover_each_pixel_once() {
        let size = Resolution::new(10, 8);
        // The lower half has three times the work of the upper half.
        let found = divide(&(0..80), size, &[100, 100, 300, 300], 2);
        assert_eq!(found.len(), 2);
        assert!((52..=54).contains(&found[0].end), "{found:?}");
        for processes in 1..12 {
            let found = divide(&(0..80), size, &[0, 7, 0, 1], processes);
            assert_eq!(found.len(), processes);
            assert_eq!(found.iter().flat_map(Clone::clone).collect::<Vec<_>>(), (0..80).collect::<Vec<_>>());
        }
        // The total work is 800, so each of four processes gets 200. The rows have 20 pixels each, and the work 100, 100, 300 and 300.
        let found = divide(&(0..80), size, &[99, 99, 299, 299], 4);
        assert_eq!(found, [0..40, 40..53, 53..66, 66..80], "cut after 2, 2⅔ and 3⅓ rows");
        assert_eq!(divide(&(0..0), size, &[1, 1], 3), [0..0, 0..0, 0..0]);
    }

    /// The work of each process, measured in rays, differs from an equal share by at most one row of pixels at either end.
    #[test]
    fn the_rays_of_a_scene_are_shared_out_evenly() {
        let mut scene = crate::transport::tests::apart(crate::scene::builtin::corner().to_scene(), 0.2);
        // The upper part of the picture does not show the scene, so its pixels need fewer rays.
        scene.camera.position += 0.6 * scene.camera.up;
        let mut tracer =
            Tracer::new(&scene, None).expect("the README's test command installs a Vulkan driver");
        let settings = TraceSettings {
            projector: Some(Resolution::new(20, 60)),
            ..TraceSettings::new(Resolution::new(30, 40), 1)
        };
        let sizes = [Resolution::new(30, 40), Resolution::new(20, 60)];
        let mut rays = sizes.map(|size| vec![0; size.pixels()]);
        tracer
            .trace(&settings, &mut |batch| {
                (0..batch.len()).for_each(|path| {
                    rays[usize::from(!batch.from_camera())][batch.pixel(path) as usize] += batch.rays(path);
                });
                Ok(())
            })
            .expect("the scene can be traced");
        let parts = balanced(&mut tracer, &settings, 3).expect("the scene can be traced");
        for (end, (size, rays)) in sizes.iter().zip(&rays).enumerate() {
            let of_part =
                |part: &StartPixels| if end == 0 { part.camera.clone() } else { part.projector.clone() };
            let of_rows: Vec<u64> = rays.chunks(size.width).map(|row| row.iter().sum()).collect();
            let most = *of_rows.iter().max().expect("there are rows") as f64;
            let fair = rays.iter().sum::<u64>() as f64 / 3.0;
            let evenly = size.pixels() / 3;
            let of_equal: u64 = rays[..evenly].iter().sum();
            assert!(
                (of_equal as f64 - fair).abs() > 2.0 * most,
                "equal parts are not fair: {of_equal} of {fair}"
            );
            let mut next = 0;
            for part in &parts {
                let pixels = of_part(part);
                assert_eq!(pixels.start, next);
                next = pixels.end;
                let work: u64 = rays[pixels].iter().sum();
                assert!(
                    (work as f64 - fair).abs() <= 2.0 * most,
                    "end {end}: {work} of {fair}, {most} in a row"
                );
            }
            assert_eq!(next, size.pixels());
        }
    }
}
