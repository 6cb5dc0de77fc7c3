//! Writes the generated parts of the guide and the README anew: the reference of the command line, and all pictures.
//!
//! `cargo run --release --example regenerate_guide [pictures|gallery|readme|reference]`, in the repository.

mod concepts;
mod gallery;
mod panels;
mod readme;
mod reference;

use std::path::Path;

use krylux::error::{Error, Result};

/// The folder of the pictures.
const PICTURES: &str = "guide/src/pictures";

fn main() -> Result<()> {
    let only = std::env::args().nth(1);
    let is_asked = |part: &str| only.as_deref().is_none_or(|only| only == part);
    if is_asked("reference") {
        std::fs::write(reference::PAGE, reference::page(krylux::cli::command()))
            .map_err(Error::writing(reference::PAGE))?;
        std::fs::write(gallery::PAGE, gallery::page()).map_err(Error::writing(gallery::PAGE))?;
        println!("{}, {}", reference::PAGE, gallery::PAGE);
    }
    if is_asked("pictures") || is_asked("readme") {
        readme::first_look(&Path::new(PICTURES).join("first-look.png"))?;
    }
    if is_asked("pictures") {
        let folder = Path::new(PICTURES);
        concepts::matrix(&folder.join("matrix.png"))?;
        concepts::photos_of_photos(&folder.join("photos-of-photos.png"))?;
        concepts::convergence(&folder.join("convergence.svg"))?;
        concepts::frozen_and_fresh(&folder.join("frozen-and-fresh.svg"))?;
        println!("{PICTURES}");
    }
    if is_asked("pictures") || is_asked("gallery") {
        gallery::pictures(Path::new(PICTURES))?;
    }
    Ok(())
}
