"""`diffuse-transmission.glb`: a paper sheet that stands before a wall and lets half of its light through, coaxial."""
import sys

import numpy as np

from common import checker8, device, direct_photo, lambert, ones, quad, repeat, write_glb, z_test

CAMERA = device("camera", (0.0, 0.15, 0.3), (0.0, 0.0, -0.9), 40.0, (48, 48))
WHITE = {"base": 0.7}
# (1 − 0.5)·0.8/π reflected and 0.5·0.6/π transmitted, on both sides: base and transmitted colour differ on purpose.
PAPER = {"base": 0.8, "transmit": (0.5, 0.6)}
PARTS = [
    ("floor", quad((-0.7, -0.35, -0.3), (0.7, -0.35, -0.3), (0.7, -0.35, -1.2), (-0.7, -0.35, -1.2)), WHITE),
    ("wall", quad((-0.7, -0.35, -1.2), (0.7, -0.35, -1.2), (0.7, 0.65, -1.2), (-0.7, 0.65, -1.2)), WHITE),
    # Turned by about 18° about the vertical.
    ("sheet", quad((-0.32, -0.25, -0.85), (0.12, -0.25, -0.99), (0.12, 0.2, -0.99), (-0.32, 0.2, -0.85)), PAPER),
]

if __name__ == "__main__":
    from mitsuba_peer import build, photograph
    spp, seeds, size = int(sys.argv[1]), int(sys.argv[2]), CAMERA["size"]
    write_glb("diffuse-transmission", PARTS, [CAMERA])
    mean, error = repeat("diffuse-transmission_48_ones_direct",
                         photograph(build(PARTS, CAMERA, CAMERA, ones(size), hits=1), 256), seeds)
    z_test("direct", mean, error, direct_photo(PARTS, CAMERA, CAMERA, ones(size), lambert, grid=24))
    for label, p in (("ones", ones(size)), ("checker8", checker8(size))):
        repeat(f"diffuse-transmission_48_{label}", photograph(build(PARTS, CAMERA, CAMERA, p), spp), seeds)
