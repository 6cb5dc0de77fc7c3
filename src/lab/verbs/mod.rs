//! The verbs of the command line as methods of a laboratory. Each takes a request, and returns an answer with arrays.

mod audit;
mod photo;
mod probe;
mod solve;

pub use photo::SinglePhoto;
