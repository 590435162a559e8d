"""Meshes for an `EmbreeScene`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import FLOAT32, mesh_vertices
from .rtcore_scene import EmbreeScene


class TriangleMesh:
    """Adds a mesh to a scene: vertices (V, 3) and indices (F, 3); or the corners of all triangles,
    (F, 3, 3)."""

    def __init__(
        self, scene: EmbreeScene, vertices: ArrayLike, indices: ArrayLike | None = None
    ) -> None:
        if indices is None:
            corners = np.asarray(vertices)
            if corners.ndim != 3 or corners.shape[1:] != (3, 3):
                raise ValueError(f"vertices: expected shape (F, 3, 3), given {corners.shape}")
            vertices = corners.reshape(-1, 3)
            indices = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        self.geomID = scene._add(mesh_vertices(vertices, dtype=FLOAT32), np.asarray(indices))
