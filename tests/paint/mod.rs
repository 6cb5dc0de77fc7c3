//! The painting page: what its server answers and refuses, and, in a browser, what a user does with it.

mod browser;
mod hostile;
mod painting;
mod served;
