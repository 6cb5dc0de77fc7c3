//! Painting with light: patterns are painted in a browser, and the photo is seen while the pen moves.
//!
//! A [`Canvas`] turns patterns into photos. Where the light transport matrix is in memory, a stroke costs only the columns of the
//! pixels that it changes. A [`Session`] holds what is on the projector and answers the newest requests of all browsers; the
//! [server](serve()) carries them between the two. [`page`] makes the page: one that asks the server, or one file that holds the matrix.

mod canvas;
mod connection;
mod embedded;
mod message;
pub mod page;
mod question;
mod server;
mod session;

pub use canvas::{Canvas, Light};
pub use question::{Answer, Question};
pub use server::{Ended, ServeOptions, serve};
pub use session::Session;
