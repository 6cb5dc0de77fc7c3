//! Painting with light: the user paints patterns in a browser and sees the photo while the pen moves.
//!
//! A [`Canvas`] turns patterns into photos. If the light transport matrix is in memory, a stroke costs only the columns of the pixels that
//! it changes. A [`Session`] holds the pattern on the projector and answers the newest requests of all browsers. The [server](serve())
//! passes messages between them. [`page`] makes the page: either a page that asks the server, or one file that contains the matrix.

mod canvas;
mod connection;
mod embedded;
mod message;
pub mod page;
mod question;
mod server;
mod session;

pub use canvas::{Canvas, Light};
pub use question::{PageAnswer, PageQuestion};
pub use server::{Ended, ServeOptions, serve};
pub use session::Session;
