"""A ray object that `trimesh` accepts in place of its own.

    import raydix.trimesh
    mesh.ray = raydix.trimesh.RayMeshIntersector(mesh)

`mesh.contains`, `trimesh.proximity` and all else that asks `mesh.ray` then asks raydix.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import MISSING
from .scene import Scene


class RayMeshIntersector:
    """Ray queries on a `trimesh.Trimesh`, with the methods of
    `trimesh.ray.ray_pyembree.RayMeshIntersector`.

    The mesh and its rays are moved to the middle of its box before they are rounded to float32, so
    that a mesh far from the origin keeps its details. `scale_to_box` is accepted and has no effect:
    meshes may be 1e-9 to 1e12 units large. Edits of the mesh are noticed.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True) -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._made: tuple[Any, Any, Any] = None, None, None

    def _scene(self) -> tuple[Scene, np.ndarray]:
        """The mesh moved to 0, and by how much."""
        now = hash(self.mesh)
        made_for, scene, middle = self._made
        if made_for != now:
            vertices = np.asarray(self.mesh.vertices, np.float64)
            faces = np.asarray(self.mesh.faces)
            corners = vertices[np.unique(faces)]  # what no triangle has does not count
            corners = corners[np.isfinite(corners).all(axis=1)]
            middle = (
                (corners.min(axis=0) + corners.max(axis=0)) / 2 if len(corners) else np.zeros(3)
            )
            scene = Scene(vertices - middle, faces)
            self._made = now, scene, middle  # in one step: other threads may ask
        return scene, middle

    def _rays(
        self, origins: ArrayLike, directions: ArrayLike
    ) -> tuple[Scene, np.ndarray, np.ndarray]:
        start, along = np.asarray(origins, np.float64), np.asarray(directions, np.float64)
        if start.shape != along.shape:
            raise ValueError("Ray origin and direction don't match!")
        start, along = start.reshape(-1, 3), along.reshape(-1, 3)
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
        scene, middle = self._scene()
        return scene, start - middle, along

    def _places(self, hits: dict[str, np.ndarray], triangles: np.ndarray) -> np.ndarray:
        """Where on their triangles hits are, from the mesh's own float64 corners."""
        corners = np.asarray(self.mesh.vertices, np.float64)[np.asarray(self.mesh.faces)[triangles]]
        u, v = hits["u"].astype(np.float64)[:, None], hits["v"].astype(np.float64)[:, None]
        return (
            corners[:, 0]
            + u * (corners[:, 1] - corners[:, 0])
            + v * (corners[:, 2] - corners[:, 0])
        )

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
    ) -> tuple[np.ndarray, ...]:
        """(index_tri, index_ray), and locations if asked for: every hit, or the first of each ray.

        All hits of a ray come from one traversal, nearest first: none is lost or found twice. At
        most `max_hits` of each ray.
        """
        scene, start, along = self._rays(ray_origins, ray_directions)
        if multiple_hits:
            found = scene.all_hits(start, along)
            lengths = np.diff(found["offsets"]).astype(np.int64)
            rank = np.arange(len(found["t"])) - np.repeat(
                found["offsets"][:-1].astype(np.int64), lengths
            )
            index_ray = np.repeat(np.arange(len(start)), lengths)
            keep = rank < max_hits
        else:
            found = scene.intersect(start, along)
            index_ray = np.arange(len(start))
            keep = found["prim"] != MISSING
        hits = {name: found[name][keep] for name in ("prim", "u", "v")}
        index_tri, index_ray = hits["prim"].astype(np.int64), index_ray[keep]
        if return_locations:
            return index_tri, index_ray, self._places(hits, index_tri)
        return index_tri, index_ray

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(locations, index_ray, index_tri)."""
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> np.ndarray:
        """The first triangle that each ray hits, -1 for none: int64."""
        scene, start, along = self._rays(ray_origins, ray_directions)
        prim = scene.intersect(start, along)["prim"]
        return np.where(prim == MISSING, -1, prim.astype(np.int64))

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> np.ndarray:
        """Whether each ray hits the mesh: bool."""
        scene, start, along = self._rays(ray_origins, ray_directions)
        return scene.occluded(start, along)

    def contains_points(self, points: ArrayLike) -> np.ndarray:
        """Whether each point is inside: bool, exact on closed meshes, at edges and vertices too.
        See `Scene.contains`."""
        scene, middle = self._scene()
        return scene.contains(np.asarray(points, np.float64).reshape(-1, 3) - middle)

    def __getstate__(self) -> dict[str, Any]:
        return {"mesh": self.mesh, "_scale_to_box": self._scale_to_box}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["mesh"], state["_scale_to_box"])  # type: ignore[misc]

    def __copy__(self, *_: Any) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box)

    __deepcopy__ = __copy__
