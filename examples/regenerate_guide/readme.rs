//! The picture of the README: what is asked of two scenes, and what comes of it.

use std::path::Path;

use krylux::analysis::SegmentOptions;
use krylux::analysis::segment::segment;
use krylux::error::Result;
use krylux::image::{Image, Resolution};
use krylux::lab::{ChannelChoice, Lab};
use krylux::report::palette::paint_labels;
use krylux::transport::Part;
use krylux::verbs::Compensate;

use crate::panels;

/// Pixels on a side.
const SIDE: usize = 128;

/// A coloured box, an egg carton and its groups; a corner that the pattern of a target is projected on, and one that is compensated; the box
/// under painted light.
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

    let colours = Lab::builder("assets/scenes/cornell/scene.glb").channels(ChannelChoice::Rgb);
    let mut cornell = colours.size(SIDE, SIDE).samples(256).open()?;
    let lit = cornell.white()?;
    let painted = cornell.photo(&brush_strokes(resolution))?;
    let above = [panels::photo(&lit), panels::photo(&white), paint_labels(resolution, &groups.labels[0].1)];
    let below = [
        panels::photo_like(&found.uncompensated, &found.target),
        panels::photo_like(&found.observed, &found.target),
        panels::photo(&painted),
    ];
    panels::grid(&[above.as_slice(), below.as_slice()], 3).write_png(path)
}

/// Three waves of coloured light, as a brush would paint them.
fn brush_strokes(resolution: Resolution) -> Image {
    let mut image = Image::filled(resolution, 3, 0.0);
    let strokes = [(0.25, [1.0, 0.55, 0.1]), (0.5, [0.2, 0.9, 1.0]), (0.75, [1.0, 0.2, 0.8])];
    for (pixel, samples) in image.samples_mut().chunks_exact_mut(3).enumerate() {
        let [x, y] = [pixel % SIDE, pixel / SIDE].map(|at| at as f32 / SIDE as f32);
        for (height, colour) in strokes {
            let distance = (y - height - 0.09 * (9.0 * x + 6.0 * height).sin()).abs();
            let light = (1.0 - distance / 0.035).clamp(0.0, 1.0);
            samples.iter_mut().zip(colour).for_each(|(sample, colour)| *sample += light * colour);
        }
    }
    image
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
