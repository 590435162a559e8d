"""What hits say about the surface there: points, normals, and what vertices carry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import ALL, MISSING, UINT32, cast, describe, shown, text, to_numpy, uint32s, whole
from ._core import InputError
from ._rays import hit_rows, ray_rows
from .hits import COLUMNS, Hits

_COMPUTED = ("position", "normal")


def also_names(also: Any) -> tuple[str, ...]:
    """What `intersect(also=...)` was given: one name or several."""
    names = (also,) if isinstance(also, str) else also
    if not isinstance(names, (tuple, list)):
        raise TypeError(f"also: expected a name or several, given {shown(also)}")
    return tuple(text(name, "also") for name in names)


def _columns_of(hits: Any) -> list[np.ndarray]:
    """What interpolation needs of hits, all of one shape."""
    names = ("prim", "geometry", "instance", "u", "v")
    if not isinstance(hits, Mapping) or any(name not in hits for name in names):
        raise TypeError(
            f"hits: expected a dict of arrays {', '.join(COLUMNS)}, as of Scene.intersect, "
            f"given {shown(hits)}"
        )
    ids = [uint32s(hits[name], f"hits, {name}") for name in names[:3]]
    weights = [to_numpy(hits[name], f"hits, {name}") for name in names[3:]]
    columns = [*ids, *weights]
    for name, column in zip(names, columns, strict=True):
        if column.shape != ids[0].shape or column.dtype.kind not in "iuf":
            raise ValueError(
                f"hits, {name}: expected numbers of shape {ids[0].shape}, given {describe(column)}"
            )
    return columns


def _rows_of(found: tuple, name: str, id: int) -> tuple[np.ndarray, np.ndarray]:
    """An attribute of a mesh: a row for each vertex, and the triangles."""
    numbers, columns, vertices, faces = found
    values = numbers.reshape(-1) if columns is None else numbers.reshape(-1, columns)
    if len(values) != vertices:
        raise ValueError(
            f"{name}: geometry {id} had {len(values)} vertices when it was given, "
            f"and has {vertices} now"
        )
    return values, faces


class SurfaceOfHits:
    """What a Scene knows about hits."""

    _core: Any
    dtype: np.dtype
    threads: int

    def positions(
        self,
        hits: Mapping[str, Any],
        rays: ArrayLike | None = None,
        directions: ArrayLike | None = None,
    ) -> np.ndarray:
        """Where hits are: shape (..., 3) in the scene's type, in this scene's space, through all
        instances.

        `hits`: as `intersect` and `all_hits` return them, of this scene as it is committed
        now. Computed in float64 from the triangle, u and v; in a float32 scene rounded once. NaN
        for those that hit nothing. InputError: a path, geometry or triangle that the last commit
        does not have. Hits of spheres and capsules need the rays, as `intersect` was given them:
        their points are origin + t * direction.
        """
        return self._of_hits(hits, rays, directions, "positions")

    def normals(
        self,
        hits: Mapping[str, Any],
        rays: ArrayLike | None = None,
        directions: ArrayLike | None = None,
    ) -> np.ndarray:
        """The geometric normal at each hit: shape (..., 3) in the scene's type, of unit length, in
        this scene's space. Counter-clockwise corners face the viewer; the outside of a mesh stays
        outside where an instance mirrors it. Of spheres and capsules, which need the rays, it
        points away from the center or axis. `hits`, `rays`, NaN and errors as in `positions`."""
        return self._of_hits(hits, rays, directions, "normals")

    def _of_hits(self, hits: Mapping[str, Any], rays: Any, directions: Any, what: str) -> np.ndarray:
        columns = self._core.hit_columns
        given = hit_rows(hits, self.dtype, columns)
        lead = given.shape[:-1]
        with_rays = None if rays is None else ray_rows(rays, directions, lead, self.dtype)
        found = np.empty((*lead, 3), self.dtype)
        call = getattr(self._core, what)
        call(given.reshape(-1, columns), with_rays, found.reshape(-1, 3), self.threads)
        return found

    def set_attributes(self, id: int = 0, **attributes: ArrayLike | None) -> None:
        """Gives the vertices of a mesh more than a place: `set_attributes(0, uv=array)`.

        Each array has shape (V,) or (V, C), numbers, V as the mesh has vertices now; it is copied,
        in the scene's type. None takes one away. `intersect(..., also="uv")` and `interpolate` give
        their values at hits. "position", "normal" and the names of columns and methods of
        `Hits` are taken, as "hit" and "items". InputError:
        no such geometry, or no mesh. `load_scene` and files give none.
        """
        number = whole(id, "id", 0, ALL)
        mesh = self._core.arrays_of(number)
        if mesh is None:
            raise InputError(f"geometry {number} is no mesh whose vertices could have attributes")
        vertices = len(mesh[0])
        checked: dict[str, np.ndarray | None] = {}
        for name, values in attributes.items():
            taken = name in (*_COMPUTED, *COLUMNS, "offsets") or hasattr(Hits, name)
            if taken or name.startswith("_"):
                raise ValueError(f"attributes: the name {name!r} is taken")
            checked[name] = None if values is None else self._attribute(values, name, vertices)
        for name, array in checked.items():
            if array is None:
                self._core.set_attribute(number, name, None, None)
            else:
                columns = None if array.ndim == 1 else array.shape[1]
                self._core.set_attribute(number, name, array.reshape(-1), columns)

    def _attribute(self, values: ArrayLike, name: str, vertices: int) -> np.ndarray:
        array = to_numpy(values, name)
        if array.dtype.kind not in "iuf" or array.ndim not in (1, 2) or len(array) != vertices:
            raise ValueError(
                f"{name}: expected shape ({vertices},) or ({vertices}, C) of numbers, "
                f"given {describe(array)}"
            )
        return np.ascontiguousarray(cast(array, self.dtype))

    def interpolate(self, hits: Mapping[str, Any], name: str) -> np.ndarray:
        """A vertex attribute at hits: (1-u-v) of the first corner + u of the second + v of the
        third, in the scene's type, shape (...,) or (..., C). NaN for misses and for geometries
        without it. Through instances too.

        `hits` are of this scene as it is committed now. Values are those that were set for the
        meshes of that commit, before it or since; what is set for a mesh that has changed since
        shows after the next commit. ValueError: neither a geometry that was hit nor one of this
        scene has it, or those that were hit have other numbers of columns."""
        columns = _columns_of(hits)
        lead = columns[0].shape
        prim, geometry, instance, u, v = (column.reshape(-1) for column in columns)
        name = text(name, "name")
        hit = np.flatnonzero(prim != MISSING)
        places, which = np.unique(
            np.stack([instance[hit], geometry[hit]]).astype(UINT32), axis=1, return_inverse=True
        )
        parts = []
        for i, (path, id) in enumerate(places.T.tolist()):
            found = self._core.attribute(name, path, id)
            if found is not None:
                parts.append((hit[which.reshape(-1) == i], *_rows_of(found, name, id)))
        widths = {values.shape[1:] for _, values, _ in parts}
        if len(widths) > 1:
            raise ValueError(f"{name}: meshes that were hit have it in columns {sorted(widths)}")
        if not widths:
            found = self._core.attribute(name)
            if found is None:
                raise ValueError(f"{name}: no geometry that was hit has such an attribute")
            widths = {() if found[1] is None else (found[1],)}
        (width,) = widths
        made = np.full((len(prim), *width), np.nan, self.dtype)
        for rays, values, faces in parts:
            if prim[rays].max() >= len(faces):
                raise InputError(
                    f"{name}: triangle {prim[rays].max()} was hit, and its mesh has {len(faces)} "
                    "by the last commit"
                )
            corners = values[faces[prim[rays]]]  # (n, 3, ...)
            weights = np.stack([1 - u[rays] - v[rays], u[rays], v[rays]], axis=1)
            weights = weights.reshape(weights.shape + (1,) * len(width))
            made[rays] = (weights * corners).sum(axis=1)
        return made.reshape(lead + tuple(width))

    def _with(self, hits: Hits, also: Sequence[str], rays: Any, directions: Any) -> Hits:
        """The hits, and what else was asked for."""
        if not isinstance(hits, Hits):
            raise ValueError("also: only for hits that are not left on a GPU")
        more: dict[str, np.ndarray] = {}
        for name in also:
            if name == "position":
                more[name] = self._of_hits(hits, rays, directions, "positions")
            elif name == "normal":
                more[name] = self._of_hits(hits, rays, directions, "normals")
            else:
                more[name] = self.interpolate(hits, name)
        return Hits(hits._rows, more)
