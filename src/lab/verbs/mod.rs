//! The verbs of the command line as methods of a laboratory. Each takes a request, and returns an answer with arrays.

mod photo;

pub use photo::SinglePhoto;
