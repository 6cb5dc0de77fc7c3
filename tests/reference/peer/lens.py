"""`lens.glb`: a thin lens before three fronto-parallel planes of striped albedo; the projector is a pinhole in the lens's
centre."""
import sys

import numpy as np

from common import device, direct_photo, lambert, ones, quad, repeat, write_glb, z_test

CAMERA = device("camera", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 40.0, (48, 48))
LENS = (0.02, 1.0)  # aperture radius, and distance along the axis of the plane in focus


def striped(name, x, y, depth, count):
    """`count` vertical stripes of albedo 0.8 and 0.2 in turn."""
    edges = np.linspace(*x, count + 1)
    stripes = [quad((a, y[0], -depth), (b, y[0], -depth), (b, y[1], -depth), (a, y[1], -depth))
               for a, b in zip(edges[:-1], edges[1:])]
    return [(f"{name} {kind}", np.concatenate(stripes[first::2]), {"base": base})
            for first, kind, base in ((0, "bright", 0.8), (1, "dark", 0.2))]


PARTS = (striped("near", (-0.30, -0.07), (-0.28, 0.1), 0.7, 6) + striped("middle", (0.04, 0.42), (-0.42, 0.05), 1.0, 6)
         + striped("far", (-0.65, 0.65), (-0.65, 0.65), 1.6, 13))


def stripes(size):
    """1 where column // 6 is even."""
    return np.tile(((np.arange(size[0]) // 6) % 2 == 0).astype(np.float32), (size[1], 1))


if __name__ == "__main__":
    from mitsuba_peer import build, photograph
    spp, seeds, size = int(sys.argv[1]), int(sys.argv[2]), CAMERA["size"]
    write_glb("lens", PARTS, [CAMERA])
    for label, p in (("ones", ones(size)), ("stripes6", stripes(size))):
        scene = build(PARTS, CAMERA, CAMERA, p, lens=LENS, hits=1)
        mean, error = repeat(f"lens_48_{label}_direct", photograph(scene, spp), seeds)
        ours = [direct_photo(PARTS, CAMERA, CAMERA, p, lambert, 16, LENS, np.random.default_rng(s)) for s in range(8)]
        error = np.hypot(error, np.std(ours, axis=0, ddof=1) / len(ours) ** 0.5)
        z_test(label, mean, error, np.mean(ours, 0))
        repeat(f"lens_48_{label}", photograph(build(PARTS, CAMERA, CAMERA, p, lens=LENS), spp), seeds)
