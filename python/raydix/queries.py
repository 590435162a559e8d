"""Queries of scenes: closest points, inside and outside, overlaps, what balls touch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import (
    ALL,
    FLOAT32,
    FLOAT64,
    UINT32,
    cast,
    flag,
    number,
    one_of,
    require_dtype,
    result_bytes,
    rows,
    shown,
    whole,
)
from ._rays import floats_of, ray_batch

if TYPE_CHECKING:
    from .scene import Scene


RULES = ("automatic", "crossings", "parity", "winding")


class SceneQueries:
    """What a Scene answers without rays."""

    _core: Any
    dtype: np.dtype
    threads: int

    def closest_point(
        self, points: ArrayLike, *, max_distance: float = np.inf, mask: int = ALL
    ) -> dict[str, np.ndarray]:
        """The point of the scene that is closest to each query.

        `points`: shape (..., 3), converted to the scene's type. Beyond `max_distance` (its square
        decides, rounded) nothing is found. Returns a dict of arrays with the leading shape of the
        queries: "point" (..., 3), "distance", "u" and "v" in the scene's type; "prim", "geometry"
        and "instance" as those of a hit. At equal distances the lower (instance, geometry, prim)
        wins; nothing found: infinity and 0xFFFFFFFF. `mask` as in `intersect`: geometries and
        instances that it does not show are not there. ValueError for a negative or NaN
        `max_distance`.

        Triangles of instances are those that their vertices make in the world, moved in float64 and
        rounded once. Within spheres and capsules the distance is 0.
        """
        asked, lead = rows(points, "points", (3,), self.dtype)
        reach = number(max_distance, "max_distance")
        # prim, geometry and instance are uint32 behind the distance, padded to whole scalars.
        places = np.empty((len(asked), 9 if self.dtype == FLOAT32 else 8), self.dtype)
        self._core.closest(asked, places, reach, self.threads, _mask(mask))
        places = places.reshape(lead + (places.shape[1],))
        first = self.dtype.itemsize
        ids = places.view(UINT32)[..., first : first + 3]
        return {
            "point": places[..., :3],
            "distance": places[..., 3],
            "prim": ids[..., 0],
            "geometry": ids[..., 1],
            "instance": ids[..., 2],
            "u": places[..., -2],
            "v": places[..., -1],
        }

    def signed_distance(
        self,
        points: ArrayLike,
        *,
        max_distance: float = np.inf,
        rule: str = "automatic",
        mask: int = ALL,
    ) -> np.ndarray:
        """Distance of each point from the mesh, negative inside: in the scene's type, with the
        leading shape of the queries.

        (`trimesh.proximity.signed_distance` has the other sign.) The sign is that of `contains`
        with this `rule` and `mask`. Beyond `max_distance` the answer is infinite, with its sign; for points
        with NaN or infinity it is infinite.
        """
        asked, lead = rows(points, "points", (3,), self.dtype)
        distances = np.empty(lead, self.dtype)
        reach = number(max_distance, "max_distance")
        how = (_rule(rule), self.threads, _mask(mask))
        self._core.signed_distance(asked, distances.reshape(-1), reach, *how)
        return distances

    def contains(
        self, points: ArrayLike, *, rule: str = "automatic", mask: int = ALL
    ) -> np.ndarray:
        """Whether each point is inside of the mesh: bool, with the leading shape of the queries.

        `rule`: "crossings" (signed crossings to infinity are not 0), "parity" (their number is
        odd), "winding" (generalized winding number of 1/2 or more, Jacobson et al. 2013: for meshes
        with holes; parts far away count by a series, see `winding_number`), or "automatic": the
        first of these that the mesh is closed enough for. The first two are decided without rounding, at edges and vertices
        too, and points of the surface are inside. Points with NaN or infinity are outside. `mask`:
        as in `closest_point`. The first call with another one than before makes that body anew.
        """
        asked, lead = rows(points, "points", (3,), self.dtype)
        flags = np.empty(lead, np.bool_)
        self._core.contains(asked, flags.reshape(-1), _rule(rule), self.threads, _mask(mask))
        return flags

    def winding_number(
        self, points: ArrayLike, *, rule: str = "automatic", mask: int = ALL
    ) -> np.ndarray:
        """The number that `contains` decides by: float64, with the leading shape; NaN for points
        with NaN or infinity.

        With "winding" parts far away count by two terms of a series (Barill et al. 2018). The error
        differs between builders and qualities. It is below 0.01 for surfaces that do not overlap,
        as far as tests go. Layers that lie on each other add theirs up: 0.27 for 40 of them."""
        asked, lead = rows(points, "points", (3,), self.dtype)
        numbers = np.empty(lead, FLOAT64)
        self._core.winding(asked, numbers.reshape(-1), _rule(rule), self.threads, _mask(mask))
        return numbers

    def overlaps(
        self,
        other: Scene | None = None,
        *,
        narrow: bool = False,
        max_result_bytes: int = 0,
        mask: int = ALL,
    ) -> np.ndarray | dict[str, np.ndarray]:
        """All pairs of triangles whose boxes overlap: shape (P, 2) uint32, sorted.

        Within this scene (i < j; pairs that share a corner are left out), or between it and `other`
        (i of this one, j of `other`). With `narrow` the triangles themselves must meet, decided
        without rounding. `max_result_bytes` as in `all_hits`: no pair is ever dropped. `mask` as in
        `closest_point`, for both scenes. TypeError for scenes of different types.

        If one of the scenes is more than one mesh, a dict of such arrays: "prim", "geometry" and
        "instance", as those of a hit. Pairs are then sorted by (instance, geometry, prim) of the
        first, then of the second. The memory of the call holds a copy of all triangles, those of
        instances on every path. InputError names spheres and capsules.
        """
        pairs = self._core.overlaps(
            self._partner(other),
            flag(narrow, "narrow"),
            result_bytes(max_result_bytes),
            self.threads,
            _mask(mask),
        )
        if pairs.shape[1] == 2:
            return pairs
        columns = pairs.reshape(-1, 2, 3)
        return {"prim": columns[..., 2], "geometry": columns[..., 1], "instance": columns[..., 0]}

    def _partner(self, other: Scene | None) -> Any:
        """The core of a scene that this one can be held against."""
        if other is None:
            return None
        if not isinstance(other, SceneQueries):
            raise TypeError(f"other: expected a Scene, given {shown(other)}")
        require_dtype(other, self.dtype, "other")
        return other._core

    def count_overlaps(
        self, other: Scene | None = None, *, narrow: bool = False, mask: int = ALL
    ) -> int:
        """How many pairs `overlaps` would give, without keeping them."""
        return self._core.count_overlaps(
            self._partner(other), flag(narrow, "narrow"), self.threads, _mask(mask)
        )

    def touched_by(
        self,
        *,
        spheres: ArrayLike | None = None,
        segments: ArrayLike | None = None,
        max_result_bytes: int = 0,
        mask: int = ALL,
    ) -> dict[str, np.ndarray]:
        """All triangles and shapes that each ball (x y z radius, shape (..., 4)) or segment (two
        points, shape (..., 6)) touches.

        Returns a dict: "offsets" (uint64, one more than queries); "prim", "geometry" and "instance"
        as those of a hit, ascending by (instance, geometry, prim) in each row. `max_result_bytes`
        as in `all_hits`, `mask` as in `closest_point`.
        """
        kind, shapes, _ = self._touching(spheres, segments, "touched_by")
        call = getattr(self._core, f"touched_by_{kind}")
        offsets, names = call(shapes, result_bytes(max_result_bytes), self.threads, _mask(mask))
        return {
            "offsets": offsets,
            "prim": names[:, 2],
            "geometry": names[:, 1],
            "instance": names[:, 0],
        }

    def touches(
        self,
        *,
        spheres: ArrayLike | None = None,
        segments: ArrayLike | None = None,
        mask: int = ALL,
    ) -> np.ndarray:
        """Whether each ball or segment, as for `touched_by`, touches anything that the mask shows:
        bool, with their leading shape."""
        kind, shapes, lead = self._touching(spheres, segments, "touches")
        flags = np.empty(lead, np.bool_)
        call = getattr(self._core, f"touches_{kind}")
        call(shapes, flags.reshape(-1), self.threads, _mask(mask))
        return flags

    def _touching(self, spheres: Any, segments: Any, call: str) -> tuple[str, np.ndarray, tuple]:
        """Which of both there is, its rows, and their leading shape."""
        if (spheres is None) == (segments is None):
            raise ValueError(f"{call}: expected either spheres or segments")
        if spheres is not None:
            return ("spheres", *rows(spheres, "spheres", (4,), self.dtype))
        return ("segments", *rows(segments, "segments", (6,), self.dtype))

    def sweep_spheres(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        radii: ArrayLike,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
    ) -> dict[str, np.ndarray]:
        """Where balls whose centers move along rays first touch a triangle.

        Rays as in `intersect`; `radii`: a number, or an array that fits their leading shape.
        Returns a dict of arrays with that shape: "t" of the center at the first contact (infinity:
        there is none), "point" (..., 3), the point that is touched, "u", "v", and "prim",
        "geometry" and "instance" as those of a hit. At equal t the lower (instance, geometry, prim)
        wins. A ball that touches at the start has t = tmin. Those with a negative radius or one
        that is not finite touch nothing, as rays that are invalid hit nothing. `mask` as in
        `closest_point`. InputError names spheres and capsules that it shows: they have no answer.
        """
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        balls = np.empty((len(args[0]), 9), self.dtype)
        if len(args) == 1:
            balls[:, :8] = args[0]
        else:
            with np.errstate(over="ignore"):  # beyond float32 it is infinite
                balls[:, :3], balls[:, 4:7], balls[:, 3], balls[:, 7] = args
        balls[:, 8] = cast(floats_of(radii, "radii", lead), self.dtype).reshape(-1)
        # prim, geometry and instance as in closest_point, behind t.
        columns = 9 if self.dtype == FLOAT32 else 8
        hits = np.empty((len(balls), columns), self.dtype)
        self._core.sweep(balls, hits, self.threads, _mask(mask))
        hits = hits.reshape(lead + (columns,))
        first = self.dtype.itemsize // 4
        ids = hits.view(UINT32)[..., first : first + 3]
        return {
            "t": hits[..., 0],
            "point": hits[..., -5:-2],
            "prim": ids[..., 0],
            "geometry": ids[..., 1],
            "instance": ids[..., 2],
            "u": hits[..., -2],
            "v": hits[..., -1],
        }


def _rule(rule: Any) -> str:
    return one_of(rule, "rule", RULES)


def _mask(mask: Any) -> int:
    return whole(mask, "mask", 0, ALL)
