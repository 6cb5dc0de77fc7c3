//! What to do with files of other programs: how each becomes a scene that is read.

use std::path::Path;

use super::source::fault;
use crate::error::Error;

/// The error about a file whose name says another format; `extension` is in lower case.
pub(super) fn unknown(path: &Path, extension: &str) -> Error {
    let (what, help) = match extension {
        "xml" => (
            "a scene of Mitsuba, as it seems, and not of krylux",
            "give a .glb, .gltf or .obj file: import the meshes (.ply, .obj) that it names into Blender and export them as .glb, \
             with the camera; bidirectional materials have no counterpart but metallic-roughness and specular",
        ),
        "blend" => (
            "a file of Blender, which only Blender reads",
            "export it as .glb: blender -b FILE.blend --python-expr \"import bpy; \
             bpy.ops.export_scene.gltf(filepath='scene.glb', export_cameras=True)\"",
        ),
        "fbx" | "dae" | "ply" | "stl" | "usd" | "usda" | "usdc" | "usdz" | "abc" | "3ds" | "x3d" | "pbrt" => {
            (
                "a format of scenes that krylux does not read",
                "import it into Blender and export it as .glb, with the camera; or give a .gltf or .obj file",
            )
        }
        _ => ("not a known scene format", "give a .glb, .gltf or .obj file"),
    };
    fault(path, what, help)
}
