//! Segments a scene by how light travels in it: pixels that exchange light form a group.
//!
//! `cargo run --release --example segment [SOURCE] [FOLDER]`

use std::path::PathBuf;

use krylux::analysis::{SegmentOptions, segment::segment};
use krylux::transport::Part;

fn main() -> krylux::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let source = arguments.next().unwrap_or("assets/scenes/zigzag/scene.glb".into());
    let folder = arguments.next().map_or(std::env::temp_dir().join("krylux-segment"), PathBuf::from);

    let mut lab = krylux::lab::Lab::builder(source).size(48, 48).open()?;
    // Two bounces and more: direct light says nothing about groups.
    let mut global = lab.operator(Part::Global)?;
    let found = segment(&mut global, &SegmentOptions { photos: 20, ..SegmentOptions::groups([2, 6]) })?;
    println!("{} photos; the largest eigenvalues are {:.4?}", found.photos, &found.eigenvalues[..3]);
    println!("{}", found.regions.sentence());
    if let Some(truth) = lab.truth()? {
        for (groups, score) in truth.scores(&found)? {
            println!("{groups} groups: adjusted Rand index {score:.3} against the true regions");
        }
    }
    if folder.exists() {
        println!("{} exists already; name another folder to save the report", folder.display());
        return Ok(());
    }
    println!("see {}", lab.save(&folder, &found)?.report.display());
    Ok(())
}
