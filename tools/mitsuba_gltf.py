#!/usr/bin/env python3
"""Compares paths over glTF's materials with Mitsuba 3, an independent path tracer that is told how they reflect.

    pip install mitsuba numpy
    tools/mitsuba_gltf.py --scenes ../shared/scenes --brickwalk target/release/brickwalk -o DIR

The materials are a plugin of Mitsuba's, written here from appendix B of the specification of glTF 2.0 and from
docs/methods/light.md: GGX with Smith's correlated masking, Fresnel by Schlick, the light of further bounces between
facets (Turquin 2019), what the diffuse part has left, a clear coat, and facets that refract. Sheen, anisotropy and
iridescence are written from KHR_materials_sheen, _anisotropy and _iridescence. What facets and sheen reflect of light
from everywhere is integrated here, by quadrature. Scenes are generated: spheres over roughness of metal, of
plastic and of coated things, glass, rough glass, glass beside metal, a box with a lamp, a room that is lit through a
door, a chain of small spheres, velvet, brushed metal, and films on plastic and metal. `mtl` is written as an OBJ file
with a library of materials, and `teapots` is the file of that name, its 1,899 instances made one mesh for Mitsuba. Each
is rendered with so many bounces as --bounces has.

A row of the table is a picture, as in tools/mitsuba.py. The exit status is 1 where means differ by more than half a
percent and by more than three standard errors, or FLIP is above 1.15 times that of the noise; and with --control where
neither is. A control tells Mitsuba something wrong: `roughness` that of facets, `index` of refraction, `sheen` the
roughness of sheen, `anisotropy` its strength, `film` the thickness.

The variant llvm_ad_rgb needs a libLLVM.so, which the system finds or DRJIT_LIBLLVM_PATH names: 19.1 works.
"""

import argparse
import importlib.util
import json
import math
import pathlib
import subprocess
import sys

# The folder of this file comes first, and `import mitsuba` would be the file beside it.
HERE = pathlib.Path(__file__).resolve().parent
sys.path = [path for path in sys.path if pathlib.Path(path or ".").resolve() != HERE]

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")


def beside(name):
    """The module of a file in this folder."""
    spec = importlib.util.spec_from_file_location("beside", HERE / name)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SIZE = (160, 120)
# Means may differ by this share, or by so many standard errors.
BOUND, ERRORS = 0.005, 3.0
# FLIP may be so many times that of the noise: of few samples neither is certain.
NOISE = 1.15
BATCHES = 8
# Which scenes each wrong material shows in.
CONTROLS = {
    "roughness": ("metals", "plastics", "coated"),
    "index": ("glass", "rough-glass"),
    "sheen": ("sheen",),
    "anisotropy": ("anisotropy",),
    "film": ("iridescence",),
}
COSINES = 64


def white_lobe(alpha):
    """What a lobe with reflectances of (1, 0) and (0, 1) reflects of light from everywhere, over cosines of the view.

    The mean of masking over facets that are seen, on an even grid of numbers.
    """
    a, b = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(512) + 0.5) / 512, indexing="ij")
    table = []
    for i in range(COSINES):
        c = max((i / (COSINES - 1)) ** 2, 1e-4)
        view = np.array([math.sqrt(1 - c * c), 0.0, c])
        stretched = view * [alpha, alpha, 1.0]
        stretched /= np.linalg.norm(stretched)
        height = 1 - b * (1 + stretched[2])
        level = np.sqrt(np.maximum(1 - height * height, 0))
        h = np.stack([level * np.cos(2 * np.pi * a), level * np.sin(2 * np.pi * a), height], -1) + stretched
        h *= [alpha, alpha, 1.0]
        h[..., 2] = np.maximum(h[..., 2], 0)
        h /= np.linalg.norm(h, axis=-1, keepdims=True)
        cos_facet = h @ view
        light = 2 * cos_facet * h[..., 2] - c
        above = light > 0
        light = np.maximum(light, 1e-9)

        def root(x):
            return np.sqrt(alpha**2 + (1 - alpha**2) * x * x)

        # G2 / G1 of masking that is correlated.
        masked = light * (c + root(c)) / (light * root(c) + c * root(light))
        f = np.clip(1 - cos_facet, 0, 1) ** 5
        table.append([np.mean(above * masked * (1 - f)), np.mean(above * masked * f)])
    return np.array(table)


AZIMUTHS = 33


def facets(view, alphas, angles=192, heights=256):
    """Of facets that are seen: weights, which have a mean of what white ones reflect, and cosines to the view."""
    a, b = np.meshgrid((np.arange(angles) + 0.5) / angles, (np.arange(heights) + 0.5) / heights, indexing="ij")
    scale = np.array([*alphas, 1.0])

    def root(d):
        return np.sqrt(((d * scale) ** 2).sum(-1))

    stretched = view * scale / root(view)
    height = 1 - b * (1 + stretched[2])
    level = np.sqrt(np.maximum(1 - height * height, 0))
    h = np.stack([level * np.cos(2 * np.pi * a), level * np.sin(2 * np.pi * a), height], -1) + stretched
    h = h * scale
    h[..., 2] = np.maximum(h[..., 2], 0)
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    cosine = h @ view
    light = 2 * cosine[..., None] * h - view
    c, z = light[..., 2], view[2]
    masked = c * (z + root(view)) / np.maximum(c * root(view) + z * root(light), 1e-12)
    return np.where((c > 0) & (cosine > 0), masked, 0), np.clip(cosine, 0, 1)


def film(lib, index, thickness, f0, cosine):
    """Iridescent Fresnel of a film in air over a base that reflects f0 along the normal, a colour; at most all."""
    fresnel0 = lambda beyond, before: ((beyond - before) / (beyond + before)) ** 2
    schlick = lambda f, c: f + (1 - f) * (1 - c) ** 5
    inner = lib.sqrt(1 - (1 - cosine * cosine) / index**2)
    r12 = schlick(fresnel0(index, 1.0), cosine)
    t121 = 1 - r12
    path = 2 * index * thickness * inner

    def wave(path, shift):
        """X, Y and Z of cosines that are shifted by half turns."""
        phase = 2 * math.pi * path * 1e-9
        gauss = lambda value, place, variance, s: (
            value * math.sqrt(2 * math.pi * variance) / 1.0685e-7
        ) * lib.cos(place * phase + math.pi * s) * lib.exp(-variance * phase * phase)
        x = gauss(5.4856e-13, 1.6810e6, 4.3278e9, shift[0]) + gauss(9.7470e-14, 2.2399e6, 4.5282e9, shift[0])
        return x, gauss(4.4201e-13, 1.7953e6, 9.3046e9, shift[1]), gauss(5.2481e-13, 2.2084e6, 6.6121e9, shift[2])

    base = [(1 + math.sqrt(min(f + 1e-4, 0.9999))) / (1 - math.sqrt(min(f + 1e-4, 0.9999))) for f in f0]
    halves = [1 + (n < index) for n in base]
    waves = [wave(m * path, [m * half for half in halves]) for m in (1, 2)]
    rgb = ((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560), (0.0556434, -0.2040259, 1.0572252))
    colors = []
    for n, row in zip(base, rgb):
        r23 = schlick(fresnel0(n, index), inner)
        r123 = lib.minimum(lib.maximum(r12 * r23, 1e-5), 0.9999)
        all_orders = t121 * t121 * r23 / (1 - r123)
        found, amplitude = r12 + all_orders, all_orders - t121
        for xyz in waves:
            amplitude = amplitude * lib.sqrt(r123)
            found = found + amplitude * 2 * sum(m * x for m, x in zip(row, xyz))
        colors.append(lib.minimum(lib.maximum(found, 0), 1))
    return colors


def sheen_masking(lib, cosine, alpha):
    """Lambda of the fit for Charlie sheen."""
    by = (1 - alpha) ** 2
    a, b, c, d, e = (
        rough * (1 - by) + smooth * by
        for rough, smooth in (
            (21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.97760, -1.27393), (-4.32054, -4.85967)
        )
    )
    l = lambda x: a / (1 + b * x**c) + d * x + e
    flat, steep = lib.maximum(cosine, 1e-6), lib.maximum(1 - cosine, 1e-6)
    choose = np.where if lib is np else lib.select
    return choose(cosine < 0.5, lib.exp(l(flat)), lib.exp(2 * l(0.5) - l(steep)))


def white_sheen(cosine, alpha):
    """What white sheen reflects of light from everywhere."""
    angle = 0.5 * np.pi * (np.arange(1500)[:, None] + 0.5) / 1500
    phi = np.pi * (np.arange(180)[None] + 0.5) / 180
    sine, c = np.sin(angle), np.cos(angle)
    h = np.stack([sine * np.cos(phi) + math.sqrt(1 - cosine**2), sine * np.sin(phi), c + cosine + 0 * phi])
    squared = (h[0] ** 2 + h[1] ** 2) / (h**2).sum(0)
    distribution = (2 + 1 / alpha) * squared ** (0.5 / alpha) / (2 * np.pi)
    masking = 1 + sheen_masking(np, np.array(cosine), alpha) + sheen_masking(np, c, alpha)
    return float((distribution / (masking * 4 * cosine) * sine).mean() * 0.5 * np.pi * 2 * np.pi)


class Gltf(mi.BSDF):
    """How a material of glTF reflects and refracts."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)

        def get(name, otherwise):
            return float(props[name]) if name in props else otherwise

        self.base = mi.Color3f(*(get(f"base_{c}", 1.0) for c in "rgb"))
        self.metallic, self.transmission = get("metallic", 0.0), get("transmission", 0.0)
        self.alpha = max(get("roughness", 1.0) ** 2, 0.001)
        self.index = get("index", 1.5)
        self.f0 = ((self.index - 1) / (self.index + 1)) ** 2
        self.coat = get("coat", 0.0)
        self.coat_alpha = max(get("coat_roughness", 0.0) ** 2, 0.001)
        self.strength, self.rotation = get("anisotropy", 0.0), get("rotation", 0.0)
        self.along = self.alpha + (1 - self.alpha) * self.strength**2
        self.sheen = mi.Color3f(*(get(f"sheen_{c}", 0.0) for c in "rgb"))
        self.has_sheen = any(get(f"sheen_{c}", 0.0) for c in "rgb")
        self.sheen_alpha = max(get("sheen_roughness", 0.0) ** 2, 0.01)
        self.film, self.film_of = get("film", 0.0), (get("film_index", 1.3), get("film_thickness", 400.0))
        self.film_bases = [[self.f0] * 3, [get(f"base_{c}", 1.0) for c in "rgb"]]
        tables = np.concatenate([white_lobe(self.alpha), white_lobe(self.coat_alpha)], axis=1)[None]
        tables = np.concatenate([np.repeat(tables, AZIMUTHS, 0), self.layers()], axis=2)
        self.table = mi.Texture2f(mi.TensorXf(tables.astype(np.float32)))
        both = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide if self.transmission else mi.BSDFFlags.FrontSide
        self.m_components = [mi.BSDFFlags.GlossyReflection | both, mi.BSDFFlags.DiffuseReflection | both]
        if self.transmission:
            self.m_components.append(mi.BSDFFlags.GlossyTransmission | both)
        self.m_flags = self.m_components[0]
        for flags in self.m_components:
            self.m_flags = self.m_flags | flags

    def layers(self):
        """By azimuth and cosine of the view: white facets' two numbers, two films' means of colours, and white sheen's."""
        table = np.zeros((AZIMUTHS, COSINES, 9))
        for i in range(COSINES if self.strength or self.film or self.has_sheen else 0):
            c = max((i / (COSINES - 1)) ** 2, 1e-4)
            sine = math.sqrt(1 - c * c)
            if self.has_sheen:
                table[:, i, 8] = white_sheen(c, self.sheen_alpha)
            for k in range(AZIMUTHS if self.strength else 1):
                x = k / (AZIMUTHS - 1)
                view = np.array([sine * x, sine * math.sqrt(1 - x * x), c])
                weights, cosines = facets(view, (self.along, self.alpha), *((64, 96) if self.strength else (192, 256)))
                f = (1 - cosines) ** 5
                found = [(weights * (1 - f)).mean(), (weights * f).mean()]
                for base in self.film_bases:
                    colors = film(np, *self.film_of, base, cosines) if self.film else [0 * f] * 3
                    found += [(weights * color).mean() / weights.mean() for color in colors]
                rows = slice(k, k + 1) if self.strength else slice(None)
                table[rows, i, :8] = found
        return table

    def parts(self, wi):
        """Reflectances along the normal and at grazing angles, what is diffuse, the coat's share, and the choices."""
        place = dr.sqrt(dr.clip(wi.z, 0, 1))
        azimuth = dr.clip(dr.abs(wi.x) / dr.maximum(dr.sqrt(wi.x * wi.x + wi.y * wi.y), 1e-6), 0, 1)
        # Texels have their centres at halves.
        at = mi.Point2f((place * (COSINES - 1) + 0.5) / COSINES, (azimuth * (AZIMUTHS - 1) + 0.5) / AZIMUTHS)
        along, grazing, coat_along, coat_grazing, *own, sheen_share = self.table.eval(at)
        if self.strength:
            along, grazing = own[:2]
        white = along + grazing
        more = dr.select(self.transmission > 0, 0.0, (1 - white) / white)
        dielectric, metal = 1 + self.f0 * more, 1 + self.base * more
        f0 = dr.lerp(mi.Color3f(self.f0 * dielectric), self.base * metal, self.metallic)
        f90 = dr.lerp(mi.Color3f(dielectric), metal, self.metallic)
        left = dr.maximum(1 - (self.f0 * along + grazing) * dielectric, 0)
        share = f0 * along + f90 * grazing
        self.films = []
        if self.film:
            means = [mi.Color3f(*own[2:5]), mi.Color3f(*own[5:8])]
            self.films = [1 + mean * more for mean in means]
            of_films = [white * mean * brighter for mean, brighter in zip(means, self.films)]
            share = dr.lerp(share, dr.lerp(*of_films, self.metallic), self.film)
            left = dr.lerp(mi.Color3f(left), mi.Color3f(1 - dr.max(of_films[0])), self.film)
        coat_share = self.coat * (0.04 * coat_along + coat_grazing)
        gain = dr.maximum(sheen_share, 1)
        sheen = self.sheen * (1 - coat_share) / gain
        self.sheen_scale = sheen
        under = (1 - coat_share) * (1 - dr.max(self.sheen) * sheen_share / gain)
        below = self.base * (1 - self.metallic) * under
        diffuse, through = below * left * (1 - self.transmission), below * self.transmission
        gloss, of_sheen = dr.max(share) * under + dr.max(through), dr.max(sheen) * sheen_share
        total = gloss + coat_share + of_sheen + dr.max(diffuse)
        return f0, f90, diffuse, through, under, gloss / total, coat_share / total, of_sheen / total

    def root(self, along, across, d):
        return dr.sqrt(dr.square(along * d.x) + dr.square(across * d.y) + dr.square(d.z))

    def lobe(self, along, across, wi, wo, h):
        """Distribution and masking over four cosines, and the density of directions by facets that are seen."""
        squared = along * across
        q = squared * h.z * h.z + across / along * h.x * h.x + along / across * h.y * h.y
        distribution = squared / (dr.pi * q * q)
        ri, ro = (self.root(along, across, x) for x in (wi, wo))
        masked = 0.5 / dr.maximum(wo.z * ri + wi.z * ro, 1e-20)
        return distribution * masked, 0.5 * distribution / (wi.z + ri)

    def fresnel(self, f0, f90, cosine, eta):
        """By Schlick, with the cosine on the side outside; eta: index on this side over that beyond."""
        beyond = 1 - eta * eta * (1 - cosine * cosine)
        outside = dr.select(eta > 1, dr.sqrt(dr.maximum(beyond, 0)), cosine)
        f = dr.power(dr.clip(1 - outside, 0, 1), 5)
        found = dr.lerp(f0, f90, f)
        if self.film:
            dielectric, metal = (
                mi.Color3f(*film(dr, *self.film_of, base, dr.clip(outside, 0, 1))) * brighter
                for base, brighter in zip(self.film_bases, self.films)
            )
            found = dr.lerp(found, dr.lerp(dielectric, metal, self.metallic), self.film)
        return dr.select((eta > 1) & (beyond <= 0), mi.Color3f(1.0), found)

    def eta(self, inside):
        return dr.select(inside, self.index, 1 / self.index) if self.transmission else mi.Float(0.5)

    def evaluated(self, wi, wo, inside):
        """Of reflection: the value times the cosine, and the density; both directions above."""
        f0, f90, diffuse, _, under, gloss, coat, of_sheen = self.parts(wi)
        h = dr.normalize(wi + wo)
        value, density = self.lobe(self.along, self.alpha, wi, wo, h)
        fresnel = self.fresnel(f0, f90, dr.dot(wi, h), self.eta(inside))
        value = fresnel * value * under + diffuse / dr.pi
        density = density * gloss * (dr.max(fresnel) if self.transmission else 1.0)
        if self.coat:
            f = dr.power(dr.clip(1 - dr.dot(wi, h), 0, 1), 5)
            coated, by_coat = self.lobe(self.coat_alpha, self.coat_alpha, wi, wo, h)
            value += self.coat * dr.lerp(0.04, 1.0, f) * coated
            density += by_coat * coat
        if self.has_sheen:
            squared = dr.maximum(h.x * h.x + h.y * h.y, 1e-20)
            distribution = (2 + 1 / self.sheen_alpha) * dr.power(squared, 0.5 / self.sheen_alpha) / (2 * dr.pi)
            masking = 1 + sheen_masking(dr, wi.z, self.sheen_alpha) + sheen_masking(dr, wo.z, self.sheen_alpha)
            value += self.sheen_scale * (distribution / (masking * 4 * wi.z * dr.maximum(wo.z, 1e-6)))
        density += of_sheen / (2 * dr.pi)
        density += (1 - gloss - coat - of_sheen) * wo.z / dr.pi
        is_above = (wi.z > 0) & (wo.z > 0)
        return dr.select(is_above, value * wo.z, 0.0), dr.select(is_above, density, 0.0)

    def turned(self, si):
        """The view on the upper side, and whether it is within the body."""
        inside = si.wi.z < 0
        wi = mi.Vector3f(si.wi)
        if self.transmission:
            wi.z = dr.abs(wi.z)
        wi.z = dr.select(wi.z > 0, dr.maximum(wi.z, 1e-4), wi.z)
        return self.in_frame(wi, -self.rotation), inside

    def in_frame(self, v, angle):
        """Turned about the normal, so that x is the direction of the anisotropy, and back."""
        c, s = math.cos(angle), math.sin(angle)
        return mi.Vector3f(c * v.x - s * v.y, s * v.x + c * v.y, v.z) if self.strength else v

    def sample(self, ctx, si, sample1, sample2, active):
        wi, inside = self.turned(si)
        f0, f90, _, through, _, gloss, coat, of_sheen = self.parts(wi)
        is_gloss, is_coat = sample1 < gloss, (sample1 >= gloss) & (sample1 < gloss + coat)
        is_sheen = (sample1 >= gloss + coat) & (sample1 < gloss + coat + of_sheen)
        along_x, along_y = (dr.select(is_coat, self.coat_alpha, alpha) for alpha in (self.along, self.alpha))
        stretched = dr.normalize(mi.Vector3f(along_x * wi.x, along_y * wi.y, wi.z))
        height = 1 - sample2.y * (1 + stretched.z)
        level = dr.safe_sqrt((1 - height) * (1 + height))
        sine, cosine = dr.sincos(2 * dr.pi * sample2.x)
        h = mi.Vector3f(level * cosine, level * sine, height) + stretched
        h = dr.normalize(mi.Vector3f(along_x * h.x, along_y * h.y, dr.maximum(h.z, 0)))
        along = dr.dot(wi, h)
        reflected = dr.normalize(2 * along * h - wi)
        wo = dr.select(is_gloss | is_coat, reflected, mi.warp.square_to_cosine_hemisphere(sample2))
        wo = dr.select(is_sheen, mi.warp.square_to_uniform_hemisphere(sample2), wo)
        eta = self.eta(inside)
        bs = dr.zeros(mi.BSDFSample3f)
        fresnel = self.fresnel(f0, f90, along, eta)
        chance = dr.max(fresnel)
        # What is left of the number that chose the lobe chooses anew.
        crosses = is_gloss & (sample1 / dr.maximum(gloss, 1e-9) >= chance) & (self.transmission > 0)
        beyond = dr.safe_sqrt(1 - eta * eta * (1 - along * along))
        refracted = dr.normalize((eta * along - beyond) * h - eta * wi)
        wo = dr.select(crosses, refracted, wo)
        value, density = self.evaluated(wi, wo, inside)
        weight = dr.select(density > 0, value / density, 0.0)
        below = dr.maximum(-wo.z, 0)
        unmasked = 2 * below / dr.maximum(below + self.root(self.along, self.alpha, wo), 1e-20)
        passed = through * (1 - fresnel) * (unmasked * eta * eta / (dr.maximum(1 - chance, 1e-6) * gloss))
        weight = dr.select(crosses, dr.select(wo.z < 0, passed, 0.0), weight)
        # No lamp's ray brings what comes through facets: as if it were sharp.
        bs.pdf = dr.select(crosses, 1.0, density)
        bs.sampled_type = dr.select(
            crosses, mi.UInt32(+mi.BSDFFlags.DeltaTransmission), mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        )
        bs.eta = dr.select(crosses, 1 / eta, 1.0)
        if self.transmission:
            wo.z = dr.select(inside, -wo.z, wo.z)
        bs.wo = self.in_frame(wo, self.rotation)
        return bs, weight & (active & (bs.pdf > 0))

    def both(self, si, wo, active):
        wi, inside = self.turned(si)
        wo = self.in_frame(mi.Vector3f(wo), -self.rotation)
        if self.transmission:
            wo.z = dr.select(inside, -wo.z, wo.z)
        value, density = self.evaluated(wi, wo, inside)
        return value & active, dr.select(active, density, 0.0)

    def eval(self, ctx, si, wo, active):
        return self.both(si, wo, active)[0]

    def pdf(self, ctx, si, wo, active):
        return self.both(si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active):
        return self.both(si, wo, active)

    def to_string(self):
        return "Gltf[]"


mi.register_bsdf("gltf", Gltf)


def sphere(at, radius=1.0, rows=192):
    """Positions, normals and triangles."""
    down, around = np.meshgrid(
        np.pi * np.arange(rows + 1) / rows, np.pi * np.arange(2 * rows + 1) / rows, indexing="ij"
    )
    normals = np.stack([np.sin(down) * np.cos(around), np.cos(down), np.sin(down) * np.sin(around)], -1).reshape(-1, 3)
    corner = np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)[None]
    below = corner + 2 * rows + 1
    upper = np.stack([corner, corner + 1, below], -1)[1:].reshape(-1, 3)
    lower = np.stack([corner + 1, below + 1, below], -1)[:-1].reshape(-1, 3)
    return np.array(at) + radius * normals, normals, np.concatenate([upper, lower])


def quad(corner, u, v):
    """Positions, normals and triangles of a parallelogram, which faces u x v."""
    corner, u, v = (np.array(x, float) for x in (corner, u, v))
    n = np.cross(u, v)
    normals = np.tile(n / np.linalg.norm(n), (4, 1))
    return np.stack([corner, corner + u, corner + u + v, corner + v]), normals, np.array([[0, 1, 2], [0, 2, 3]])


GREY = {"base": (0.5, 0.5, 0.5), "weight": 0.0}
FLOOR = (quad((-12, -1, 12), (24, 0, 0), (0, 0, -24)), GREY)


def row_of(material, **more):
    """Three spheres over roughness, on a floor."""
    spheres = [(sphere((2.3 * i, 0, 0)), {**material, "roughness": r, **more}) for i, r in zip((-1, 0, 1), (0.1, 0.4, 0.8))]
    return [FLOOR, *spheres]


def walls(door=False):
    """The inside of a box from -2 to 2; with a door the front is open a little."""
    white, red, green = ({"base": c, "weight": 0.0} for c in ((0.75,) * 3, (0.6, 0.1, 0.1), (0.1, 0.6, 0.1)))
    all_walls = [
        (quad((-2, -2, 2), (4, 0, 0), (0, 0, -4)), white),
        (quad((-2, 2, -2), (4, 0, 0), (0, 0, 4)), white),
        (quad((-2, -2, -2), (4, 0, 0), (0, 4, 0)), white),
        (quad((-2, -2, 2), (0, 0, -4), (0, 4, 0)), red),
        (quad((2, -2, -2), (0, 0, 4), (0, 4, 0)), green),
    ]
    if door:
        all_walls.append((quad((-2, -2, 2), (2.5, 0, 0), (0, 4, 0)), white))
        all_walls.append((quad((0.5, 0.5, 2), (1.5, 0, 0), (0, 1.5, 0)), white))
    return all_walls


def brushed(at, material, rows=192):
    """A sphere with coordinates around it, and tangents along them."""
    around = (np.pi * np.arange(2 * rows + 1) / rows)[None] + np.zeros((rows + 1, 1))
    tangents = np.stack([-np.sin(around), 0 * around, np.cos(around), 0 * around + 1], -1).reshape(-1, 4)
    uv = np.stack([around / (2 * np.pi), (np.arange(rows + 1) / rows)[:, None] + 0 * around], -1).reshape(-1, 2)
    return sphere(at, rows=rows), {**material, "uv": uv, "tangents": tangents}


METAL = {"base": (0.95, 0.75, 0.5), "metallic": 1.0}
PLASTIC = {"base": (0.2, 0.4, 0.7)}
GLASS = {"base": (1, 1, 1), "transmission": 1.0, "roughness": 0.0}
LAMP = (quad((-0.7, 1.98, -0.7), (1.4, 0, 0), (0, 0, 1.4)), {"base": (0, 0, 0), "weight": 0.0, "emission": 12.0})
VIEW = ((0.5, 2.2, 8.0), (0, -0.2, 0), 42)
SCENES = {
    "metals": (row_of(METAL), "env", VIEW),
    "plastics": (row_of(PLASTIC), "env", VIEW),
    "coated": (row_of(PLASTIC, coat=1.0, coat_roughness=0.1), "env", VIEW),
    "glass": ([FLOOR, (sphere((0, 0, 0)), GLASS)], "env", VIEW),
    "rough-glass": ([FLOOR, (sphere((0, 0, 0)), {**GLASS, "roughness": 0.45, "base": (0.9, 0.95, 0.8)})], "env", VIEW),
    "glass-metal": (
        [FLOOR, (sphere((-1.1, 0, 0.3)), GLASS), (sphere((1.1, 0, -0.3)), {**METAL, "roughness": 0.15})],
        "env",
        VIEW,
    ),
    "box": ([*walls(), LAMP, (sphere((0.7, -1.2, 0.3), 0.8), {**METAL, "roughness": 0.3})], None, ((0, 0, 7), (0, 0, 0), 40)),
    "door": (walls(door=True), "env", ((-1.5, 0, 1.7), (0.5, -0.5, -2), 75)),
    "chain": (
        [FLOOR] + [(sphere((0.9 * i - 2.7, -0.5, 0.5 * (i % 2)), 0.5, 96), m) for i, m in enumerate([METAL, PLASTIC, {**PLASTIC, "coat": 0.7}] * 2)],
        "env",
        VIEW,
    ),
    "mtl": (
        [
            *walls(),
            # Faces of OBJ files have two sides, so the lamp is closed.
            (sphere((0, 1.4, 0), 0.35, 16), {"base": (0, 0, 0), "weight": 0.0, "emission": 12.0}),
            (sphere((-1.1, -1.3, -0.5), 0.7, 96), {**METAL, "roughness": 0.3}),
            (sphere((0.0, -1.4, 0.7), 0.6, 96), {**PLASTIC, "roughness": 0.4, "exponent": True}),
            (sphere((1.1, -1.3, -0.3), 0.7, 96), {**PLASTIC, "roughness": 0.6, "coat": 1.0, "coat_roughness": 0.2}),
        ],
        None,
        ((0, 0, 7), (0, 0, 0), 40),
    ),
    # Its own camera.
    "teapots": (None, "env", ((0, 20, 0), (0, 19.7126521, -0.9578263), 46.8265)),
    "sheen": (
        [FLOOR]
        + [
            (sphere((2.3 * i, 0, 0)), {"base": (0.3, 0.1, 0.1), "sheen": (0.9, 0.8, 0.6), "sheen_roughness": r, **more})
            for i, r, more in ((-1, 0.3, {}), (0, 0.6, {}), (1, 1.0, {"coat": 0.8, "coat_roughness": 0.2}))
        ],
        "env",
        VIEW,
    ),
    "anisotropy": (
        [FLOOR]
        + [
            brushed((2.3 * i, 0, 0), {**base, "roughness": r, "anisotropy": strength, "rotation": rotation})
            for i, base, r, strength, rotation in (
                (-1, METAL, 0.25, 0.8, 0.0), (0, METAL, 0.4, 0.6, 1.0), (1, PLASTIC, 0.3, 0.9, math.pi / 2)
            )
        ],
        "env",
        VIEW,
    ),
    "iridescence": (
        [FLOOR]
        + [
            (sphere((2.3 * i, 0, 0)), {**base, "roughness": r, "film": 1.0, "film_index": index, "film_thickness": t})
            for i, base, r, index, t in (
                (-1, METAL, 0.3, 1.5, 300.0), (0, {"base": (0.05,) * 3}, 0.15, 2.0, 450.0), (1, PLASTIC, 0.5, 1.8, 700.0)
            )
        ],
        "env",
        VIEW,
    ),
}


def path_file(view, folder):
    """The camera path."""
    position, target, fov = view
    keyframe = {"time": 0, "position": position, "target": target}
    (folder / "path.json").write_text(json.dumps({"fov_y_degrees": fov, "up": [0, 1, 0], "keyframes": [keyframe]}))


def obj(parts, folder):
    """The scene as an OBJ file with a library of materials. Returns its path.

    Matt materials have `illum 1`, metals and plastics roughness (Pr) or an exponent (Ns), whose lobe is as wide where
    the square of the roughness is the root of 2 / (Ns + 2).
    """
    lines, library, count = ["mtllib scene.mtl"], [], 1
    for number, ((positions, normals, triangles), m) in enumerate(parts):
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in positions]
        lines += [f"vn {x:.9g} {y:.9g} {z:.9g}" for x, y, z in normals]
        lines.append(f"usemtl {number}")
        lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in triangles + count]
        count += len(positions)
        library += [f"newmtl {number}", "Kd {} {} {}".format(*m["base"])]
        if "emission" in m:
            library.append("Ke {0} {0} {0}".format(m["emission"]))
        if "weight" in m:
            library.append("illum 1")
        elif m.get("exponent"):
            library += ["illum 2", "Ks 0.04 0.04 0.04", f"Ns {2 / m['roughness'] ** 4 - 2}"]
        else:
            library += ["illum 2", "Ks 1 1 1", "Ni 1.5", f"Pr {m['roughness']}", f"Pm {m.get('metallic', 0)}"]
            library += [f"Pc {m.get('coat', 0)}", f"Pcr {m.get('coat_roughness', 0)}"]
    (folder / "scene.mtl").write_text("\n".join(library) + "\n")
    (folder / "scene.obj").write_text("\n".join(lines) + "\n")
    return folder / "scene.obj"


def teapots(scenes):
    """The parts of TeapotsGalore.gltf, each instance where it stands."""
    helpers = beside("mitsuba.py")
    folder = scenes / "teapots_instanced"
    document = json.loads((folder / "TeapotsGalore.gltf").read_text())
    data = [(folder / buffer["uri"]).read_bytes() for buffer in document["buffers"]]
    parts = []

    def array(index):
        buffer = document["bufferViews"][document["accessors"][index]["bufferView"]]["buffer"]
        return helpers.accessor(document, data[buffer], index).astype(np.float64)

    def visit(index, above):
        node = document["nodes"][index]
        world = above @ helpers.matrix(node)
        places = [np.eye(4)]
        instances = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if instances:
            columns = {name.lower(): array(i).tolist() for name, i in instances["attributes"].items()}
            rows = (dict(zip(columns, values)) for values in zip(*columns.values()))
            places = [helpers.matrix(row) for row in rows]
        if "mesh" in node:
            (primitive,) = document["meshes"][node["mesh"]]["primitives"]
            positions, normals = (array(primitive["attributes"][name]) for name in ("POSITION", "NORMAL"))
            triangles = array(primitive["indices"]).astype(int).reshape(-1, 3)
            matrices = [world @ place for place in places]
            moved = [positions @ m[:3, :3].T + m[:3, 3] for m in matrices]
            turned = [normals @ np.linalg.inv(m[:3, :3]) for m in matrices]
            turned = [n / np.linalg.norm(n, axis=1, keepdims=True) for n in turned]
            indices = [triangles + i * len(positions) for i in range(len(places))]
            surface = document["materials"][primitive["material"]]["pbrMetallicRoughness"]
            material = {"base": surface["baseColorFactor"][:3], "metallic": surface["metallicFactor"]}
            material["roughness"] = surface["roughnessFactor"]
            parts.append((tuple(map(np.concatenate, (moved, turned, indices))), material))
        for child in node.get("children", ()):
            visit(child, world)

    for root in document["scenes"][0]["nodes"]:
        visit(root, np.eye(4))
    return parts


def gltf(parts, folder):
    """The scene as a glTF file. Returns its path."""
    blob, views, accessors, primitives, materials = b"", [], [], [], []

    def add(array, kind, component):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "type": kind})
        accessors[-1]["count"] = array.size if kind == "SCALAR" else len(array)
        if kind != "SCALAR":
            accessors[-1] |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        blob += array.tobytes()
        return len(accessors) - 1

    for (positions, normals, triangles), m in parts:
        attributes = {
            "POSITION": add(positions.astype(np.float32), "VEC3", 5126),
            "NORMAL": add(normals.astype(np.float32), "VEC3", 5126),
        }
        if "tangents" in m:
            attributes["TANGENT"] = add(m["tangents"].astype(np.float32), "VEC4", 5126)
            attributes["TEXCOORD_0"] = add(m["uv"].astype(np.float32), "VEC2", 5126)
        indices = add(triangles.astype(np.uint32), "SCALAR", 5125)
        primitives.append({"attributes": attributes, "indices": indices, "material": len(materials)})
        extensions = {"KHR_materials_specular": {"specularFactor": m["weight"]}} if "weight" in m else {}
        if "coat" in m:
            coat = {"clearcoatFactor": m["coat"], "clearcoatRoughnessFactor": m.get("coat_roughness", 0.0)}
            extensions["KHR_materials_clearcoat"] = coat
        if "sheen" in m:
            sheen = {"sheenColorFactor": m["sheen"], "sheenRoughnessFactor": m["sheen_roughness"]}
            extensions["KHR_materials_sheen"] = sheen
        if "anisotropy" in m:
            stretch = {"anisotropyStrength": m["anisotropy"], "anisotropyRotation": m["rotation"]}
            extensions["KHR_materials_anisotropy"] = stretch
        if "film" in m:
            extensions["KHR_materials_iridescence"] = {
                "iridescenceFactor": m["film"],
                "iridescenceIor": m["film_index"],
                "iridescenceThicknessMaximum": m["film_thickness"],
            }
        if "transmission" in m:
            extensions["KHR_materials_transmission"] = {"transmissionFactor": m["transmission"]}
            extensions["KHR_materials_volume"] = {"thicknessFactor": 1.0}
        if "emission" in m:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": m["emission"]}
        materials.append(
            {
                "doubleSided": "transmission" not in m and "emission" not in m,
                "emissiveFactor": [1.0 if "emission" in m else 0.0] * 3,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*m["base"], 1.0],
                    "metallicFactor": m.get("metallic", 0.0),
                    "roughnessFactor": m.get("roughness", 1.0),
                },
                "extensions": extensions,
            }
        )
    used = sorted({name for material in materials for name in material["extensions"]})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "extensionsUsed": used,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": "scene.bin", "byteLength": len(blob)}],
    }
    (folder / "scene.bin").write_bytes(blob)
    (folder / "scene.gltf").write_text(json.dumps(document))
    return folder / "scene.gltf"


def theirs(parts, environment, view, bounces, control):
    """The scene for Mitsuba."""
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": 2 + bounces, "rr_depth": 1000}}
    for number, ((positions, normals, triangles), m) in enumerate(parts):
        own = {"type": "gltf", **{f"base_{c}": x for c, x in zip("rgb", m["base"])}}
        own |= {k: m[k] for k in ("metallic", "transmission", "coat", "coat_roughness") if k in m}
        own["roughness"] = m.get("roughness", 1.0) + (0.3 if control == "roughness" else 0.0)
        own["index"] = 1.4 if control == "index" else 1.5
        own |= {k: m[k] for k in ("sheen_roughness", "anisotropy", "rotation", "film", "film_index", "film_thickness") if k in m}
        own |= {f"sheen_{c}": x for c, x in zip("rgb", m.get("sheen", ()))}
        if control == "sheen" and "sheen" in m:
            own["sheen_roughness"] = 0.5 * m["sheen_roughness"]
        if control == "anisotropy" and "anisotropy" in m:
            own["anisotropy"] = 0.25 * m["anisotropy"]
        if control == "film" and "film" in m:
            own["film_thickness"] = m["film_thickness"] + 100
        if "weight" in m:
            own = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(m["base"])}}
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(own if "transmission" in m else {"type": "twosided", "bsdf": own})
        if "emission" in m:
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": m["emission"]}})
        mesh = mi.Mesh(f"part {number}", len(positions), len(triangles), has_vertex_normals=True, has_vertex_texcoords="uv" in m, props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = positions.astype(np.float32).ravel()
        parameters["vertex_normals"] = normals.astype(np.float32).ravel()
        if "uv" in m:
            parameters["vertex_texcoords"] = m["uv"].astype(np.float32).ravel()
        parameters["faces"] = triangles.astype(np.uint32).ravel()
        parameters.update()
        scene[f"part{number}"] = mesh
    if environment:
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        scene["environment"] = {"type": "envmap", "filename": str(environment), "to_world": turn}
    position, target, fov = view
    scene["sensor"] = {
        "type": "perspective",
        "fov": float(fov),
        "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(position, target, [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}},
        "sampler": {"type": "independent"},
    }
    return mi.load_dict(scene)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=pathlib.Path, required=True, help="folder with env/")
    parser.add_argument("--brickwalk", default="target/release/brickwalk", help="default target/release/brickwalk")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="folder for scenes and pictures")
    parser.add_argument("--spp", type=int, default=1024, help="samples a pixel of both (default 1024)")
    parser.add_argument("--cases", default=",".join(SCENES), help=f"scenes (default {','.join(SCENES)})")
    parser.add_argument("--bounces", default="2,4,8", help="bounces of each (default 2,4,8)")
    parser.add_argument("--control", choices=list(CONTROLS), help="tell Mitsuba something wrong (default: nothing)")
    options = parser.parse_args()
    helpers = beside("mitsuba.py")
    failed = count = 0
    print("| scene | bounces | mean | channel | worst tile | FLIP | FLIP of the noise | brickwalk, s | Mitsuba, s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for case in options.cases.split(","):
        if options.control and case not in CONTROLS[options.control]:
            continue
        parts, light, view = SCENES[case]
        environment = options.scenes / "env" / "venice_sunset_1k.hdr" if light else None
        folder = options.output / case
        folder.mkdir(parents=True, exist_ok=True)
        path_file(view, folder)
        if case == "teapots":
            parts, model = teapots(options.scenes), options.scenes / "teapots_instanced" / "TeapotsGalore.gltf"
        else:
            model = (obj if case == "mtl" else gltf)(parts, folder)
        bricks = folder / "scene.bricks"
        words = [options.brickwalk, "convert", model, "-o", bricks, "-q"]
        subprocess.run([str(word) for word in words], check=True)
        for bounces in map(int, options.bounces.split(",")):
            own = folder / f"ours-{bounces}-{options.spp}"
            words = [options.brickwalk, "walk", bricks, "-o", own, "--path", folder / "path.json", "--frames", "1", "-q"]
            words += ["--size", f"{SIZE[0]}x{SIZE[1]}", "--quality", "exact", "--spp", options.spp, "--aov"]
            words += ["--effects", "path", "--bounces", bounces, "--diffuse-rays", "1", "--sun-intensity", "0"]
            words += ["--rotation", "full", "--cache", "100%"]
            words += ["--environment", environment] if environment else ["--sky-intensity", "0"]
            start = helpers.processor_time()
            if not (own / "frames" / "0000.exr").exists():
                subprocess.run([str(word) for word in words], check=True)
            seconds = helpers.processor_time() - start
            scene = theirs(parts, environment, view, bounces, options.control)
            start = helpers.time.process_time()
            batches = [
                np.array(mi.render(scene, spp=options.spp // BATCHES, seed=i)).astype(np.float64)[..., :3]
                for i in range(BATCHES)
            ]
            their_seconds = helpers.time.process_time() - start
            picture = np.mean(batches, axis=0)
            name = "-".join(filter(None, ["mitsuba", options.control, str(bounces)]))
            reference, half = folder / f"{name}.exr", folder / f"{name}-half.exr"
            mi.Bitmap(picture.astype(np.float32)).write(str(reference))
            # Two halves differ by twice the noise of the whole.
            halves = np.mean(batches[::2], axis=0) - np.mean(batches[1::2], axis=0)
            mi.Bitmap(np.maximum(picture + halves / math.sqrt(2), 0).astype(np.float32)).write(str(half))
            mine = helpers.read(mi, own / "frames" / "0000.exr")

            def flip(a, b):
                said = subprocess.run([options.brickwalk, "compare", str(a), str(b), "--json"], capture_output=True, check=True)
                return json.loads(said.stdout)["flip"]

            mean = mine.mean() / picture.mean() - 1
            means = np.array([batch.mean() for batch in batches])
            # Both pictures have noise of about one size.
            error = math.sqrt(2 / BATCHES) * means.std(ddof=1) / means.mean()
            channels = mine.mean(axis=(0, 1)) / picture.mean(axis=(0, 1)) - 1
            tiles = [x.reshape(6, 20, 8, 20, 3).mean(axis=(1, 3, 4)) for x in (mine, picture)]
            worst = np.abs(tiles[0] / tiles[1] - 1)[tiles[1] > 0.05 * picture.mean()].max()
            errors = [flip(own / "frames" / "0000.exr", reference), flip(half, reference)]
            agrees = abs(mean) <= max(BOUND, ERRORS * error) and errors[0] <= NOISE * errors[1]
            count, failed = count + 1, failed + (agrees == bool(options.control))
            columns = [case, str(bounces), f"{100 * mean:+.2f} ± {100 * error:.2f} %"]
            columns += [f"{100 * channels[np.abs(channels).argmax()]:+.2f} %", f"{100 * worst:.1f} %"]
            columns += [f"{error:.4f}" for error in errors]
            print(f"| {' | '.join(columns)} | {seconds:.0f} | {their_seconds:.0f} |", flush=True)
    by = "more" if options.control else "no more"
    print(f"{count - failed} of {count} pictures differ by {by} than allowed", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("interrupted; the same command goes on")
