//! The picture of the README: what is asked of two scenes, and what comes of it.

use std::path::Path;

use krylux::analysis::SegmentOptions;
use krylux::analysis::segment::segment;
use krylux::error::Result;
use krylux::image::{Image, Resolution};
use krylux::lab::Lab;
use krylux::report::palette::paint_labels;
use krylux::transport::Part;
use krylux::verbs::Compensate;

use crate::panels;

/// Pixels on a side.
const SIDE: usize = 128;

/// An egg carton and its groups; a corner that the pattern of a target is projected on, and one that is compensated.
pub fn first_look(path: &Path) -> Result<()> {
    let mut carton = Lab::builder("assets/scenes/carton/scene.glb").size(SIDE, SIDE).samples(256).open()?;
    let white = carton.white()?;
    let options = SegmentOptions { photos: 100, eigenvectors: 20, ..SegmentOptions::groups([12]) };
    let groups = segment(&mut carton.operator(Part::Global)?, &options)?;
    let resolution = Resolution::new(SIDE, SIDE);

    let mut corner = Lab::builder("assets/scenes/corner/scene.glb").size(SIDE, SIDE).samples(256).open()?;
    let target = Some(rings(resolution).into());
    let found = corner.ask(&Compensate { target, photos: Some(40), ..Compensate::default() })?.found;
    println!("residual {:.4}, without compensation {:.4}", found.residual, found.uncompensated_residual);
    let pictures = [
        panels::photo(&white),
        paint_labels(resolution, &groups.labels[0].1),
        panels::photo_like(&found.uncompensated, &found.target),
        panels::photo_like(&found.observed, &found.target),
    ];
    panels::row(&pictures, 2).write_png(path)
}

/// A target of bright and dark rings.
fn rings(resolution: Resolution) -> Image {
    let mut image = Image::filled(resolution, 1, 0.0);
    let middle = (SIDE as f32 - 1.0) / 2.0;
    for (pixel, sample) in image.samples_mut().iter_mut().enumerate() {
        let (x, y) = ((pixel % SIDE) as f32 - middle, (pixel / SIDE) as f32 - middle);
        let ring = (x.hypot(y) / 10.0) as usize;
        *sample = if ring.is_multiple_of(2) { 0.9 } else { 0.25 };
    }
    image
}
