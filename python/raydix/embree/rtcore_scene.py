"""`EmbreeScene`, which holds meshes and answers rays."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import FLOAT32, mesh_faces, rows
from ..hits import Hits
from ..scene import Scene

FAR = np.float32(1e37)
"""How far rays go that have no limit of their own; what stands for the distance of a miss."""
QUERIES = ("INTERSECT", "OCCLUDED", "DISTANCE")


class EmbreeScene:
    """Meshes of `mesh_construction.TriangleMesh`. `robust` is accepted: rays never slip through
    edges."""

    def __init__(self, device: object = None, robust: bool = False) -> None:
        self._scene = Scene()
        self._scene.commit()

    @property
    def is_committed(self) -> int:
        """1 if the trees are built."""
        return int(self._scene.committed)

    def __repr__(self) -> str:
        return f"<raydix.embree.EmbreeScene: {len(self._scene)} meshes>"

    def __getstate__(self) -> dict[str, Any]:
        self._ready()  # a scene with changes that no commit has seen has no copy
        return self.__dict__

    def __copy__(self) -> EmbreeScene:
        made = type(self).__new__(type(self))
        made.__dict__.update(self.__getstate__(), _scene=copy.copy(self._scene))
        return made

    def _ready(self) -> Scene:
        if not self._scene.committed:
            self._scene.commit()
        return self._scene

    def _add(self, vertices: np.ndarray, indices: np.ndarray) -> int:
        return self._scene.add(vertices, mesh_faces(indices, len(vertices), "indices"))

    def run(
        self,
        vec_origins: ArrayLike,
        vec_directions: ArrayLike,
        dists: ArrayLike | float | None = None,
        query: str = "INTERSECT",
        output: object = None,
    ) -> np.ndarray | dict[str, np.ndarray]:
        """Asks for rays: origins (N, 3), and directions (N, 3) or (1, 3).

        `dists`: how far each ray goes, one number or (N,). `query`: "INTERSECT" gives the triangle
        that each ray hits first, int32, -1 for none; "OCCLUDED" 0 for rays that hit anything, else
        -1; "DISTANCE" how far along its direction each ray hits, float32, `dists` or 1e37 for none.
        `output`: true gives a dict of "u", "v", "Ng" (the normal, twice the triangle's area long),
        "tfar", "primID" and "geomID" instead; not with "OCCLUDED".
        """
        if query not in QUERIES:
            raise ValueError(f"query: expected one of {', '.join(QUERIES)}, given {query!r}")
        if output and query == "OCCLUDED":
            raise ValueError("output: a ray that is occluded has no place where it hits")
        origins, lead = rows(vec_origins, "vec_origins", (3,), FLOAT32)
        along, others = rows(vec_directions, "vec_directions", (3,), FLOAT32)
        if len(lead) != 1 or len(others) != 1 or len(along) not in (1, len(origins)):
            raise ValueError(
                "vec_origins, vec_directions: expected shapes (N, 3) and (N, 3) or (1, 3), "
                f"given {np.shape(vec_origins)} and {np.shape(vec_directions)}"
            )
        scene = self._ready()
        far = np.broadcast_to(np.asarray(FAR if dists is None else dists, FLOAT32), len(origins))
        along = np.broadcast_to(along, origins.shape)
        if query == "OCCLUDED":
            hit = scene.occluded(origins, along, tmax=far)
            return np.where(hit, 0, -1).astype(np.int32)
        if output:
            with scene._core.held():  # hits and vertices of one commit
                return self._columns(scene.intersect(origins, along, tmax=far), far)
        hits = scene.intersect(origins, along, tmax=far)
        if query == "DISTANCE":
            return np.where(hits.hit, hits.t, far)
        return _signed(hits.prim)

    def _columns(self, hits: Hits, far: np.ndarray) -> dict[str, np.ndarray]:
        normals = np.zeros((len(far), 3), FLOAT32)
        for id in self._scene:
            here = np.flatnonzero(hits.geometry == id)
            if not len(here):
                continue
            vertices, faces = self._scene._core.arrays_of(id)
            a, b, c = (vertices[faces[hits.prim[here], i]] for i in range(3))
            normals[here] = np.cross(b - a, c - a)
        return {
            "u": np.array(hits.u),
            "v": np.array(hits.v),
            "Ng": normals,
            "tfar": np.where(hits.hit, hits.t, far),
            "primID": _signed(hits.prim),
            "geomID": _signed(hits.geometry),
        }


def _signed(ids: np.ndarray) -> np.ndarray:
    """-1 for none."""
    return np.ascontiguousarray(ids).view(np.int32)
