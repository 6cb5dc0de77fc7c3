//! Photos without a matrix: the scene is traced anew for each photo, so no matrix has to fit into memory.

use rayon::prelude::*;

use super::assembled::shape;
use super::matrix::{deinterleave, interleave};
use super::noise::Halves;
use super::tiles::{BLOCK_WIDTH, Interleaved};
use super::{Channels, Part, Transport, luminance, planes, project, spread};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::operator::{Adjoint, Direction, Operator, Symmetry};
use crate::render::{Batch, PIXEL_MASK, Run, TraceSettings, Tracer};

/// A scene that is traced once per photo, with the same light paths. The host sums in path order, so repeated photos are equal to the bit.
pub struct Retraced<'a> {
    /// The scene on its device. The tracer's observer sees the steps of each photo, and may stop the photo.
    pub tracer: &'a mut Tracer,
    /// The settings of the trace for each photo.
    pub settings: TraceSettings,
    /// Gray or colour.
    pub channels: Channels,
}

impl Retraced<'_> {
    /// The photo of `pattern`, and its standard error pixel by pixel, ambient light included. The error comes from the difference between
    /// the two halves of the samples, as in [`super::Noise`]. It is zero if there is only one path per pixel. The call fails like
    /// [`Transport::photograph`].
    pub fn photograph_with_error(&mut self, pattern: &Image) -> Result<(Image, Image)> {
        let seen: Vec<Vec<[f64; 2]>> = self.see(pattern)?;
        let image = |value: fn(&[f64; 2]) -> f64| {
            let planes: Vec<Vec<f64>> = seen.iter().map(|plane| plane.iter().map(value).collect()).collect();
            Image::from_planes(self.settings.resolution, &planes)
        };
        Ok((image(|[mean, _]| *mean)?, image(|[_, error]| error.abs())?))
    }

    /// The photo under the pattern, with the ambient light: `[channel][pixel]`.
    fn see<T: Tally>(&mut self, pattern: &Image) -> Result<Vec<Vec<T>>> {
        let lit = planes(pattern, self.pattern_resolution(), self.channels)?;
        match self.channels {
            Channels::Luma => self.see_channels::<1, T>(&lit),
            Channels::Rgb => self.see_channels::<3, T>(&lit),
        }
    }

    fn see_channels<const C: usize, T: Tally>(&mut self, lit: &[Vec<f64>]) -> Result<Vec<Vec<T>>> {
        let (lights, pixels) = (lit[0].len(), self.settings.resolution.pixels());
        let lit: Vec<[f64; C]> = (0..lights).map(|pixel| std::array::from_fn(|c| lit[c][pixel])).collect();
        let way = Way { direction: Direction::Forward, part: Part::Full, with_ambient: true };
        let seen: Vec<[T; C]> = self.trace(way, &lit, project, pixels)?;
        Ok((0..C).map(|channel| seen.iter().map(|seen| seen[channel]).collect()).collect())
    }

    /// The photos under `K` patterns in one channel, pixel by pixel. All patterns use the same light paths.
    fn products<const K: usize>(
        &mut self,
        way: Way,
        channel: usize,
        lit: &[[f64; K]],
        pixels: usize,
    ) -> Result<Vec<[f64; K]>> {
        match self.channels {
            Channels::Luma => self.trace(way, lit, |rgb| [luminance(rgb); K], pixels),
            Channels::Rgb => self.trace(way, lit, |rgb| [rgb[channel]; K], pixels),
        }
    }

    /// Traces the scene, and returns the photo under the pattern `lit`, pixel by pixel. `project` converts the colour of a connection to
    /// channels.
    fn trace<const C: usize, T: Tally>(
        &mut self,
        way: Way,
        lit: &[[f64; C]],
        project: impl Fn([f32; 3]) -> [f32; C] + Sync,
        pixels: usize,
    ) -> Result<Vec<[T; C]>> {
        let mut seen = vec![[T::default(); C]; pixels];
        self.each(way, project, &mut |contributions| contributions.add_to(&mut seen, lit))?;
        Ok(seen)
    }

    /// Traces the scene, and passes the contributions of each batch to `add`, in path order.
    pub(super) fn each<const C: usize>(
        &mut self,
        way: Way,
        project: impl Fn([f32; 3]) -> [f32; C] + Sync,
        add: &mut (impl FnMut(&Contributions<C>) + Send),
    ) -> Result<()> {
        let samples = self.settings.samples;
        // The contributions of the previous batch, which have been read but not yet summed.
        let mut last: Option<Contributions<C>> = None;
        spread::trace(self.tracer, &self.settings, &mut |batch| {
            // One core sums the contributions in path order. Meanwhile, the other cores read the next batch. Reading takes longer.
            let (read, ()) = rayon::join(
                || Contributions::read(batch, samples, way, &project),
                || last.iter().for_each(&mut *add),
            );
            last = Some(read);
            Ok(())
        })?;
        last.iter().for_each(add);
        Ok(())
    }
}

impl Transport for Retraced<'_> {
    fn pattern_resolution(&self) -> Resolution {
        self.tracer.projector_resolution(&self.settings)
    }

    fn photo_resolution(&self) -> Resolution {
        self.settings.resolution
    }

    fn channels(&self) -> Channels {
        self.channels
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let seen: Vec<Vec<f64>> = self.see(pattern)?;
        Image::from_planes(self.settings.resolution, &seen)
    }
}

/// `y = P x` for one part and channel. The scene is traced anew for each product; up to four vectors of a block share one trace. The matrix
/// equals that of [`super::MatrixOperator`], up to rounding.
pub struct RetracedOperator<'a> {
    /// The scene.
    pub retraced: Retraced<'a>,
    /// The part of the light.
    pub part: Part,
    /// The channel, below [`Channels::count`].
    pub channel: usize,
}

impl RetracedOperator<'_> {
    fn block(&mut self, direction: Direction, from: &[&[f64]], to: &mut [&mut [f64]]) -> Result<()> {
        debug_assert_eq!(from.len(), to.len());
        let way = Way { direction, part: self.part, with_ambient: false };
        for (from, to) in from.chunks(BLOCK_WIDTH).zip(to.chunks_mut(BLOCK_WIDTH)) {
            let pixels = to[0].len();
            if let ([from], [to]) = (from, &mut *to) {
                let seen = self.retraced.products(way, self.channel, from.as_chunks::<1>().0, pixels)?;
                to.copy_from_slice(seen.as_flattened());
                continue;
            }
            let lit: Vec<_> = interleave(from).into_iter().map(|Interleaved(lit)| lit).collect();
            let seen = self.retraced.products(way, self.channel, &lit, pixels)?;
            deinterleave(&seen.into_iter().map(Interleaved).collect::<Vec<_>>(), to);
        }
        Ok(())
    }
}

impl Operator for RetracedOperator<'_> {
    fn rows(&self) -> usize {
        self.retraced.photo_resolution().pixels()
    }

    fn cols(&self) -> usize {
        self.retraced.pattern_resolution().pixels()
    }

    fn symmetry(&self) -> Symmetry {
        shape(self.retraced.tracer, &self.retraced.settings).symmetry()
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Forward, xs, ys)
    }

    fn block_size(&self) -> usize {
        BLOCK_WIDTH
    }
}

impl Adjoint for RetracedOperator<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Adjoint, ys, xs)
    }
}

#[derive(Clone, Copy)]
pub(super) struct Way {
    pub(super) direction: Direction,
    pub(super) part: Part,
    pub(super) with_ambient: bool,
}

/// A running mean over samples, with or without its error.
pub(super) trait Tally: Copy + Default + Send {
    fn add(&mut self, halves: Halves, half: usize, value: f64);
}

impl Tally for f64 {
    fn add(&mut self, halves: Halves, _half: usize, value: f64) {
        *self += halves.share(value);
    }
}

impl Tally for [f64; 2] {
    fn add(&mut self, halves: Halves, half: usize, value: f64) {
        halves.add(self, half, value);
    }
}

/// The contributions of a batch to a photo in `C` channels. All cores read them in parallel. One core sums them in path order.
pub(super) struct Contributions<const C: usize> {
    halves: Halves,
    symmetric: bool,
    /// Whether the paths start at the pixels that receive light. Otherwise they start at the pixels that send light.
    from_seeing: bool,
    parts: Vec<Read<C>>,
}

const RUNS: usize = 16;

/// The bits above the number of the pixel, which give the kind of a contribution: direct light, ambient light, or neither bit for a
/// connection.
const DIRECT: u32 = 1 << 30;
const AMBIENT: u32 = 1 << 31;

impl<const C: usize> Contributions<C> {
    /// Reads the records of a batch. Values are divided by `samples`. `project` converts RGB to channels.
    pub(super) fn read(
        batch: &Batch<'_>,
        samples: u32,
        way: Way,
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) -> Self {
        let runs: Vec<Run> = batch.runs().collect();
        Self {
            halves: Halves::new(samples, batch.samples()),
            symmetric: batch.symmetric(),
            from_seeing: batch.from_camera() == (way.direction == Direction::Forward),
            parts: runs.par_chunks(RUNS).map(|runs| Read::new(batch, runs, way, project)).collect(),
        }
    }

    /// `seen += P lit` for each channel, with the contributions of this batch to `P`.
    pub(super) fn add_to<T: Tally>(&self, seen: &mut [[T; C]], lit: &[[f64; C]]) {
        let ambient = [1.0; C];
        self.entries(|run, to, from, value| {
            let light = from.map_or(&ambient, |from| &lit[from]);
            for ((seen, &value), light) in seen[to].iter_mut().zip(value).zip(light) {
                seen.add(self.halves, run.half, f64::from(value) * light);
            }
        });
    }

    /// Calls `entry` for each contribution with its run, the pixel that receives the light, the pixel that sends it, and the value. Ambient
    /// light has no sending pixel.
    pub(super) fn entries(&self, mut entry: impl FnMut(&Run, usize, Option<usize>, &[f32; C])) {
        for (run, found) in self.parts.iter().flat_map(Read::runs) {
            let start = run.pixel as usize;
            for (other, value) in found {
                let end = (other & PIXEL_MASK) as usize;
                match other & !PIXEL_MASK {
                    DIRECT => entry(run, start, Some(start), value),
                    AMBIENT => entry(run, start, None, value),
                    _ if self.symmetric => {
                        entry(run, start, Some(end), value);
                        // The reversed path has the same weight.
                        entry(run, end, Some(start), value);
                    }
                    _ if self.from_seeing => entry(run, start, Some(end), value),
                    _ => entry(run, end, Some(start), value),
                }
            }
        }
    }

    pub(super) fn halves(&self) -> Halves {
        self.halves
    }
}

/// The nonzero contributions of the paths of some runs. A contribution has its kind together with the pixel at its other end, and its
/// value.
struct Read<const C: usize> {
    /// Each run, with the end index of its contributions.
    runs: Vec<(Run, usize)>,
    found: Vec<(u32, [f32; C])>,
}

impl<const C: usize> Read<C> {
    fn new(
        batch: &Batch<'_>,
        runs: &[Run],
        Way { part, with_ambient, .. }: Way,
        project: &impl Fn([f32; 3]) -> [f32; C],
    ) -> Self {
        let (has_direct, has_ambient) = (part.holds(1), with_ambient && batch.has_ambient());
        let mut found = Vec::new();
        let mut end = 0;
        let mut ends = Vec::with_capacity(runs.len());
        for run in runs {
            // The stride of the batch is the maximum number of contributions of a path.
            found.resize(end + run.paths.len() * batch.stride(), (0, [0.0; C]));
            // A contribution that does not count or has no light is also written, but the next one overwrites it. A branch would delay the
            // load of the next record.
            let mut keep = |counts: bool, other: u32, color: [f32; 3]| {
                let value = project(color);
                found[end] = (other, value);
                let is_light = value.iter().fold(false, |any, &value| any | (value != 0.0));
                end += usize::from(counts & is_light);
            };
            for path in run.paths.clone() {
                if has_direct {
                    keep(true, DIRECT, batch.direct(path));
                }
                if has_ambient {
                    keep(true, AMBIENT, batch.ambient(path).unwrap_or_default());
                }
                batch
                    .ends(path)
                    .for_each(|end| keep(end.is_seen & part.holds(end.bounces), end.pixel, end.value));
            }
            ends.push((run.clone(), end));
        }
        found.truncate(end);
        Self { runs: ends, found }
    }

    fn runs(&self) -> impl Iterator<Item = (&Run, &[(u32, [f32; C])])> {
        let starts = std::iter::once(0).chain(self.runs.iter().map(|(_, end)| *end));
        self.runs.iter().zip(starts).map(|((run, end), start)| (run, &self.found[start..*end]))
    }
}
