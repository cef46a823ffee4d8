"""Light transport of a Lambertian scene, estimated with Mitsuba's rays, lights and materials.

Everything is demodulated at the primary hit: divided by its albedo, that is, for a white surface
there. The estimators work on the lanes of one wavefront, one lane per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from experiments.rendering.guide import Guide


@dataclass(frozen=True)
class Lights:
    """What is known of a scene's emitters before a kernel is compiled."""

    environment: bool
    surfaces: bool

    @classmethod
    def of(cls, scene: Any) -> Lights:
        kinds = [emitter.is_environment() for emitter in scene.emitters()]
        return cls(any(kinds), not all(kinds))


@dataclass(frozen=True)
class Vertex:
    """A point of a path: `it` spawns rays, the shading `normal` faces the last vertex."""

    it: Any
    normal: Any

    def cosine_ray(self, point: Any) -> Any:
        """A ray in a cosine-distributed direction about the normal."""
        local = mi.warp.square_to_cosine_hemisphere(point)
        return self.it.spawn_ray(mi.Frame3f(self.normal).to_world(local))


def vertex_of(si: Any, direction: Any) -> Vertex:
    """The vertex where a ray of `direction` met the surface `si`."""
    normal = si.sh_frame.n
    facing = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
    return Vertex(mi.Interaction3f(si.t, si.time, si.wavelengths, si.p, si.n), facing)


def _power(a: Any, b: Any) -> Any:
    """The power heuristic of two densities, 0 where both are 0."""
    return a * a / dr.maximum(a * a + b * b, 1e-30)


def light_sample(scene: Any, vertex: Vertex, point: Any, mis: bool, active: Any) -> Any:
    """Next-event estimation: mean radiance of the cosine-weighted hemisphere, one light sample."""
    ds, weight = scene.sample_emitter_direction(vertex.it, point, False, active)
    density = dr.maximum(dr.dot(vertex.normal, ds.d), 0) * dr.inv_pi
    active = active & (density > 0) & (ds.pdf > 0) & (dr.max(weight) > 0)
    active &= scene.ray_test(vertex.it.spawn_ray_to(ds.p), False, active) ^ True
    share = dr.select(ds.delta, 1, _power(ds.pdf, density)) if mis else mi.Float(1)
    return dr.select(active, weight * density * share, 0)


def _light_share(scene: Any, vertex: Vertex, ray: Any, si: Any, active: Any) -> Any:
    """The weight of a light hit by a cosine-distributed ray, against `light_sample`."""
    ds = mi.DirectionSample3f(scene, si, vertex.it)
    density = dr.maximum(dr.dot(vertex.normal, ray.d), 0) * dr.inv_pi
    return _power(density, scene.pdf_emitter_direction(vertex.it, ds, active))


def light_met(scene: Any, vertex: Vertex, ray: Any, si: Any, active: Any) -> Any:
    """Radiance of a light that a cosine-distributed ray met, weighted against `light_sample`."""
    emitter = si.emitter(scene, active)
    if emitter is None:  # only in the scalar variant, which has one lane
        return mi.Color3f(0)
    active = active & (emitter != None)  # noqa: E711 (a comparison of every lane)
    radiance = emitter.eval(si, active)
    share = _light_share(scene, vertex, ray, si, active)
    return dr.select(active, radiance * share, 0)


def light_at_end(scene: Any, lights: Lights, vertex: Vertex, ray: Any, active: Any) -> Any:
    """`light_met` for a ray of which nothing else is needed: the fewest interactions."""
    if not lights.surfaces:
        active = active & (scene.ray_test(ray, False, active) ^ True)
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi = -ray.d
        return light_met(scene, vertex, ray, si, active)
    hit = scene.ray_intersect_preliminary(ray, False, active=active)
    found = hit.is_valid()
    useful = active & found
    if hit.shape is not None:  # None only in the scalar variant
        useful &= hit.shape.is_emitter()
    if lights.environment:
        useful |= active & (found ^ True)
    si = hit.compute_surface_interaction(ray, mi.RayFlags.Minimal, useful)
    return light_met(scene, vertex, ray, si, useful)


def albedo_of(si: Any, active: Any) -> Any:
    """Diffuse reflectance (Color3f) at a hit, 0 to 1."""
    if si.shape is None:  # only in the scalar variant
        return mi.Color3f(0)
    return dr.clip(si.bsdf().eval_diffuse_reflectance(si, active), 0, 1)


def indirect(
    scene: Any,
    lights: Lights,
    start: Vertex,
    points: Any,
    bounces: int,
    mis: bool,
    active: Any,
    guide: Guide | None = None,
    learning: bool = False,
) -> Any:
    """One sample of demodulated indirect light with `bounces` bounces after the primary hit.

    A `guide` draws the first direction and the first light; it records samples while `learning`.
    """
    total, throughput = mi.Color3f(0), mi.Color3f(1)
    point, weight, entry = points.next_2d(), mi.Float(1), mi.UInt32(0)
    if guide:
        point, weight, entry = guide.first.warp(point, guide.tile)
        throughput *= weight
    vertex, ray = start, start.cosine_ray(point)
    for bounce in range(bounces):
        si = scene.ray_intersect(
            ray, mi.RayFlags.UV | mi.RayFlags.ShadingFrame, False, active=active
        )
        if mis and bounce > 0:
            total += throughput * light_met(scene, vertex, ray, si, active)
        active &= si.is_valid()
        throughput *= dr.select(active, albedo_of(si, active), 0)
        active &= dr.max(throughput) > 0
        vertex, point = vertex_of(si, ray.d), points.next_2d()
        if guide and bounce == 0:
            point, share, second = guide.light.warp(point, guide.cell(si.p))
            lit = throughput * light_sample(scene, vertex, point, mis, active) * share
            if learning:
                guide.light.record(second, share, dr.mean(lit), active)
        else:
            lit = throughput * light_sample(scene, vertex, point, mis, active)
        total += lit
        if mis or bounce + 1 < bounces:
            ray = vertex.cosine_ray(points.next_2d())
    if mis:
        total += throughput * light_at_end(scene, lights, vertex, ray, active)
    if guide and learning:
        guide.first.record(entry, weight, dr.mean(total), True)
    return dr.select(dr.isfinite(total), total, 0)


def direct(scene: Any, lights: Lights, start: Vertex, points: Any, active: Any) -> Any:
    """One sample of demodulated direct light at the primary hit."""
    total = light_sample(scene, start, points.next_2d(), True, active)
    return total + light_at_end(scene, lights, start, start.cosine_ray(points.next_2d()), active)


def open_sky(scene: Any, start: Vertex, points: Any, distance: Any, active: Any) -> Any:
    """One sample of ambient occlusion: 1 where a cosine ray is free within `distance`."""
    ray = start.cosine_ray(points.next_2d())
    ray.maxt = mi.Float(distance)
    free = active & (scene.ray_test(ray, False, active) ^ True)
    return mi.Color3f(dr.select(free, mi.Float(1), 0))
