"""The scenes of `common` in Mitsuba 3 (llvm_ad_mono): glTF's materials as exact BSDFs, the rig, and one seed's photo."""
import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_mono")


class GltfBsdf(mi.BSDF):
    """glTF 2.0, appendix B: GGX of width roughness², height-correlated Smith, Schlick on V·H, no normal maps; two-sided.

    The metal's F0 is the base colour; the dielectric has F0 = 0.04 (ior 1.5), F90 = 1, and a diffuse lobe that its coat dims on
    the way in and out, as guide/src/right/bsdf.md has it for rough surfaces. Written from these texts; sampling is
    by Mitsuba's own visible-normal sampler and by cosine, half and half where there is a diffuse lobe.
    """

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.base, self.metallic = props["base"], props["metallic"]
        self.alpha = props["roughness"] ** 2
        self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)
        self.share = 1.0 if self.metallic == 1.0 else 0.5
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [flags]
        self.m_flags = flags

    def under_coat(self, c):
        """1 − R(c)"""
        x = 1 - c
        return 0.96 * (1 - x**5 / (1 + 13 * self.alpha**2) - c**2 * (x**2 + 0.002) / 10)

    def under_coat_mean(self):
        return 0.96 * (1 - 1 / 21 / (1 + 13 * self.alpha**2) - (1 / 30 + 0.001) / 10)

    def both(self, si, wo, active):
        """Value times cosine, and density."""
        sign = dr.mulsign(mi.Float(1.0), si.wi.z)
        wi, wo = si.wi * sign, wo * sign
        active = active & (wi.z > 0) & (wo.z > 0)
        h = dr.normalize(wi + wo)
        grazing = dr.clip(1 - dr.dot(wi, h), 0, 1) ** 5
        a2 = self.alpha**2
        smith = 0.5 / (wo.z * dr.sqrt(wi.z**2 * (1 - a2) + a2) + wi.z * dr.sqrt(wo.z**2 * (1 - a2) + a2))
        lobe = self.facets.eval(h) * smith
        metal = (self.base + (1 - self.base) * grazing) * lobe
        fresnel = 0.04 + 0.96 * grazing
        coated = self.under_coat(wi.z) * self.under_coat(wo.z) / self.under_coat_mean()
        dielectric = coated * self.base / dr.pi + fresnel * lobe
        value = self.metallic * metal + (1 - self.metallic) * dielectric
        pdf = (self.share * self.facets.pdf(wi, h) / (4 * dr.dot(wo, h)) + (1 - self.share) * wo.z / dr.pi)
        return dr.select(active, value * wo.z, 0), dr.select(active, pdf, 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        sign = dr.mulsign(mi.Float(1.0), si.wi.z)
        wi = si.wi * sign
        m, _ = self.facets.sample(wi, sample2)
        wo = dr.select(sample1 < self.share, 2 * dr.dot(wi, m) * m - wi, mi.warp.square_to_cosine_hemisphere(sample2))
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = wo * sign
        value, bs.pdf = self.both(si, bs.wo, active)
        bs.eta = 1.0
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        bs.sampled_component = 0
        return bs, mi.Spectrum(dr.select(bs.pdf > 0, value / bs.pdf, 0))

    def eval(self, ctx, si, wo, active=True):
        return mi.Spectrum(self.both(si, wo, active)[0])

    def pdf(self, ctx, si, wo, active=True):
        return self.both(si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = self.both(si, wo, active)
        return mi.Spectrum(value), pdf


class SheetBsdf(mi.BSDF):
    """KHR_materials_diffuse_transmission over a Lambertian: (1 − t)·base/π reflected, t·colour/π transmitted."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.base, self.factor, self.colour = props["base"], props["factor"], props["colour"]
        kinds = [mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.DiffuseTransmission]
        self.m_components = [k | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide for k in kinds]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def both(self, si, wo, active):
        same = si.wi.z * wo.z > 0
        value = dr.select(same, (1 - self.factor) * self.base, self.factor * self.colour) * dr.abs(wo.z) / dr.pi
        return dr.select(active, value, 0), dr.select(active, 0.5 * dr.abs(wo.z) / dr.pi, 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        reflect = sample1 < 0.5
        wo.z = dr.mulsign(wo.z, dr.select(reflect, si.wi.z, -si.wi.z))
        bs.wo = wo
        value, bs.pdf = self.both(si, wo, active)
        bs.eta = 1.0
        bs.sampled_type = dr.select(reflect, mi.UInt32(+mi.BSDFFlags.DiffuseReflection),
                                    mi.UInt32(+mi.BSDFFlags.DiffuseTransmission))
        bs.sampled_component = dr.select(reflect, mi.UInt32(0), mi.UInt32(1))
        return bs, mi.Spectrum(dr.select(bs.pdf > 0, value / bs.pdf, 0))

    def eval(self, ctx, si, wo, active=True):
        return mi.Spectrum(self.both(si, wo, active)[0])

    def pdf(self, ctx, si, wo, active=True):
        return self.both(si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = self.both(si, wo, active)
        return mi.Spectrum(value), pdf


mi.register_bsdf("gltf", GltfBsdf)
mi.register_bsdf("sheet", SheetBsdf)


def bsdf(m):
    if "bsdf" in m:
        return m["bsdf"]
    if "glass" in m:
        return {"type": "dielectric", "int_ior": m["glass"], "ext_ior": 1.0}
    if "transmit" in m:
        return {"type": "sheet", "base": m["base"], "factor": m["transmit"][0], "colour": m["transmit"][1]}
    if m.get("metallic") or "specular" in m:
        return {"type": "gltf", "base": m["base"], "metallic": m.get("metallic", 0.0), "roughness": m["roughness"]}
    return {"type": "twosided", "inner": {"type": "diffuse", "reflectance": {"type": "uniform", "value": m["base"]}}}


def mesh(name, triangles, material):
    """A triangle soup: no shared vertices, so that the normals are the faces'."""
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf(material))
    out = mi.Mesh(name, 3 * len(triangles), len(triangles), props=props)
    params = mi.traverse(out)
    params["vertex_positions"] = mi.Float(triangles.astype(np.float32).reshape(-1))
    params["faces"] = mi.UInt32(np.arange(3 * len(triangles), dtype=np.uint32))
    params.update()
    return out


def to_world(d):
    """Mitsuba's devices look along +z with +x to the left of the image."""
    matrix = np.eye(4)
    matrix[:3] = np.stack([-d["right"], d["up"], d["forward"], d["position"]], 1)
    return mi.ScalarTransform4f(matrix)


def build(parts, camera, projector, pattern, lens=None, hits=6, integrator="path"):
    """`hits`: surface hits at most; Mitsuba counts the path's edges but the one into the projector, one more."""
    d = {"type": "scene", "integrator": {"type": integrator, "max_depth": hits + 1, "rr_depth": 10000}}
    d["sensor"] = {"type": "perspective", "to_world": to_world(camera), "fov": camera["yfov"], "fov_axis": "y",
                   "near_clip": 1e-3, "far_clip": 100.0,
                   "film": {"type": "hdrfilm", "width": camera["size"][0], "height": camera["size"][1],
                            "pixel_format": "luminance", "component_format": "float32", "rfilter": {"type": "box"}},
                   "sampler": {"type": "independent"}}
    if lens:
        d["sensor"] |= {"type": "thinlens", "aperture_radius": lens[0], "focus_distance": lens[1]}
    bitmap = mi.Bitmap(np.ascontiguousarray(pattern, np.float32)[..., None])
    d["projector"] = {"type": "projector", "to_world": to_world(projector), "fov": projector["yfov"], "fov_axis": "y",
                      "scale": float(1 / np.pi),
                      "irradiance": {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "nearest",
                                     "wrap_mode": "clamp"}}
    for name, triangles, material in parts:
        d[name] = mesh(name, triangles, material)
    return mi.load_dict(d)


def photograph(scene, spp):
    """One seed's photo as a function of the seed."""
    return lambda seed: np.array(mi.render(scene, spp=spp, seed=seed))[..., 0]
