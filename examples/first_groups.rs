//! The README's five lines: groups of pixels that exchange light, and eigenpairs, from the same laboratory.
//!
//! `cargo run --release --example first_groups [FOLDER]`

use std::path::PathBuf;

use krylux::krylov::{EigsOptions, eigs};
use krylux::transport::Part;
use krylux::verbs::Segment;

fn main() -> krylux::Result<()> {
    let folder =
        std::env::args().nth(1).map_or(std::env::temp_dir().join("krylux-first-groups"), PathBuf::from);
    if folder.exists() {
        println!("{} exists already; name another folder", folder.display());
        return Ok(());
    }
    let mut lab = krylux::open("assets/scenes/zigzag/scene.glb")?; // a scene, a rig, the folder of a run, or a matrix
    let mut global = lab.operator(Part::Global)?; // a linear operator; each product is a photo
    let pairs = eigs(&mut global, &EigsOptions { count: 4, ..EigsOptions::default() })?;
    let groups = lab.ask(&Segment { groups: vec![2, 6], ..Segment::default() })?; // pixels that exchange light
    lab.save(&folder, &groups)?; // arrays, pictures, run.json, report.html
    println!("the largest eigenvalue is {:.4}; {}", pairs.values[0], groups.segmentation.regions.sentence());
    Ok(())
}
