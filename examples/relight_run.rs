//! Captures a scene into a run's folder, and relights it from the folder alone: no scene, no graphics device, no further photo.
//!
//! `cargo run --release --example relight_run`

use krylux::image::{Image, Resolution};
use krylux::lab::{ChannelChoice, Lab};
use krylux::verbs::Relight;

fn main() -> krylux::Result<()> {
    let folder = std::env::temp_dir().join(format!("krylux-relight-{}", std::process::id()));
    let mut lab = Lab::builder("assets/scenes/corner/scene.glb").size(32, 32).open()?;
    let captured = lab.ask(&Relight { photos: Some(20), ..Relight::default() })?;
    lab.save(&folder, &captured)?;
    println!("captured {} photos into {}", captured.photos, folder.display());

    // Another day, another machine.
    let mut run = Lab::builder(&folder).channels(ChannelChoice::Native).open()?;
    let Resolution { width, .. } = run.projector_resolution();
    let samples = (0..run.projector_resolution().pixels()).map(|pixel| (pixel % width < width / 2) as u8);
    let left = Image::new(run.projector_resolution(), 1, samples.map(f32::from).collect())?;
    let relit = run.photo(&left)?;

    let truth = lab.photo(&left)?;
    let norm = |values: &mut dyn Iterator<Item = f32>| values.map(|v| v * v).sum::<f32>().sqrt();
    let error = norm(&mut relit.samples().iter().zip(truth.samples()).map(|(a, b)| a - b));
    println!("the relit photo is within {:.2} %", 100.0 * error / norm(&mut truth.samples().iter().copied()));
    std::fs::remove_dir_all(&folder).map_err(krylux::Error::writing(&folder))?;
    Ok(())
}
