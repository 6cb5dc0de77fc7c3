//! Painting with light: the user paints a pattern in a browser and sees its photo while the pen moves.
//!
//! A [`Canvas`] computes photos of patterns. If the light transport matrix is in memory, a stroke costs only the columns of the pixels that
//! it changes. A [`Session`] keeps the projected pattern, and answers the newest requests of all browsers. The [server](serve())
//! passes messages between session and browsers. [`page`] makes the page: either a page that needs the server, or one file with the matrix.

mod canvas;
#[cfg(feature = "paint")]
mod connection;
mod embedded;
#[cfg(feature = "paint")]
mod message;
pub mod page;
mod question;
#[cfg(feature = "paint")]
mod server;
#[cfg(feature = "paint")]
mod session;

pub use canvas::{Canvas, Light};
pub use question::{PageAnswer, PageQuestion};
#[cfg(feature = "paint")]
pub use server::{Ended, ServeOptions, serve};
#[cfg(feature = "paint")]
pub use session::Session;
