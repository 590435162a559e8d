"""Point clouds: who is near."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import (
    MISSING,
    UINT32,
    cast,
    describe,
    flag,
    floats,
    number,
    one_of,
    own_attributes,
    path,
    result_bytes,
    rows,
    thread_count,
    to_numpy,
    uint32s,
    whole,
)

_INDICES = {
    (np.dtype(np.float32), 2): _core.PointIndex2f,
    (np.dtype(np.float32), 3): _core.PointIndex3f,
    (np.dtype(np.float64), 2): _core.PointIndex2d,
    (np.dtype(np.float64), 3): _core.PointIndex3d,
}


TREES = ("automatic", "bvh", "kdtree")


class Points:
    """An index over points in two or three dimensions.

    Parameters
    ----------
    points :
        Shape (N, 2) or (N, 3), float32 or float64. Queries are answered in this type; those of the
        other are rounded to it.
    tree :
        "kdtree", "bvh", or "automatic". Answers do not depend on it.
    strict :
        Points with NaN, infinity or a coordinate beyond 1e12 raise InputError; otherwise they are
        left out.
    threads :
        Threads for the build and for queries; 0: all the machine has. No result depends on it.

    Distances are sqrt((dx*dx + dy*dy) + dz*dz), in the type of the points, without fused
    operations: NumPy gives the same bits. What is compared is what stands under the root, rounded:
    with other such squares, at equal ones the lower index goes first; and with r * r, rounded, up
    to which a point is within r. Two distances may be equal whose squares are not. Answers are
    exact in this sense and the same for every number of
    threads. The points are copied. Any number of threads may ask at once; `add` and `remove` change
    what is there. Missing neighbours have
    the index 0xFFFFFFFF and an infinite distance; queries with NaN or infinity have none.
    """

    def __init__(
        self, points: ArrayLike, *, tree: str = "automatic", strict: bool = False, threads: int = 0
    ) -> None:
        array = floats(points, "points", (3, 2))
        if array.ndim != 2:
            raise ValueError(
                "points: expected shape (N, 2) or (N, 3) float32 or float64, "
                f"given {describe(array)}"
            )
        self.dtype = array.dtype
        self.dimension = array.shape[1]
        self.threads = threads = thread_count(threads)
        tree, strict = one_of(tree, "tree", TREES), flag(strict, "strict")
        self._core = _INDICES[self.dtype, self.dimension](
            cast(array, self.dtype), tree, strict, threads
        )
        self._options = {"tree": tree, "strict": strict, "threads": threads}

    @property
    def options(self) -> dict[str, Any]:
        """What the index was made with: a new dict of the arguments of `Points` by their names."""
        return dict(self._options)

    def _points(self) -> np.ndarray:
        """The points as they were given; NaN for those that were left out."""
        given, numbers, there = self._core.snapshot()
        points = np.full((given, self.dimension), np.nan, self.dtype)
        points[numbers] = there
        return points

    def __reduce__(self) -> tuple:
        """Pickles, copies and deep copies are the points and what else the object carries; their
        trees are built again. Removed points keep their numbers."""
        return _remade, (self._points(), self._options, type(self)), own_attributes(self, _OWN)

    def add(self, points: ArrayLike) -> np.ndarray:
        """Adds points, shape (M, D) or (D,), in the type of the index. Returns their numbers, (M,)
        uint32: they go on where those before ended, and none is given twice.

        Queries then answer as a fresh index over all points does, but for the numbers, and take up
        to twice its time. Larger batches cost less for each point. Waits for queries of other
        threads. ValueError, and nothing is added: with `strict` the first point that is not finite
        or beyond 1e12.
        """
        added, _ = rows(points, "points", (self.dimension,), self.dtype)
        first = self._core.insert(added)
        return np.arange(first, first + len(added), dtype=UINT32)

    def remove(self, indices: ArrayLike) -> int:
        """Removes points by their numbers, a whole number or shape (M,). Those that were removed
        before or left out are passed over. Returns how many were removed. ValueError, and nothing
        is removed: a number that was never given."""
        numbers = np.atleast_1d(uint32s(indices, "indices"))
        if numbers.ndim != 1:
            raise ValueError(f"indices: expected shape (M,), given {describe(numbers)}")
        return self._core.remove(np.ascontiguousarray(numbers))

    def knn(
        self,
        queries: ArrayLike,
        k: int,
        *,
        max_distance: float = np.inf,
        max_result_bytes: int = 0,
        threads: int | None = None,
    ) -> dict[str, np.ndarray]:
        """The k nearest points of each query, nearest first; equal squared distances by index.

        `queries`: shape (..., D). `k`: any number of 1 or more. Points farther than `max_distance`
        do not count, as `radius` has it, which saves the search for them. Returns "indices"
        (uint32) and "distances", both of shape (..., k); where fewer count, rows end with MISSING
        and infinity. A query that is one of the points finds itself.
        `max_result_bytes` bounds both arrays; 0: half of the memory that is left. InputError,
        before they are made, if they would take more.
        """
        asked, lead = rows(queries, "queries", (self.dimension,), self.dtype)
        k = whole(k, "k", 1, 2**31)
        max_distance = number(max_distance, "max_distance")
        shape = lead + (k,)
        bytes_each = UINT32.itemsize + self.dtype.itemsize
        _core.require_result_bytes(
            "knn", min(len(asked) * k * bytes_each, 2**64 - 1), result_bytes(max_result_bytes)
        )
        indices, distances = np.empty(shape, UINT32), np.empty(shape, self.dtype)
        flat = (len(asked), k)
        self._core.knn(
            asked,
            indices.reshape(flat),
            distances.reshape(flat),
            max_distance,
            self._threads(threads),
        )
        return {"indices": indices, "distances": distances}

    def radius(
        self,
        queries: ArrayLike,
        r: ArrayLike,
        *,
        sort: bool = False,
        padded: bool = False,
        max_result_bytes: int = 0,
        threads: int | None = None,
    ) -> dict[str, np.ndarray]:
        """All points within a distance of each query, the distance itself included (squares
        decide: see the class).

        `queries`: shape (..., D). `r`: a number, or one for each query (their leading shape); 0
        finds equal points, infinity all. Rows ascend by index, with `sort` by (squared distance,
        index).
        Returns a dict: "offsets" (uint64, one more than queries), "indices" (uint32), "distances":
        row i, counted in C order, is offsets[i] to offsets[i + 1]. With `padded`: "counts" (...),
        "indices" and "distances" (..., longest row), filled up with 0xFFFFFFFF and infinity.
        `max_result_bytes` bounds the peak memory of the call, the arrays included; 0: half of what
        is left. InputError if it would take more: no point is ever dropped. ValueError for a
        negative or NaN radius.
        """
        asked, lead = rows(queries, "queries", (self.dimension,), self.dtype)
        max_result_bytes = result_bytes(max_result_bytes)
        radii = self._radii(r, lead)
        is_padded = flag(padded, "padded")
        offsets, indices, distances = self._core.radius(
            asked, radii, flag(sort, "sort"), max_result_bytes, self._threads(threads)
        )
        if not is_padded:
            return {"offsets": offsets, "indices": indices, "distances": distances}
        return _padded(offsets, indices, distances, lead, max_result_bytes)

    def _radii(self, r: ArrayLike, lead: tuple[int, ...]) -> np.ndarray:
        """One radius for all, (1,), or one for each query, (n,)."""
        radii = to_numpy(r, "r")
        if radii.ndim == 0 and radii.dtype.kind in "OU":
            radii = np.array(number(r, "r"))  # whole numbers of any length, too
        is_numbers = radii.dtype.kind in "biuf" or not radii.size
        if not is_numbers or (radii.ndim and radii.shape != lead):
            error = ValueError if is_numbers else TypeError
            raise error(f"r: expected a number or shape {lead}, given {describe(radii)}")
        radii = cast(radii, self.dtype)
        if radii.ndim and not (radii >= 0).all():  # before batches are cut: of all, the first
            first = np.flatnonzero(~(radii.reshape(-1) >= 0))[0]
            raise _core.InputError(
                f"radius {first} is {radii.reshape(-1)[first]:g}; it must be 0 or more"
            )
        return radii.reshape(-1)

    def count(self, queries: ArrayLike, r: float, *, threads: int | None = None) -> np.ndarray:
        """How many points lie within the distance `r` of each query: uint32, with the leading shape
        of the queries."""
        asked, lead = rows(queries, "queries", (self.dimension,), self.dtype)
        counts = np.empty(lead, UINT32)
        self._core.count(asked, number(r, "r"), counts.reshape(-1), self._threads(threads))
        return counts

    def box(
        self, boxes: ArrayLike, *, max_result_bytes: int = 0, threads: int | None = None
    ) -> dict[str, np.ndarray]:
        """All points in each closed box.

        `boxes`: shape (..., 2 D): lowest corner, highest corner. A box with lo > hi on an axis, NaN
        or infinity holds none. Returns "offsets" and "indices" as in `radius`, rows ascending.
        `max_result_bytes` as in `radius`.
        """
        asked, _ = rows(boxes, "boxes", (2 * self.dimension,), self.dtype)
        offsets, indices, _ = self._core.box(
            asked, result_bytes(max_result_bytes), self._threads(threads)
        )
        return {"offsets": offsets, "indices": indices}

    def pairs(
        self, r: float, *, max_result_bytes: int = 0, threads: int | None = None
    ) -> dict[str, np.ndarray]:
        """All pairs of points no farther apart than `r`.

        Returns "pairs" (P, 2) uint32 with i < j, sorted, and "distances" (P,). Points at the same
        place are a pair. `max_result_bytes` as in `radius`.
        """
        max_result_bytes = result_bytes(max_result_bytes)
        offsets, others, distances = self._core.neighbours(
            number(r, "r"), False, max_result_bytes, self._threads(threads)
        )
        lists = offsets.nbytes + others.nbytes + distances.nbytes
        first, lengths = others.nbytes, 2 * offsets.nbytes + UINT32.itemsize * len(offsets)
        _core.require_result_bytes(
            "pairs", lists + 2 * others.nbytes + first + lengths, max_result_bytes
        )
        pairs = np.empty((len(others), 2), UINT32)
        pairs[:, 0] = np.repeat(
            np.arange(len(offsets) - 1, dtype=UINT32), np.diff(offsets).astype(np.int64)
        )
        pairs[:, 1] = others
        return {"pairs": pairs, "distances": distances}

    def neighbours(
        self, r: float, *, max_result_bytes: int = 0, threads: int | None = None
    ) -> dict[str, np.ndarray]:
        """The points within `r` of each point, itself left out: one row for each point, as `radius`
        has them. `max_result_bytes` as in `radius`."""
        offsets, others, distances = self._core.neighbours(
            number(r, "r"), True, result_bytes(max_result_bytes), self._threads(threads)
        )
        return {"offsets": offsets, "indices": others, "distances": distances}

    def _threads(self, threads: int | None) -> int:
        return self.threads if threads is None else thread_count(threads)

    def stats(self) -> dict[str, Any]:
        """Figures of the index, and the milliseconds of its stages ("ms")."""
        return self._core.stats()

    def __len__(self) -> int:
        """Points in the index; those left out are not."""
        return len(self._core)

    def __repr__(self) -> str:
        return f"<raydix.Points: {len(self):,} points, {self.dimension}-D {self.dtype}>"


_OWN = ("dtype", "dimension", "threads", "_core", "_options")
"""What an index makes for itself."""


def _remade(points: np.ndarray, options: dict[str, Any], kind: type[Points] = Points) -> Points:
    index = object.__new__(kind)
    if not options["strict"]:
        Points.__init__(index, points, **options)
        return index
    removed = np.flatnonzero(np.isnan(points).any(axis=1))
    points[removed] = 0
    Points.__init__(index, points, **options)
    Points.remove(index, removed)
    return index


def _padded(
    offsets: np.ndarray,
    indices: np.ndarray,
    distances: np.ndarray,
    lead: tuple[int, ...],
    max_result_bytes: int,
) -> dict[str, np.ndarray]:
    """Rows of any length -> a table as wide as the longest."""
    counts = np.diff(offsets).astype(np.int64)
    width = int(counts.max(initial=0))
    lists = 3 * offsets.nbytes + indices.nbytes + distances.nbytes
    place = UINT32.itemsize + distances.itemsize + 1  # of a table, and whether it is used
    _core.require_result_bytes("radius", lists + len(counts) * width * place, max_result_bytes)
    table = np.full((len(counts), width), MISSING, UINT32)
    far = np.full((len(counts), width), np.inf, distances.dtype)
    used = np.arange(width) < counts[:, None]
    table[used] = indices
    far[used] = distances
    shape = lead + (width,)
    return {
        "counts": counts.astype(UINT32).reshape(lead),
        "indices": table.reshape(shape),
        "distances": far.reshape(shape),
    }


def load_points(file: str | bytes | os.PathLike) -> np.ndarray:
    """The vertices of a file, (N, 3) float32: .ply, .xyz, .npy, .obj, .stl, .off, .gltf, .glb, also
    with .gz, .xz or .zst.

    InputError names the file, the element and the reason.
    """
    return _core.load_scene(path(file, "file"), 1)["vertices"]
