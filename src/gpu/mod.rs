//! The graphics device: opening it, composing shaders for it, moving data to and from it. Nothing above
//! [`crate::render`] sees these types, but for the products of [`crate::transport`].

pub(crate) mod buffers;
pub(crate) mod device;
mod fold;
#[cfg(test)]
pub(crate) mod layout;
pub(crate) mod readback;
pub mod shader;

pub use device::AdapterSummary;
pub(crate) use device::Gpu;
