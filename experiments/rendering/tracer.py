"""Runs the estimators of `transport` over the pixels of one view: means as numpy pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.rendering import transport
from experiments.rendering.camera import slopes
from experiments.rendering.guide import Guide
from experiments.rendering.sampling import Independent, Stratified
from jflnr.camera import Camera

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
    start: Any  # a Vertex of all lanes, or a list of one for each in the scalar variant
    active: Any
    shape: Any
    guides: dict[str, Image]

    @classmethod
    def of(cls, scene: Any, camera: Camera, width: int, height: int) -> Tracer:
        """Trace the primary rays, through the pixel centres."""
        start: Any
        if dr.is_jit_v(mi.Float):
            lanes = dr.arange(mi.UInt32, width * height)
            start, hit, shape, layers = _primary(scene, camera, width, height, lanes)
            dr.eval(start.it, start.normal, hit, shape, layers)
            pictures = {name: np.array(value, np.float32).T for name, value in layers.items()}
        else:
            lists = [_primary(scene, camera, width, height, i) for i in range(width * height)]
            start, hit, shape = ([lane[i] for lane in lists] for i in range(3))
            pictures = {
                name: np.array([lane[3][name] for lane in lists], np.float32)
                for name in lists[0][3]
            }
        guides = {k: v.reshape(height, width, -1) for k, v in pictures.items()}
        lights = transport.Lights.of(scene)
        return cls(scene, lights, width, height, start, hit, shape, guides)

    def shows(self, name: str) -> NDArray[np.bool_]:
        """Where `(H, W)` the shape of a name is seen."""
        seen = np.zeros((self.height, self.width), bool)
        for shape in self.scene.shapes():
            if shape.id() == name and dr.is_jit_v(mi.Float):
                seen |= np.array(self.shape == mi.ShapePtr(shape)).reshape(seen.shape)
            elif shape.id() == name:
                seen |= np.array([s == shape for s in self.shape]).reshape(seen.shape)
        return seen

    def _sums(
        self, estimate: Callable[[Any, Any, Any], Any], spp: int, seed: int, first: int | None
    ) -> NDArray[np.float64]:
        """Sums `(H, W, 3)` of `spp` samples; from sample `first` of a sequence if it is given."""
        if not dr.is_jit_v(mi.Float):
            return self._sums_one_by_one(estimate, spp, seed + (first or 0))
        lane = dr.arange(mi.UInt32, self.width * self.height)
        stream, count = dr.opaque(mi.UInt32, seed), dr.opaque(mi.UInt32, spp)
        begin = dr.opaque(mi.UInt32, first or 0)
        generator = Independent.start(lane, stream)

        def body(i: Any, generator: Any, total: Any) -> tuple[Any, Any, Any]:
            if first is None:
                points: Any = Independent(generator)
            else:
                points = Stratified(lane, stream, begin + i)
            total = total + estimate(self.start, points, mi.Bool(self.active))
            return i + 1, points.generator if first is None else generator, total

        zero = dr.zeros(mi.Color3f, self.width * self.height)
        index = dr.zeros(mi.UInt32, self.width * self.height)
        _, _, total = dr.while_loop((index, generator, zero), lambda i, g, t: i < count, body)
        return np.array(total, np.float64).T.reshape(self.height, self.width, 3)

    def _sums_one_by_one(
        self, estimate: Callable[[Any, Any, Any], Any], spp: int, seed: int
    ) -> NDArray[np.float64]:
        """The same in the scalar variant, of independent samples."""
        sums = np.zeros((self.width * self.height, 3))
        for lane, (start, active) in enumerate(zip(self.start, self.active, strict=True)):
            points = Independent(Independent.start(lane, seed))
            for _ in range(spp):
                sums[lane] += np.array(estimate(start, points, active), float).ravel()
        return sums.reshape(self.height, self.width, 3)

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

        def estimate(start: Any, points: Any, active: Any) -> Any:
            return transport.indirect(
                self.scene, self.lights, start, points, bounces, mis, active, guide, learning
            )

        return self._sums(estimate, spp, seed, first)

    def guide(self) -> Guide | None:
        """An untaught guide for this view; None in the scalar variant."""
        if not dr.is_jit_v(mi.Float):
            return None
        mask = self.guides["mask"][..., 0] > 0
        return Guide.of(self.width, self.height, self.guides["position"], mask)

    def direct(self, spp: int, seed: int) -> NDArray[np.float64]:
        """Sum of `spp` samples of demodulated direct light, `(H, W, 3)` float64."""

        def estimate(start: Any, points: Any, active: Any) -> Any:
            return transport.direct(self.scene, self.lights, start, points, active)

        return self._sums(estimate, spp, seed, 0)

    def occlusion(self, rays: int, distance: float, seed: int) -> Image:
        """Share `(H, W, 1)` of `rays` cosine-distributed rays that are free within `distance`."""
        far = dr.opaque(mi.Float, distance)

        def estimate(start: Any, points: Any, active: Any) -> Any:
            return transport.open_sky(self.scene, start, points, far, active)

        return (self._sums(estimate, rays, seed, 0)[..., :1] / rays).astype(np.float32)


def _primary_ray(camera: Camera, width: int, height: int, lane: Any) -> Any:
    """The ray through the centre of pixel `lane`, counted along the rows."""
    columns = dr.opaque(mi.UInt32, width)
    y = lane // columns
    x = lane - y * columns
    slope_x, slope_y = (dr.opaque(mi.Float, s) for s in slopes(camera, width, height))
    sx, sy = dr.opaque(mi.Float, 2 / width), dr.opaque(mi.Float, 2 / height)
    local = mi.Vector3f(
        (1 - (mi.Float(x) + 0.5) * sx) * slope_x, (1 - (mi.Float(y) + 0.5) * sy) * slope_y, 1
    )
    m = [[dr.opaque(mi.Float, float(v)) for v in row] for row in camera.to_world[:3]]
    direction = mi.Vector3f(*(r[0] * local.x + r[1] * local.y + r[2] * local.z for r in m))
    return mi.Ray3f(mi.Point3f(*(r[3] for r in m)), dr.normalize(direction))


def _primary(
    scene: Any, camera: Camera, width: int, height: int, lane: Any
) -> tuple[transport.Vertex, Any, Any, dict[str, Any]]:
    """Vertex, whether there is one, shape and layers of the primary rays of pixels `lane`."""
    ray = _primary_ray(camera, width, height, lane)
    si = scene.ray_intersect(ray, mi.RayFlags.UV | mi.RayFlags.ShadingFrame, True)
    hit = si.is_valid()
    emitter = si.emitter(scene)
    emission = mi.Color3f(0)
    if emitter is not None:  # None only in the scalar variant
        emission = dr.select(emitter != None, emitter.eval(si), 0)  # noqa: E711
    surface = hit & ((dr.max(emission) > 0) ^ True)
    start = transport.vertex_of(si, ray.d)
    forward = mi.Vector3f(*(dr.opaque(mi.Float, float(v)) for v in camera.to_world[:3, 2]))
    layers = {
        "albedo": dr.select(surface, transport.albedo_of(si, surface), 0),
        "normal": dr.select(hit, start.normal, 0),
        "depth": dr.select(hit, dr.dot(si.p - ray.o, forward), 0),
        "position": dr.select(hit, si.p, 0),
        "emission": emission,
        "mask": dr.select(surface, mi.Float(1), 0),
    }
    return start, hit, si.shape, layers
