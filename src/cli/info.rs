//! `krylux info`: the adapters, and the content of a scene, a rig file or a matrix file.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;
use indicatif::HumanCount;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::options::ViewArgs;
use crate::analysis::captures::captured_checkerboards;
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::image::{Image, Resolution};
use crate::io::atomic;
use crate::io::name::Name;
use crate::io::raster::Raster;
use crate::io::raster::encode_srgb;
use crate::io::sparse::{self, Pictures};
use crate::lab::{self, SourceKind};
use crate::measure::{CaptureMap, Captures, RigFile, is_captures};
use crate::render;
use crate::scene::{self, Camera, LoadOptions, Scene};
use crate::verbs::rig::about;

/// Show the graphics adapters and their limits, and what is in a scene, a rig file, a matrix file or a folder of captures
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  krylux info\n  krylux info scene.glb")]
pub(super) struct Args {
    /// A scene (.glb, .gltf, .obj), a rig (.toml), a matrix (.npz, .npy, .mtx, .mtx.gz, .mat) or a folder of captures to describe as well
    #[arg(value_name = "SOURCE")]
    source: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    /// Write the camera of the scene, or the one that --auto-camera places, as a camera file, to be changed and given as --camera-file
    #[arg(long, value_name = "FILE", requires = "source")]
    write_camera: Option<PathBuf>,
    /// Draw what the camera sees even where stdout is no terminal, in which it is drawn anyway: colours of surfaces, lit from the camera
    #[arg(long, requires = "source")]
    draw: bool,
    /// Write the same picture into this .png file, without a graphics adapter
    #[arg(short = 'o', long = "output", value_name = "FILE", requires = "source")]
    picture: Option<PathBuf>,
}

/// The longer side of a picture in a file, in pixels.
const SIDE: usize = 512;

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let mut scene = None;
    let mut rig = None;
    let mut matrix = None;
    let mut captures = None;
    match &args.source {
        Some(path) if is_captures(path) => captures = Some(about_captures(path, console)?),
        Some(path) if SourceKind::of(path) == SourceKind::Rig => rig = Some(about(&RigFile::load(path)?)),
        Some(path) if SourceKind::of(path) == SourceKind::Matrix => {
            matrix = Some(about_matrix(path, console)?);
        }
        Some(path) => scene = Some(load(path, &args.view, console)?),
        None => {}
    }
    if let Some(rig) = &rig {
        rig.lines.iter().try_for_each(|line| console.say(line))?;
    }
    if let Some(scene) = &scene {
        say_scene(scene, console)?;
        show(scene, args, console)?;
    } else if let Some(option) = args.picture.as_ref().map(|_| "--output").or(args.draw.then_some("--draw")) {
        return Err(Error::option(option, "only scenes are drawn").help("give a scene"));
    }
    if let (Some(scene), Some(file)) = (&scene, &args.write_camera) {
        atomic::write_bytes(file, scene.camera.to_toml(scene.origin).as_bytes())?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    let team = console.team();
    let placements = team.as_ref().map_or(&[][..], |team| team.placements());
    for (rank, placement) in placements.iter().enumerate() {
        let cores: Vec<String> = placement.cores.iter().map(usize::to_string).collect();
        console.say(format_args!("process   {rank} on {}, cores {}", placement.host, cores.join(" ")))?;
    }
    let adapters = render::adapters()?;
    for adapter in &adapters {
        console.say(format_args!("adapter   {} ({})", adapter.name, adapter.kind))?;
        console.say(format_args!("  driver  {} {}", adapter.driver, adapter.driver_version))?;
        console.say(format_args!(
            "  limits  shader buffers {} MiB, buffers {} MiB, textures {} texels a side, {} in shaders",
            adapter.max_storage_binding >> 20,
            adapter.max_buffer >> 20,
            adapter.max_texture_side,
            if adapter.double_precision { "f64" } else { "no f64" }
        ))?;
    }
    console.summary(&json!({
        "verb": "info",
        "version": env!("CARGO_PKG_VERSION"),
        "processes": placements,
        "adapters": adapters,
        "scene": scene.as_ref().map(describe),
        "rig": rig,
        "matrix": matrix,
        "captures": captures,
    }))?;
    // The command fails without an adapter, unless the source needs none.
    if adapters.is_empty() && rig.is_none() && matrix.is_none() && captures.is_none() {
        return Err(render::no_adapter());
    }
    Ok(Outcome::Done)
}

/// Describes a folder of captures.
fn about_captures(folder: &Path, console: &Console) -> Result<serde_json::Value> {
    let captures = Captures::read(folder)?;
    let [camera, projector] = [&captures.photos, &captures.patterns].map(|images| images[0].resolution());
    let planes: Vec<Vec<f64>> = captures.patterns.iter().map(Image::luminance).collect();
    let checkerboards = captured_checkerboards(&planes, projector);
    let map = match &captures.map {
        CaptureMap::Coaxial => "coaxial",
        CaptureMap::Found => "to be found from the photos",
        CaptureMap::None => "none",
        CaptureMap::Given(_) => "given",
    };
    let count = captures.photos.len();
    console.say(format_args!("captures  {}", folder.display()))?;
    console.say(format_args!("  photos  {count} of {camera} pixels; patterns {projector}"))?;
    if let Some([square, shifts]) = checkerboards {
        console.say(format_args!("  boards  checkerboards of {square} px at {shifts}×{shifts} places"))?;
    }
    console.say(format_args!("  map     {map}"))?;
    let noise =
        if captures.noise.is_some() { "by repeated takes" } else { "not known: no photo was repeated" };
    console.say(format_args!("  noise   {noise}"))?;
    Ok(json!({
        "folder": Name::from(folder),
        "photos": count,
        "camera": camera,
        "projector": projector,
        "checkerboards": checkerboards,
        "map": map,
        "noise_is_measured": captures.noise.is_some(),
        "unit": captures.unit,
        "findings": captures.findings,
    }))
}

/// Describes a matrix file.
fn about_matrix(path: &Path, console: &Console) -> Result<serde_json::Value> {
    let file = sparse::read_file(path)?;
    let [rows, columns] = file.shape();
    let entries: usize = file.channels.iter().map(|matrix| matrix.weights().len()).sum();
    let is_symmetric = file.channels.iter().all(|matrix| matrix.is_symmetric());
    let count = |number: usize| HumanCount(number as u64);
    console.say(format_args!("matrix    {}", path.display()))?;
    console.say(format_args!(
        "  shape   {} rows, {} columns, {} entries in {} channel(s); {}",
        count(rows),
        count(columns),
        count(entries),
        file.channels.len(),
        if is_symmetric { "symmetric to the last bit" } else { "not symmetric" }
    ))?;
    match file.pictures {
        Some(Pictures { camera, projector }) => {
            console.say(format_args!("  photos  {camera} pixels; patterns {projector}"))?;
        }
        None => console.say(format_args!(
            "  photos  of unknown size: give --size, and --projector-size if patterns differ"
        ))?,
    }
    let direct = if file.direct.is_empty() { "not held separately" } else { "held separately" };
    console.say(format_args!("  direct  light of one bounce is {direct}"))?;
    if let Some(noise) = file.noise {
        console.say(format_args!(
            "  noise   {:.3e}: the error of a product with a pattern of norm 1",
            noise.full
        ))?;
    }
    Ok(json!({
        "file": Name::from(path),
        "rows": rows,
        "columns": columns,
        "entries": entries,
        "channels": file.channels.len(),
        "is_symmetric": is_symmetric,
        "camera": file.pictures.map(|pictures| pictures.camera),
        "projector": file.pictures.map(|pictures| pictures.projector),
        "has_direct": !file.direct.is_empty(),
        "noise": file.noise,
    }))
}

/// Loads the scene and reports what was ignored in it.
fn load(path: &Path, view: &ViewArgs, console: &Console) -> Result<Scene> {
    // A camera is placed if the scene has none, so that such a scene is described, too.
    let scene = scene::load_with(path, &LoadOptions { auto_camera: true, ..view.options() })?;
    for warning in &scene.warnings {
        console.note(format_args!("warning: {}: {warning}", scene.path.display()));
    }
    Ok(scene)
}

fn say_scene(scene: &Scene, console: &Console) -> Result<()> {
    let (low, high) = bounds(scene);
    let camera = &scene.camera;
    let length = |metres: f64| decimal(metres, 3);
    let point = |place: DVec3| format!("[{}]", place.to_array().map(|metres| decimal(metres, 3)).join(", "));
    let field = 2.0 * camera.tan_half_fov.atan().to_degrees();
    console.say(format_args!("scene     {}", scene.path.display()))?;
    console.say(format_args!(
        "  shape   {} triangles, {} x {} x {} m",
        HumanCount(scene.triangles.len() as u64),
        length((high - low).x),
        length((high - low).y),
        length((high - low).z)
    ))?;
    if camera.name == Camera::PLACED {
        console.say(format_args!("  box     from {} to {} m", point(low), point(high)))?;
        console.say(format_args!(
            "  camera  none; --auto-camera places one at {} that looks along {:.3}, and --write-camera FILE writes it",
            point(scene.origin + camera.position.as_dvec3()),
            camera.forward
        ))?;
    } else {
        console
            .say(format_args!("  camera  `{}`, {field:.1}° field of view from top to bottom", camera.name))?;
    }
    if let Some(projector) = &scene.projector {
        console.say(format_args!(
            "  light   projector `{}`, {} m from the camera",
            projector.name,
            length(projector.position.distance(camera.position).into())
        ))?;
    }
    console.say(format_args!(
        "  look    {} materials, {} textures",
        scene.materials.len(),
        scene.textures.len()
    ))?;
    let kind = if scene.regions_are_labels { "labelled by the scene" } else { "one for each mesh node" };
    console.say(format_args!("  regions {} ({kind}): {}", scene.regions.len(), scene.regions.join(", ")))
}

/// Draws the camera's view, in the terminal and into the requested file.
fn show(scene: &Scene, args: &Args, console: &Console) -> Result<()> {
    // Photos are square by default.
    let aspect = scene.camera.aspect.unwrap_or(1.0);
    if args.draw || console.draws_pictures() {
        console.print(&half_blocks(&picture(scene, drawn_size(aspect))?))?;
    }
    let Some(file) = &args.picture else { return Ok(()) };
    if file.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("png")) {
        return Err(Error::data(file, "what the camera sees is written as a picture for people")
            .help("name it .png; `krylux photo` writes light as .exr or .npy"));
    }
    let short = |ratio: f32| ((SIDE as f32 * ratio).round() as usize).max(1);
    let size = match aspect >= 1.0 {
        true => Resolution::new(SIDE, short(1.0 / aspect)),
        false => Resolution::new(short(aspect), SIDE),
    };
    picture(scene, size)?.write_png(file)?;
    console.say(format_args!("wrote     {}", file.display()))
}

fn picture(scene: &Scene, size: Resolution) -> Result<Raster> {
    let seen = lab::look(scene, size)?;
    let pixels = seen.samples().as_chunks::<3>().0.iter();
    Ok(Raster::from_pixels(size, pixels.map(|pixel| pixel.map(encode_srgb))))
}

fn describe(scene: &Scene) -> serde_json::Value {
    let bounds = match scene.origin == DVec3::ZERO {
        true => json!(scene.bounds().map(|corner| corner.to_array())),
        false => json!([bounds(scene).0.to_array(), bounds(scene).1.to_array()]),
    };
    json!({
        "path": Name::from(&scene.path),
        "triangles": scene.triangles.len(),
        "materials": scene.materials.iter().map(|material| &material.name).collect::<Vec<_>>(),
        "textures": scene.textures.len(),
        "camera": scene.camera.name,
        "projector": scene.projector.as_ref().map(|projector| &projector.name),
        "regions": scene.regions,
        "regions_are_labels": scene.regions_are_labels,
        "bounds": bounds,
        "warnings": scene.warnings,
    })
}

/// The smallest and the largest coordinates, as in the file.
fn bounds(scene: &Scene) -> (DVec3, DVec3) {
    let [low, high] = scene.bounds().map(|corner| corner.as_dvec3() + scene.origin);
    (low, high)
}

/// The number of columns of a picture in the terminal.
const COLUMNS: usize = 48;

/// The size of a picture with this aspect ratio. A character is twice as high as wide, and shows two rows of pixels.
fn drawn_size(aspect: f32) -> Resolution {
    let rows = (COLUMNS as f32 / aspect).round().clamp(2.0, 2.0 * COLUMNS as f32) as usize;
    Resolution::new(COLUMNS, rows.next_multiple_of(2))
}

/// The picture as characters with 24-bit colours, which most terminals support.
fn half_blocks(picture: &Raster) -> String {
    let size = picture.resolution();
    let mut text = String::new();
    for row in (0..size.height).step_by(2) {
        for column in 0..size.width {
            let [red, green, blue] = picture.pixel(column, row);
            let [below_red, below_green, below_blue] = match row + 1 < size.height {
                true => picture.pixel(column, row + 1),
                false => [0; 3],
            };
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "\u{1b}[38;2;{red};{green};{blue};48;2;{below_red};{below_green};{below_blue}m▀"
            );
        }
        text.push_str("\u{1b}[0m\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_character_has_the_colours_of_two_pixels() {
        let pixels = [[255, 0, 0], [0, 255, 0], [1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]];
        let text = half_blocks(&Raster::from_pixels(Resolution::new(2, 3), pixels));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "\u{1b}[38;2;255;0;0;48;2;1;2;3m▀\u{1b}[38;2;0;255;0;48;2;4;5;6m▀\u{1b}[0m");
        assert_eq!(lines[1], "\u{1b}[38;2;7;8;9;48;2;0;0;0m▀\u{1b}[38;2;10;11;12;48;2;0;0;0m▀\u{1b}[0m");
        assert_eq!(lines.len(), 2);
    }

    #[test]
    fn pictures_keep_their_shape() {
        assert_eq!(drawn_size(1.0), Resolution::new(48, 48));
        assert_eq!(drawn_size(16.0 / 9.0), Resolution::new(48, 28));
        assert_eq!(drawn_size(1e9), Resolution::new(48, 2));
        assert_eq!(drawn_size(1e-9), Resolution::new(48, 96));
    }
}
