//! The graphics device: it is opened here, shaders are composed for it, and data is moved to and from it.
//! Only [`crate::render`] and the GPU matrix of [`crate::transport`] use these types.

pub(crate) mod buffers;
pub(crate) mod device;
mod fold;
#[cfg(test)]
pub(crate) mod layout;
pub mod shader;

pub use device::AdapterSummary;
pub(crate) use device::Gpu;
