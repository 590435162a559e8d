"""`cKDTree` and `KDTree` with the calls of `scipy.spatial`, on `raydix.Points`.

    from raydix.scipy import cKDTree

Float64, as there. Answers are exact, whatever `eps`. Of two neighbours at the same distance (with
p = 2 the same square of it) the one with the lower index comes first; SciPy promises no order. Coordinates go to 1e12. The nodes of the
tree (`tree`) cannot be had.

Euclidean distances in one, two or three dimensions take the short way: the index answers. With
another `p`, a `boxsize` or more dimensions the index names candidates, and NumPy then measures
them. In three dimensions the nearest then take 1 to 13 times as long as SciPy's, most where many
are asked of clustered points. With four or more use SciPy's own class: the index knows three axes,
those along which the data is widest.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import MISSING, number, shown, whole
from ._distances import Neighbourhood, Pairs, distance_of, measure_of, order_of


def _threads(workers: int) -> int:
    threads = whole(workers, "workers", -1, 1024)
    if threads == 0:
        raise ValueError("workers: expected -1 or a number of 1 or more, given 0")
    return max(threads, 0)


def _real(value: ArrayLike, name: str) -> np.ndarray:
    error: type[Exception] = TypeError
    array = None
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "cSUmMV":
            return array.astype(np.float64, copy=False)
    except (ValueError, OverflowError):
        error = ValueError
    except TypeError:
        pass
    if array is not None and array.dtype.kind == "c":
        raise TypeError(f"{name}: complex data is not supported")
    raise error(f"{name}: expected numbers, given {shown(value)}")


def _radii(r: ArrayLike, lead: tuple[int, ...]) -> np.ndarray:
    """One for each query: shape (Q,)."""
    given = _real(r, "r")
    try:
        return np.array(np.broadcast_to(given, lead)).reshape(-1)
    except ValueError:
        raise ValueError(f"r: expected a number or shape {lead}, given {shown(given)}") from None


def _ranks(k: Any) -> tuple[int, np.ndarray | None]:
    """How many neighbours, k rounded up, and which of them, if k lists some."""
    if type(k) is int:
        return k, None
    if k is None:
        raise ValueError("k must be an integer or a sequence of integers")
    if np.ndim(k) == 0:
        most = number(k, "k")
        if not most < 2**31:  # NaN too
            raise ValueError(f"k: expected at most {2**31 - 1}, given {shown(k)}")
        return int(np.ceil(max(most, 0))), None
    ranks = np.asarray(k)
    if ranks.ndim != 1 or (ranks.dtype.kind not in "biuf" and ranks.size):
        raise TypeError(f"k: expected a number or shape (K,) of whole numbers, given {shown(k)}")
    ranks = ranks.astype(np.intp)
    return int(ranks.max(initial=0)) if ranks.min(initial=1) > 0 else 0, ranks


def _box(boxsize: ArrayLike | None, data: np.ndarray) -> np.ndarray | None:
    """How often each axis repeats, 0 for never; None: no axis was named."""
    if boxsize is None:
        return None
    box = np.array(np.broadcast_to(_real(boxsize, "boxsize"), data.shape[1:]))
    if not np.isfinite(box).all():
        raise ValueError("boxsize: must be finite, without NaN")
    outside = ((data < 0) | (data >= box)) & (box > 0)
    if outside.any():
        point, axis = np.argwhere(outside)[0]
        raise ValueError(
            f"data: point {point} is at {data[point, axis]} on axis {axis}, which repeats from 0 "
            f"to {box[axis]}"
        )
    return np.maximum(box, 0)


def _lists(rows: np.ndarray, indices: np.ndarray, count: int) -> np.ndarray:
    """Pairs that are sorted by row -> an array of `count` lists."""
    ends = np.searchsorted(rows, np.arange(count + 1)).tolist()
    values = indices.tolist()
    lists = np.empty(count, object)
    for i in range(count):
        lists[i] = values[ends[i] : ends[i + 1]]
    return lists


class cKDTree:  # noqa: N801, the name of the class that it stands in for
    """An index over `data`, shape (n, m). `boxsize`: how often space repeats, one number or one for
    each axis; 0 for an axis that does not. `leafsize` and the other options of SciPy's have no
    effect."""

    def __init__(
        self,
        data: ArrayLike,
        leafsize: int = 16,
        compact_nodes: bool = True,
        copy_data: bool = False,
        balanced_tree: bool = True,
        boxsize: ArrayLike | None = None,
    ) -> None:
        self.data = _real(data, "data")
        if copy_data:
            self.data = self.data.copy()
        if self.data.ndim != 2 or self.data.shape[1] < 1:
            raise ValueError(f"data: expected shape (n, m), given {self.data.shape}")
        if not np.isfinite(self.data).all():
            raise ValueError("data: must be finite, without NaN")
        self.n, self.m = self.data.shape
        self.leafsize = leafsize
        self.boxsize = _box(boxsize, self.data)
        self.maxes = self.data.max(axis=0) if self.n else np.zeros(self.m)
        self.mins = self.data.min(axis=0) if self.n else np.zeros(self.m)
        self._near = Neighbourhood(self.data, self._repeats())

    def _repeats(self) -> np.ndarray:
        return np.zeros(self.m) if self.boxsize is None else self.boxsize

    def __reduce__(self) -> tuple:
        """Pickles and copies are the data; the tree is built again."""
        return type(self), (self.data, self.leafsize, True, False, True, self.boxsize)

    def __repr__(self) -> str:
        return f"<raydix.scipy.{type(self).__name__}: {self.n:,} points, {self.m}-D>"

    @property
    def size(self) -> int:
        """Nodes of the tree, as SciPy's attribute of that name; theirs and these differ."""
        return self._near.points.stats()["nodes"]

    @property
    def indices(self) -> np.ndarray:
        """The numbers of the points in the order of the tree."""
        return self._near.points._core.order().astype(np.intp)

    def _queries(self, x: ArrayLike) -> np.ndarray:
        queries = _real(x, "x")
        if queries.ndim == 0 or queries.shape[-1] != self.m:
            raise ValueError(f"x: expected shape (..., {self.m}), given {queries.shape}")
        if not np.isfinite(queries).all():
            raise ValueError("x: must be finite, without NaN")
        return queries

    def _other(self, other: cKDTree) -> cKDTree:
        if not isinstance(other, cKDTree):
            raise TypeError(f"other: expected a raydix.scipy.cKDTree, given {type(other).__name__}")
        if other.m != self.m or (other._repeats() != self._repeats()).any():
            raise ValueError("other: has another number of dimensions or another boxsize")
        return other

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
        p = order_of(p)
        most, ranks = _ranks(k)
        queries = self._queries(x)
        if most < 1:
            raise ValueError("k: neighbours are counted from 1")
        distances, indices = self._nearest(
            queries, most, p, _threads(workers), distance_upper_bound
        )
        missing = ~(distances < distance_upper_bound)
        distances[missing] = np.inf
        indices[missing] = self.n
        if ranks is not None:
            return distances[..., ranks - 1], indices[..., ranks - 1]
        if k == 1:
            distances, indices = distances[..., 0], indices[..., 0]
            return (distances, indices) if queries.ndim > 1 else (float(distances), int(indices))
        return distances, indices

    def _nearest(
        self, queries: np.ndarray, k: int, p: float, threads: int, bound: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """Those beyond `bound` may be left out."""
        near = self._near
        most = bound * (1 + 1e-6) if bound >= 0 else np.inf
        if near.plain(p):
            found = near.points.knn(
                near.along_axes(queries), k, max_distance=most, threads=threads
            )
            indices = found["indices"].astype(np.intp)
            indices[found["indices"] == MISSING] = self.n
            return found["distances"], indices
        measures, indices = near.nearest(queries.reshape(-1, self.m), k, p, threads, most)
        shape = queries.shape[:-1] + (k,)
        return distance_of(measures, p).reshape(shape), indices.reshape(shape)

    def _within(
        self, queries: np.ndarray, radii: np.ndarray, p: float, threads: int
    ) -> Iterator[Pairs]:
        """Batches of numbers of queries, of points, and distances: every pair no farther apart than
        the query's radius, sorted by both numbers. Queries (Q, m), radii (Q,)."""
        near = self._near
        if not (radii >= 0).all():  # below 0, or NaN: nothing is so near
            some = np.flatnonzero(radii >= 0)
            for rows, indices, distances in self._within(queries[some], radii[some], p, threads):
                yield some[rows], indices, distances
            return
        if near.plain(p):
            found = near.points.radius(near.along_axes(queries), radii, threads=threads)
            lengths = np.diff(found["offsets"]).astype(np.intp)
            rows = np.repeat(np.arange(len(queries)), lengths)
            yield rows, found["indices"].astype(np.intp), found["distances"]
            return
        for rows, indices, measures in near.within(queries, measure_of(radii, p), p, threads):
            yield rows, indices, distance_of(measures, p)

    def _pairs_within(
        self, queries: np.ndarray, radii: np.ndarray, p: float, threads: int
    ) -> Pairs:
        batches = list(self._within(queries, radii, p, threads))
        if not batches:
            return np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)
        rows, indices, distances = (np.concatenate(part) for part in zip(*batches, strict=True))
        return rows, indices, distances

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
        lists. Rows ascend always. None are within a
        radius below 0 or NaN."""
        p, threads = order_of(p), _threads(workers)
        queries = self._queries(x)
        lead = queries.shape[:-1]
        near, rows = self._near, queries.reshape(-1, self.m)
        radii = _radii(r, lead)
        if return_length:
            if np.ndim(r) == 0 and near.plain(p) and (radii >= 0).all():
                lengths = near.points.count(near.along_axes(rows), float(r), threads=threads)  # type: ignore[arg-type]
            else:
                lengths = np.zeros(len(rows), np.intp)
                for some, _, _ in self._within(rows, radii, p, threads):
                    lengths += np.bincount(some, minlength=len(rows))
            lengths = lengths.astype(np.intp).reshape(lead)
            return lengths if lead else lengths[()]
        some, indices, _ = self._pairs_within(rows, radii, p, threads)
        lists = _lists(some, indices, len(rows))
        return lists.reshape(lead) if lead else lists[0]

    def query_ball_tree(
        self, other: cKDTree, r: float, p: float = 2.0, eps: float = 0
    ) -> list[list[int]]:
        """For each point of this tree the indices of all points of `other` within r, ascending."""
        return self._other(other).query_ball_point(self.data, number(r, "r"), p).tolist()

    def query_pairs(
        self, r: float, p: float = 2.0, eps: float = 0, output_type: str = "set"
    ) -> Any:
        """All pairs (i, j), i < j, no farther apart than r: a set of tuples, or with "ndarray" an
        array (P, 2)."""
        p = order_of(p)
        if output_type not in ("set", "ndarray"):
            raise ValueError(f"output_type: expected 'set' or 'ndarray', given {output_type!r}")
        r = number(r, "r")
        if self._near.plain(p) and r >= 0:
            pairs = self._near.points.pairs(r)["pairs"].astype(np.intp)
        else:
            radii = np.full(self.n, r, np.float64)
            halves = [
                np.stack([i, j], axis=1)[i < j] for i, j, _ in self._within(self.data, radii, p, 1)
            ]
            pairs = np.concatenate([np.empty((0, 2), np.intp), *halves])
        return pairs if output_type == "ndarray" else set(map(tuple, pairs.tolist()))

    def sparse_distance_matrix(
        self,
        other: cKDTree,
        max_distance: float,
        p: float = 2.0,
        output_type: str = "dok_matrix",
    ) -> Any:
        """The distance of each point of this tree to each point of `other` that is no farther away
        than `max_distance`. `output_type`: "ndarray", an array of fields i, j and v; "dict", {(i,
        j): v}; "dok_matrix" or "coo_matrix", of `scipy.sparse`, which these two need."""
        kinds = ("dok_matrix", "coo_matrix", "dict", "ndarray")
        if output_type not in kinds:
            raise ValueError(
                f"output_type: expected one of {', '.join(kinds)}, given {output_type!r}"
            )
        radii = np.full(self.n, number(max_distance, "max_distance"), np.float64)
        i, j, v = self._other(other)._pairs_within(self.data, radii, order_of(p), 1)
        if output_type == "ndarray":
            table = np.empty(len(i), [("i", np.intp), ("j", np.intp), ("v", np.float64)])
            table["i"], table["j"], table["v"] = i, j, v
            return table
        if output_type == "dict":
            return dict(zip(zip(i.tolist(), j.tolist(), strict=True), v.tolist(), strict=True))
        from scipy.sparse import coo_matrix

        matrix = coo_matrix((v, (i, j)), (self.n, other.n))
        return matrix if output_type == "coo_matrix" else matrix.todok()

    def count_neighbors(
        self,
        other: cKDTree,
        r: ArrayLike,
        p: float = 2.0,
        weights: Any = None,
        cumulative: bool = True,
    ) -> Any:
        """How many pairs of a point of this tree and one of `other` are no farther apart than r, a
        number or shape (R,).

        Without `cumulative`: farther apart than the r before and no farther than this one, for r
        that do not descend. With `weights`, (of this tree, of the other) or one array for both of
        the same tree, the sum of the products of both; None stands for ones.
        """
        other, p = self._other(other), order_of(p)
        steps = _real(r, "r")
        if steps.ndim > 1:
            raise ValueError(f"r: expected a number or shape (R,), given {steps.shape}")
        radii = steps.reshape(-1)
        if not cumulative and (np.diff(radii) < 0).any():
            raise ValueError("r: must not descend where counts are not cumulative")
        mine, theirs = self._weights(other, weights)
        if mine is None and theirs is None and other._near.plain(p):
            near, seen = other._near, self._near.along_axes(self.data)
            sums = np.array(
                [
                    int(near.points.count(seen, x).sum(dtype=np.intp)) if x >= 0 else 0
                    for x in radii
                ],
                np.intp,
            )
        else:
            sums = self._sums(other, radii, p, mine, theirs)
        if not cumulative:
            sums = np.diff(sums, prepend=sums.dtype.type(0))
        return sums if steps.ndim else sums[0].item()

    def _weights(self, other: cKDTree, weights: Any) -> tuple[np.ndarray | None, np.ndarray | None]:
        if weights is None:
            return None, None
        if not isinstance(weights, tuple):
            if other is not self:
                raise ValueError("weights: one array is for a tree and itself; give a pair")
            weights = weights, weights
        mine, theirs = (None if w is None else _real(w, "weights") for w in weights)
        for array, tree in ((mine, self), (theirs, other)):
            if array is not None and array.shape != (tree.n,):
                raise ValueError(f"weights: expected shape ({tree.n},), given {array.shape}")
        return mine, theirs

    def _sums(
        self,
        other: cKDTree,
        radii: np.ndarray,
        p: float,
        mine: np.ndarray | None,
        theirs: np.ndarray | None,
    ) -> np.ndarray:
        """Sums of the products of weights over the pairs within each radius."""
        weighted = mine is not None or theirs is not None
        radii = np.where(radii >= 0, radii, -1.0)  # NaN holds no pair either
        order = np.argsort(radii, kind="stable")
        limits = measure_of(np.maximum(radii[order], 0), p)
        bins = np.zeros(len(radii) + 1, np.float64 if weighted else np.intp)
        if len(radii) and radii.max() >= 0:
            most = np.full(self.n, limits[-1])
            for i, j, measures in other._near.within(self.data, most, p, 1):
                place = np.searchsorted(limits, measures)
                product = None
                if weighted:
                    product = (1 if mine is None else mine[i]) * (
                        1 if theirs is None else theirs[j]
                    )
                    product = np.broadcast_to(product, i.shape)
                bins += np.bincount(place, product, len(bins)).astype(bins.dtype)
        sums = np.empty(len(radii), bins.dtype)
        sums[order] = bins.cumsum()[:-1]
        sums[radii < 0] = 0
        return sums


class KDTree(cKDTree):
    """`cKDTree` under SciPy's other name. One neighbour of one query has an index of NumPy's type;
    `leafsize` is 10 unless given."""

    def __init__(self, data: ArrayLike, leafsize: int = 10, *args: Any, **kwargs: Any) -> None:
        super().__init__(data, leafsize, *args, **kwargs)

    def query(self, *args: Any, **kwargs: Any) -> tuple[Any, Any]:
        """As `cKDTree.query`."""
        distances, indices = super().query(*args, **kwargs)
        return distances, np.intp(indices) if isinstance(indices, int) else indices
