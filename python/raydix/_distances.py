"""Neighbours by measures that `Points` does not have: Minkowski distances, periodic boxes, more
than three axes.

`Points` finds every point that may be near enough, by Euclidean distance along up to three axes,
with a margin for rounding. The measure of each of these is then computed in NumPy, and what is too
far is dropped. A measure grows with the distance: it is the square for p = 2, else the distance.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from ._arrays import MISSING, number
from ._core import InputError
from .points import Points

CANDIDATES = 1 << 21
"""How many candidates are at work at a time, about."""
BATCH_BYTES = 1 << 28
MARGIN = 1e-9
"""Relative; far more than all rounding between a measure and what `Points` compares."""

Pairs = tuple[np.ndarray, np.ndarray, np.ndarray]


def order_of(p: float) -> float:
    """p of a Minkowski distance; ValueError unless it is from 1 to infinity."""
    order = number(p, "p")
    if not order >= 1:
        raise ValueError(f"p: expected a number from 1 to infinity, given {p}")
    return order


def measure_of(distance: np.ndarray, p: float) -> np.ndarray:
    """Distances -> measures."""
    return distance * distance if p == 2 else distance


def distance_of(measure: np.ndarray, p: float) -> np.ndarray:
    """Measures -> distances."""
    return np.sqrt(measure) if p == 2 else measure


def measured(apart: np.ndarray, p: float) -> np.ndarray:
    """How far apart along each axis, shape (..., m), none negative -> measures, shape (...)."""
    if p == np.inf:
        return apart.max(axis=-1)
    if p in (1, 2):
        terms = apart if p == 1 else apart * apart
        total = terms[..., 0].copy()
        for axis in range(1, terms.shape[-1]):
            total += terms[..., axis]
        return total
    most = apart.max(axis=-1)  # powers of large numbers overflow, those of small ones vanish
    part = np.divide(apart, most[..., None], out=np.zeros_like(apart), where=most[..., None] > 0)
    return most * (part**p).sum(axis=-1) ** (1 / p)


class Neighbourhood:
    """An index over `data`, float64 of shape (n, m). `boxsize`: shape (m,), how often the axes
    repeat, 0 for those that do not."""

    def __init__(self, data: np.ndarray, boxsize: np.ndarray) -> None:
        self.data = data
        self.boxsize = boxsize
        self.size, m = data.shape
        lo, hi = (f(axis=0) if self.size else np.zeros(m) for f in (data.min, data.max))
        self.axes = np.sort(np.argsort(hi - lo, kind="stable")[-3:]) if m > 3 else np.arange(m)
        self.lo, self.hi = lo[self.axes], hi[self.axes]
        self.points = Points(self.along_axes(data), strict=True)
        self.extent = float(np.abs(data).max(initial=0) + boxsize.max(initial=0))
        self.shifts = [
            np.array(shift)
            for shift in itertools.product(
                *((0.0, -size, size) if size > 0 else (0.0,) for size in boxsize[self.axes])
            )
        ]

    def along_axes(self, places: np.ndarray) -> np.ndarray:
        """What the index sees of places: two or three of their coordinates, or one and 0."""
        if places.shape[-1] == 1:
            return np.concatenate([places, np.zeros_like(places)], axis=-1)
        return places if places.shape[-1] <= 3 else np.ascontiguousarray(places[..., self.axes])

    def plain(self, p: float) -> bool:
        """Whether the answers of `points` are the answers."""
        m = self.data.shape[1]
        return len(self.shifts) == 1 and (m == 1 or (m <= 3 and p == 2))

    def wrapped(self, queries: np.ndarray) -> np.ndarray:
        """Queries -> the same in the box where it repeats."""
        if len(self.shifts) == 1 and not self.boxsize.any():
            return queries
        size = np.where(self.boxsize > 0, self.boxsize, np.inf)
        inside = queries - np.floor(queries / size) * np.where(self.boxsize > 0, size, 0)
        return np.where((self.boxsize > 0) & (inside >= size), 0.0, inside)

    def _measures(self, queries: np.ndarray, indices: np.ndarray, p: float) -> np.ndarray:
        apart = np.abs(queries - self.data[indices])
        if self.boxsize.any():
            around = np.where(self.boxsize > 0, self.boxsize - apart, np.inf)
            apart = np.minimum(apart, around)
        return measured(apart, p)

    def _reach(self, limits: np.ndarray, p: float) -> np.ndarray:
        """Measures -> Euclidean distances along `axes` that no point with at most these exceeds."""
        factor = max(1.0, len(self.axes) ** (0.5 - 1 / p)) * (1 + MARGIN)
        return distance_of(limits, p) * factor + self.extent * 1e-14

    def within(
        self, queries: np.ndarray, limits: np.ndarray, p: float, threads: int
    ) -> Iterator[Pairs]:
        """All pairs of a query and a point whose measure is at most that query's limit, (Q,), in
        batches: numbers of queries, of points, measures; sorted by the numbers."""
        queries = self.wrapped(queries)
        reach = self._reach(limits, p)
        begin, size = 0, 64
        while begin < len(queries):
            some = slice(begin, min(begin + size, len(queries)))
            try:
                rows, indices = self._candidates(
                    queries[some], reach[some], BATCH_BYTES if size > 1 else 0, threads
                )
            except InputError:
                if size == 1:
                    raise
                size = max(1, size // 8)
                continue
            rows += begin
            measures = self._measures(queries[rows], indices, p)
            near = measures <= limits[rows]
            yield rows[near], indices[near], measures[near]
            begin = some.stop
            size = max(1, min(8 * size, size * CANDIDATES // max(len(rows), 1)))

    def _candidates(
        self, queries: np.ndarray, reach: np.ndarray, max_bytes: int, threads: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a query and a point that one of the images of the query may be near to."""
        seen = self.along_axes(queries)
        all_rows, all_indices = [], []
        for shift in self.shifts:
            rows, moved = np.arange(len(queries)), seen
            if shift.any():
                moved = seen.copy()
                moved[:, : len(shift)] += shift
                beside = np.maximum(
                    self.lo - moved[:, : len(shift)], moved[:, : len(shift)] - self.hi
                )
                gap = np.sqrt((np.maximum(beside, 0) ** 2).sum(axis=1))
                rows = np.flatnonzero((gap <= reach) & (reach < np.inf))
                moved = moved[rows]
                if not len(rows):
                    continue
            found = self.points.radius(
                moved, reach[rows], max_result_bytes=max_bytes, threads=threads
            )
            all_rows.append(np.repeat(rows, np.diff(found["offsets"]).astype(np.intp)))
            all_indices.append(found["indices"].astype(np.intp))
        if len(all_rows) == 1:
            return all_rows[0], all_indices[0]
        pairs = np.concatenate(all_rows) * self.size + np.concatenate(all_indices)
        pairs.sort(kind="stable")  # which knows the runs that there are
        pairs = pairs[np.diff(pairs, prepend=-1) > 0]
        return np.divmod(pairs, self.size)

    def nearest(
        self, queries: np.ndarray, k: int, p: float, threads: int, most: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """(measures, indices), both (Q, k): the k nearest by (measure, index). Where there are
        fewer within the distance `most`, infinity and n."""
        measures = np.full((len(queries), k), np.inf)
        indices = np.full((len(queries), k), self.size, np.intp)
        if self.size == 0 or len(queries) == 0:
            return measures, indices
        queries = self.wrapped(queries)
        wanted = asked = min(k, self.size)
        pending = np.arange(len(queries))
        while len(pending):
            limits, enough = self._enough(queries[pending], wanted, asked, p, threads, most)
            done = pending[enough]
            for rows, found, at in self.within(queries[done], limits[enough], p, threads):
                order = np.lexsort((found, at, rows))
                rows, found, at = rows[order], found[order], at[order]
                rank = np.arange(len(rows)) - np.searchsorted(rows, rows)
                kept = rank < k
                measures[done[rows[kept]], rank[kept]] = at[kept]
                indices[done[rows[kept]], rank[kept]] = found[kept]
            pending = pending[~enough]
            asked = min(4 * asked, self.size)
        return measures, indices

    def _enough(
        self, queries: np.ndarray, wanted: int, asked: int, p: float, threads: int, most: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Limits within which each query has `wanted` points or all within the distance `most`,
        from those that are nearest along `axes`; and whether a search within them is worth its
        while: with more than three axes the limits of few points are wide."""
        limits = np.empty(len(queries))
        enough = np.ones(len(queries), bool)
        bound = measure_of(most, p)
        reach = float(self._reach(bound, p))
        step = max(1, CANDIDATES // (asked * queries.shape[1]))
        for begin in range(0, len(queries), step):
            some = slice(begin, begin + step)
            near = self.points.knn(
                self.along_axes(queries[some]), asked, max_distance=reach, threads=threads
            )
            found = np.minimum(near["indices"], self.size - 1).astype(np.intp)
            at = self._measures(queries[some, None], found, p)
            at[near["indices"] == MISSING] = np.inf
            last = np.partition(at, wanted - 1, axis=1)[:, wanted - 1]
            limits[some] = np.minimum(last * (1 + MARGIN), bound)
            if queries.shape[1] > 3 and asked < self.size:
                enough[some] = self._reach(limits[some], p) <= 1.3 * near["distances"][:, -1]
        return limits, enough
