"""`glass-sphere.glb`: a caustic by brute force, from the projector through a faceted glass sphere onto the floor.

Only the ray–triangle tests are Mitsuba's; refraction, Fresnel's terms and the deposits are written out here.
"""
import sys

import drjit as dr
import numpy as np
from scipy import ndimage

from common import Mean, device, half_extents, icosphere, ones, quad, write_glb

RIG = dict(position=(0.0, 1.1, 0.5), target=(0.0, 0.0, 0.0), yfov=48.0, size=(64, 64))
CAMERA = device("camera", **RIG)
CENTRE, RADIUS, IOR, BASE = CAMERA["position"] + 0.55 * CAMERA["forward"] + 0.05 * CAMERA["right"], 0.1, 1.5, 0.1
PARTS = [
    ("floor", quad((-0.9, 0, 0.7), (0.9, 0, 0.7), (0.9, 0, -0.9), (-0.9, 0, -0.9)), {"base": BASE}),
    ("sphere", icosphere(CENTRE, RADIUS, 4), {"base": 1.0, "glass": IOR, "roughness": 0.0, "thickness": 2 * RADIUS}),
]
INTERNAL = 4  # exits into the air that are followed: after 0, 1, … 3 internal reflections

KINDS = ("none", "transmitted", "reflected", "seen_transmitted", "seen_reflected", "both")
# Cells along each side of the floor's 1.8 m, for `both`; without this argument it is left out.
CELLS = int(sys.argv[3]) if len(sys.argv) > 3 else 1
CELL = 1.8 / CELLS


def fresnel(cos_i, eta):
    """Unpolarized reflectance of a dielectric and the cosine of the refracted ray; `eta` = n_transmitted / n_incident."""
    sin2 = (1 - cos_i**2) / eta**2
    cos_t = dr.sqrt(dr.maximum(1 - sin2, 0))
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    across = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return dr.select(sin2 >= 1, 1.0, 0.5 * (parallel**2 + across**2)), cos_t


class Tracer:
    def __init__(self, mi, scene):
        self.mi, self.scene = mi, scene
        self.floor = [s for s in scene.shapes() if s.id() == "floor"][0]
        self.tx, self.ty = map(float, half_extents(CAMERA))

    # Fresh at every use: Dr.Jit widens a shared constant to the first wavefront that it meets.
    p = property(lambda self: self.mi.Point3f(CAMERA["position"].tolist()))
    f = property(lambda self: self.mi.Vector3f(CAMERA["forward"].tolist()))
    r = property(lambda self: self.mi.Vector3f(CAMERA["right"].tolist()))
    u = property(lambda self: self.mi.Vector3f(CAMERA["up"].tolist()))

    def sphere_pixels(self):
        """The pixels in which any of 64 rays meets the sphere, and their neighbours."""
        direction, pixel = self.primary(0, 64, np.arange(np.prod(CAMERA["size"])))
        si = self.scene.ray_intersect(self.mi.Ray3f(self.p, direction))
        met = np.array(pixel)[np.array(si.is_valid() & (si.shape != self.mi.ShapePtr(self.floor)))]
        mask = np.zeros(CAMERA["size"][::-1], bool)
        mask.reshape(-1)[met] = True
        return np.flatnonzero(ndimage.binary_dilation(mask, np.ones((3, 3))))

    def primary(self, seed, samples, pixels):
        """`samples` rays through each of `pixels`, on the R2 lattice shifted at random by pixel and seed; returns
        direction and pixel."""
        mi, (w, h) = self.mi, CAMERA["size"]
        index = dr.arange(mi.UInt32, len(pixels) * samples)
        pixel = dr.gather(mi.UInt32, mi.UInt32(pixels.astype(np.uint32)), index // samples)
        shift, step = mi.sample_tea_32(pixel, mi.UInt32(seed), 8), index % samples
        x, y = ((s + step * k) >> 8 for s, k in zip(shift, (3242174889, 2447445413)))
        u, v = (mi.Float(pixel % w) + mi.Float(x) / 2**24) / w, (mi.Float(pixel // w) + mi.Float(y) / 2**24) / h
        d = self.f + (2 * u - 1) * self.tx * self.r + (1 - 2 * v) * self.ty * self.u
        return dr.normalize(d), pixel

    def chains(self, direction, visit):
        """Follows rays from the pinhole; `visit(kind, floor hit, throughput)` at each floor hit at the end of a chain:
        kind 'none', 'reflected' (off the outside) or 'transmitted' (through the glass)."""
        mi = self.mi
        si = self.scene.ray_intersect(mi.Ray3f(self.p, direction))
        floor = si.is_valid() & (si.shape == mi.ShapePtr(self.floor))
        visit("none", si, mi.Float(1.0), floor)
        glass = si.is_valid() & ~floor
        cos_i = -dr.dot(direction, si.n)
        reflectance, cos_t = fresnel(cos_i, IOR)
        self.end(si, direction + 2 * cos_i * si.n, reflectance, glass & (cos_i > 0), "reflected", visit)
        inside = direction / IOR + (cos_i / IOR - cos_t) * si.n
        weight = 1 - reflectance
        for _ in range(INTERNAL):
            si = self.scene.ray_intersect(si.spawn_ray(inside), glass)
            glass &= si.is_valid() & (si.shape != mi.ShapePtr(self.floor))
            cos_i = dr.dot(inside, si.n)
            reflectance, cos_t = fresnel(cos_i, 1 / IOR)
            out = inside * IOR - (cos_i * IOR - cos_t) * si.n
            self.end(si, out, weight * (1 - reflectance), glass & (reflectance < 1), "transmitted", visit)
            inside = inside - 2 * cos_i * si.n
            weight *= reflectance

    def end(self, si, direction, weight, active, kind, visit):
        si = self.scene.ray_intersect(si.spawn_ray(dr.normalize(direction)), active)
        visit(kind, si, weight, active & si.is_valid() & (si.shape == self.mi.ShapePtr(self.floor)))

    def density(self, point):
        """The pixel that sees `point`, and D = cosθ_x / (r² cos³θ), 0 where the sphere hides it or it is out of view."""
        mi, (w, h) = self.mi, CAMERA["size"]
        offset = point - self.p
        depth = dr.dot(offset, self.f)
        column = dr.floor((1 + dr.dot(offset, self.r) / (depth * self.tx)) / 2 * w)
        row = dr.floor((1 - dr.dot(offset, self.u) / (depth * self.ty)) / 2 * h)
        seen = (depth > 0) & (column >= 0) & (column < w) & (row >= 0) & (row < h)
        distance = dr.norm(offset)
        seen &= ~self.scene.ray_test(mi.Ray3f(self.p, offset / distance, distance * (1 - 1e-4), 0.0, []))
        density = dr.select(seen, dr.abs(offset.y) / depth**3, 0)
        return mi.UInt32(dr.select(seen, row * w + column, 0)), density

    def cell(self, point):
        """The floor's cell of size `CELL`."""
        x, z = self.mi.UInt32((point.x + 0.9) / CELL), self.mi.UInt32((point.z + 0.9) / CELL)
        return dr.minimum(z, CELLS - 1) * CELLS + dr.minimum(x, CELLS - 1)

    def photos(self, seed, samples, pixels, irradiance=None):
        """Photos under all ones, from `samples` rays through each of `pixels`: light that came in through the sphere
        (`transmitted`, `reflected`) and is seen directly; the same seen through the sphere and lit directly
        (`seen_…`); direct light (`none`). With `irradiance`, the floor's cells: `both`, lit and seen by the sphere.
        Also the power that came into each cell by the sphere, for `irradiance`."""
        mi, n = self.mi, int(np.prod(CAMERA["size"]))
        direction, pixel = self.primary(seed, samples, pixels)
        film = {k: dr.zeros(mi.Float, n) for k in KINDS}
        cells = dr.zeros(mi.Float, CELLS * CELLS)

        def visit(kind, si, weight, active):
            # A ray carries the flux |image plane| / (n·samples), and a pixel's mean divides by |image plane| / n.
            carried = dr.select(active, weight * BASE / dr.pi / samples, 0)
            seen_by, density = self.density(si.p)
            dr.scatter_reduce(dr.ReduceOp.Add, film[kind], carried * density, seen_by, active)
            if kind == "none":
                return
            dr.scatter_reduce(dr.ReduceOp.Add, film["seen_" + kind], carried * density, pixel, active)
            flux = 4 * self.tx * self.ty / (n * samples)
            dr.scatter_reduce(dr.ReduceOp.Add, cells, weight * flux / CELL**2, self.cell(si.p), active)
            if irradiance is not None:
                lit = carried * dr.gather(mi.Float, irradiance, self.cell(si.p), active)
                dr.scatter_reduce(dr.ReduceOp.Add, film["both"], lit, pixel, active)

        self.chains(direction, visit)
        dr.eval(film, cells)
        return {k: np.array(v, dtype=float).reshape(CAMERA["size"][::-1]) for k, v in film.items()}, np.array(cells)


if __name__ == "__main__":
    from mitsuba_peer import build, mi
    samples, seeds = int(sys.argv[1]), int(sys.argv[2])
    write_glb("glass-sphere", PARTS, [CAMERA])
    tracer = Tracer(mi, build(PARTS, CAMERA, CAMERA, ones(CAMERA["size"])))
    sphere, everywhere = tracer.sphere_pixels(), np.arange(np.prod(CAMERA["size"]))
    print(len(sphere), "pixels hold the sphere")
    # Irradiance for `both` from seeds of its own: a path must not find its own light.
    irradiance = CELLS > 1 and sum(tracer.photos(1000 + s, samples, sphere)[1] / seeds for s in range(seeds))
    irradiance = mi.Float(irradiance.astype(np.float32)) if CELLS > 1 else None
    means = {kind: Mean() for kind in KINDS if irradiance is not None or kind != "both"}
    for seed in range(1, seeds + 1):
        photos, _ = tracer.photos(seed, samples, sphere, irradiance)
        photos["none"] = tracer.photos(seed, max(1, samples // 16), everywhere)[0]["none"]
        for kind in means:
            means[kind].add(photos[kind])
    for kind, mean in means.items():
        mean.save(f"glass-sphere_64_{kind}")
