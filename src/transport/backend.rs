//! The backend of products: the processor, or the device that traced the paths.
//!
//! [`Backend::Auto`] takes the device where all of these hold: it is a GPU (discrete, integrated or virtual);
//! the matrix has enough entries to be worth the transfer of the vectors; shaders can calculate in `f64`; and
//! matrix and vectors fit its buffers and the share of its memory that may be used. Otherwise it takes the
//! processor; if a GPU lacked something, the reason is returned. On software Vulkan, which runs on the
//! processor, products take ten times as long as by the processor itself. Each process of a
//! team multiplies its rows of a matrix on its processor.

use super::{Assembled, GpuMatrix};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::Tracer;

/// Entries from which a product is worth sending to a GPU: a few cores multiply them in about the time of the
/// transfers, some 0.2 ms. This is an estimate that was not measured on a GPU.
const WORTHWHILE: usize = 1 << 20;

/// Where products with the traced matrix are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// On the device if it is a suitable GPU, else on the processor.
    #[default]
    Auto,
    /// On the processor.
    Cpu,
    /// On the device, of whatever kind.
    Gpu,
}

impl Assembled {
    /// Chooses the backend of all later products; the device is the one that `tracer` traces on. Returns what
    /// a GPU lacked, where [`Backend::Auto`] therefore chose the processor.
    ///
    /// # Errors
    /// [`Error::Device`] for [`Backend::Gpu`] on a device without `f64` or without enough memory; [`Error::Option`] for it where several
    /// processes have the matrix.
    pub fn place(&mut self, tracer: &Tracer, place: Backend) -> Result<Option<String>> {
        self.place_on(tracer.gpu(), place, WORTHWHILE)
    }

    /// Whether products are taken on a device.
    pub fn is_on_gpu(&self) -> bool {
        self.gpu_matrix.is_some()
    }

    /// As [`Assembled::place`], with `worthwhile` in place of [`WORTHWHILE`].
    fn place_on(&mut self, gpu: &Gpu, place: Backend, worthwhile: usize) -> Result<Option<String>> {
        self.gpu_matrix = None;
        let suits = !gpu.summary.is_processor() && self.matrix.nonzeros() >= worthwhile;
        if self.matrix.processes() > 1 && place == Backend::Gpu {
            return Err(Error::Option {
                option: "--products".into(),
                fault: "each process multiplies its rows of the matrix on its processor".into(),
                help: "leave it out, or start one process".into(),
            });
        }
        let suits = suits && self.matrix.processes() == 1;
        if place == Backend::Cpu || (place == Backend::Auto && !suits) {
            return Ok(None);
        }
        match GpuMatrix::on(gpu, &self.matrix) {
            Ok(gpu_matrix) => self.gpu_matrix = Some(gpu_matrix),
            Err(error) if gpu.require_working().is_err() => return Err(error),
            Err(Error::Device { fault, .. }) if place == Backend::Auto => return Ok(Some(fault)),
            Err(Error::Device { fault, .. }) => {
                let help = "take the products on the processor (--products cpu), or use another --adapter";
                return Err(Error::Device { fault, help: help.into() });
            }
            Err(error) => return Err(error),
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::gpu::AdapterSummary;
    use crate::image::Image;
    use crate::operator::Operator;
    use crate::transport::gpu_matrix::tests::{coaxial, gpu};
    use crate::transport::{MatrixOperator, Part, Products, Transport};

    /// Software Vulkan that claims to be a discrete GPU.
    fn card() -> Gpu {
        let mut gpu = gpu();
        gpu.summary.kind = "discrete GPU".into();
        gpu
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
        let (software, card, mut traced) = (gpu(), card(), coaxial());
        assert!(software.summary.is_processor(), "the tests run on software Vulkan");
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
            assert!(traced.product(Part::Full, 0, &white, &mut y).is_ok() && y == expected);
        }
    }

    #[test]
    fn photos_and_operators_use_the_backend_of_the_matrix() {
        let [here, mut there] = [coaxial(), coaxial()];
        assert_eq!(placed(&mut there, &gpu(), Backend::Gpu, 0), (None, true));
        let [mut here, mut there] = [here, there].map(Arc::new);
        let resolution = here.photo_resolution();
        let pattern = Image::filled(resolution, 3, 0.5);
        let photos = [&mut here, &mut there].map(|rig| rig.photograph(&pattern));
        let [Ok(expected), Ok(found)] = photos else { unreachable!("{photos:?}") };
        for (expected, found) in expected.samples().iter().zip(found.samples()) {
            // Equal to 1e-13, then rounded to `f32`, down or up.
            assert!((expected - found).abs() <= f32::EPSILON * expected, "{expected} and {found}");
        }
        let pixels = resolution.pixels();
        let x: Vec<f64> = (0..pixels).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0 - 0.5).collect();
        let product = |matrix: &dyn Products| {
            let mut y = vec![f64::NAN; pixels];
            let taken = MatrixOperator::new(matrix, Part::Global, 1).apply(&x, &mut y);
            taken.unwrap_or_else(|error| unreachable!("{error}"));
            y
        };
        let (placed, matrix) = (product(&*there), product(&there.matrix));
        assert!(placed != matrix, "sums are taken in another order there");
        assert!(placed == product(&*there) && matrix == product(&*here));
    }
}
