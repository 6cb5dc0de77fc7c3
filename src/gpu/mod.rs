//! The graphics device: opening it, composing shaders for it, moving data to and from it. Nothing above
//! [`crate::render`] sees these types.

pub(crate) mod buffers;
pub(crate) mod device;
pub mod shader;

pub use device::AdapterSummary;
pub(crate) use device::Gpu;
