"""Triangle meshes from numbers: boxes, sheets, turned and swept forms. Metres; y is up.

Texture coordinates are metres along the surface, so that a texture has its true size everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """`vertices (N, 3)`, `normals (N, 3)`, `uv (N, 2)` and `faces (M, 3)`."""

    vertices: Array
    normals: Array
    uv: Array
    faces: NDArray[np.uint32]

    def moved(self, offset: ArrayLike) -> Mesh:
        return Mesh(self.vertices + np.asarray(offset, float), self.normals, self.uv, self.faces)

    def turned(self, matrix: Array) -> Mesh:
        """Multiplied by a rotation or a scaling `(3, 3)` about the origin."""
        normals = self.normals @ np.linalg.inv(matrix)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        faces = self.faces if np.linalg.det(matrix) > 0 else self.faces[:, ::-1]
        return Mesh(self.vertices @ matrix.T, normals, self.uv, faces)

    def flipped(self) -> Mesh:
        """With the other side in front."""
        return Mesh(self.vertices, -self.normals, self.uv, self.faces[:, ::-1])


def join(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of several."""
    parts = list(meshes)
    starts = np.cumsum([0] + [len(m.vertices) for m in parts[:-1]])
    return Mesh(
        np.concatenate([m.vertices for m in parts]),
        np.concatenate([m.normals for m in parts]),
        np.concatenate([m.uv for m in parts]),
        np.concatenate([m.faces + s for m, s in zip(parts, starts, strict=True)]).astype(np.uint32),
    )


def rotation(degrees: float, axis: str = "y") -> Array:
    """Rotation matrix `(3, 3)` about a coordinate axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def quad(corner: ArrayLike, u: ArrayLike, v: ArrayLike) -> Mesh:
    """A parallelogram whose front looks along `u x v`."""
    corner, u, v = (np.asarray(a, float) for a in (corner, u, v))
    normal = np.cross(u, v)
    normal /= np.linalg.norm(normal)
    lu, lv = np.linalg.norm(u), np.linalg.norm(v)
    return Mesh(
        np.stack([corner, corner + u, corner + u + v, corner + v]),
        np.tile(normal, (4, 1)),
        np.array([[0, 0], [lu, 0], [lu, lv], [0, lv]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )


def box(low: ArrayLike, high: ArrayLike) -> Mesh:
    """An axis-aligned box, its faces outwards."""
    a, b = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag(b - a)
    return join(
        [
            quad(a, y, x),
            quad(a + z, x, y),
            quad(a, z, y),
            quad(a + x, y, z),
            quad(a, x, z),
            quad(a + y, z, x),
        ]
    )


def sheet(points: ArrayLike, smooth: bool = True) -> Mesh:
    """A surface through a grid of points `(R, C, 3)`; its front: (next row) x (next column)."""
    p = np.asarray(points, float)
    if not smooth:
        corners = (p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:])
        return _flat(np.stack([c.reshape(-1, 3) for c in corners], 1))
    rows, columns = p.shape[:2]
    along = np.gradient(p, axis=0) if rows > 1 else np.zeros_like(p)
    across = np.gradient(p, axis=1)
    if np.allclose(p[:, 0], p[:, -1]):  # closed: the seam is smooth as well
        across[:, 0] = across[:, -1] = p[:, 1] - p[:, -2]
    normals = np.cross(along, across)
    _mend_poles(normals)
    v = np.cumsum(np.linalg.norm(np.diff(p, axis=0, prepend=p[:1]), axis=2), 0)
    u = np.cumsum(np.linalg.norm(np.diff(p, axis=1, prepend=p[:, :1]), axis=2), 1)
    u = np.tile(u[np.argmax(u[:, -1])], (rows, 1))
    i = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (x.ravel() for x in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh(
        p.reshape(-1, 3),
        normals.reshape(-1, 3),
        np.stack([u, v], -1).reshape(-1, 2),
        faces.astype(np.uint32),
    )


def _mend_poles(normals: Array) -> None:
    """Scale to unit length; where a row has shrunk to a point, use the next row's mean."""
    for row, inner in ((0, 1), (-1, -2)):
        flat = np.linalg.norm(normals[row], axis=-1) < 1e-12
        if flat.any() and len(normals) > 1:
            normals[row] = np.where(flat[:, None], normals[inner].mean(0), normals[row])
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[...] = np.where(length > 1e-12, normals / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])


def _flat(corners: Array) -> Mesh:
    """Quads `(N, 4, 3)`, each with its own flat normal."""
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    lu = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    lv = np.linalg.norm(corners[:, 3] - corners[:, 0], axis=1)
    zero = np.zeros_like(lu)
    uv = np.stack([zero, zero, lu, zero, lu, lv, zero, lv], 1).reshape(-1, 2)
    first = 4 * np.arange(len(corners))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.uint32)
    return Mesh(corners.reshape(-1, 3), np.repeat(normals, 4, 0), uv, faces)


def quads(centres: Array, u: Array, v: Array) -> Mesh:
    """Many parallelograms: centres and half sides, each `(N, 3)`."""
    return _flat(np.stack([centres - u - v, centres + u - v, centres + u + v, centres - u + v], 1))


def lathe(profile: Sequence[tuple[float, float]], segments: int = 32, smooth: bool = True) -> Mesh:
    """A turned form: `profile` is (radius, height) from bottom to top; outwards is its front."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    radius, height = np.asarray(profile, float).T
    circle = np.stack([-np.sin(angle), np.zeros_like(angle), np.cos(angle)], -1)
    points = radius[:, None, None] * circle + height[:, None, None] * np.array([0.0, 1.0, 0.0])
    return sheet(points, smooth)


def cylinder(radius: float, height: float, segments: int = 24) -> Mesh:
    """A closed cylinder that stands on the origin."""
    rim = [(radius, 0.0), (radius, height)]
    caps = [_disc(radius, segments).flipped(), _disc(radius, segments).moved([0, height, 0])]
    return join([lathe(rim, segments), *caps])


def _disc(radius: float, segments: int) -> Mesh:
    mesh = lathe([(radius, 0.0), (0.0, 0.0)], segments)
    normals = np.tile([0.0, 1.0, 0.0], (len(mesh.vertices), 1))
    return Mesh(mesh.vertices, normals, mesh.vertices[:, [0, 2]], mesh.faces)


def sphere(radius: float, segments: int = 48) -> Mesh:
    """A sphere about the origin."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    profile = np.stack([radius * np.cos(latitude), radius * np.sin(latitude)], 1)
    profile[[0, -1], 0] = 0
    mesh = lathe([(r, h) for r, h in profile], segments)
    return Mesh(mesh.vertices, mesh.vertices / radius, mesh.uv, mesh.faces)


def tube(path: ArrayLike, radius: ArrayLike, segments: int = 16) -> Mesh:
    """A tube of `radius` (one, or one a point) along points `(N, 3)`, open at its ends."""
    p = np.asarray(path, float)
    tangent = np.gradient(p, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.123, 0.456, 0.881])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.linspace(0, 2 * np.pi, segments + 1)[:, None, None]
    ring = np.cos(angle) * side + np.sin(angle) * np.cross(side, tangent)
    r = np.broadcast_to(np.asarray(radius, float), len(p))[:, None]
    return sheet((p + r * ring).transpose(1, 0, 2))
