//! Textures of `.mtl` materials: map options, and the opacity map, which becomes the alpha of the base colour.

use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::{Affine2, Mat2, Vec2};

use super::statements::shortened;
use crate::error::{Error, Result};
use crate::file;
use crate::scene::source::{self, Fault, SceneFile, Texels};
use crate::scene::{Texture, TextureRef, Wrap};

/// The textures of the materials, in the order of their first use.
#[derive(Default)]
pub(super) struct Maps {
    pub textures: Vec<Texture>,
    index_of: HashMap<([Option<PathBuf>; 2], bool), u32>,
}

#[derive(Clone, PartialEq)]
struct TextureMap {
    file: PathBuf,
    offset: Vec2,
    scale: Vec2,
    clamp: bool,
}

impl Maps {
    /// The texture of a picture map with an opacity map as its alpha: `map_Kd` and `map_d`.
    pub(super) fn texture(
        &mut self,
        material: &str,
        maps: [Option<&str>; 2],
        file: &mut SceneFile,
    ) -> Result<Option<TextureRef>> {
        let mut found = [None, None];
        for (found, text) in found.iter_mut().zip(maps) {
            let map = text.map(|text| parse(file, material, text)).transpose()?;
            *found = map.filter(|map| is_there(file, material, map));
        }
        let placed = match &found {
            [None, None] => return Ok(None),
            [Some(color), Some(opacity)] => {
                let same = TextureMap { file: color.file.clone(), ..opacity.clone() } == *color;
                if !same {
                    return Err(file
                        .fault(format!("material `{material}`: map_Kd and map_d have different options"))
                        .help("give both the same -o, -s and -clamp"));
                }
                color.clone()
            }
            [Some(map), None] | [None, Some(map)] => map.clone(),
        };
        let key = (found.map(|map| map.map(|map| map.file)), placed.clamp);
        let texture = match self.index_of.get(&key) {
            Some(&texture) => texture,
            None => {
                let Texels { width, height, texels } = combined(file, material, &key.0)?;
                let name = placed.file.display().to_string();
                let wrap = [if placed.clamp { Wrap::ClampToEdge } else { Wrap::Repeat }; 2];
                self.textures.push(Texture { name, width, height, texels, wrap, linear: true });
                let texture = self.textures.len() as u32 - 1;
                self.index_of.insert(key, texture);
                texture
            }
        };
        // Here v points downwards. The file transforms 1 − v, which points upwards, so the transformed v is 1 − (scale · (1 − v) + offset).
        let Vec2 { x: scale_u, y: scale_v } = placed.scale;
        let offset = Vec2::new(placed.offset.x, 1.0 - scale_v - placed.offset.y);
        let transform =
            Affine2::from_mat2_translation(Mat2::from_diagonal(Vec2::new(scale_u, scale_v)), offset);
        Ok(Some(TextureRef { transform, ..TextureRef::new(texture) }))
    }
}

/// Whether the picture of a map exists and has a supported format. If not, a warning says that the material is shown without the map. If
/// the scene is read strictly, the result is always `true`, and reading the picture later causes an error.
fn is_there(scene: &mut SceneFile, material: &str, map: &TextureMap) -> bool {
    if scene.strict {
        return true;
    }
    let picture = format!("material `{material}`: its picture {}", map.file.display());
    if source::is_missing(&map.file) {
        scene.warn(format!("{picture} is missing, and left out"));
        return false;
    }
    // A file that cannot be opened causes an error later, when the picture is read.
    let mut beginning = [0; 16];
    let read = file::open(&map.file).ok().and_then(|mut file| file.read(&mut beginning).ok());
    let unread = read.and_then(|length| source::unread(&beginning[..length], &map.file));
    if let Some(Fault { fault, help, .. }) = &unread {
        scene.warn(format!("{picture} {fault}, and left out; {help}"));
    }
    unread.is_none()
}

/// The texels of a picture whose alpha comes from another picture.
fn combined(scene: &mut SceneFile, material: &str, files: &[Option<PathBuf>; 2]) -> Result<Texels> {
    let [color, opacity] = files;
    let same = color == opacity;
    let mut read = |picture: &Option<PathBuf>| {
        picture.as_ref().map(|picture| read_picture(scene, material, picture)).transpose()
    };
    let color = read(color)?;
    let opacity = if same { None } else { read(opacity)? };
    Ok(match (color, opacity) {
        // If a picture is its own opacity map, its alpha is used as the opacity.
        (Some(color), None) if same => color,
        (Some(mut color), None) => {
            // Without a `map_d`, the picture's alpha is not used.
            color.texels.iter_mut().for_each(|texel| texel[3] = 255);
            color
        }
        (None, Some(mut opacity)) => {
            let alpha = opacity_channel(&opacity);
            opacity.texels.iter_mut().for_each(|texel| *texel = [255, 255, 255, alpha(*texel)]);
            opacity
        }
        (Some(color), Some(opacity)) => with_opacity(color, &opacity),
        (None, None) => Texels { width: 1, height: 1, texels: vec![[255; 4]] },
    })
}

fn read_picture(scene: &mut SceneFile, material: &str, picture: &Path) -> Result<Texels> {
    let bytes = scene.read_other(&format!("material `{material}`"), picture)?;
    scene
        .decode(&bytes, Some(picture))
        .map_err(|what| Error::scene(picture, format!("the picture {}", what.fault)).help(what.help))
}

/// Parses the arguments `-o u v w -s u v w … FILE`.
fn parse(scene: &mut SceneFile, material: &str, text: &str) -> Result<TextureMap> {
    let what = format!("material `{material}`: `{}`", shortened(text));
    let bad = |scene: &SceneFile, why: &str| {
        scene
            .fault(format!("{what} {why}"))
            .help("give the options -o, -s and -clamp, and a file next to the scene")
    };
    let mut map = TextureMap { file: PathBuf::new(), offset: Vec2::ZERO, scale: Vec2::ONE, clamp: false };
    let mut rest = text.trim();
    while let Some(option) = rest.strip_prefix('-') {
        let (name, arguments) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        rest = arguments.trim_start();
        // The options -t (random distortion), -mm (contrast) and -imfchan (choice of a channel) only cause a warning.
        let most = match name {
            "o" | "s" | "t" => 3,
            "mm" => 2,
            "clamp" | "blendu" | "blendv" | "cc" | "bm" | "boost" | "texres" => 1,
            "imfchan" | "type" | "colorspace" => {
                rest = rest.split_once(char::is_whitespace).map_or("", |(_, after)| after.trim_start());
                0
            }
            _ => return Err(bad(scene, "has an option that is not known")),
        };
        if matches!(name, "t" | "mm" | "imfchan") {
            let what = shortened(text);
            scene.warn(format!("material `{material}`: the option -{name} of `{what}` is ignored"));
        }
        let mut values = Vec::new();
        while values.len() < most {
            let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            let is_switch = matches!(word, "on" | "off");
            if word.parse::<f32>().is_err() && !is_switch {
                break;
            }
            values.push(word);
            rest = after.trim_start();
        }
        let number = |index: usize, default: f32| match values.get(index) {
            None => Ok(default),
            Some(word) => {
                let number = word.parse::<f32>().ok().filter(|number: &f32| number.is_finite());
                number.ok_or_else(|| bad(scene, "has an option that is no number"))
            }
        };
        match name {
            "o" => map.offset = Vec2::new(number(0, 0.0)?, number(1, 0.0)?),
            "s" => map.scale = Vec2::new(number(0, 1.0)?, number(1, 1.0)?),
            "clamp" => map.clamp = values.first() == Some(&"on"),
            _ => {}
        }
    }
    if rest.is_empty() {
        return Err(bad(scene, "names no picture"));
    }
    map.file = scene
        .resolve(rest)
        .map_err(|what| bad(scene, &format!("is {what}; only files next to the scene are read")))?;
    Ok(map)
}

/// Adds `opacity` as alpha. If the pictures differ in size, the nearest texel of `opacity` is used.
fn with_opacity(mut color: Texels, opacity: &Texels) -> Texels {
    let alpha = opacity_channel(opacity);
    let [width, height] = [color.width as usize, color.height as usize];
    let [from_width, from_height] = [opacity.width as usize, opacity.height as usize];
    for (index, texel) in color.texels.iter_mut().enumerate() {
        let column = (2 * (index % width) + 1) * from_width / (2 * width);
        let row = (2 * (index / width) + 1) * from_height / (2 * height);
        texel[3] = alpha(opacity.texels[row * from_width + column]);
    }
    color
}

/// Selects the function that computes a texel's opacity: its alpha, or its brightness if the alpha is opaque in all texels.
fn opacity_channel(picture: &Texels) -> fn([u8; 4]) -> u8 {
    if picture.texels.iter().any(|texel| texel[3] != 255) {
        |texel| texel[3]
    } else {
        |[red, green, blue, _]| ((u16::from(red) + u16::from(green) + u16::from(blue)) / 3) as u8
    }
}
