//! The light transport matrix of a scene. The light paths are traced, summed for each pair of pixels, and combined into rows. Photos are
//! products with the matrix, on the processor or on a device.

use std::sync::Arc;

use super::layer::Layer;
use super::noise::Noise;
use super::{Channels, GpuMatrix, MatrixOperator, Part, RigShape, Transport, TransportMatrix, spread};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::{Image, Resolution};
use crate::operator::Operator;
use crate::render::{TraceSettings, TraceSummary, Tracer};

/// A traced scene.
#[derive(Debug)]
pub struct Assembled {
    /// The light transport matrix.
    pub matrix: TransportMatrix,
    /// The photo without projector light, in W/(m² sr): the light that the scene itself emits.
    pub ambient: Image,
    /// The noise of the matrix. It is `None` if an endpoint has only one path per pixel, from which noise cannot be estimated.
    pub noise: Option<Noise>,
    /// The cost of tracing.
    pub summary: TraceSummary,
    /// The copy of the matrix on a GPU, if the GPU computes products; see [`Assembled::place`].
    pub(crate) gpu_matrix: Option<GpuMatrix>,
}

/// Traces the scene and assembles its light transport matrix. Equal settings on equal devices give equal bits. The tracer's observer sees
/// the steps. The call fails like [`Tracer::trace`].
pub fn assemble(tracer: &mut Tracer, settings: &TraceSettings, channels: Channels) -> Result<Assembled> {
    assemble_layers(tracer, settings, channels, false)
}

/// Works like [`assemble()`]. If `split` is set, light of two bounces and light of more bounces are separate layers.
pub fn assemble_layers(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
) -> Result<Assembled> {
    match channels {
        Channels::Luma => spread::assemble::<1>(tracer, settings, channels, split),
        Channels::Rgb => spread::assemble::<3>(tracer, settings, channels, split),
    }
}

pub(super) fn shape(tracer: &Tracer, settings: &TraceSettings) -> RigShape {
    RigShape {
        camera: settings.resolution,
        projector: tracer.projector_resolution(settings),
        symmetric: tracer.symmetric(settings),
    }
}

/// A traced scene as a rig. Several owners may share it. It is linear, so patterns may be negative and of any magnitude.
impl Transport for Arc<Assembled> {
    fn pattern_resolution(&self) -> Resolution {
        self.matrix.projector_resolution()
    }

    fn photo_resolution(&self) -> Resolution {
        self.matrix.resolution()
    }

    fn channels(&self) -> Channels {
        self.matrix.channels()
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let matrix = &self.matrix;
        let lit = super::planes(pattern, matrix.projector_resolution(), matrix.channels())?;
        let mut photo = vec![vec![0.0; matrix.resolution().pixels()]; lit.len()];
        for (channel, (pattern, plane)) in lit.iter().zip(&mut photo).enumerate() {
            self.operator(Part::Full, channel).apply(pattern, plane)?;
            for (value, ambient) in plane.iter_mut().zip(self.ambient.plane(channel)) {
                *value += ambient;
            }
        }
        Image::from_planes(matrix.resolution(), &photo)
    }
}

/// A product is sent to a GPU only if the matrix has at least this many entries. A few cores multiply so many entries in about the time of
/// the transfers, some 0.2 ms. This number is an estimate; it was not measured on a GPU.
const WORTHWHILE: usize = 1 << 20;

/// The backend of products with the traced matrix: the processor, or the device that traced the paths.
///
/// [`Backend::Auto`] takes the device if all of these hold: it is a GPU (discrete, integrated or virtual); the matrix has enough entries to
/// be worth the transfer of the vectors; shaders can calculate in `f64`; and matrix and vectors fit its buffers and the share of its memory
/// that may be used. Otherwise it takes the processor. If a GPU lacked something, the reason is returned. Software Vulkan takes ten times
/// as long as the processor itself. Each process of a team multiplies its rows on its processor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Backend {
    /// On the device that traces, if that is a GPU with all that it takes
    #[default]
    Auto,
    /// On the processor
    Cpu,
    /// On the device that traces, whatever it is
    #[value(name = "device")]
    Gpu,
}

impl Assembled {
    /// Products with one part and channel of the matrix, on its backend. Repeated products on one backend are equal to the bit. Products of
    /// different backends differ only by the rounding of sums.
    pub fn operator(&self, part: Part, channel: usize) -> MatrixOperator<'_> {
        MatrixOperator::new(&self.matrix, part, channel).on(self.gpu_matrix.as_ref())
    }

    /// Chooses the backend of all later products. The device is that on which `tracer` traces. The result is a reason if [`Backend::Auto`]
    /// chose the processor because a GPU lacked something.
    ///
    /// # Errors
    /// [`Error::Device`] for [`Backend::Gpu`] on a device without `f64` or without enough memory; [`Error::Option`] for [`Backend::Gpu`] if
    /// the matrix is spread over several processes.
    pub fn place(&mut self, tracer: &Tracer, place: Backend) -> Result<Option<String>> {
        self.place_on(tracer.gpu(), place, WORTHWHILE)
    }

    /// Whether the device computes products.
    pub fn is_on_gpu(&self) -> bool {
        self.gpu_matrix.is_some()
    }

    fn place_on(&mut self, gpu: &Gpu, place: Backend, worthwhile: usize) -> Result<Option<String>> {
        // A device that has assembled the matrix keeps it, unless the processor is to multiply.
        let resident = self
            .gpu_matrix
            .take()
            .filter(|_| self.matrix.layers.iter().any(|layer| layer.resident().is_some()));
        let suits = !gpu.summary.is_processor() && self.matrix.nonzeros() >= worthwhile;
        if self.matrix.processes() > 1 && place == Backend::Gpu {
            return Err(Error::option(
                "--products",
                "each process multiplies its rows of the matrix on its processor",
            )
            .help("leave it out, or start one process"));
        }
        let suits = suits && self.matrix.processes() == 1;
        if place == Backend::Cpu || (place == Backend::Auto && !suits) {
            self.matrix.layers.iter_mut().try_for_each(Layer::leave_device)?;
            return Ok(None);
        }
        if let Some(resident) = resident {
            self.gpu_matrix = Some(resident);
            return Ok(None);
        }
        match GpuMatrix::on(gpu, &self.matrix) {
            Ok(gpu_matrix) => self.gpu_matrix = Some(gpu_matrix),
            Err(error) if gpu.require_working().is_err() => return Err(error),
            Err(Error::Device { fault, .. }) if place == Backend::Auto => return Ok(Some(fault)),
            Err(Error::Device { fault, .. }) => {
                let help = "take the products on the processor (--products cpu), or use another --adapter";
                return Err(Error::device(fault).help(help));
            }
            Err(error) => return Err(error),
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::AdapterSummary;
    use crate::transport::gpu_matrix::tests::coaxial;

    fn adapter(kind: &str) -> Gpu {
        let mut gpu = Gpu::for_tests();
        gpu.summary.kind = kind.into();
        gpu
    }

    fn card() -> Gpu {
        adapter("discrete GPU")
    }

    fn placed(
        traced: &mut Assembled,
        gpu: &Gpu,
        place: Backend,
        worthwhile: usize,
    ) -> (Option<String>, bool) {
        let why = traced.place_on(gpu, place, worthwhile).unwrap_or_else(|error| unreachable!("{error}"));
        (why, traced.is_on_gpu())
    }

    #[test]
    fn products_are_taken_on_the_chosen_backend() {
        let (software, card, mut traced) = (adapter("software"), card(), coaxial());
        let entries = traced.matrix.nonzeros();
        assert_eq!(placed(&mut traced, &software, Backend::Gpu, 0), (None, true));
        assert_eq!(placed(&mut traced, &software, Backend::Auto, 0), (None, false));
        assert_eq!(placed(&mut traced, &card, Backend::Auto, entries), (None, true));
        assert_eq!(placed(&mut traced, &card, Backend::Auto, entries + 1), (None, false));
        assert_eq!(placed(&mut traced, &card, Backend::Gpu, entries + 1), (None, true));
        assert_eq!(placed(&mut traced, &card, Backend::Cpu, 0), (None, false));
    }

    #[test]
    fn a_gpu_without_f64_or_memory_is_not_chosen_and_an_error_where_it_is_required() {
        let mut traced = coaxial();
        let pixels = traced.matrix.resolution().pixels();
        let (white, mut expected) = (vec![1.0; pixels], vec![f64::NAN; pixels]);
        traced.matrix.apply(Part::Full, 0, &white, &mut expected);
        type Taken = fn(&mut AdapterSummary);
        let lacking: [(&str, Taken); 2] = [
            ("f64", |summary| summary.double_precision = false),
            ("MiB", |summary| summary.max_buffer = 1000),
        ];
        for (lack, take) in lacking {
            let mut card = card();
            take(&mut card.summary);
            let forced = traced.place_on(&card, Backend::Gpu, 0);
            let error = forced.map_or_else(|error| error.to_string(), |_| String::new());
            assert!(error.contains(lack) && error.contains("--products cpu"), "{error}");
            let (why, is_on_gpu) = placed(&mut traced, &card, Backend::Auto, 0);
            assert!(why.is_some_and(|why| why.contains(lack)) && !is_on_gpu);
            let mut y = vec![f64::NAN; pixels];
            assert!(traced.operator(Part::Full, 0).apply(&white, &mut y).is_ok() && y == expected);
        }
    }

    #[test]
    fn photos_and_operators_use_the_backend_of_the_matrix() {
        let [here, mut there] = [coaxial(), coaxial()];
        assert_eq!(placed(&mut there, &Gpu::for_tests(), Backend::Gpu, 0), (None, true));
        let [mut here, mut there] = [here, there].map(Arc::new);
        let resolution = here.photo_resolution();
        let pattern = Image::filled(resolution, 3, 0.5);
        let photos = [&mut here, &mut there].map(|rig| rig.photograph(&pattern));
        let [Ok(expected), Ok(found)] = photos else { unreachable!("{photos:?}") };
        for (expected, found) in expected.samples().iter().zip(found.samples()) {
            // The values agree to 1e-13, but may be rounded to different `f32`.
            assert!((expected - found).abs() <= f32::EPSILON * expected, "{expected} and {found}");
        }
        let pixels = resolution.pixels();
        let x: Vec<f64> = (0..pixels).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0 - 0.5).collect();
        let product = |mut operator: MatrixOperator<'_>| {
            let mut y = vec![f64::NAN; pixels];
            operator.apply(&x, &mut y).expect("the vector fits");
            y
        };
        let placed = product(there.operator(Part::Global, 1));
        let matrix = product(MatrixOperator::new(&there.matrix, Part::Global, 1));
        assert!(placed != matrix, "sums are taken in another order there");
        assert!(placed == product(there.operator(Part::Global, 1)));
        assert!(matrix == product(here.operator(Part::Global, 1)));
    }

    /// A call compiles only if `T` may move to another thread.
    const fn assert_send<T: Send>() {}

    const _: () = {
        assert_send::<Tracer>();
        assert_send::<Assembled>();
        assert_send::<GpuMatrix>();
        assert_send::<super::super::Retraced<'_>>();
    };
}
