//! The gallery of the guide: the commands of each verb on shipped scenes and rigs, and the pictures that they leave.

use std::path::Path;
use std::process::Command;

use krylux::error::{Error, Result};
use krylux::image::Resolution;
use krylux::io::raster::Raster;

use crate::panels;

/// The page of the gallery.
pub const PAGE: &str = "guide/src/gallery.md";

/// Pictures are enlarged until each has about this many pixels along a side.
const SIDE: usize = 512;

/// Commands, and the pictures that they leave.
struct Entry {
    name: &'static str,
    title: &'static str,
    sentence: &'static str,
    commands: &'static [&'static str],
    pictures: &'static [&'static str],
}

const ENTRIES: [Entry; 9] = [
    Entry {
        name: "segment",
        title: "Segment a scene by its light",
        sentence: "An egg carton, twelve groups of pixels that exchange light, and two of the eigenvectors behind them.",
        commands: &[
            "krylux segment assets/scenes/carton/scene.glb --size 96 --groups 12 --eigenvectors 20 --photos 100 --spp 256 -o out/gallery/segment",
        ],
        pictures: &[
            "segment/white.png",
            "segment/labels-12.png",
            "segment/eigenvector-02.png",
            "segment/eigenvector-05.png",
        ],
    },
    Entry {
        name: "compensate",
        title: "Compensate for the light between surfaces",
        sentence: "The target, the corner under the target itself, the corner under the compensation, and the compensation.",
        commands: &[
            "krylux photo assets/scenes/corner/scene.glb --size 64 --pattern checker:8 --max-bounces 1 --channels luma -o corner-target.png",
            "krylux compensate assets/scenes/corner/scene.glb --size 64 --spp 256 --target corner-target.png --photos 20 -o out/gallery/compensate",
        ],
        pictures: &[
            "compensate/target.png",
            "compensate/uncompensated.png",
            "compensate/observed.png",
            "compensate/compensation.png",
        ],
    },
    Entry {
        name: "separate",
        title: "Separate direct from global light",
        sentence: "One bounce; two and more; of these, light from near by; and light from farther away.",
        commands: &["krylux separate assets/scenes/mirror-ball/scene.glb --size 64 -o out/gallery/separate"],
        pictures: &[
            "separate/direct.png",
            "separate/global.png",
            "separate/near-indirect.png",
            "separate/far-indirect.png",
        ],
    },
    Entry {
        name: "relight",
        title: "Relight without further photos",
        sentence: "A pattern, the photo that a model of 40 photos predicts, and the true one.",
        commands: &[
            "krylux relight assets/scenes/corner/scene.glb --size 48 --pattern checker:6 -o out/gallery/relight",
        ],
        pictures: &["relight/pattern-1.png", "relight/relit-1.png", "relight/true-1.png"],
    },
    Entry {
        name: "probe",
        title: "Let through some of the light's paths",
        sentence: "Light from near by, measured by random patterns, and exactly.",
        commands: &[
            "krylux probe assets/scenes/corner/scene.glb --size 48 --paths near -o out/gallery/probe",
        ],
        pictures: &["probe/probed.png", "probe/exact.png"],
    },
    Entry {
        name: "eigs",
        title: "Find eigenvectors of the light transport",
        sentence: "The three strongest eigenvectors of the global light of a box: projected, each comes back as a photo of itself.",
        commands: &[
            "krylux eigs assets/scenes/cornell/scene.glb --size 48 --part global --spp 256 --photos 80 --count 3 -o out/gallery/eigs",
        ],
        pictures: &["eigs/eigenvector-01.png", "eigs/eigenvector-02.png", "eigs/eigenvector-03.png"],
    },
    Entry {
        name: "photo",
        title: "Take a photo",
        sentence: "A box with coloured walls under white light, and under a checkerboard.",
        commands: &[
            "krylux photo assets/scenes/cornell/scene.glb --size 128 --spp 256 -o out/gallery/white.png",
            "krylux photo assets/scenes/cornell/scene.glb --size 128 --spp 256 --pattern checker:16 -o out/gallery/checker.png",
        ],
        pictures: &["white.png", "checker.png"],
    },
    Entry {
        name: "rig",
        title: "Measure through a projector and a camera",
        sentence: "A virtual rig is calibrated from captures, and segments its scene. The pictures are the camera pixels for each projector pixel, and the groups.",
        commands: &[
            "cp assets/rigs/realistic.toml assets/rigs/gallery.toml",
            "krylux rig calibrate assets/rigs/gallery.toml -o assets/rigs/gallery --use",
            "krylux segment assets/rigs/gallery.toml --photos 40 --groups 2 -o out/gallery/rig",
        ],
        pictures: &["../../assets/rigs/gallery/footprints.png", "rig/labels-2.png"],
    },
    Entry {
        name: "labels",
        title: "See the truth of a simulated scene",
        sentence: "The regions that the author of the scene has named.",
        commands: &["krylux labels assets/scenes/two-sheets/scene.glb --size 128 -o out/gallery/labels.png"],
        pictures: &["labels.png"],
    },
];

/// The text of the page.
pub fn page() -> String {
    let mut page = "# Gallery\n\nEach command runs in a clone of the repository, in this order. Each picture is what the commands above it leave, enlarged.\nThis page is generated by `cargo run --release --example regenerate_guide`.\n".to_owned();
    for Entry { name, title, sentence, commands, .. } in &ENTRIES {
        let commands = commands.join("\n");
        page += &format!(
            "\n## {title}\n\n```sh\n{commands}\n```\n\n![{sentence}](pictures/gallery-{name}.png)\n\n{sentence}\n"
        );
    }
    page + "\n[All verbs](reference/command-line.md) have a page with every option.\n"
}

/// Runs the commands in a temporary folder, and writes a picture for each entry into `folder`. The program must have been built.
pub fn pictures(folder: &Path) -> Result<()> {
    let place = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let root = std::env::current_dir().map_err(Error::reading("."))?;
    let at = |path: &str| place.path().join(path);
    std::fs::create_dir_all(at("out/gallery")).map_err(Error::writing("out/gallery"))?;
    let script = format!("set -e; cp -r '{}' assets\n", root.join("assets").display());
    let commands = ENTRIES.iter().flat_map(|entry| entry.commands).copied().collect::<Vec<_>>().join("\n");
    let built = std::env::current_exe().map_err(Error::reading("the example"))?;
    let programs = built.ancestors().nth(2).map(Path::to_path_buf).unwrap_or_default();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(programs).chain(std::env::split_paths(&path));
    let status = Command::new("bash")
        .args(["-c", &(script + &commands)])
        .current_dir(place.path())
        .env("PATH", std::env::join_paths(paths).unwrap_or(path.clone()))
        .status()
        .map_err(Error::reading("bash"))?;
    if !status.success() {
        return Err(Error::option("gallery", "a command failed")
            .help("build the program first: cargo build --release"));
    }
    for entry in &ENTRIES {
        let read = |name: &&str| read(&at("out/gallery").join(name));
        let pictures: Vec<Raster> = entry.pictures.iter().map(read).collect::<Result<_>>()?;
        let picture = panels::grid(&[pictures.as_slice()], 1);
        picture.write_png(&folder.join(format!("gallery-{}.png", entry.name)))?;
    }
    Ok(())
}

fn read(path: &Path) -> Result<Raster> {
    let picture = image::open(path)
        .map_err(|error| Error::data(path, error.to_string()).help("run it by hand"))?
        .to_rgb8();
    let size = Resolution::new(picture.width() as usize, picture.height() as usize);
    Ok(Raster::from_pixels(size, picture.pixels().map(|pixel| pixel.0)).enlarged(SIDE / size.width))
}
