//! The part that all scene loaders share: errors and warnings, files next to the scene, the content hash, and picture decoding.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::bvh::KeptTree;
use super::camera::Posed;
use super::camera_file::Cameras;
use super::place::Place;
use super::{Camera, Material, Scene, Texture, Triangle};
use crate::error::{Error, Result};
use crate::file;
use crate::image::codec::Format;

/// A scene file that is being loaded, with the data that all loaders need.
pub(super) struct SceneFile {
    pub path: PathBuf,
    /// Whether missing pictures and texture coordinates are errors.
    pub strict: bool,
    pub hash: ContentHash,
    /// The warnings in the order in which they arose.
    pub warnings: Vec<String>,
    /// The subjects and texts of the warnings so far.
    warned: HashSet<String>,
    pictures: Pictures,
}

impl SceneFile {
    /// Reads the file at `path`. Also returns its bytes.
    pub(super) fn read(path: &Path, strict: bool) -> Result<(Self, Vec<u8>)> {
        let bytes = file::read(path).and_then(|bytes| not_a_pointer(path, bytes))?;
        Ok((Self::of(path, strict, &bytes), bytes))
    }

    /// A scene file whose bytes have been read.
    pub(super) fn of(path: &Path, strict: bool, bytes: &[u8]) -> Self {
        let (mut hash, warnings, warned, pictures): (ContentHash, _, _, _) = Default::default();
        hash.add(bytes);
        Self { path: path.to_path_buf(), strict, hash, warnings, warned, pictures }
    }

    pub(super) fn fault(&self, fault: impl Into<String>) -> Error {
        Error::scene(&self.path, fault)
    }

    /// Adds a warning unless there is already a warning about `subject`.
    pub(super) fn warn_once(&mut self, subject: &str, warning: impl Into<String>) {
        if self.warned.insert(subject.into()) {
            self.warnings.push(warning.into());
        }
    }

    /// Adds a warning unless there is already a warning with the same text.
    pub(super) fn warn(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if !self.warned.contains(&warning) {
            self.warned.insert(warning.clone());
            self.warnings.push(warning);
        }
    }

    /// Adds a warning with the fault, its consequence, and the remedy. If the scene is read strictly, the fault is an error instead.
    pub(super) fn tolerate(
        &mut self,
        fault: String,
        consequence: &str,
        help: impl Into<String>,
    ) -> Result<()> {
        let help = help.into();
        if self.strict {
            return Err(self.fault(fault).help(help));
        }
        self.warn(format!("{fault}: {consequence}; {help}"));
        Ok(())
    }

    /// Reads a file that the scene refers to, and adds it to the hash. `path` is resolved. `what` names the referring object (`buffer 0`).
    pub(super) fn read_other(&mut self, what: &str, path: &Path) -> Result<Vec<u8>> {
        let scene = self.path.display();
        if is_missing(path) {
            let fault = format!("no such file, but {what} of {scene} refers to it");
            let help = "a scene may be several files: put this one where the scene names it, or get the scene as one .glb";
            return Err(Error::scene(path, fault).help(help));
        }
        if std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
            return Err(Error::scene(path, format!("not a file, but {what} of {scene} refers to it"))
                .help("correct the reference in the scene"));
        }
        let bytes = file::read(path).and_then(|bytes| not_a_pointer(path, bytes))?;
        self.hash.add(&bytes);
        Ok(bytes)
    }

    /// Resolves the path by which the scene refers to a file next to it. If the path belongs to another computer and the scene is not read
    /// strictly, the result is the file of the same name next to the scene. `Err` says why the path is not relative.
    pub(super) fn resolve(&self, name: &str) -> std::result::Result<PathBuf, &'static str> {
        let name = name.replace('\\', "/");
        match next_to(&self.path, &name) {
            Err(what) if !self.strict => same_name(&self.path, &name).ok_or(what),
            found => found,
        }
    }

    /// Decodes a picture of the scene; see [`Pictures::decode`].
    pub(super) fn decode(&mut self, bytes: &[u8], name: Option<&Path>) -> std::result::Result<Texels, Fault> {
        self.pictures.decode(bytes, name)
    }

    /// Makes the scene from surfaces, cameras and regions. If no file states a camera, a camera is placed in front of the surfaces. A
    /// projector that coincides with the camera is dropped (coaxial rig).
    pub(super) fn scene(
        self,
        place: &Place,
        cameras: Cameras,
        triangles: Vec<Triangle>,
        (materials, textures): (Vec<Material>, Vec<Texture>),
        (regions, regions_are_labels): (Vec<String>, bool),
    ) -> Scene {
        let Cameras { camera, projector, projector_resolution, .. } = cameras;
        let placed = || {
            let camera = Camera::in_front_of(&triangles, &materials);
            Posed { position: place.origin + camera.position.as_dvec3(), camera }
        };
        let camera = camera.unwrap_or_else(placed).around(place.origin);
        let projector = projector.map(|projector| projector.around(place.origin));
        let projector = projector.filter(|projector| !projector.coincides(&camera, place.distance() as f32));
        Scene {
            path: self.path,
            origin: place.origin,
            triangles,
            materials,
            textures,
            camera,
            projector,
            projector_resolution,
            regions,
            regions_are_labels,
            hash: self.hash.finish(),
            warnings: self.warnings,
            tree: KeptTree::default(),
        }
    }
}

/// Refuses a pointer file of Git LFS, which stands for a large file that was not fetched.
fn not_a_pointer(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>> {
    if bytes.starts_with(b"version https://git-lfs.github.com/spec/") {
        return Err(Error::scene(path, "not the file itself, but a pointer of Git LFS to it")
            .help("fetch the file: git lfs pull, or download it by itself"));
    }
    Ok(bytes)
}

/// The text of a file. It is UTF-16 if it begins with the byte order mark of UTF-16, otherwise UTF-8. Invalid parts are replaced.
pub(super) fn text(bytes: &[u8]) -> Cow<'_, str> {
    let wide = |read: fn([u8; 2]) -> u16| {
        let units = bytes[2..].as_chunks::<2>().0.iter().map(|&unit| read(unit));
        Cow::Owned(
            char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect(),
        )
    };
    match bytes {
        [0xFE, 0xFF, ..] => wide(u16::from_be_bytes),
        [0xFF, 0xFE, ..] => wide(u16::from_le_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => String::from_utf8_lossy(rest),
        _ => String::from_utf8_lossy(bytes),
    }
}

/// Finds the file next to the scene that has the same file name as the path `elsewhere`, which may come from another computer.
fn same_name(scene: &Path, elsewhere: &str) -> Option<PathBuf> {
    let name = elsewhere.rsplit(['/', '\\']).next().filter(|name| !name.is_empty() && !name.contains(':'))?;
    next_to(scene, name).ok()
}

pub(super) fn is_missing(path: &Path) -> bool {
    std::fs::metadata(path).is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
}

/// Resolves the relative path by which `scene` refers to a file. `Err` says why the path is not relative.
pub(super) fn next_to(scene: &Path, relative: &str) -> std::result::Result<PathBuf, &'static str> {
    // The part before a colon is a URI scheme or a drive.
    if relative.split(['/', '\\']).next().unwrap_or_default().contains(':') {
        return Err("not a relative path");
    }
    if relative.starts_with(['/', '\\']) {
        return Err("an absolute path");
    }
    Ok(scene.parent().map(|folder| folder.join(relative)).unwrap_or_else(|| relative.into()))
}

/// A BLAKE3 hash of a sequence of byte strings. Each string is preceded by its length, so that other boundaries give another hash.
#[derive(Default)]
pub(super) struct ContentHash(blake3::Hasher);

impl ContentHash {
    pub(super) fn add(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    pub(super) fn finish(&self) -> [u8; 32] {
        *self.0.finalize().as_bytes()
    }
}

/// The largest width and height of a picture in pixels.
pub(super) const MAX_SIDE: u32 = 16384;

/// The largest number of texels of all pictures together, because a few kilobytes of PNG can encode any number of pixels.
const MAX_TEXELS: u64 = 1 << 27;

/// The largest size of a decoded picture in bytes. PNG's largest pixel (16-bit RGBA) has 8 bytes.
const MAX_BYTES: usize = 8 << 27;

pub(super) struct Texels {
    pub width: u32,
    pub height: u32,
    /// RGBA, row 0 at the top.
    pub texels: Vec<[u8; 4]>,
}

pub(super) struct Fault {
    /// The end of a sentence whose subject is the picture.
    pub fault: String,
    /// The remedy.
    pub help: String,
    /// Whether krylux does not read the picture's format. Otherwise the picture is damaged or too large.
    pub is_unknown: bool,
}

const CONVERT: &str =
    "convert it (magick PICTURE picture.png) and name that, or export the scene with PNG or JPEG pictures";

/// Picture formats that occur in scenes but are not read: the offset of the magic number, the magic number, the name, and advice.
const UNREAD: [(usize, &[u8], &str, &str); 5] = [
    (
        0,
        b"\xABKTX 20\xBB",
        "KTX2",
        "convert the pictures: npx @gltf-transform/cli ktxdecompress SCENE.glb PLAIN.glb, with `ktx` of KTX-Software installed",
    ),
    (0, b"DDS ", "DDS", CONVERT),
    (4, b"ftypavif", "AVIF", CONVERT),
    (0, b"#?RADIANCE", "Radiance HDR", CONVERT),
    (0, b"\x76\x2F\x31\x01", "EXR", CONVERT),
];

/// The reason why krylux does not read a picture, from the file's beginning and name. `None` if krylux reads the format.
pub(super) fn unread(beginning: &[u8], name: &Path) -> Option<Fault> {
    let format = Format::of(beginning).or_else(|| Format::of_name(name));
    format.is_none().then(|| other_format(beginning))
}

fn other_format(bytes: &[u8]) -> Fault {
    let of = |(at, beginning, ..): &&(usize, &[u8], &str, &str)| {
        bytes.get(*at..).is_some_and(|rest| rest.starts_with(beginning))
    };
    let (fault, help) = match UNREAD.iter().find(of) {
        Some((_, _, name, help)) => (format!("has the format {name}, which is not read"), *help),
        None => ("is neither PNG, JPEG, WebP, BMP, GIF nor TGA".into(), CONVERT),
    };
    Fault { fault, help: help.into(), is_unknown: true }
}

/// The decoder of a scene's pictures, which counts the texels of all pictures.
#[derive(Default)]
struct Pictures {
    texels: u64,
}

impl Pictures {
    /// Decodes a PNG, JPEG, WebP, BMP, GIF or TGA file, or the first picture of an animation. TGA is recognized only by its `name`.
    fn decode(&mut self, bytes: &[u8], name: Option<&Path>) -> std::result::Result<Texels, Fault> {
        let Some(format) = Format::of(bytes).or_else(|| Format::of_name(name?)) else {
            return Err(other_format(bytes));
        };
        let broken = |error: String| Fault {
            fault: format!("cannot be decoded: {error}"),
            help: "convert it (magick PICTURE picture.png), or save it again as PNG or JPEG".into(),
            is_unknown: false,
        };
        let (width, height) = format.size(bytes).map_err(broken)?;
        self.texels = self.texels.saturating_add(u64::from(width) * u64::from(height));
        if width > MAX_SIDE || height > MAX_SIDE || width == 0 || height == 0 || self.texels > MAX_TEXELS {
            return Err(Fault {
                fault: format!("is {width}x{height} pixels"),
                help: format!(
                    "make it smaller: at most {MAX_SIDE} pixels a side, and {MAX_TEXELS} in all pictures together"
                ),
                is_unknown: false,
            });
        }
        let decoded = format.decode(bytes, MAX_BYTES).map_err(broken)?;
        Ok(Texels { width: decoded.width, height: decoded.height, texels: decoded.into_rgba8() })
    }
}
