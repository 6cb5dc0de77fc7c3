//! Sweeps the albedo of every surface of a scene over twenty values: the share of light that has bounced more than once.
//!
//! `cargo run --release --example sweep_albedo`

use std::path::Path;

use krylux::lab::Lab;
use krylux::operator::Operator;
use krylux::scene;
use krylux::transport::Part;

fn main() -> krylux::Result<()> {
    let loaded = scene::load(Path::new("assets/scenes/corner/scene.glb"), None)?;
    println!("albedo  global light");
    for step in 1..=20 {
        let albedo = step as f32 / 20.0;
        let mut scene = loaded.clone();
        for material in &mut scene.materials {
            material.base_color = glam::Vec3::splat(albedo);
        }
        let mut lab = Lab::builder_of_scene(scene).size(32, 32).samples(32).open()?;
        let mut light = |part| -> krylux::Result<f64> {
            let mut operator = lab.operator(part)?;
            let mut photo = vec![0.0; operator.rows()];
            operator.apply(&vec![1.0; operator.cols()], &mut photo)?;
            Ok(photo.iter().sum())
        };
        let [full, global] = [light(Part::Full)?, light(Part::Global)?];
        println!("{albedo:>6.2}  {:>10.2} %", 100.0 * global / full);
    }
    Ok(())
}
