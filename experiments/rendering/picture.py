"""Paths of all light through scenes of any material, as Cycles samples and records them.

A sample's place in its pixel is drawn with the density of Cycles' Blackman-Harris filter, so that
a pixel is the plain mean of samples of its own. With the radiance every path gives auxiliary
layers, which are as antialiased, defocused and noisy as the picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.rendering.camera import slopes
from experiments.rendering.sampling import Stratified, hash_32
from experiments.rendering.scenes.world import Finish
from jflnr.camera import Camera

LONGEST = 8  # rays of a path
ROULETTE = 2  # rays of a path before it may end by chance, as Cycles' do
CLAMP = 30.0  # of the sum of three colours: Blender's 10 for indirect light
SPECULAR = 0.075  # GGX alpha up to which the auxiliary layers follow a reflection
FILTER = 1.5  # pixels from the centre to the end of the filter
KNOTS = 1024
# Mean over the samples of a pixel, by the channels of each.
LAYERS = {
    "beauty": 3,
    "seen_albedo": 3,
    "seen_normal": 3,
    "normal": 3,
    "emission": 3,
    "environment": 3,
    "alpha": 1,
}

Images = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class Lens:
    """A thin lens: its radius, and the depth that is sharp, both in scene units."""

    radius: float = 0.0
    focus: float = 1.0


def filter_offsets() -> NDArray[np.float32]:
    """Quantiles `(KNOTS,)` of the distance to a pixel's centre along one axis, in pixels."""
    x = np.linspace(-FILTER, FILTER, 8 * KNOTS)
    t = np.pi * (x / FILTER + 1)
    terms = (0.35875 * t, -0.48829 * np.sin(t), 0.14128 / 2 * np.sin(2 * t))
    cumulative = (sum(terms) - 0.01168 / 3 * np.sin(3 * t)) / (2 * np.pi * 0.35875)
    return np.interp(np.linspace(0, 1, KNOTS), cumulative, x).astype(np.float32)


@dataclass
class Shading:
    """What the auxiliary layers need to know of the materials: an entry for each shape."""

    alpha: Any  # roughness of what reflects and transmits
    metallic: Any
    glass: Any
    coat: Any
    tint: Any  # Color3f, of metals and glass that have no texture
    tinted: Any

    @classmethod
    def of(cls, scene: Any, finishes: dict[str, Finish]) -> Shading:
        """For the shapes of a scene; those without a finish are diffuse."""
        shapes = scene.shapes()
        index = np.array([_entry(mi.ShapePtr(shape))[0] for shape in shapes], np.int64)
        values = np.zeros((int(index.max(initial=0)) + 1, 8), np.float32)
        for i, shape in zip(index, shapes, strict=True):
            finish = finishes.get(shape.id(), Finish())
            glass = finish.kind in ("glass", "pane")
            coat = finish.kind == "plastic" or finish.coat > 0
            metallic = 1.0 if finish.kind == "metal" else finish.metallic
            numbers = (finish.alpha, metallic, glass, coat)
            values[i] = (*numbers, *finish.tint, glass or finish.kind == "metal")
        columns: list[Any] = [mi.Float(v.copy()) for v in values.T]
        alpha, metallic, glass, coat, *tint, tinted = columns
        return cls(alpha, metallic, glass, coat, tint, tinted)

    def at(self, si: Any, active: Any) -> tuple[Any, Any, Any]:
        """Of a hit: albedo of what is rough, of what is smooth, and whether to follow the latter.

        As Cycles: it is followed where three quarters of what is reflected are specular.
        """
        entry = _entry(si.shape)
        get: Callable[[Any], Any] = lambda table: dr.gather(mi.Float, table, entry, active)
        colour = dr.clip(si.bsdf().eval_diffuse_reflectance(si, active), 0, 1)
        tint = mi.Color3f(*(get(channel) for channel in self.tint))
        colour = dr.select(get(self.tinted) > 0, tint, colour)
        metallic, glass = get(self.metallic), get(self.glass)
        grazing = (1 - dr.abs(mi.Frame3f.cos_theta(si.wi))) ** 5
        gloss = dr.select(get(self.alpha) >= 1, 0.0, 0.04 + 0.96 * grazing)
        metal = colour + (1 - colour) * grazing
        base = metal * metallic + mi.Color3f(gloss) * (1 - metallic)
        base = dr.select(glass > 0, colour, base)
        diffuse = colour * ((1 - metallic) * (1 - gloss))
        diffuse = dr.select(glass > 0, 0, diffuse)
        smooth = get(self.alpha) <= SPECULAR
        coat = dr.select(get(self.coat) > 0, 0.04 + 0.96 * grazing, 0)
        mirrored = dr.select(smooth, base, 0) * (1 - coat) + coat
        rough = (diffuse + dr.select(smooth, 0, base)) * (1 - coat)
        return rough, mirrored, 3 * dr.mean(rough) < dr.mean(mirrored)


@dataclass
class Film:
    """One view of a scene, ready to be sampled."""

    scene: Any
    camera: Camera
    width: int
    height: int
    shading: Shading
    lens: Lens = Lens()
    transparent: bool = False  # whether the environment is left out of what is seen directly
    exposure: float = 1.0  # radiance is multiplied by it before it is clamped

    def sample(self, spp: int, seed: int) -> Images:
        """Means `(H, W, C)` over `spp` samples per pixel of the stream `seed`."""
        lanes = self.width * self.height
        lane = dr.arange(mi.UInt32, lanes)
        stream, count = dr.opaque(mi.UInt32, seed), dr.opaque(mi.UInt32, spp)
        shoot = self._camera_rays(lane)
        # Blinded to the compiler, so that all views share one kernel.
        exposure = dr.opaque(mi.Float, self.exposure)
        clamp = dr.opaque(mi.Float, CLAMP)
        background = dr.opaque(mi.Float, 0.0 if self.transparent else 1.0)
        scene, shading, context = self.scene, self.shading, mi.BSDFContext()

        def body(s: Any) -> tuple[dict[str, Any]]:
            first = s["depth"] == 0
            start = hash_32(lane ^ hash_32(stream))
            points = Stratified(lane, stream, s["index"])
            points.seed = dr.select(first, start, s["seed"])
            fresh = shoot(points.next_2d(), points.next_2d())
            ray = mi.Ray3f(
                dr.select(first, fresh.o, s["origin"]), dr.select(first, fresh.d, s["direction"])
            )
            throughput = dr.select(first, 1, s["throughput"])
            followed = dr.select(first, 1, s["followed"])
            seeking = first | s["seeking"]
            delta = first | s["delta"]
            total = s["total"]

            si = scene.ray_intersect(ray, mi.RayFlags.All, False)
            hit = si.is_valid()
            # Light that the ray met, weighted against the sampling of lights.
            previous = dr.zeros(mi.Interaction3f)
            previous.p = s["origin"]
            emitter = si.emitter(scene)
            shines = emitter != None  # noqa: E711
            ds = mi.DirectionSample3f(scene, si, previous)
            density = scene.pdf_emitter_direction(previous, ds, shines & (delta ^ True))
            share = dr.select(delta, 1, s["pdf"] / dr.maximum(s["pdf"] + density, 1e-30))
            light = throughput * emitter.eval(si, shines) * (share * exposure)
            light = limited(light, s["depth"] >= 2, clamp)
            light *= dr.select(first & (hit ^ True), background, 1)
            light = dr.select(shines, light, 0)

            rough, mirrored, follow = shading.at(si, hit)
            facing = si.sh_frame.n
            facing = dr.select(dr.dot(facing, ray.d) > 0, -facing, facing)
            ends = hit & seeking & (follow ^ True)
            albedo = dr.select(seeking, followed * light, 0) + dr.select(ends, followed * rough, 0)
            seen = dr.select(ends, facing, 0)
            followed *= mirrored
            seeking &= hit & follow

            # Light sampled from here, and the next direction.
            bsdf = si.bsdf(ray)
            lit = hit & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            lit &= s["depth"] + 1 < LONGEST
            ds, weight = scene.sample_emitter_direction(si, points.next_2d(), True, lit)
            lit &= ds.pdf > 0
            choice, point = points.next_2d(), points.next_2d()
            value, pdf, sampled, change = bsdf.eval_pdf_sample(
                context, si, si.to_local(ds.d), choice.x, point, hit
            )
            share = dr.select(ds.delta, 1, ds.pdf / dr.maximum(ds.pdf + pdf, 1e-30))
            direct = throughput * value * weight * (share * exposure)
            direct = limited(dr.select(lit, direct, 0), s["depth"] >= 1, clamp)
            radiance = light + dr.select(dr.isfinite(direct), direct, 0)
            values = (
                *radiance, *albedo, *seen,
                *dr.select(first & hit, facing, 0),
                *dr.select(first & hit, light, 0),
                *dr.select(first & (hit ^ True), light, 0),
                dr.select(first & (hit | (background > 0)), mi.Float(1), 0),
            )  # fmt: skip
            total = [
                t + dr.select(dr.isfinite(v), v, 0) for t, v in zip(total, values, strict=True)
            ]

            throughput *= change
            depth = s["depth"] + 1
            strongest = dr.max(throughput)
            survival = dr.select(depth >= ROULETTE, dr.clip(dr.sqrt(strongest), 0.05, 1), 1)
            goes_on = hit & (depth < LONGEST) & (strongest > 0) & (choice.y < survival)
            new = si.spawn_ray(si.to_world(sampled.wo))
            return (
                {
                    "index": s["index"] + dr.select(goes_on, mi.UInt32(0), mi.UInt32(1)),
                    "depth": dr.select(goes_on, depth, 0),
                    "seed": points.seed,
                    "origin": new.o,
                    "direction": new.d,
                    "throughput": throughput / survival,
                    "pdf": sampled.pdf,
                    "delta": mi.has_flag(sampled.sampled_type, mi.BSDFFlags.Delta),
                    "seeking": seeking,
                    "followed": followed,
                    "total": total,
                },
            )

        state: Any = {
            "index": dr.zeros(mi.UInt32, lanes),
            "depth": dr.zeros(mi.UInt32, lanes),
            "seed": dr.zeros(mi.UInt32, lanes),
            "origin": dr.zeros(mi.Point3f, lanes),
            "direction": dr.zeros(mi.Vector3f, lanes),
            "throughput": dr.zeros(mi.Color3f, lanes),
            "pdf": dr.zeros(mi.Float, lanes),
            "delta": dr.zeros(mi.Bool, lanes),
            "seeking": dr.zeros(mi.Bool, lanes),
            "followed": dr.zeros(mi.Color3f, lanes),
            "total": [dr.zeros(mi.Float, lanes) for _ in range(sum(LAYERS.values()))],
        }
        (state,) = dr.while_loop((state,), lambda s: s["index"] < count, body)
        dr.eval(state["total"])  # at once: one by one, each would run the loop again
        planes = np.stack([np.array(t, np.float32) for t in state["total"]], -1) / spp
        planes = planes.reshape(self.height, self.width, -1)
        ends = np.cumsum(list(LAYERS.values()))
        return dict(zip(LAYERS, np.split(planes, ends[:-1], axis=-1), strict=True))

    def _camera_rays(self, lane: Any) -> Any:
        """A function of two points, of the filter and of the lens, to rays of the pixels."""
        offsets = mi.Float(filter_offsets())
        columns = dr.opaque(mi.UInt32, self.width)
        y = lane // columns
        x = lane - y * columns
        slope = [dr.opaque(mi.Float, s) for s in slopes(self.camera, self.width, self.height)]
        scale = [dr.opaque(mi.Float, 2 / n) for n in (self.width, self.height)]
        m = [[dr.opaque(mi.Float, float(v)) for v in row] for row in self.camera.to_world[:3]]
        radius = dr.opaque(mi.Float, self.lens.radius)
        focus = dr.opaque(mi.Float, self.lens.focus)

        def offset(u: Any) -> Any:
            place = u * (KNOTS - 1)
            i = dr.minimum(mi.UInt32(place), KNOTS - 2)
            low, high = (dr.gather(mi.Float, offsets, i + k) for k in (0, 1))
            return low + (place - mi.Float(i)) * (high - low)

        def world(v: Any) -> Any:
            return [r[0] * v[0] + r[1] * v[1] + r[2] * v[2] for r in m]

        def shoot(point: Any, aperture: Any) -> Any:
            px, py = mi.Float(x) + 0.5 + offset(point.x), mi.Float(y) + 0.5 + offset(point.y)
            disk = mi.warp.square_to_uniform_disk_concentric(aperture) * radius
            sharp = ((1 - px * scale[0]) * slope[0] * focus, (1 - py * scale[1]) * slope[1] * focus)
            local = (sharp[0] - disk.x, sharp[1] - disk.y, focus)
            origin = [o + r[3] for o, r in zip(world((disk.x, disk.y, 0.0)), m, strict=True)]
            return mi.Ray3f(mi.Point3f(*origin), dr.normalize(mi.Vector3f(*world(local))))

        return shoot


def _entry(shape: Any) -> Any:
    """The number by which Dr.Jit knows a shape."""
    return dr.reinterpret_array(mi.UInt32, shape)


def limited(light: Any, indirect: Any, clamp: Any) -> Any:
    """A contribution, scaled down where it is indirect and the sum of its colours exceeds that."""
    total = light[0] + light[1] + light[2]
    return light * dr.select(indirect & (total > clamp), clamp / dr.maximum(total, 1e-30), 1)
