"""Runs the estimators of `transport` over the pixels of one view: means as numpy pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.render import transport
from experiments.render.camera import Camera
from experiments.render.guide import Guide
from experiments.render.sampling import Independent, Stratified

Image = NDArray[np.float32]


@dataclass
class Tracer:
    """The primary hits of one view, kept between kernels.

    `guides` holds float32 pictures `(H, W, C)` by the names of the layers.
    """

    scene: Any
    lights: transport.Lights
    width: int
    height: int
    start: transport.Vertex
    active: Any
    shape: Any
    guides: dict[str, Image]

    @classmethod
    def of(cls, scene: Any, camera: Camera, width: int, height: int) -> Tracer:
        """Trace the primary rays, through the pixel centres."""
        lane = dr.arange(mi.UInt32, width * height)
        ray = _primary_ray(camera, width, height, lane)
        si = scene.ray_intersect(ray, mi.RayFlags.UV | mi.RayFlags.ShadingFrame, True)
        hit = si.is_valid()
        emitter = si.emitter(scene)
        emission = dr.select(emitter != None, emitter.eval(si), 0)  # noqa: E711
        surface = hit & ~(dr.max(emission) > 0)
        albedo = dr.select(surface, transport.albedo_of(si, surface), 0)
        start = transport.vertex_of(si, ray.d)
        forward = mi.Vector3f(*(dr.opaque(mi.Float, float(v)) for v in camera.to_world[:3, 2]))
        depth = dr.dot(si.p - ray.o, forward)
        dr.eval(start.it, start.normal, surface, hit, albedo, emission, depth, si.shape)
        layers = {
            "albedo": albedo,
            "normal": dr.select(hit, start.normal, 0),
            "depth": dr.select(hit, depth, 0),
            "position": dr.select(hit, si.p, 0),
            "emission": emission,
            "mask": dr.select(surface, mi.Float(1), 0),
        }
        shape = (height, width, -1)
        guides = {k: np.array(v, np.float32).T.reshape(shape) for k, v in layers.items()}
        lights = transport.Lights.of(scene)
        return cls(scene, lights, width, height, start, mi.Bool(hit), si.shape, guides)

    def shows(self, name: str) -> NDArray[np.bool_]:
        """Where `(H, W)` the shape of a name is seen."""
        seen = np.zeros((self.height, self.width), bool)
        for shape in self.scene.shapes():
            if shape.id() == name:
                seen |= np.array(self.shape == mi.ShapePtr(shape)).reshape(seen.shape)
        return seen

    def _sums(
        self, estimate: Callable[[Any, Any], Any], spp: int, seed: int, first: int | None
    ) -> NDArray[np.float64]:
        """Sums `(H, W, 3)` of `spp` samples; from sample `first` of a sequence if it is given."""
        lane = dr.arange(mi.UInt32, self.width * self.height)
        seed, count = dr.opaque(mi.UInt32, seed), dr.opaque(mi.UInt32, spp)
        begin = dr.opaque(mi.UInt32, first or 0)
        generator = Independent.start(lane, seed)

        def body(i: Any, generator: Any, total: Any) -> tuple[Any, Any, Any]:
            points = Independent(generator) if first is None else Stratified(lane, seed, begin + i)
            total = total + estimate(points, mi.Bool(self.active))
            return i + 1, generator if first is not None else points.generator, total

        zero = dr.zeros(mi.Color3f, self.width * self.height)
        i = dr.zeros(mi.UInt32, self.width * self.height)
        _, _, total = dr.while_loop((i, generator, zero), lambda i, g, t: i < count, body)
        return np.array(total, np.float64).T.reshape(self.height, self.width, 3)

    def indirect(
        self,
        spp: int,
        seed: int,
        first: int | None = None,
        bounces: int = 1,
        mis: bool = True,
        guide: Guide | None = None,
        learning: bool = False,
    ) -> NDArray[np.float64]:
        """Sum of `spp` samples of demodulated indirect light, `(H, W, 3)` float64.

        From independent points, or from sample `first` of a scrambled sequence.
        """

        def estimate(points: Any, active: Any) -> Any:
            return transport.indirect(
                self.scene, self.lights, self.start, points, bounces, mis, active, guide, learning
            )

        return self._sums(estimate, spp, seed, first)

    def guide(self) -> Guide:
        """An untaught guide for this view."""
        mask = self.guides["mask"][..., 0] > 0
        return Guide.of(self.width, self.height, self.guides["position"], mask)

    def direct(self, spp: int, seed: int) -> NDArray[np.float64]:
        """Sum of `spp` samples of demodulated direct light, `(H, W, 3)` float64."""

        def estimate(points: Any, active: Any) -> Any:
            return transport.direct(self.scene, self.lights, self.start, points, active)

        return self._sums(estimate, spp, seed, 0)

    def occlusion(self, rays: int, distance: float, seed: int) -> Image:
        """Share `(H, W, 1)` of `rays` cosine-distributed rays that are free within `distance`."""
        far = dr.opaque(mi.Float, distance)

        def estimate(points: Any, active: Any) -> Any:
            return transport.open_sky(self.scene, self.start, points, far, active)

        return (self._sums(estimate, rays, seed, 0)[..., :1] / rays).astype(np.float32)


def _primary_ray(camera: Camera, width: int, height: int, lane: Any) -> Any:
    """The ray through the centre of pixel `lane`, counted along the rows."""
    columns = dr.opaque(mi.UInt32, width)
    y = lane // columns
    x = lane - y * columns
    slope_x, slope_y = (dr.opaque(mi.Float, s) for s in camera.slopes(width, height))
    sx, sy = dr.opaque(mi.Float, 2 / width), dr.opaque(mi.Float, 2 / height)
    local = mi.Vector3f(
        (1 - (mi.Float(x) + 0.5) * sx) * slope_x, (1 - (mi.Float(y) + 0.5) * sy) * slope_y, 1
    )
    m = [[dr.opaque(mi.Float, float(v)) for v in row] for row in camera.to_world[:3]]
    direction = mi.Vector3f(*(r[0] * local.x + r[1] * local.y + r[2] * local.z for r in m))
    return mi.Ray3f(mi.Point3f(*(r[3] for r in m)), dr.normalize(direction))
