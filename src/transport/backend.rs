//! Where products are taken: on the processor, or on the device that traced the paths.
//!
//! The rule, for [`Backend::Auto`]: on the device where that is a GPU (of its own, part of the processor, or virtual), a product has
//! enough entries to be worth the way there and back, shaders calculate in `f64`, and matrix and vectors fit its buffers and the
//! share of its memory that is taken at most; else on the processor, and why is said where a GPU was passed over for want of
//! something. On software Vulkan, which is the processor with a detour, products take ten times as long.

use super::{Assembled, GpuMatrix};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::Tracer;

/// Entries that make a product worth sending to a GPU: they take a few cores as long as the way there and back, some 0.2 ms. An
/// estimate: it was never measured on one.
const WORTHWHILE: usize = 1 << 20;

/// Where products with the frozen matrix are to be taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// On the device where it is a GPU that suits.
    #[default]
    Auto,
    /// On the processor.
    Cpu,
    /// On the device, whatever it is.
    Gpu,
}

impl Assembled {
    /// Moves the matrix to where products are to be taken from now on, by the device that `tracer` traces on. Where a GPU was passed
    /// over for want of something, says of what.
    ///
    /// # Errors
    /// [`Error::Device`] where the device is insisted on, but has no `f64` or not the memory.
    pub fn place(&mut self, tracer: &Tracer, place: Backend) -> Result<Option<String>> {
        self.place_on(tracer.gpu(), place, WORTHWHILE)
    }

    /// Whether products are taken on a device.
    pub fn is_on_gpu(&self) -> bool {
        self.gpu_matrix.is_some()
    }

    /// As [`Assembled::place`], where so many entries are worth the way.
    fn place_on(&mut self, gpu: &Gpu, place: Backend, worthwhile: usize) -> Result<Option<String>> {
        self.gpu_matrix = None;
        let suits = !gpu.summary.is_processor() && self.matrix.nonzeros() >= worthwhile;
        if place == Backend::Cpu || (place == Backend::Auto && !suits) {
            return Ok(None);
        }
        match GpuMatrix::on(gpu, &self.matrix) {
            Ok(gpu_matrix) => self.gpu_matrix = Some(gpu_matrix),
            Err(Error::Device { fault, .. }) if place == Backend::Auto => return Ok(Some(fault)),
            Err(Error::Device { fault, .. }) => {
                let help = "leave the products to the processor (--products cpu), or use another --adapter";
                return Err(Error::Device { fault, help: help.into() });
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
    use crate::image::Image;
    use crate::operator::Operator;
    use crate::transport::gpu_matrix::tests::{coaxial, gpu};
    use crate::transport::{MatrixOperator, Part, Products, Simulated, Transport};

    /// Software Vulkan under the name of a card.
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
    fn products_are_taken_where_they_are_wanted() {
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
    fn a_card_without_f64_or_room_is_passed_over_and_an_error_where_it_is_insisted_on() {
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
    fn photos_and_operators_go_with_the_matrix() {
        let [mut here, mut there] = [coaxial(), coaxial()].map(|traced| Simulated { traced });
        assert_eq!(placed(&mut there.traced, &gpu(), Backend::Gpu, 0), (None, true));
        let resolution = here.photo_resolution();
        let pattern = Image::filled(resolution, 3, 0.5);
        let photos = [&mut here, &mut there].map(|rig| rig.photograph(&pattern));
        let [Ok(expected), Ok(found)] = photos else { unreachable!("{photos:?}") };
        for (expected, found) in expected.samples().iter().zip(found.samples()) {
            // The same to 1e-13, and then rounded to `f32`, down or up.
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
        let traced = &there.traced;
        let (placed, matrix) = (product(traced), product(&traced.matrix));
        assert!(placed != matrix, "sums are taken in another order there");
        assert!(placed == product(traced) && matrix == product(&here.traced));
    }
}
