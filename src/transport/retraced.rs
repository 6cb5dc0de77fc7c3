//! Photos by tracing anew for each one. No matrix is kept, so none has to fit the memory.

use super::block::{deinterleave, interleave};
use super::contributions::{Contributions, Tally, Way};
use super::matrix::Direction;
use super::tiles::{BLOCK_WIDTH, Interleaved};
use super::{Channels, Part, Transport, from_planes, luminance, planes, spread};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::render::{TraceSettings, Tracer};

/// A scene that is traced once per photo, always with the same light paths.
///
/// The connections are added up on the host in path order, so that photos repeat to the bit.
pub struct Retraced<'a> {
    /// The scene on its device. Its observer sees the steps of each photo, and may stop it.
    pub tracer: &'a mut Tracer,
    /// What is traced for each photo.
    pub settings: TraceSettings,
    /// Gray or colour.
    pub channels: Channels,
}

impl Retraced<'_> {
    /// The photo of `pattern`, and its standard error pixel by pixel: the halves' difference, as in
    /// [`super::Noise`], of this very photo with its ambient light. Zeros where one path per pixel cannot
    /// tell.
    ///
    /// # Errors
    /// As [`Transport::photograph`].
    pub fn photograph_with_error(&mut self, pattern: &Image) -> Result<(Image, Image)> {
        let seen: Vec<Vec<[f64; 2]>> = self.see(pattern)?;
        let image = |value: fn(&[f64; 2]) -> f64| {
            let planes: Vec<Vec<f64>> = seen.iter().map(|plane| plane.iter().map(value).collect()).collect();
            from_planes(self.settings.resolution, &planes)
        };
        Ok((image(|[mean, _]| *mean)?, image(|[_, error]| error.abs())?))
    }

    /// What arrives of `pattern`, with the ambient light: `[channel][pixel]`.
    fn see<T: Tally>(&mut self, pattern: &Image) -> Result<Vec<Vec<T>>> {
        let lit = planes(pattern, self.pattern_resolution(), self.channels)?;
        let pixels = self.settings.resolution.pixels();
        let way = Way { direction: Direction::Forward, part: Part::Full, with_ambient: true };
        match (self.channels, &lit[..]) {
            (Channels::Rgb, [red, green, blue]) => {
                let lit: Vec<[f64; 3]> =
                    red.iter().zip(green).zip(blue).map(|((&r, &g), &b)| [r, g, b]).collect();
                let seen = self.trace(way, &lit, |rgb| rgb, pixels)?;
                Ok((0..3).map(|channel| seen.iter().map(|seen: &[T; 3]| seen[channel]).collect()).collect())
            }
            _ => {
                let lit: Vec<[f64; 1]> = lit[0].iter().map(|&light| [light]).collect();
                let seen = self.trace(way, &lit, |rgb| [luminance(rgb)], pixels)?;
                Ok(vec![seen.into_iter().map(|[seen]| seen).collect()])
            }
        }
    }

    /// What arrives of `K` patterns in one channel by the same paths, pixel by pixel.
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

    /// Traces, and returns what arrives of `lit`, pixel by pixel. `project` makes channels of a connection's
    /// colours.
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

    /// Traces, and hands the contributions of each batch to `add`, in path order.
    pub(super) fn each<const C: usize>(
        &mut self,
        way: Way,
        project: impl Fn([f32; 3]) -> [f32; C] + Sync,
        add: &mut (impl FnMut(&Contributions<C>) + Send),
    ) -> Result<()> {
        let samples = self.settings.samples;
        // Of the batch before: read, but not yet added up.
        let mut last: Option<Contributions<C>> = None;
        spread::trace(self.tracer, &self.settings, &mut |batch| {
            // One core adds up the contributions, in path order; meanwhile the others read the next batch, which
            // takes longer.
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
        from_planes(self.settings.resolution, &seen)
    }
}

/// `y = P x` for one part and channel. The scene is traced anew for each product, or once for four vectors of
/// a block. The matrix is that of [`super::MatrixOperator`], to rounding.
pub struct RetracedOperator<'a> {
    /// The scene.
    pub retraced: Retraced<'a>,
    /// Which light.
    pub part: Part,
    /// Which channel, below [`Channels::count`].
    pub channel: usize,
}

impl RetracedOperator<'_> {
    /// Vectors of a block that are traced together.
    pub const BLOCK_SIZE: usize = BLOCK_WIDTH;

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
        let Retraced { tracer, settings, .. } = &self.retraced;
        if tracer.symmetric(settings) { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.block(Direction::Forward, &[x], &mut [y])
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Forward, xs, ys)
    }

    fn block_size(&self) -> usize {
        Self::BLOCK_SIZE
    }
}

impl Adjoint for RetracedOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.block(Direction::Backward, &[y], &mut [x])
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Backward, ys, xs)
    }
}
