"""Trees as arrays: BVHs, octrees and k-d trees over triangles or points, with their statistics."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import (
    FLOAT32,
    UINT32,
    code_bits,
    flag,
    mesh_faces,
    mesh_vertices,
    number,
    one_of,
    require_float32,
    result_bytes,
    rows,
    thread_count,
    uint32s,
    whole,
)

BVH_NODE = np.dtype([("lo", "<f4", 3), ("first", "<u4"), ("hi", "<f4", 3), ("count", "<u4")])
"""32 bytes. Leaf: count > 0, order[first : first + count]. Inner: count 0, children are nodes first
and first + 1. Slot 1 is padding."""

OCTREE_NODE = np.dtype(
    [
        ("code", "<u8"),
        ("parent", "<u4"),
        ("first_child", "<u4"),
        ("first_point", "<u4"),
        ("point_count", "<u4"),
        ("child_mask", "<u4"),
        ("level", "<u4"),
    ]
)
"""32 bytes. `code`: the cell's coordinates on its level, interleaved. Leaf: child_mask 0;
0xFFFFFFFF stands for no node."""

KD_NODE = np.dtype([("lo", "<f4"), ("hi", "<f4"), ("plane", "<f4"), ("link", "<u4")])
"""16 bytes. link & 3: axis, or 3 for a leaf. Inner: children at slots 2 * (link >> 2) + 2 and the
next. Leaf: link >> 2 primitives from `plane` seen as uint32 on, in the order."""


def _mesh(vertices: Any, faces: Any) -> tuple[np.ndarray, np.ndarray]:
    if faces is None and hasattr(vertices, "faces") and hasattr(vertices, "vertices"):
        if hasattr(vertices, "dtype"):
            require_float32(vertices, "trees as arrays")
        vertices, faces = vertices.vertices, vertices.faces
    corners = mesh_vertices(vertices)
    return corners, np.zeros((0, 3), UINT32) if faces is None else mesh_faces(faces, len(corners))


def _kept(part: Any) -> Any:
    if not isinstance(part, np.ndarray):
        return part
    copy = part.copy()
    copy.flags.writeable = False
    return copy


class _Tree:
    """What the three kinds have in common."""

    _core_type: Any
    _node: np.dtype

    def __init__(self, *made_of: Any) -> None:
        self._core = self._core_type(*made_of)
        # Kept for copies: read-only, and none of the caller's own memory.
        self._made_of = tuple(_kept(part) for part in made_of)

    def __reduce__(self) -> tuple:
        """Pickles, copies and deep copies are vertices and faces; the tree is built again."""
        return type(self), self._made_of

    @property
    def nodes(self) -> np.ndarray:
        """The nodes as a structured array, read-only: the tree's own memory. Node 0 is the root; an
        empty tree has none."""
        raw = self._core.nodes
        return raw.reshape(-1).view(self._node) if len(raw) else np.empty(0, self._node)

    @property
    def order(self) -> np.ndarray:
        """Which primitive stands at each position of the leaves: uint32."""
        return self._core.order

    @property
    def ms(self) -> dict[str, float]:
        """Milliseconds of the stages of the build."""
        return self._core.ms

    @property
    def left_out(self) -> int:
        """Primitives that are not in the tree, because they are not finite or too large."""
        return self._core.left_out

    def stats(self) -> dict[str, Any]:
        """Figures of the tree, and its hash: equal exactly when the trees are."""
        return self._core.stats()

    def check(self) -> None:
        """Verifies every invariant; RuntimeError names the first that does not hold."""
        self._core.check()

    def __repr__(self) -> str:
        counts = f"{len(self.order):,} primitives, {len(self.nodes):,} nodes"
        return f"<raydix.{type(self).__name__}: {counts}>"


class Bvh(_Tree):
    """A binary bounding volume hierarchy, made by `raydix.bvh`. Its nodes are
    `raydix.trees.BVH_NODE`."""

    _core_type = _core.Bvh
    _node = BVH_NODE

    def stats(
        self, *, epo: bool = False, node_cost: float = 1.0, primitive_cost: float = 1.0
    ) -> dict[str, Any]:
        """Figures of the tree: "sah" with these costs, "epo" (Aila, Karras, Laine 2013) if asked
        for, and the hash."""
        return self._core.stats(
            flag(epo, "epo"),
            number(node_cost, "node_cost"),
            number(primitive_cost, "primitive_cost"),
        )


class Octree(_Tree):
    """An octree (Karras 2012, section 5), made by `raydix.octree`. Its nodes are
    `raydix.trees.OCTREE_NODE`."""

    _core_type = _core.Octree
    _node = OCTREE_NODE

    @property
    def points(self) -> np.ndarray:
        """The points in the order of the leaves, (N, 3) float32; of triangles the centres of their
        boxes."""
        return self._core.points

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lowest and highest corner of the primitives."""
        return self._core.bounds

    def boxes(self, nodes: ArrayLike) -> np.ndarray:
        """The cubes of nodes, given by their numbers (M,): (M, 6) float32, lowest corner and
        highest. InputError: no such node."""
        return self._core.boxes(uint32s(nodes, "nodes").reshape(-1))

    def locate(self, points: ArrayLike) -> np.ndarray:
        """The deepest node that holds each point (..., 3): uint32, 0xFFFFFFFF outside of the
        root."""
        asked, lead = rows(points, "points", (3,), FLOAT32)
        return self._core.locate(asked).reshape(lead)

    def points_in_boxes(
        self, boxes: ArrayLike, *, max_result_bytes: int = 0
    ) -> dict[str, np.ndarray]:
        """Points in closed boxes (..., 6): "offsets" and "indices", rows ascending.
        `max_result_bytes` as in `Scene.all_hits`."""
        asked, _ = rows(boxes, "boxes", (6,), FLOAT32)
        offsets, indices = self._core.points_in_boxes(asked, result_bytes(max_result_bytes))
        return {"offsets": offsets, "indices": indices}


class KdTree(_Tree):
    """A k-d tree (Karras 2012, section 5), made by `raydix.kdtree`. Its nodes are
    `raydix.trees.KD_NODE`."""

    _core_type = _core.KdTree
    _node = KD_NODE

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lowest and highest corner of the primitives."""
        return self._core.bounds


def bvh(
    vertices: ArrayLike,
    faces: ArrayLike | None = None,
    *,
    builder: str = "karras",
    bits: int = 63,
    max_leaf: int = 4,
    strict: bool = False,
    threads: int = 0,
) -> Bvh:
    """A BVH over triangles; over the vertices as points if there are no faces.

    `builder`: one of `raydix.builders()`. "karras", "lauterbach", "garanzha" and "apetrei" give the
    same tree bit for bit. The same tree for every number of threads. Arguments as in
    `raydix.Scene`.
    """
    return Bvh(
        *_mesh(vertices, faces),
        one_of(builder, "builder", _core.builders()),
        code_bits(bits),
        whole(max_leaf, "max_leaf", 1, 255),
        flag(strict, "strict"),
        thread_count(threads),
    )


def octree(
    vertices: ArrayLike,
    faces: ArrayLike | None = None,
    *,
    bits: int = 63,
    max_level: int = -1,
    max_leaf: int = 4,
    strict: bool = False,
    threads: int = 0,
) -> Octree:
    """An octree over points, or over the centres of triangles: nodes with more than `max_leaf` are
    divided, down to `max_level`."""
    return Octree(
        *_mesh(vertices, faces),
        code_bits(bits),
        whole(max_level, "max_level", -1, 21),
        whole(max_leaf, "max_leaf", 1, 2**31 - 1),
        flag(strict, "strict"),
        thread_count(threads),
    )


def kdtree(
    vertices: ArrayLike,
    faces: ArrayLike | None = None,
    *,
    bits: int = 63,
    max_leaf: int = 0,
    strict: bool = False,
    threads: int = 0,
) -> KdTree:
    """A k-d tree over triangles or points. `max_leaf` 0: 8 points or 4 triangles. For neighbours
    use `raydix.Points`: it is faster."""
    return KdTree(
        *_mesh(vertices, faces),
        code_bits(bits),
        whole(max_leaf, "max_leaf", 0, 255),
        flag(strict, "strict"),
        thread_count(threads),
    )
