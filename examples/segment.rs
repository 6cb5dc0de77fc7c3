//! Segments a scene by how light travels in it: pixels that exchange light form a group.
//!
//! `cargo run --release --example segment [SOURCE] [FOLDER]`

use std::path::PathBuf;

use krylux::lab::Answer;
use krylux::verbs::Segment;

fn main() -> krylux::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let source = arguments.next().unwrap_or("assets/scenes/zigzag/scene.glb".into());
    let folder = arguments.next().map_or(std::env::temp_dir().join("krylux-segment"), PathBuf::from);

    let mut lab = krylux::lab::Lab::builder(source).size(48, 48).open()?;
    let found = lab.ask(&Segment { groups: vec![2, 6], photos: Some(20), ..Segment::default() })?;
    let eigenvalues = &found.segmentation.eigenvalues[..3];
    println!("{} photos; the largest eigenvalues are {eigenvalues:.4?}", found.photos());
    println!("{}", found.segmentation.regions.sentence());
    for (groups, score) in &found.scores {
        println!("{groups} groups: adjusted Rand index {score:.3} against the true regions");
    }
    if folder.exists() {
        println!("{} exists already; name another folder to save the report", folder.display());
        return Ok(());
    }
    println!("see {}", lab.save(&folder, &found)?.report.display());
    Ok(())
}
