//! Finds what to project so that a corner of two walls looks like an evenly lit target.
//!
//! `cargo run --release --example compensate`

use krylux::image::Image;
use krylux::lab::Lab;
use krylux::verbs::Compensate;

fn main() -> krylux::Result<()> {
    let mut lab = Lab::builder("assets/scenes/corner/scene.glb").size(48, 48).open()?;
    // Values from 0 to 1; by default 1 stands for half the median of the white photo.
    let target = Some(Image::filled(lab.resolution(), 1, 0.5).into());
    let found = lab.ask(&Compensate { target, photos: Some(20), ..Compensate::default() })?.found;
    println!("{} photos: {}", found.photos, found.status);
    println!("residual: {:.4} of the target", found.residual);
    println!("residual without compensation: {:.4}", found.uncompensated_residual);
    let brightest = found.pattern.samples().iter().copied().fold(0.0, f32::max);
    println!("the pattern's values are at most {brightest:.3}");
    Ok(())
}
