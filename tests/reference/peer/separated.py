"""`separated.glb`: camera and projector on different nodes, a diffuse corner and a block that casts shadows."""
import sys

import numpy as np

from common import OUT, box, device, direct_photo, half_extents, lambert, ones, quad, repeat, write_glb, z_test

CAMERA = device("camera", (0.1, 0.35, 0.2), (0.0, -0.05, -1.3), 42.0, (48, 48))
# 0.35 m beside the camera, turned towards the scene, with its own field of view and its own shape.
PROJECTOR = device("projector", CAMERA["position"] - 0.35 * CAMERA["right"], (0.05, -0.08, -1.25), 30.0, (64, 48))
WHITE, GRAY = {"base": 0.8}, {"base": 0.5}
PARTS = [
    ("floor", quad((-0.8, -0.4, -0.5), (0.7, -0.4, -0.5), (0.7, -0.4, -1.7), (-0.8, -0.4, -1.7)), WHITE),
    ("back wall", quad((-0.8, -0.4, -1.7), (0.7, -0.4, -1.7), (0.7, 0.7, -1.7), (-0.8, 0.7, -1.7)), WHITE),
    ("side wall", quad((0.7, -0.4, -0.5), (0.7, 0.7, -0.5), (0.7, 0.7, -1.7), (0.7, -0.4, -1.7)), GRAY),
    ("block", box((-0.15, -0.4, -1.35), (0.2, -0.05, -1.05), 25.0), GRAY),
]


def pattern():
    """Left third 1; one checker of 1 at the upper right; one of 0.25 at the lower right; else 0."""
    p = np.zeros((48, 64), np.float32)
    p[:, :21] = 1
    p[6:18, 36:48] = 1
    p[30:42, 48:60] = 0.25
    return p


if __name__ == "__main__":
    from mitsuba_peer import build, photograph
    spp, seeds = int(sys.argv[1]), int(sys.argv[2])
    write_glb("separated", PARTS, [CAMERA, PROJECTOR])
    np.save(f"{OUT}/separated_pattern.npy", pattern())
    for name, p in (("ones", ones(PROJECTOR["size"])), ("pattern", pattern())):
        scene = build(PARTS, CAMERA, PROJECTOR, p, hits=1)
        mean, error = repeat(f"separated_48_{name}_direct", photograph(scene, spp), seeds)
        z_test(name, mean, error, direct_photo(PARTS, CAMERA, PROJECTOR, p, lambert))
        repeat(f"separated_48_{name}", photograph(build(PARTS, CAMERA, PROJECTOR, p), spp), seeds)
    # Aᵀ·1: the devices swapped, times the ratio of the pixels' areas on the image planes at unit distance, since a photo
    # is a mean over its pixel and a pattern is not.
    area = [np.prod(half_extents(d)) * 4 / np.prod(d["size"]) for d in (PROJECTOR, CAMERA)]
    swapped = photograph(build(PARTS, PROJECTOR, CAMERA, ones(CAMERA["size"])), spp)
    repeat("separated_64x48_transposed_ones", lambda seed: swapped(seed) * area[0] / area[1], seeds)
