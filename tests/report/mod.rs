//! Files that are written and read, and the page that shows a run.

mod arrays;
mod index;
mod matrix_files;
mod metadata;
mod page;
mod pictures;
mod plots;
mod sparse;
mod strip;
mod viewer;
