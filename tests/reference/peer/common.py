"""What the peer's scripts share: scenes as .glb, the same scenes in Mitsuba 3, repeated seeds, and exact direct light.

A scene is a list of parts `(name, triangles (n, 3, 3) in metres, material)`; a material is a dict of glTF's factors:
`base`, `metallic`, `roughness`, `specular`, and `transmit` = (factor, colour) for a diffusely transmitting sheet.
A device is a dict: `position`, `right`, `up`, `forward`, `yfov` in degrees, `size` = (columns, rows).
"""
import json
import os
import struct
import time

import numpy as np

OUT = os.environ.get("PEER_OUT", os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


# --- geometry ---------------------------------------------------------------------------------------------------------

def quad(a, b, c, d):
    """Two triangles, counter-clockwise as seen from the front."""
    return np.array([[a, b, c], [a, c, d]], float)


def box(low, high, turn=0.0):
    """An axis-aligned box, then turned by `turn` degrees about the vertical through its centre."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    p = np.array([[x, y, z] for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    centre = p.mean(0)
    p = (p - centre) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + centre
    return np.concatenate([quad(*p[list(f)]) for f in faces])


def icosphere(centre, radius, levels):
    g = (1 + 5 ** 0.5) / 2
    v = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
                  [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]], float)
    f = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
         (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
         (8, 6, 7), (9, 8, 1)]
    t = v[np.array(f)]
    t /= np.linalg.norm(t, axis=-1, keepdims=True)
    for _ in range(levels):
        a, b, c = t[:, 0], t[:, 1], t[:, 2]
        m = [(p + q) / np.linalg.norm(p + q, axis=-1, keepdims=True) for p, q in ((a, b), (b, c), (c, a))]
        t = np.concatenate([np.stack(s, 1) for s in ((a, m[0], m[2]), (m[0], b, m[1]), (m[2], m[1], c), m)])
    return t * radius + np.array(centre)


def device(name, position, target, yfov, size, up=(0, 1, 0)):
    position = np.array(position, float)
    forward = np.array(target, float) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return dict(name=name, position=position, right=right, up=np.cross(right, forward), forward=forward, yfov=yfov,
                size=size)


def half_extents(d):
    vertical = np.tan(np.radians(d["yfov"]) / 2)
    return vertical * d["size"][0] / d["size"][1], vertical


# --- glTF -------------------------------------------------------------------------------------------------------------

def gltf_material(name, m):
    """A Lambertian has specularFactor 0 (the default here), metallic 0, roughness 1."""
    out = {"name": name, "doubleSided": True, "pbrMetallicRoughness": {
        "baseColorFactor": [m["base"]] * 3 + [1.0], "metallicFactor": m.get("metallic", 0.0),
        "roughnessFactor": m.get("roughness", 1.0)}}
    extensions = {}
    if "specular" not in m and not m.get("metallic") and "glass" not in m:
        extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
    if "transmit" in m:
        factor, colour = m["transmit"]
        extensions["KHR_materials_diffuse_transmission"] = {"diffuseTransmissionFactor": factor,
                                                            "diffuseTransmissionColorFactor": [colour] * 3}
    if "glass" in m:
        out["doubleSided"] = False
        extensions["KHR_materials_transmission"] = {"transmissionFactor": 1.0}
        extensions["KHR_materials_volume"] = {"thicknessFactor": m["thickness"]}
        extensions["KHR_materials_ior"] = {"ior": m["glass"]}
    if extensions:
        out["extensions"] = extensions
    return out


def write_glb(name, parts, devices):
    """Positions only (flat geometric normals), shared corners; one mesh and one node per part, one node per device."""
    blob, views, accessors, meshes, nodes, materials = b"", [], [], [], [], []
    for label, triangles, material in parts:
        points, corners = np.unique(triangles.reshape(-1, 3).astype("<f4"), axis=0, return_inverse=True)
        corners = corners.reshape(-1).astype("<u2")
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": points.nbytes, "target": 34962})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(points), "type": "VEC3",
                          "min": points.min(0).tolist(), "max": points.max(0).tolist()})
        blob += points.tobytes()
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": corners.nbytes, "target": 34963})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5123, "count": len(corners),
                          "type": "SCALAR"})
        blob += corners.tobytes() + b"\0" * (-corners.nbytes % 4)
        entry = gltf_material(label, material)
        materials.append(entry)
        meshes.append({"name": label, "primitives": [{
            "attributes": {"POSITION": len(accessors) - 2}, "indices": len(accessors) - 1,
            "material": len(materials) - 1}]})
        nodes.append({"name": label, "mesh": len(meshes) - 1})
    cameras = []
    for d in devices:
        cameras.append({"name": d["name"], "type": "perspective", "perspective": {
            "yfov": np.radians(d["yfov"]), "aspectRatio": d["size"][0] / d["size"][1], "znear": 0.01}})
        matrix = np.eye(4)
        matrix[:3] = np.stack([d["right"], d["up"], -d["forward"], d["position"]], 1)
        node = {"name": d["name"], "camera": len(cameras) - 1, "matrix": [float(x) for x in matrix.T.reshape(-1)]}
        if d["name"] == "projector":
            node["extras"] = {"krylux": "projector"}
        nodes.append(node)
    used = sorted({e for m in materials for e in m.get("extensions", {})})
    document = {"asset": {"version": "2.0", "generator": "krylux peer scripts"}, "extensionsUsed": used, "scene": 0,
                "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes, "meshes": meshes, "cameras": cameras,
                "materials": materials, "accessors": accessors, "bufferViews": views,
                "buffers": [{"byteLength": len(blob)}]}
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(f"{OUT}/{name}.glb", "wb") as f:
        f.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob)))
        f.write(struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob)


# --- patterns ---------------------------------------------------------------------------------------------------------

def ones(size):
    return np.ones((size[1], size[0]), np.float32)


def checker8(size):
    row, column = np.mgrid[:size[1], :size[0]]
    return ((row // 8 + column // 8) % 2 == 0).astype(np.float32)


# --- direct light, exactly and without Mitsuba ------------------------------------------------------------------------

def closest(triangles, origin, direction):
    """Möller–Trumbore against every triangle: distance (in units of `direction`) and index of the closest, or inf."""
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    best = np.full(len(direction), np.inf)
    index = np.zeros(len(direction), int)
    for i in range(len(triangles)):
        p = np.cross(direction, e2[i])
        det = p @ e1[i]
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin - a[i]
            u = np.sum(s * p, 1) / det
            q = np.cross(s, e1[i])
            v = np.sum(q * direction, 1) / det
            t = (q @ e2[i]) / det
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6) & (t < best)
        best[hit], index[hit] = t[hit], i
    return best, index


def direct_photo(parts, camera, projector, pattern, brdf, grid=16, lens=None, rng=None):
    """The photo after one surface hit: the mean of f·D·pattern·visibility over `grid`² points of each pixel.
    `brdf(material, normal, to_camera, to_projector)`; `lens` = (aperture radius, focus distance)."""
    w, h = camera["size"]
    triangles = np.concatenate([t for _, t, _ in parts]).astype(np.float32).astype(float)
    owner = np.concatenate([[k] * len(t) for k, (_, t, _) in enumerate(parts)])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    step = (np.arange(w * grid) + 0.5) / grid, (np.arange(h * grid) + 0.5) / grid
    u, v = np.meshgrid(*step)
    jitter = (rng or np.random.default_rng(1)).random((2, *u.shape)) - 0.5
    u, v = u + jitter[0] / grid, v + jitter[1] / grid
    tx, ty = half_extents(camera)
    direction = (camera["forward"] + ((2 * u / w - 1) * tx)[..., None] * camera["right"]
                 + ((1 - 2 * v / h) * ty)[..., None] * camera["up"]).reshape(-1, 3)
    origin = np.broadcast_to(camera["position"], direction.shape)
    if lens:
        r, phi = lens[0] * np.sqrt(rng.random(len(direction))), 2 * np.pi * rng.random(len(direction))
        shift = (r * np.cos(phi))[:, None] * camera["right"] + (r * np.sin(phi))[:, None] * camera["up"]
        direction, origin = direction - shift / lens[1], origin + shift
    t, index = closest(triangles, origin, direction)
    seen = np.isfinite(t)
    x = origin[seen] + t[seen, None] * direction[seen]
    n = normals[index[seen]]
    offset = x - projector["position"]
    depth = offset @ projector["forward"]
    tx, ty = half_extents(projector)
    pw, ph = projector["size"]
    column = np.floor((1 + (offset @ projector["right"]) / (depth * tx)) / 2 * pw).astype(int)
    row = np.floor((1 - (offset @ projector["up"]) / (depth * ty)) / 2 * ph).astype(int)
    lit = (depth > 0) & (column >= 0) & (column < pw) & (row >= 0) & (row < ph)
    block, _ = closest(triangles, np.broadcast_to(projector["position"], x.shape), offset)
    lit &= block > 1 - 1e-5
    side = np.sum(n * offset, 1) * np.sum(n * direction[seen], 1)
    value = np.zeros(len(x))
    to_camera = -direction[seen] / np.linalg.norm(direction[seen], axis=1, keepdims=True)
    to_projector = -offset / np.linalg.norm(offset, axis=1, keepdims=True)
    density = np.abs(np.sum(n * offset, 1)) / np.abs(depth) ** 3
    for k, (_, _, material) in enumerate(parts):
        own = lit & (owner[index[seen]] == k)
        f = brdf(material, n[own], to_camera[own], to_projector[own], side[own] > 0)
        value[own] = f * density[own] * pattern[row[own], column[own]]
    photo = np.zeros(len(direction))
    photo[seen] = value
    return photo.reshape(h, grid, w, grid).mean((1, 3))


def lambert(material, normal, to_camera, to_projector, same_side):
    if "transmit" in material:
        factor, colour = material["transmit"]
        return np.where(same_side, (1 - factor) * material["base"], factor * colour) / np.pi
    return np.where(same_side, material["base"], 0.0) / np.pi


# --- repeated seeds and files -----------------------------------------------------------------------------------------

class Mean:
    """Mean and standard error of photos of independent seeds."""

    def __init__(self):
        self.photos = []

    def add(self, photo):
        self.photos.append(np.asarray(photo, float))

    def save(self, name):
        stack = np.stack(self.photos)
        mean, error = stack.mean(0), stack.std(0, ddof=1) / np.sqrt(len(stack))
        np.save(f"{OUT}/{name}.npy", mean.astype(np.float32))
        np.save(f"{OUT}/{name}_stderr.npy", error.astype(np.float32))
        total = stack.sum((1, 2))
        print(f"{name}: {len(stack)} seeds, relative L2 noise {100 * np.sqrt((error**2).sum() / (mean**2).sum()):.3f} %,"
              f" total {total.mean():.6g} ± {total.std(ddof=1) / np.sqrt(len(stack)):.2g}", flush=True)
        return mean, error


def repeat(name, photo, seeds, seconds=1e9):
    """Photos of `seeds` seeds, at least 16, while time remains."""
    begin, mean = time.time(), Mean()
    for seed in range(1, seeds + 1):
        mean.add(photo(seed))
        if seed >= 16 and time.time() - begin > seconds:
            break
    return mean.save(name)


def z_test(name, mean, error, expected):
    """The rms of z where either is not exactly zero, and the bias of the total."""
    # Where a pixel is evenly lit the error is rounding alone, in single precision.
    error = np.hypot(error, 1e-5 * expected.max())
    some = (mean != 0) | (expected != 0)
    z = ((mean - expected) / error)[some]
    print(f"{name}: z rms {np.sqrt(np.mean(z**2)):.3f}, largest {np.abs(z).max():.1f}, bias of the total"
          f" {100 * (mean.sum() / expected.sum() - 1):+.4f} %", flush=True)
