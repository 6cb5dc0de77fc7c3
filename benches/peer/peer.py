"""Mitsuba 3 on the scenes of `scenes.py`: photos of signed patterns, and a Lanczos run of photos.

As a program it is one whole process, or with `serve` a resident one that takes a JSON request a line:

    peer.py photo SCENE SIZE SPP OUT.npy
    peer.py lanczos SCENE SIZE SPP PHOTOS
    peer.py serve SCENE SIZE
"""
import json
import os
import resource
import sys
import time

import mitsuba as mi
import numpy as np

import scenes

# Mitsuba counts the edge into the projector as well, and ends paths by chance from `rr_depth` on.
SURFACES = 6


def variant(scene):
    """The fastest that renders the scene: one channel where all is gray."""
    return "llvm_ad_rgb" if scene.colored else "llvm_ad_mono"


class Peer:
    """A scene, loaded once, under a pattern that can be changed without a new kernel."""

    def __init__(self, scene, size):
        mi.set_variant(variant(scene))
        self.size = size
        # Mitsuba's devices look along +z, with +x to the left.
        placed = mi.ScalarTransform4f(scene.to_world @ np.diag([-1.0, 1.0, -1.0, 1.0]))
        view = {"to_world": placed, "fov": float(np.degrees(scene.vertical_fov)), "fov_axis": "y"}
        film = {"type": "hdrfilm", "width": size, "height": size, "pixel_format": "luminance",
                "component_format": "float32", "rfilter": {"type": "box"}}
        bitmap = mi.Bitmap(np.ones((size, size, 1), np.float32))
        description = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": SURFACES + 1, "rr_depth": 1000},
            "sensor": {"type": "perspective", "near_clip": 1e-3, "far_clip": 100.0, "film": film,
                       "sampler": {"type": "independent"}, **view},
            # Scale 1/π: a pattern of 1 is then 1 W/m² at 1 m.
            "projector": {"type": "projector", "scale": float(1 / np.pi), **view,
                          "irradiance": {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "nearest",
                                         "wrap_mode": "clamp"}},
        }
        for index, part in enumerate(scene.parts):
            description[f"part{index}"] = mesh(f"part{index}", part)
        self.scene = mi.load_dict(description)
        self.parameters = mi.traverse(self.scene)

    def photo(self, pattern, spp, seed):
        """A · pattern with fresh noise; the pattern may be signed."""
        self.parameters["projector.irradiance.data"] = mi.TensorXf(pattern.reshape(self.size, self.size, 1).astype(np.float32))
        self.parameters.update()
        return np.array(mi.render(self.scene, spp=spp, seed=seed), float).reshape(-1)


def mesh(name, part):
    """A triangle soup, so that normals are the faces' own."""
    if part.mirror:
        inner = {"type": "conductor", "material": "none", "specular_reflectance": {"type": "rgb", "value": list(part.color)}}
    else:
        inner = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(part.color)}}
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "inner": inner})
    count = len(part.triangles)
    out = mi.Mesh(name, 3 * count, count, props=properties)
    parameters = mi.traverse(out)
    parameters["vertex_positions"] = mi.Float(part.triangles.astype(np.float32).reshape(-1))
    parameters["faces"] = mi.UInt32(np.arange(3 * count, dtype=np.uint32))
    parameters.update()
    return out


def signed_product(peer, way, x, spp, seed):
    """A x for a signed x, by photos of `spp` samples in all for each pixel.

    `signed`: one photo of the pattern as it is, which no projector could show. `split`: x⁺ and x⁻. `affine`: the pattern
    moved into [0, 1], and the white photo, whose cost is counted half for half.
    """
    if way == "signed":
        return peer.photo(x, spp, seed)
    half = max(spp // 2, 1)
    if way == "split":
        return peer.photo(np.maximum(x, 0), half, seed) - peer.photo(np.maximum(-x, 0), half, seed + 1)
    low, high = x.min(), x.max()
    moved = peer.photo((x - low) / (high - low), half, seed)
    return (high - low) * moved + low * peer.photo(np.ones_like(x), half, seed + 1)


def lanczos(product, start, photos):
    """The extreme eigenvalues after so many photos, with full reorthogonalization, as krylux has it."""
    basis = np.zeros((photos + 1, len(start)))
    basis[0] = start / np.linalg.norm(start)
    alpha, beta = np.zeros(photos), np.zeros(photos)
    for step in range(photos):
        y = product(basis[step], step)
        alpha[step] = basis[step] @ y
        for _ in range(2):
            y -= basis[:step + 1].T @ (basis[:step + 1] @ y)
        beta[step] = np.linalg.norm(y)
        basis[step + 1] = y / beta[step]
    return np.linalg.eigvalsh(np.diag(alpha) + np.diag(beta[:-1], 1) + np.diag(beta[:-1], -1))


def run_lanczos(peer, spp, photos, seed):
    start = np.random.default_rng(seed).standard_normal(peer.size ** 2)
    return lanczos(lambda x, step: peer.photo(x, spp, 1000 * seed + step), start, photos)


def timed(work):
    """Result, wall seconds and processor seconds."""
    def used():
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return np.array([time.perf_counter(), usage.ru_utime + usage.ru_stime])
    before = used()
    result = work()
    return result, *(used() - before)


def serve(peer):
    for line in sys.stdin:
        request = json.loads(line)
        x = np.load(request["pattern"]).reshape(-1)
        y, wall, cpu = timed(lambda: signed_product(peer, request["way"], x, request["spp"], request["seed"]))
        np.save(request["out"], y.reshape(peer.size, peer.size))
        print(json.dumps({"wall": wall, "cpu": cpu}), flush=True)


def main():
    verb, path, size, *rest = sys.argv[1:]
    peer = Peer(scenes.read(path), int(size))
    if verb == "serve":
        return serve(peer)
    if verb == "photo":
        spp, out = rest
        np.save(out, peer.photo(np.ones(int(size) ** 2), int(spp), 0).reshape(int(size), int(size)))
    else:
        spp, photos = map(int, rest)
        print(run_lanczos(peer, spp, photos, 1)[-3:])
    # The interpreter's own end, tidying up kernels, is not part of the work.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
