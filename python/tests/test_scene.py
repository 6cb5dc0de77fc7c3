"""Scenes from arrays: the same bits as from a file, parameters by path, and errors that name them."""

import copy
import json
import pickle
import struct

import numpy as np
import pytest

import krylux
from krylux import errors

from conftest import SCENES

CORNERS = np.array([[-1, -1, -2], [1, -1, -2], [1, 1, -2], [-1, 1, -2]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
#: An angle whose tangent does not change where glTF rounds its radians to single precision.
DEGREES = next(angle for angle in range(40, 60)
               if np.float32(np.tan(np.float32(np.radians(angle)) / 2, dtype=np.float64))
               == np.float32(np.tan(np.radians(angle) / 2)))
CAMERA = {"position": [0, 0, 0.5], "look_at": [0, 0, -2], "vertical_fov": DEGREES}
SMALL = {"size": 12, "spp": 8, "channels": "rgb", "progress": False}


def light(scene, **options):
    """The photos of white light and of a pattern, with what the scene emits."""
    with krylux.open(scene, **{**SMALL, **options}) as lab:
        return np.stack([lab.white, lab.photo("left"), lab.ambient])


def wall(**material):
    return krylux.Scene.from_arrays(CORNERS, FACES, name="wall", camera=CAMERA, **material)


def written_by_hand(path, scene, picture_png):
    """A glTF file of two meshes, as another program might write it: quantities of the arrays, in another order."""
    binary = bytearray()
    views, accessors = [], []

    def view(array):
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(array)})
        binary.extend(array + b"\0" * (-len(array) % 4))
        return len(views) - 1

    def accessor(array, kind, component):
        accessors.append({"bufferView": view(array.tobytes()), "componentType": component, "type": kind,
                          "count": array.size if kind == "SCALAR" else len(array)})
        return len(accessors) - 1

    def mesh(name, index):
        of = {key: scene.params.get(f"{name}.{key}") for key in ("vertices", "faces", "uv", "normals")}
        indices = accessor(of["faces"].astype(np.uint32), "SCALAR", 5125)
        attributes = {"POSITION": accessor(of["vertices"], "VEC3", 5126)}
        if of["uv"] is not None:
            attributes["TEXCOORD_0"] = accessor(of["uv"], "VEC2", 5126)
        if of["normals"] is not None:
            attributes["NORMAL"] = accessor(of["normals"], "VEC3", 5126)
        return {"primitives": [{"attributes": attributes, "indices": indices, "material": index}]}

    lambertian = {"KHR_materials_specular": {"specularFactor": 0.0}}
    meshes = [mesh("wall", 0), mesh("sheet", 1)]
    image = view(picture_png)
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"name": "wall", "mesh": 0}, {"name": "sheet", "mesh": 1},
                  {"name": "eye", "camera": 0, "translation": [0, 0, 0.5]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": np.radians(DEGREES), "znear": 0.1}}],
        "meshes": meshes,
        "materials": [
            {"doubleSided": True, "extensions": lambertian,
             "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0,
                                      "baseColorFactor": [0.5, 0.25, 0.75, 1]}},
            {"doubleSided": True, "extensions": {"KHR_materials_specular": {"specularFactor": 0.75}},
             "pbrMetallicRoughness": {"metallicFactor": 0.25, "roughnessFactor": 0.375,
                                      "baseColorFactor": [0.5, 0.5, 0.5, 1]}},
        ],
        "textures": [{"source": 0}], "images": [{"bufferView": image, "mimeType": "image/png"}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}],
        "extensionsUsed": ["KHR_materials_specular"],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def png(texels):
    """A PNG file of 8-bit RGBA, by the standard library."""
    import zlib

    height, width = texels.shape[:2]

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    rows = b"".join(b"\0" + row.tobytes() for row in texels)
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def test_a_scene_from_arrays_has_the_photos_of_the_same_gltf_file(tmp_path):
    random = np.random.default_rng(1)
    texels = random.integers(0, 256, (4, 6, 4), dtype=np.uint8)
    scene = wall(albedo=[0.5, 0.25, 0.75], uv=random.random((4, 2)), albedo_texture=texels)
    normals = random.normal([0, 0, 3], 1, (4, 3))
    scene.add_mesh("sheet", CORNERS * 0.4 + np.float32([0.1, 0, 0]), FACES, normals=normals, albedo=0.5, metallic=0.25,
                   roughness=0.375, specular=0.75)
    written_by_hand(tmp_path / "twin.glb", scene, png(texels))
    photos = light(scene)
    assert np.array_equal(photos, light(tmp_path / "twin.glb")) and photos[0].std() > 0


def test_a_shipped_scene_has_the_same_photos_through_its_arrays():
    path = SCENES / "cornell" / "scene.glb"
    loaded = krylux.Scene.load(path)
    pose = {key: np.float64(loaded.params[f"camera.{key}"]) for key in ("position", "forward", "up", "vertical_fov")}
    again = krylux.Scene("again")
    names = [of.removesuffix(".vertices") for of in loaded.params if of.endswith(".vertices")]
    assert names == ["white", "red", "green", "short", "tall"]
    for name in names:
        of = name if name in ("red", "green") else "white"
        arrays = (loaded.params[f"{name}.vertices"], loaded.params[f"{name}.faces"])
        if name in ("short", "tall"):
            again.add_mesh(name, *arrays, material="white")
        else:
            again.add_mesh(name, *arrays, albedo=loaded.params[f"{of}.albedo"])
    again._native.place("camera", json.dumps({key: value.tolist() for key, value in pose.items()}))
    assert np.array_equal(light(path), light(loaded)) and np.array_equal(light(path), light(again))


def any_scene(seed):
    """A scene of random meshes, materials, pictures, camera and projector."""
    random = np.random.default_rng(seed)
    scene = krylux.Scene("any")
    factors = {
        "albedo": 3, "metallic": 0, "roughness": 0, "specular": 0, "specular_color": 3, "transmission": 0,
        "diffuse_transmission": 0, "diffuse_transmission_color": 3, "attenuation_color": 3, "opacity": 0,
    }
    pictures = ["albedo", "metallic_roughness", "normal", "specular", "specular_color", "emissive", "transmission",
                "diffuse_transmission", "diffuse_transmission_color"]
    for index in range(random.integers(1, 4)):
        count = random.integers(4, 12)
        values = {name: random.random(size or ()) for name, size in factors.items() if random.random() < 0.4}
        if random.random() < 0.4:
            values |= {"emission": random.random(3) * 10 ** random.uniform(-3, 3), "ior": random.uniform(1, 2)}
        if "attenuation_color" in values:
            values["attenuation_distance"] = random.choice([random.uniform(0.1, 2), np.inf])
        values["double_sided"] = bool(random.random() < 0.8)
        arrays = {name: random.normal(size=(count, size)) for name, size in (("uv", 2), ("normals", 3))
                  if name == "uv" or random.random() < 0.5}
        for picture in random.choice(pictures, random.integers(0, 4), replace=False):
            texels = random.integers(0, 256, (*random.integers(1, 5, 2), 4), dtype=np.uint8)
            values[f"{picture}_texture"] = texels
            if picture == "normal":
                values["normal_scale"] = random.random()
        faces = [random.permutation(count)[:3] for _ in range(random.integers(1, 9))]
        scene.add_mesh(f"mesh.{index}", random.normal([0, 0, -4], 1, (count, 3)), faces, **arrays, **values)
    for role in ["camera", "projector"][:random.integers(1, 3)]:
        pose = {"position": random.normal(size=3), "look_at": random.normal([0, 0, -4], 0.1, 3),
                "up": random.normal([0, 1, 0], 0.3), "vertical_fov": random.uniform(20, 90)}
        if random.random() < 0.3:
            pose |= {"aperture_radius": random.uniform(0, 0.1), "focus_distance": random.uniform(1, 5)}
        if role == "projector" and random.random() < 0.5:
            pose["resolution"] = random.integers(8, 16, 2)
        scene._native.place(role, krylux._checks.as_json(role, pose))
    return scene


@pytest.mark.parametrize("seed", range(24))
def test_a_saved_scene_has_the_same_parameters_and_photos(seed, tmp_path):
    scene = any_scene(seed)
    scene.save(tmp_path / "any.glb")
    for again in (krylux.Scene.load(tmp_path / "any.glb"), pickle.loads(pickle.dumps(scene))):
        assert list(again.params) == list(scene.params)
        for path, value in scene.params.items():
            assert np.array_equal(again.params[path], value), path
            assert np.asarray(again.params[path]).dtype == np.asarray(value).dtype, path
    again.save(tmp_path / "again.glb")
    assert (tmp_path / "again.glb").read_bytes() == (tmp_path / "any.glb").read_bytes()
    # Tracing takes most of the time, so that fewer scenes are photographed.
    if seed < 8:
        photos = light(scene, cache=False)
        assert np.array_equal(photos, light(tmp_path / "any.glb")) and np.isfinite(photos).all()


def test_setting_what_a_parameter_has_changes_nothing(tmp_path):
    for seed in range(6):
        scene = any_scene(seed)
        scene.save(tmp_path / "before.glb")
        for path, value in scene.params.items():
            scene.params[path] = value
        scene.save(tmp_path / "after.glb")
        assert (tmp_path / "before.glb").read_bytes() == (tmp_path / "after.glb").read_bytes(), seed


def test_parameters_are_a_mapping_that_can_be_set():
    scene = wall(albedo=0.5)
    assert scene.params["wall.albedo"].tolist() == [0.5] * 3 and scene.params["wall.roughness"] == 1.0
    assert "wall.albedo" in scene.params and "wall.uv" not in scene.params and len(scene.params) == 19
    before = light(scene)
    scene.params["wall.albedo"] = 0.25
    # Without bounces between surfaces, the light is proportional to the albedo, and a half is exact.
    assert np.array_equal(2 * light(scene)[:2], before[:2])
    scene.params.update({"camera.position": [0, 0, 1], "camera.vertical_fov": 30})
    assert scene.params["camera.vertical_fov"] == 30 and not np.array_equal(light(scene), before)
    scene.params["camera.forward"] = [0, 1, 0]
    scene.params["camera.up"] = [0, 0, 1]
    assert scene.params["camera.up"].tolist() == [0, 0, 1]
    assert "wall.albedo: [0.25, 0.25, 0.25]" in repr(scene.params)


def test_a_copy_and_a_laboratory_keep_the_scene_as_it_was():
    scene = wall()
    lab, other = krylux.open(scene, **SMALL), copy.deepcopy(scene)
    scene.params["wall.albedo"] = 0.1
    assert other.params["wall.albedo"][0] == np.float32(0.8)
    assert np.array_equal(lab.white, light(other)[0])
    assert np.array_equal(pickle.loads(pickle.dumps(lab)).white, lab.white)


@pytest.mark.parametrize("path, value, text", [
    ("wall.albedo", 1.5, "wall.albedo: it is 1.5"),
    ("wall.albedo", [0.1, 0.2], "wall.albedo: its shape is [2]"),
    ("wall.albedo", float("nan"), "wall.albedo: it is NaN"),
    ("wall.albedo", "red", "wall.albedo: its data type is <U3"),
    ("wall.ior", 0.5, "wall.ior: it is 0.5"),
    ("wall.double_sided", 1.0, "wall.double_sided: it is not yes or no"),
    ("wall.vertices", np.full((4, 3), np.nan), "wall.vertices: row 0 has a value of NaN"),
    ("wall.vertices", np.zeros((4, 2)), "wall.vertices: its shape is [4, 2]"),
    ("wall.faces", [[0, 1, -2]], "wall.faces: it has an index of -2"),
    ("wall.faces", [[0, 1, 2.5]], "wall.faces: its data type is float64"),
    ("wall.albedo_texture", np.zeros((2, 2, 3)), "wall.albedo_texture: its data type is float64"),
    ("wall.albedo_texture", np.zeros((0, 2, 3), np.uint8), "wall.albedo_texture: it has 2×0 pixels"),
    ("wall.albedo_texture", np.zeros((2, 2), np.uint8), "wall.albedo_texture: its shape is (2, 2)"),
    ("camera.vertical_fov", 180, "camera.vertical_fov: it is 180"),
    ("camera.forward", [0, 0, 0], "camera.forward: it is zero"),
    ("camera.position", 1.0, "camera.position: its shape"),
    ("projector.position", [0, 0, 0], "projector.position: the scene has none"),
    ("wall.albdo", 0.5, "wall.albdo: the scene has no such parameter\n  help: the nearest are wall.albedo"),
])
def test_wrong_values_are_refused_by_name(path, value, text):
    scene = wall()
    with pytest.raises(errors.OptionError) as caught:
        scene.params[path] = value
    assert str(caught.value).startswith(text) and caught.value.option == path and caught.value.help
    assert list(scene.params.items())[0][0] == "wall.vertices"


def test_unknown_parameters_are_key_errors():
    scene = wall()
    with pytest.raises(KeyError) as caught:
        scene.params["wal.albedo"]
    assert isinstance(caught.value, errors.ParameterError) and "wall.albedo" in str(caught.value)
    assert scene.params.get("nothing") is None
    with pytest.raises(errors.OptionError, match="cannot be removed"):
        del scene.params["wall.albedo"]


@pytest.mark.parametrize("change, text", [
    ({"faces": [[0, 1, 9]]}, "wall.faces: row 0 is [0, 1, 9], but there are 4 vertices"),
    ({"faces": np.zeros((0, 3), int)}, "wall.faces: there is no triangle"),
    ({"vertices": CORNERS * np.float32(1e10)}, "wall.vertices: row 0 is"),
    ({"uv": np.zeros((3, 2))}, "wall.uv: it has 3 rows, but there are 4 vertices"),
    ({"albedo_texture": np.zeros((2, 2, 3), np.uint8)}, "wall.uv: there is none, but the base colour texture of wall"),
    ({"camera": {"position": [0, 0, 0]}}, "camera: it is no pose: missing field"),
    ({"camera": {"position": [0, 0, 0], "look_at": [0, 0, 0], "vertical_fov": 40}}, "camera: it has no direction"),
    ({"camera": {"positon": [0, 0, 0]}}, "camera: it is no pose: unknown field `positon`"),
    ({"colour": 0.5}, "wall.colour: the scene has no such parameter"),
])
def test_wrong_arrays_are_refused_by_name(change, text):
    arguments = {"vertices": CORNERS, "faces": FACES, "name": "wall", "camera": CAMERA} | change
    with pytest.raises(errors.OptionError) as caught:
        krylux.Scene.from_arrays(**arguments)
    assert str(caught.value).startswith(text) and caught.value.help


def test_what_opening_a_scene_refuses():
    scene = krylux.Scene.from_arrays(CORNERS, FACES)
    with pytest.raises(errors.OptionError, match=r"camera: the scene has none\n.*open with auto_camera"):
        krylux.open(scene, **SMALL)
    assert light(scene, auto_camera=True)[0].max() > 0
    with pytest.raises(errors.OptionError, match="camera_file: it says how a scene's file is read"):
        krylux.open(wall(), camera_file="x.toml", **SMALL)
    with pytest.raises(errors.OptionError, match="name: there is a mesh or a material `mesh` already"):
        scene.add_mesh("mesh", CORNERS, FACES)
    with pytest.raises(errors.OptionError, match="material: there is no material `paper`"):
        scene.add_mesh("other", CORNERS, FACES, material="paper")
    assert [path for path in scene.params if path.startswith("other")] == []
    flat = krylux.Scene.from_arrays(np.zeros((3, 3)), [[0, 1, 2]], camera=CAMERA)
    with pytest.raises(errors.OptionError, match="mesh.vertices: all of its triangles lie in a line"):
        krylux.open(flat, **SMALL)
    with pytest.raises(errors.OptionError, match="path: .* is no .glb file"):
        scene.save("scene.obj")


def test_a_run_keeps_the_scene(tmp_path):
    scene = wall(albedo=0.3)
    scene.add_mesh("sheet", CORNERS * 0.4, FACES)
    with krylux.open(scene, folder=tmp_path / "run", **SMALL) as lab:
        found = lab.segment(groups=[2], photos=4, eigenvectors=2)
        checked = lab.eigs(1, photos=6).check()
        found.save()
        white = lab.white
    assert checked is not None
    kept = tmp_path / "run" / "scene.glb"
    assert np.array_equal(light(kept)[0], white)
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert record["scene"]["path"] == str(kept) and "scene.glb" in record["outputs"]
    assert krylux.open(tmp_path / "run").name == "wall"
    # Photos alone are kept as well, and another scene is not written over.
    with krylux.open(scene, folder=tmp_path / "photos", **SMALL) as lab:
        assert np.array_equal(lab.white, white)
    assert (tmp_path / "photos" / "scene.glb").read_bytes() == kept.read_bytes()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scene.glb").write_bytes(b"mine")
    with pytest.raises(errors.OptionError, match="folder: .*another scene"):
        krylux.open(scene, folder=tmp_path / "mine", **SMALL)
    assert (tmp_path / "mine" / "scene.glb").read_bytes() == b"mine"
