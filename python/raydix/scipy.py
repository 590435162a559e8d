"""`cKDTree` with the signatures of `scipy.spatial.cKDTree`, on `raydix.Points`.

    from raydix.scipy import cKDTree

Euclidean distances in two or three dimensions, float64. Answers are exact, whatever `eps`. Of two
neighbours at the same squared distance the one with the lower index comes first; SciPy promises no
order. Coordinates go to 1e12; there are no `boxsize` and no `indices`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import MISSING
from .points import Points


def _threads(workers: int) -> int:
    if workers == -1:
        return 0
    if workers < 1:
        raise ValueError(f"workers: expected -1 or a number of 1 or more, given {workers}")
    return workers


def _real(value: ArrayLike, name: str) -> np.ndarray:
    array = np.asarray(value)
    if np.iscomplexobj(array):
        raise TypeError(f"{name}: complex data is not supported")
    return array.astype(np.float64, copy=False)


def _euclidean(p: float) -> None:
    if p != 2:
        raise ValueError(f"p: only 2 (Euclidean distances), given {p}")


class cKDTree:  # noqa: N801, the name of the class that it stands in for
    """An index over `data`, shape (n, 2) or (n, 3). `leafsize` and the other options of SciPy's
    have no effect."""

    def __init__(
        self,
        data: ArrayLike,
        leafsize: int = 16,
        compact_nodes: bool = True,
        copy_data: bool = False,
        balanced_tree: bool = True,
        boxsize: ArrayLike | None = None,
    ) -> None:
        if boxsize is not None:
            raise ValueError("boxsize: periodic boxes are not supported")
        self.data = _real(data, "data")
        if copy_data:
            self.data = self.data.copy()
        if self.data.ndim != 2 or self.data.shape[1] not in (2, 3):
            raise ValueError(f"data: expected shape (n, 2) or (n, 3), given {self.data.shape}")
        if not np.isfinite(self.data).all():
            raise ValueError("data: must be finite, without NaN")
        self.n, self.m = self.data.shape
        self.leafsize = leafsize
        self.maxes = self.data.max(axis=0) if self.n else np.zeros(self.m)
        self.mins = self.data.min(axis=0) if self.n else np.zeros(self.m)
        self._points = Points(self.data, strict=True)

    def __reduce__(self) -> tuple:
        """Pickles and copies are the data; the tree is built again."""
        return cKDTree, (self.data, self.leafsize)

    def __repr__(self) -> str:
        return f"<raydix.scipy.cKDTree: {self.n:,} points, {self.m}-D>"

    @property
    def size(self) -> int:
        """Nodes of the tree, as SciPy's attribute of that name; theirs and these differ."""
        return self._points.stats()["nodes"]

    def _queries(self, x: ArrayLike) -> np.ndarray:
        queries = _real(x, "x")
        if queries.ndim == 0 or queries.shape[-1] != self.m:
            raise ValueError(f"x: expected shape (..., {self.m}), given {queries.shape}")
        if not np.isfinite(queries).all():
            raise ValueError("x: must be finite, without NaN")
        return queries

    def query(
        self,
        x: ArrayLike,
        k: int | ArrayLike = 1,
        eps: float = 0,
        p: float = 2,
        distance_upper_bound: float = np.inf,
        workers: int = 1,
    ) -> tuple[Any, Any]:
        """(distances, indices) of the k nearest; missing ones have infinity and the index n. k may
        list which neighbours: [1, 3]."""
        _euclidean(p)
        if k is None:
            raise ValueError("k must be an integer or a sequence of integers")
        queries = self._queries(x)
        ranks = None if np.ndim(k) == 0 else np.asarray(k, np.int64)
        most = int(k) if ranks is None else int(ranks.max(initial=0))  # type: ignore[arg-type]
        if most < 1 or (ranks is not None and ranks.min() < 1):
            raise ValueError("k: neighbours are counted from 1")
        found = self._points.knn(queries, most, threads=_threads(workers))
        distances, indices = found["distances"], found["indices"].astype(np.intp)
        missing = (found["indices"] == MISSING) | ~(distances < distance_upper_bound)
        distances[missing] = np.inf
        indices[missing] = self.n
        if ranks is not None:
            return distances[..., ranks - 1], indices[..., ranks - 1]
        if most == 1:
            distances, indices = distances[..., 0], indices[..., 0]
            return (distances, indices) if queries.ndim > 1 else (float(distances), int(indices))
        return distances, indices

    def query_ball_point(
        self,
        x: ArrayLike,
        r: ArrayLike,
        p: float = 2.0,
        eps: float = 0,
        workers: int = 1,
        return_sorted: bool | None = None,
        return_length: bool = False,
    ) -> Any:
        """Indices of all points within r (a number or one for each query): a list, or an array of
        lists. Rows ascend always."""
        _euclidean(p)
        queries = self._queries(x)
        lead = queries.shape[:-1]
        radii = np.broadcast_to(np.asarray(r, np.float64), lead) if np.ndim(r) else r
        threads = _threads(workers)
        if return_length and np.ndim(radii) == 0:
            within = float(radii)  # type: ignore[arg-type]
            lengths = self._points.count(queries, within, threads=threads).astype(np.intp)
            return lengths if lead else int(lengths)
        found = self._points.radius(queries, radii, threads=threads)
        offsets = found["offsets"].astype(np.int64)
        if return_length:
            return np.diff(offsets).reshape(lead)
        indices = found["indices"].tolist()
        rows = np.empty(len(offsets) - 1, object)
        ends = offsets.tolist()
        for i in range(len(rows)):
            rows[i] = indices[ends[i] : ends[i + 1]]
        return rows.reshape(lead) if lead else rows[0]

    def query_pairs(
        self, r: float, p: float = 2.0, eps: float = 0, output_type: str = "set"
    ) -> Any:
        """All pairs (i, j), i < j, no farther apart than r: a set of tuples, or with "ndarray" an
        array (P, 2)."""
        _euclidean(p)
        pairs = self._points.pairs(r)["pairs"].astype(np.intp)
        if output_type == "ndarray":
            return pairs
        if output_type != "set":
            raise ValueError(f"output_type: expected 'set' or 'ndarray', given {output_type!r}")
        return set(map(tuple, pairs.tolist()))


KDTree = cKDTree
"""The same class: SciPy has both names too."""
