//! Whole files of every kind, small, and with as many features of the format as fit.

use std::path::Path;

use image::{ExtendedColorType, ImageFormat};
use krylux::image::{Image, Resolution};
use krylux::io::sparse::{Beside, Pictures, ProductNoise};
use krylux::io::{exr, npy, sparse};
use krylux::journal::{Identity, Journal, Kind};
use krylux::scene::builtin;
use krylux::sparse::Csr;

use crate::matrix_support::{
    Entries, MATS, SYMMETRIES, Symmetry, doubles, matlab, mtx_array, mtx_coordinates, packed_text,
};
use crate::matrix_support::{npz as archive, scipy_files};

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("it was just written, or is shipped")
}

fn shipped(path: &str) -> Vec<u8> {
    bytes(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path))
}

/// An image with other values everywhere.
fn image(width: usize, height: usize, channels: usize) -> Image {
    let samples = (0..width * height * channels).map(|at| at as f32 / 7.0).collect();
    Image::new(Resolution::new(width, height), channels, samples).expect("as many as pixels")
}

pub fn npy(folder: &Path) -> Vec<Vec<u8>> {
    let path = folder.join("seed.npy");
    let mut seeds = Vec::new();
    for channels in [1, 3] {
        npy::write_image(&path, &image(5, 4, channels)).expect("the folder can be written");
        seeds.push(bytes(&path));
    }
    npy::write_npy(&path, &[2, 3, 2], &[1_i64; 12]).expect("the folder can be written");
    seeds.push(bytes(&path));
    let fortran = bytes(&path);
    let at = fortran.windows(5).position(|text| text == b"False").expect("it says its order");
    let mut fortran = fortran;
    fortran[at..at + 5].copy_from_slice(b"True ");
    seeds.push(fortran);
    // Matrices of pictures, gray and in colour.
    seeds.push(doubles(&[2, 1, 1, 2], &[1.0, 0.0, -2.0, 0.5]));
    seeds.push(doubles(&[1, 2, 3, 2, 1], &[0.25; 12]));
    seeds
}

fn matrix(symmetric: bool) -> Csr {
    let columns = if symmetric { vec![0, 1, 0, 1, 2] } else { vec![1, 2, 0, 2, 1] };
    let weights = if symmetric { vec![2.0, 0.5, 0.5, 3.0, 1.0] } else { vec![1.0, -2.0, 0.1, 7.0, 1e-9] };
    Csr::new(3, vec![0, 2, 4, 5], columns, weights).expect("well formed")
}

/// A matrix of whole numbers in which a position is repeated.
fn entries() -> Entries {
    Entries { rows: 4, cols: 3, entries: vec![(0, 1, 5), (3, 0, -7), (2, 2, 1), (2, 2, 3), (1, 0, 2)] }
}

/// What krylux writes beside a matrix.
fn beside(direct: &Csr) -> Beside<'_> {
    let [camera, projector] = [(3, 1), (1, 3)].map(|(width, height)| Resolution::new(width, height));
    let noise = ProductNoise { full: 0.1, direct: 0.2, global: 0.3 };
    Beside { direct: Some(direct), pictures: Some(Pictures { camera, projector }), noise: Some(noise) }
}

/// Files of krylux with this name, with and without what is known beside the matrix.
fn written(folder: &Path, name: &str) -> Vec<Vec<u8>> {
    let path = folder.join(name);
    let mut seeds = Vec::new();
    for symmetric in [false, true] {
        let matrix = matrix(symmetric);
        for beside in [Beside::default(), beside(&matrix)] {
            sparse::write_channel(&path, &matrix, &beside).expect("the folder can be written");
            seeds.push(bytes(&path));
        }
    }
    seeds
}

pub fn npz(folder: &Path) -> Vec<Vec<u8>> {
    let entries = entries();
    let others = [false, true].into_iter().flat_map(|is_packed| {
        let dense = archive(&[("T", doubles(&[4, 3], &entries.dense()))], is_packed);
        scipy_files(&entries, is_packed).into_iter().map(|(_, bytes)| bytes).chain([dense])
    });
    written(folder, "seed.npz").into_iter().chain(others).collect()
}

/// Texts of Matrix Market in all forms.
fn market() -> Vec<String> {
    let mut texts = Vec::new();
    for symmetry in SYMMETRIES {
        let listed = entries().listed(symmetry);
        texts.push(mtx_coordinates(&listed, "integer", symmetry));
        texts.push(mtx_array(&listed, "real", symmetry));
        if symmetry != Symmetry::Skew {
            texts.push(mtx_coordinates(&listed, "pattern", symmetry));
        }
    }
    texts
}

pub fn mtx(folder: &Path) -> Vec<Vec<u8>> {
    let integers = b"%%MatrixMarket matrix coordinate integer general\n% a comment\n\n2 3 2\n1 1 5\n2 3 -7\n";
    let others = market().into_iter().map(String::into_bytes);
    written(folder, "seed.mtx").into_iter().chain([integers.to_vec()]).chain(others).collect()
}

pub fn mtx_gz(_: &Path) -> Vec<Vec<u8>> {
    market().iter().map(|text| packed_text(text)).collect()
}

pub fn mat(_: &Path) -> Vec<Vec<u8>> {
    let entries = entries();
    let mut seeds = Vec::new();
    for mat in MATS {
        let dense = mat.dense("T", &[4, 3], matlab::DOUBLE, &entries.by_columns());
        let short = mat.dense("short", &[4, 3], matlab::INT8, &entries.by_columns());
        let pictures = mat.dense("T", &[2, 1, 1, 2], matlab::INT16, &[1.0, 0.0, -2.0, 5.0]);
        let row = mat.dense("row", &[1, 2], matlab::INT8, &[1.0, 2.0]);
        let sparse = mat.sparse("T", &entries);
        let variables = [vec![dense], vec![short], vec![pictures], vec![row, sparse]];
        seeds.extend(variables.map(|variables| mat.file(&variables)));
    }
    seeds
}

fn encoded(format: ImageFormat, colors: &[ExtendedColorType]) -> Vec<Vec<u8>> {
    let samples: Vec<u8> = (0..96).map(|at| (at * 37 % 256) as u8).collect();
    let encode = |&color: &ExtendedColorType| {
        let mut file = std::io::Cursor::new(Vec::new());
        let width = 96 * 8 / u32::from(color.bits_per_pixel()) / 2;
        image::write_buffer_with_format(&mut file, &samples, width, 2, color, format)
            .expect("it holds these");
        file.into_inner()
    };
    colors.iter().map(encode).collect()
}

pub fn png(_: &Path) -> Vec<Vec<u8>> {
    use ExtendedColorType::{L8, L16, La8, Rgb8, Rgb16, Rgba8};
    let mut told = Vec::new();
    let mut writer = png::Encoder::new(&mut told, 2, 1).write_header().expect("the header is valid");
    let chunks: [(&[u8; 4], &[u8]); 4] =
        [(b"cICP", &[1, 13, 0, 1]), (b"gAMA", &[0, 1, 0, 0]), (b"cHRM", &[0; 32]), (b"eXIf", EXIF)];
    for (name, data) in chunks {
        writer.write_chunk(png::chunk::ChunkType(*name), data).expect("memory can be written");
    }
    writer.write_image_data(&[1, 2]).expect("the pixels are complete");
    writer.finish().expect("memory can be written");
    encoded(ImageFormat::Png, &[L8, La8, Rgb8, Rgba8, L16, Rgb16]).into_iter().chain([told]).collect()
}

/// A colour profile with a curve of three steps, in tags of one length.
fn profile() -> Vec<u8> {
    let mut bytes = vec![0; 128];
    bytes[16..24].copy_from_slice(b"GRAYXYZ ");
    bytes.extend(2_u32.to_be_bytes());
    for (tag, start) in [(b"kTRC", 156_u32), (b"desc", 174)] {
        bytes.extend([&tag[..], &start.to_be_bytes(), &18_u32.to_be_bytes()].concat());
    }
    bytes.extend(b"curv\0\0\0\0\0\0\0\x03\0\0\x40\0\xff\xff");
    bytes.extend(b"desc\0\0\0\0\0\0\0\x06gamma\0");
    bytes
}

/// Exif data with an orientation.
const EXIF: &[u8] = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";

pub fn jpeg(_: &Path) -> Vec<Vec<u8>> {
    let plain = encoded(ImageFormat::Jpeg, &[ExtendedColorType::L8, ExtendedColorType::Rgb8]);
    let mut told = plain[0].clone();
    for (marker, data) in
        [(0xe1, [b"Exif\0\0", EXIF].concat()), (0xe2, [b"ICC_PROFILE\0\x01\x01", &profile()[..]].concat())]
    {
        let length = (data.len() as u16 + 2).to_be_bytes();
        told.splice(2..2, [&[0xff, marker], &length[..], &data].concat());
    }
    plain.into_iter().chain([told]).collect()
}

/// TIFF, Radiance, PFM, PGM and PPM.
pub fn other_picture(_: &Path) -> Vec<Vec<u8>> {
    let radiance = |rows: &[u8]| {
        [&b"#?RADIANCE\nEXPOSURE=2\nCOLORCORR=1 2 1\nPRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329\n\n+X 2 -Y 9\n"[..], rows].concat()
    };
    let old = [[9, 8, 7, 130], [1, 1, 1, 8]].concat().repeat(2);
    let new = [&[2, 2, 0, 9][..], &[137, 7, 9, 1, 2, 3, 4, 5, 6, 7, 8, 9].repeat(2)].concat().repeat(2);
    let mut seeds = vec![
        radiance(&old),
        radiance(&new),
        b"P2\n# a comment\n2 2 1000\n1 20\n300 1000\n".to_vec(),
        b"P5 2 2 255\n\x01\x02\x03\x04".to_vec(),
        b"P6\n1 1\n65535\n\x01\x02\x03\x04\x05\x06".to_vec(),
        b"Pf\n2 1\n-1\n\0\0\x80\x3f\0\0\0\x40".to_vec(),
    ];
    #[cfg(feature = "pictures")]
    for compression in [tiff::encoder::Compression::Uncompressed, tiff::encoder::Compression::Lzw] {
        use tiff::encoder::{TiffEncoder, colortype::RGB16};
        let mut file = std::io::Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut file).expect("memory can be written");
        let mut encoder = encoder.with_compression(compression);
        let mut image = encoder.new_image::<RGB16>(2, 2).expect("it has pixels");
        image.encoder().write_tag(tiff::tags::Tag::Orientation, 6_u16).expect("memory can be written");
        image
            .encoder()
            .write_tag(tiff::tags::Tag::IccProfile, &profile()[..])
            .expect("memory can be written");
        image.write_data(&[7; 12]).expect("the pixels are complete");
        seeds.push(file.into_inner());
    }
    seeds
}

pub fn texture(_: &Path) -> Vec<Vec<u8>> {
    use ExtendedColorType::{Rgb8, Rgba8};
    let gif = encoded(ImageFormat::Gif, &[Rgba8]);
    let others =
        [ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Tga].map(|format| encoded(format, &[Rgb8, Rgba8]));
    others.into_iter().flatten().chain(gif).collect()
}

#[cfg(feature = "compressed")]
pub fn compressed(_: &Path) -> Vec<Vec<u8>> {
    let names = ["carton-draco.glb", "carton-meshopt.glb"];
    names.map(|name| shipped(&format!("tests/reference/compressed/{name}"))).to_vec()
}

pub fn exr(folder: &Path) -> Vec<Vec<u8>> {
    let path = folder.join("seed.exr");
    let (gray, colored) = (image(5, 4, 1), image(5, 4, 3));
    let layers: [&[(&str, &Image)]; 3] =
        [&[("", &gray)], &[("", &colored)], &[("photo", &colored), ("mask", &gray)]];
    layers
        .map(|layers| {
            exr::write_exr(&path, layers).expect("the folder can be written");
            bytes(&path)
        })
        .to_vec()
}

pub fn glb(_: &Path) -> Vec<Vec<u8>> {
    [builtin::zigzag(), builtin::cornell(), builtin::corner()].map(|model| model.to_glb()).to_vec()
}

pub fn gltf(_: &Path) -> Vec<Vec<u8>> {
    let position = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1]}}],
        "extensionsUsed":["EXT_mesh_gpu_instancing","KHR_materials_ior"],
        "nodes":[{{"camera":0,"translation":[0,0,2]}},
          {{"mesh":0,"rotation":[0,0,0,1],"scale":[1,2,1],"extras":{{"region":"a"}},
            "extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":1}}}}}}}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1}}}}],
        "materials":[{{"doubleSided":true,"pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.5,0.5,1],"roughnessFactor":0.7}},
          "extensions":{{"KHR_materials_ior":{{"ior":1.4}}}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{position}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
          {{"bufferView":0,"componentType":5126,"count":2,"type":"VEC3"}}]}}"#
    );
    // A file as some exporters write it: no scene, a child, normals without data, an old kind of material, and a picture of another format.
    let odd = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_materials_pbrSpecularGlossiness","EXT_mesh_features"],
        "nodes":[{{"camera":0,"translation":[0,0,2]}},{{"name":"above","children":[2]}},{{"mesh":0}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1}}}}],
        "materials":[{{"emissiveTexture":{{"index":1,"texCoord":2}},"extensions":{{"KHR_materials_pbrSpecularGlossiness":
          {{"diffuseFactor":[0.5,0.25,0.125,1],"specularFactor":[0.1,0.2,0.3],"glossinessFactor":0.7,
            "specularGlossinessTexture":{{"index":0}}}}}}}}],
        "textures":[{{"source":0}},{{}}],"images":[{{"uri":"data:image/ktx2;base64,q0tUWCAyMLsNChoK"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1}},"material":0}}]}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{position}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
          {{"componentType":5126,"count":3,"type":"VEC3"}}]}}"#
    );
    let listed = odd.replacen(r#""nodes""#, r#""scenes":[{"nodes":[0,2]},{}],"scene":0,"nodes""#, 1);
    [text, odd, listed].map(String::into_bytes).to_vec()
}

pub const CAMERA: &str =
    "[camera]\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\nup = [0, 1, 0]\nvertical_fov_degrees = 40\n";

pub fn camera_file(_: &Path) -> Vec<Vec<u8>> {
    let projector = format!(
        "{CAMERA}aperture_radius = 0.01\nfocus_distance = 3\n[projector]\nposition = [0.1, 0, 3]\nforward = [0, 0, -1]\n\
         vertical_fov_degrees = 35\nresolution = [64, 48]\n"
    );
    vec![CAMERA.into(), projector.into_bytes()]
}

pub fn obj(_: &Path) -> Vec<Vec<u8>> {
    let text = "mtllib scene.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
                usemtl red\nf 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1\ng b\ns 1\nf 1 2 3 5 4\nf -1 -2 -3\n";
    let odd = "mtllib C:\\x\\scene.mtl # of mine\nmtllib a b.mtl scene\\ two.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl red # here\nf 1/7 2/8/9 3\n\
               usemtl\nf 1 2 3\nl 1 2\n";
    let wide: Vec<u8> =
        std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    vec![text.into(), text.replace('\n', "\r\n").into_bytes(), odd.into(), wide]
}

pub fn mtl(_: &Path) -> Vec<Vec<u8>> {
    let text = "newmtl red\nKd 0.8 0.1 0.1\nKs 0.1 0.1 0.1\nNs 20\nd 1\nTr 0\nNi 1.4\nillum 2\nKe 0 0 0\nmap_Kd -s 2 2 1 red.png\n\
                newmtl glass\nKd 0 0 0\nTf 0.9 0.9 0.9\nillum 7\n";
    let odd = "newmtl red # 1\nKd 0 0 0\nmap_Kd -mm 0 1 -imfchan r -type sphere -colorspace sRGB -t 1 /home/me/red.png\nnewmtl\nKd 1 0 0\n";
    vec![text.into(), odd.into()]
}

pub fn rig(_: &Path) -> Vec<Vec<u8>> {
    let hardware = "kind = \"hardware\"\ncalibration = \"cal\"\n[projector]\nkind = \"x11\"\nmonitor = \"HDMI-1\"\nsize = [128, 96]\n\
                    [camera]\nkind = \"gphoto2\"\nsize = [12, 8]\niso = 100\ntiles = \"rggb\"\nexposures = [0.001, 1]\n\
                    settings = { whitebalance = \"Daylight\" }\n[measurement]\nexposures = [0.25]\nambient = false\n";
    let program = "kind = \"program\"\n[projector]\nsize = [12, 8]\n[camera]\nsize = [12, 8]\nbits = 12\nexposures = [1e-4, 1.0]\n";
    let mut seeds = vec![hardware.into(), program.into()];
    seeds.extend(["assets/rigs/ideal.toml", "assets/rigs/realistic.toml"].map(shipped));
    seeds
}

pub fn journal(folder: &Path) -> Vec<Vec<u8>> {
    let folder = folder.join("seed");
    let identity = Identity::new().with("rig file", "0123abcd").with("size", "8x8");
    let mut journal = Journal::create(&folder, &identity).expect("the folder can be written");
    for photo in 0..4_u8 {
        journal.pattern(&[photo / 2; 5]).expect("there is room");
        let key = journal.key(&[b"test", &[photo]]);
        let payload = vec![photo; 7 * usize::from(photo)];
        journal.append(Kind::Photo, key, b"metadata", &payload).expect("there is room");
    }
    journal.note("a note", b"of some bytes").expect("there is room");
    drop(journal);
    vec![bytes(&folder.join("photos.journal"))]
}
