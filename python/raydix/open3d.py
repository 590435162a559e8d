"""`RaycastingScene` with the calls of `open3d.t.geometry.RaycastingScene`, on `raydix.Scene`.

    from raydix.open3d import RaycastingScene

Results are NumPy arrays with the names, shapes and types of Open3D's tensors. Arguments are arrays
or what becomes one, such as Open3D's own tensors on the processor. What differs:

- Rays and points of any number type are rounded to float32. Open3D refuses others than float32.
- An edge belongs to one of its triangles in `count_intersections` and `list_intersections`. Open3D
  may count a hit on an edge twice or not at all.
- Inside is decided without rounding for closed meshes, and by winding numbers for others. So
  `nsamples` has no effect.
- Where two triangles are hit or are closest at the same distance, the lower (geometry, triangle)
  answers. Open3D gives either.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import (
    FLOAT32,
    MISSING,
    UINT32,
    mesh_faces,
    mesh_vertices,
    number,
    rows,
    shown,
    thread_count,
    whole,
)
from ._core import split_hits
from .scene import Scene


def _array(value: Any) -> Any:
    """What NumPy takes: Open3D's tensors say so themselves."""
    return value.numpy() if hasattr(value, "numpy") and not hasattr(value, "__array__") else value


def _number(hits: Any, name: str) -> np.ndarray:
    return np.ascontiguousarray(hits[name])


class RaycastingScene:
    """Meshes that rays and points ask. The first question after `add_triangles` builds the trees."""

    INVALID_ID = int(MISSING)

    def __init__(self, nthreads: int = 0) -> None:
        self._scene = Scene(threads=nthreads)
        self._scene.commit()

    def __repr__(self) -> str:
        return f"<raydix.open3d.RaycastingScene: {len(self._scene)} geometries>"

    def __getstate__(self) -> dict[str, Any]:
        self._ready(self._scene.threads)  # a scene with changes that no commit has seen has no copy
        return self.__dict__

    def __copy__(self) -> RaycastingScene:
        made = type(self).__new__(type(self))
        made.__dict__.update(self.__getstate__(), _scene=copy.copy(self._scene))
        return made

    def add_triangles(self, mesh: Any, triangle_indices: ArrayLike | None = None) -> int:
        """Adds a mesh and returns its geometry's number: vertices (N, 3) and triangles (M, 3); or an
        object that has them, as the meshes of Open3D do."""
        if triangle_indices is None:
            mesh, triangle_indices = _mesh_of(mesh)
        vertices = mesh_vertices(_array(mesh), dtype=FLOAT32)
        return self._scene.add(vertices, mesh_faces(_array(triangle_indices), len(vertices)))

    def _ready(self, nthreads: int) -> Scene:
        scene = self._scene
        if not scene.committed:
            scene.commit()
        scene.threads = thread_count(nthreads)
        return scene

    def cast_rays(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, np.ndarray]:
        """The first hit of each ray (..., 6), origin and direction: "t_hit" (...,), infinity for
        none; "geometry_ids" and "primitive_ids" uint32, INVALID_ID for none; "primitive_uvs"
        (..., 2); "primitive_normals" (..., 3) of unit length, 0 for none."""
        given = _rays(rays)
        scene = self._ready(nthreads)
        with scene._core.held():
            hits = scene.intersect(given)
            normals = scene.normals(hits)
        lead = hits._rows.shape[:-1]
        found = {
            "t_hit": np.empty(lead, FLOAT32),
            "geometry_ids": np.empty(lead, UINT32),
            "primitive_ids": np.empty(lead, UINT32),
            "primitive_uvs": np.empty((*lead, 2), FLOAT32),
            "primitive_normals": normals,
        }
        rows_of = [array.reshape(-1, *array.shape[len(lead) :]) for array in found.values()]
        split_hits(hits._rows.reshape(-1, hits._rows.shape[-1]), *rows_of)
        return found

    def test_occlusions(
        self, rays: ArrayLike, tnear: float = 0.0, tfar: float = np.inf, nthreads: int = 0
    ) -> np.ndarray:
        """Whether each ray (..., 6) hits anything between tnear and tfar: bool."""
        near, far = number(tnear, "tnear"), number(tfar, "tfar")
        return self._ready(nthreads).occluded(_rays(rays), tmin=near, tmax=far)

    def count_intersections(self, rays: ArrayLike, nthreads: int = 0) -> np.ndarray:
        """How many triangles each ray (..., 6) hits: int32."""
        return self._ready(nthreads).count(_rays(rays)).astype(np.int32)

    def list_intersections(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, np.ndarray]:
        """All hits of all rays: those of ray i are ray_splits[i] to ray_splits[i + 1] of the other
        arrays, nearest first. "ray_splits" and "ray_ids" are uint32: InputError for more hits than
        these can count."""
        hits = self._ready(nthreads).all_hits(_rays(rays))
        offsets = hits["offsets"]
        if offsets[-1] > MISSING:
            raise ValueError(f"list_intersections: {offsets[-1]} hits; ray_splits has 32 bits")
        counts = np.diff(offsets).astype(np.int64)
        return {
            "ray_splits": offsets.astype(np.uint32),
            "ray_ids": np.repeat(np.arange(len(counts), dtype=np.uint32), counts),
            "t_hit": _number(hits, "t"),
            "geometry_ids": _number(hits, "geometry"),
            "primitive_ids": _number(hits, "prim"),
            "primitive_uvs": np.stack([hits["u"], hits["v"]], axis=-1),
        }

    def compute_distance(self, query_points: ArrayLike, nthreads: int = 0) -> np.ndarray:
        """The distance of each point (..., 3) to the nearest triangle: float32."""
        found = self._ready(nthreads).closest_point(_points(query_points))
        return _number(found, "distance")

    def compute_signed_distance(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> np.ndarray:
        """The same, negative inside."""
        _check_samples(nsamples)
        return self._ready(nthreads).signed_distance(_points(query_points))

    def compute_occupancy(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> np.ndarray:
        """1 for points (..., 3) inside, else 0: float32."""
        _check_samples(nsamples)
        return self._ready(nthreads).contains(_points(query_points)).astype(np.float32)

    def compute_closest_points(
        self, query_points: ArrayLike, nthreads: int = 0
    ) -> dict[str, np.ndarray]:
        """The closest point of the meshes to each query (..., 3): "points" (..., 3),
        "geometry_ids", "primitive_ids", "primitive_uvs" and "primitive_normals" as in
        `cast_rays`."""
        given = _points(query_points)
        scene = self._ready(nthreads)
        with scene._core.held():
            found = scene.closest_point(given)
            surface = _surface(scene, {"t": found["distance"], **found})
        return {
            "points": np.ascontiguousarray(found["point"]),
            **surface,
        }

    @staticmethod
    def create_rays_pinhole(*arguments: Any, **named: Any) -> np.ndarray:
        """Rays of a pinhole camera, one through the middle of each pixel: (height, width, 6)
        float32. (intrinsic_matrix, extrinsic_matrix, width_px, height_px), or (fov_deg, center,
        eye, up, width_px, height_px) with the horizontal angle of view; rows then go toward `up`,
        as Open3D has it. Directions have length 1 along the camera's axis."""
        names = ("intrinsic_matrix", "extrinsic_matrix", "width_px", "height_px")
        if len(arguments) + len(named) == 6:
            names = ("fov_deg", "center", "eye", "up", "width_px", "height_px")
        given = dict(zip(names, arguments, strict=False)) | named
        if set(given) != set(names) or len(arguments) + len(named) != len(names):
            raise TypeError(
                f"create_rays_pinhole: expected {', '.join(names)}, given {list(given)}"
            )
        width, height = (whole(given[name], name, 1, 2**31) for name in ("width_px", "height_px"))
        if "fov_deg" in given:
            return _pinhole_rays(*_looking(given, width, height), width, height)
        matrices = (given["intrinsic_matrix"], given["extrinsic_matrix"])
        intrinsic, extrinsic = (np.asarray(_array(matrix), np.float64) for matrix in matrices)
        if intrinsic.shape != (3, 3) or extrinsic.shape != (4, 4):
            raise ValueError(
                "create_rays_pinhole: expected matrices (3, 3) and (4, 4), "
                f"given {intrinsic.shape} and {extrinsic.shape}"
            )
        return _pinhole_rays(intrinsic, extrinsic, width, height)


def _mesh_of(mesh: Any) -> tuple[Any, Any]:
    """Vertices and triangles of Open3D's meshes, of either kind."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex["positions"], mesh.triangle["indices"]
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    raise TypeError(f"add_triangles: expected a mesh or two arrays, given {type(mesh).__name__}")


def _rays(rays: ArrayLike) -> np.ndarray:
    flat, lead = rows(_array(rays), "rays", (6,), FLOAT32)
    return flat.reshape(*lead, 6)


def _points(points: ArrayLike) -> np.ndarray:
    flat, lead = rows(_array(points), "query_points", (3,), FLOAT32)
    return flat.reshape(*lead, 3)


def _check_samples(nsamples: int) -> None:
    if whole(nsamples, "nsamples", 1, 2**31) % 2 == 0:
        raise ValueError(f"nsamples: expected an odd number of 1 or more, given {shown(nsamples)}")


def _surface(scene: Scene, hits: Any) -> dict[str, np.ndarray]:
    normals = scene.normals(hits)
    normals[np.isnan(normals)] = 0
    return {
        "geometry_ids": _number(hits, "geometry"),
        "primitive_ids": _number(hits, "prim"),
        "primitive_uvs": np.stack([hits["u"], hits["v"]], axis=-1),
        "primitive_normals": normals,
    }


def _looking(given: dict[str, Any], width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Intrinsic and extrinsic matrix of a camera at `eye` that looks at `center`."""
    center, eye, up = (np.asarray(_array(given[n]), np.float64) for n in ("center", "eye", "up"))
    forward = center - eye
    right = np.cross(up, forward)
    lengths = np.linalg.norm(forward), np.linalg.norm(right)
    if not all(length > 0 for length in lengths):
        raise ValueError("create_rays_pinhole: up is along the direction of view, or eye is center")
    forward, right = forward / lengths[0], right / lengths[1]
    turn = np.stack([right, np.cross(forward, right), forward])
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = turn, -turn @ eye
    focal = 0.5 * width / np.tan(np.radians(0.5 * float(given["fov_deg"])))
    return np.array([[focal, 0, 0.5 * width], [0, focal, 0.5 * height], [0, 0, 1]]), extrinsic


def _pinhole_rays(
    intrinsic: np.ndarray, extrinsic: np.ndarray, width: int, height: int
) -> np.ndarray:
    pixels = np.ones((height, width, 3))
    pixels[..., 0] = np.arange(width) + 0.5
    pixels[..., 1] = np.arange(height)[:, None] + 0.5
    turn, move = extrinsic[:3, :3], extrinsic[:3, 3]
    rays = np.empty((height, width, 6), FLOAT32)
    rays[..., :3] = -turn.T @ move
    rays[..., 3:] = pixels @ (turn.T @ np.linalg.inv(intrinsic)).T
    return rays
