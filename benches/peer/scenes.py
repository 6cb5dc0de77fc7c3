"""The scenes of the comparison as both programs read them: glTF for krylux, and the same triangles and materials for the peer.

What the peer is to render exactly like krylux is refused here unless it has one meaning in both: pure Lambertians
(`specularFactor` 0, metallic 0, roughness 1) and perfect mirrors (metallic 1, roughness 0), flat normals, one camera.
"""
import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SHIPPED = Path(__file__).resolve().parents[2] / "assets" / "scenes"
SHIPPED_NAMES = ("corner", "cornell", "carton", "mirror")
BOX = "box-100000"


@dataclass
class Part:
    triangles: np.ndarray  # (n, 3, 3), metres
    color: tuple  # reflectance of red, green and blue
    mirror: bool


@dataclass
class Scene:
    parts: list
    to_world: np.ndarray  # the camera's, glTF: looks along −z, y upwards
    vertical_fov: float  # radians

    @property
    def colored(self):
        """Whether a gray renderer would give another luminance."""
        return any(len(set(part.color)) > 1 for part in self.parts)

    @property
    def mirrors(self):
        return any(part.mirror for part in self.parts)


def paths(folder):
    """Name and `.glb` of each scene; the large box is written to `folder`."""
    box = Path(folder) / f"{BOX}.glb"
    write_box(box, 100)
    return {**{name: SHIPPED / name / "scene.glb" for name in SHIPPED_NAMES}, BOX: box}


def read(path):
    """A `.glb` as a `Scene`; `ValueError` where it has what is not compared here."""
    data = Path(path).read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf, binary = json.loads(data[20:20 + length]), data[28 + length:]
    parts, camera = [], None
    for node in gltf["nodes"]:
        matrix = np.array(node.get("matrix", np.eye(4).reshape(-1)), float).reshape(4, 4).T
        if {"translation", "rotation", "scale", "children"} & node.keys():
            raise ValueError(f"{path}: node {node.get('name')} is placed otherwise than by a matrix")
        if "camera" in node:
            camera = matrix, gltf["cameras"][node["camera"]]["perspective"]["yfov"]
        if "mesh" in node:
            for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
                points = accessor(gltf, binary, primitive["attributes"]["POSITION"])
                points = points @ matrix[:3, :3].T + matrix[:3, 3]
                corners = accessor(gltf, binary, primitive["indices"]).reshape(-1, 3)
                parts.append(Part(points[corners], *material(path, gltf["materials"][primitive["material"]])))
    if camera is None:
        raise ValueError(f"{path}: no camera")
    return Scene(parts, *camera)


def accessor(gltf, binary, index):
    what = gltf["accessors"][index]
    view = gltf["bufferViews"][what["bufferView"]]
    kind = {5123: "<u2", 5125: "<u4", 5126: "<f4"}[what["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3}[what["type"]]
    start = view.get("byteOffset", 0) + what.get("byteOffset", 0)
    return np.frombuffer(binary, kind, what["count"] * width, start).reshape(-1, width).squeeze()


def material(path, gltf):
    surface = gltf["pbrMetallicRoughness"]
    specular = gltf.get("extensions", {}).get("KHR_materials_specular", {}).get("specularFactor", 1.0)
    color = tuple(surface["baseColorFactor"][:3])
    match surface["metallicFactor"], surface["roughnessFactor"], specular:
        case 0.0, 1.0, 0.0:
            return color, False
        case 1.0, 0.0, _:
            return color, True
    raise ValueError(f"{path}: material {gltf['name']} is neither a pure Lambertian nor a mirror")


def write_box(path, cells):
    """The box of `krylux::scene::builtin::tessellated_box`: open, 1 m, bumpy, `10·cells²` triangles."""
    walls = [((-.5, -.5, 0), (1, 0, 0), (0, 0, -1)), ((-.5, .5, -1), (1, 0, 0), (0, 0, 1)),
             ((-.5, -.5, -1), (1, 0, 0), (0, 1, 0)), ((-.5, -.5, 0), (0, 0, -1), (0, 1, 0)),
             ((.5, -.5, -1), (0, 0, 1), (0, 1, 0))]
    row, column = (grid.reshape(-1, 1) for grid in np.mgrid[:cells + 1, :cells + 1])
    s, t = column / cells, row / cells
    edge = (row % cells == 0) | (column % cells == 0)
    bump = np.where(edge, 0, .01 * (np.sin(6 * np.pi * s) * np.sin(6 * np.pi * t)) ** 2)
    lower = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    right, above = lower + 1, lower + cells + 1
    corners = np.hstack([lower, right, above + 1, lower, above + 1, above]).astype("<u4")
    blob, views, accessors, meshes = b"", [], [], []
    for origin, along, up in np.array(walls, float):
        points = (origin + s * along + t * up + bump * np.cross(along, up)).astype("<f4")
        for array, kind, shape in ((points, 5126, "VEC3"), (corners, 5125, "SCALAR")):
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
            accessors.append({"bufferView": len(views) - 1, "componentType": kind, "type": shape,
                              "count": array.size // (3 if shape == "VEC3" else 1)})
            blob += array.tobytes()
        accessors[-2] |= {"min": points.min(0).tolist(), "max": points.max(0).tolist()}
        meshes.append({"primitives": [{"attributes": {"POSITION": len(accessors) - 2}, "material": 0,
                                       "indices": len(accessors) - 1}]})
    camera = {"camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1.3, 1]}
    white = {"name": "white", "doubleSided": True, "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
             "pbrMetallicRoughness": {"baseColorFactor": [.8, .8, .8, 1], "metallicFactor": 0.0, "roughnessFactor": 1.0}}
    gltf = {"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_materials_specular"], "scene": 0,
            "scenes": [{"nodes": list(range(6))}], "nodes": [{"mesh": i} for i in range(5)] + [camera],
            "meshes": meshes, "materials": [white], "accessors": accessors, "bufferViews": views,
            "buffers": [{"byteLength": len(blob)}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": float(np.radians(40)), "aspectRatio": 1, "znear": .001}}]}
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
    Path(path).write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob)
