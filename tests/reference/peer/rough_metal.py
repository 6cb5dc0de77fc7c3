"""`rough-metal.glb` and `glossy-dielectric.glb`: a diffuse corner with a rough metal slab or a glossy floor, coaxial."""
import sys

import numpy as np

from common import box, checker8, device, direct_photo, lambert, ones, quad, repeat, write_glb, z_test

CAMERA = device("camera", (0.0, 0.45, 0.3), (0.0, -0.08, -0.9), 40.0, (48, 48))
WHITE = {"base": 0.8}
FLOOR = quad((-0.7, -0.3, -0.2), (0.7, -0.3, -0.2), (0.7, -0.3, -1.3), (-0.7, -0.3, -1.3))
WALL = quad((-0.7, -0.3, -1.3), (0.7, -0.3, -1.3), (0.7, 0.6, -1.3), (-0.7, 0.6, -1.3))
# A slab that stands on the floor, turned by 45°: what it mirrors, smeared, is the wall and the floor, not the rig.
SLAB = box((-0.25, -0.3, -0.9), (0.3, 0.15, -0.86), 45.0)
METAL = {"base": 0.9, "metallic": 1.0, "roughness": 0.5}
GLOSSY = {"base": 0.5, "specular": 1.0, "roughness": 0.6}
SCENES = {
    "rough-metal": [("floor", FLOOR, WHITE), ("wall", WALL, WHITE), ("slab", SLAB, METAL)],
    "glossy-dielectric": [("floor", FLOOR, GLOSSY), ("wall", WALL, WHITE),
                          ("block", box((-0.25, -0.3, -0.95), (0.1, 0.0, -0.65), 30.0), GLOSSY)],
}


def gltf(m, normal, to_camera, to_projector, same_side):
    """glTF's BRDF again, for coinciding or other directions, without Mitsuba."""
    if not m.get("metallic") and "specular" not in m:
        return lambert(m, normal, to_camera, to_projector, same_side)
    cos_o, cos_i = (np.abs(np.sum(normal * w, 1)) for w in (to_camera, to_projector))
    h = to_camera + to_projector
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    cos_h, cos_d, a2 = np.abs(np.sum(normal * h, 1)), np.sum(to_camera * h, 1), m["roughness"] ** 4
    lobe = a2 / (np.pi * (cos_h**2 * (a2 - 1) + 1) ** 2)
    lobe *= 0.5 / (cos_i * np.sqrt(cos_o**2 * (1 - a2) + a2) + cos_o * np.sqrt(cos_i**2 * (1 - a2) + a2))
    f0 = m["base"] if m.get("metallic") else 0.04
    fresnel = f0 + (1 - f0) * (1 - np.clip(cos_d, 0, 1)) ** 5
    def under_coat(c):
        return 0.96 * (1 - (1 - c) ** 5 / (1 + 13 * a2) - c**2 * ((1 - c) ** 2 + 0.002) / 10)

    mean = 0.96 * (1 - 1 / 21 / (1 + 13 * a2) - (1 / 30 + 0.001) / 10)
    diffuse = 0 if m.get("metallic") else under_coat(cos_o) * under_coat(cos_i) / mean * m["base"] / np.pi
    return np.where(same_side, diffuse + fresnel * lobe, 0)


if __name__ == "__main__":
    from mitsuba_peer import build, photograph
    name, spp, seeds = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    parts, size = SCENES[name], CAMERA["size"]
    write_glb(name, parts, [CAMERA])
    if len(sys.argv) > 4:  # the metal as Mitsuba's own rough conductor: another Fresnel term, and separable masking
        conductor = {"type": "roughconductor", "distribution": "ggx", "alpha": METAL["roughness"] ** 2, "eta": 0.0,
                     "k": 1.0, "specular_reflectance": METAL["base"]}
        parts = [(n, t, {"bsdf": {"type": "twosided", "inner": conductor}} if m is METAL else m) for n, t, m in parts]
        repeat(f"{name}_48_ones_{sys.argv[4]}", photograph(build(parts, CAMERA, CAMERA, ones(size)), spp), seeds)
        sys.exit()
    mean, error = repeat(f"{name}_48_ones_direct", photograph(build(parts, CAMERA, CAMERA, ones(size), hits=1), 256),
                         seeds)
    z_test(name, mean, error, direct_photo(parts, CAMERA, CAMERA, ones(size), gltf, grid=24))
    for label, p in (("ones", ones(size)), ("checker8", checker8(size)))[:1 if name == "glossy-dielectric" else 2]:
        repeat(f"{name}_48_{label}", photograph(build(parts, CAMERA, CAMERA, p), spp), seeds)
