"""What hits say about the surface there: points, normals, and what vertices carry."""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
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


class Surface:
    """What of a scene's commit has changed since then, and what its instances showed. All else is
    as it stands in the scene now."""

    def __init__(self, placed: Mapping[int, Any]) -> None:
        # By id: attributes and mesh, or None; the scene of an instance, or None.
        self.meshes: dict[int, Any] = {}
        self.placed: dict[int, Any] = {}
        self.children = {scene: scene._surface for scene in set(placed.values())}


class SurfaceOfHits:
    """What a Scene knows about hits."""

    _core: Any
    dtype: np.dtype
    threads: int
    _attributes: dict[int, dict[str, np.ndarray]]
    _placed: dict[int, Any]
    _surface: Surface  # of the last commit
    _surfaces: weakref.WeakSet  # and of those before that another scene still shows

    def _keep_surface(self) -> None:
        """After each commit."""
        self._surface = Surface(self._placed)
        self._surfaces.add(self._surface)

    @contextmanager
    def _changing(self, id: int) -> Iterator[None]:
        """Around what gives a geometry another mesh, or takes it out."""
        knowing = [surface for surface in self._surfaces if id not in surface.meshes]
        for surface in knowing:
            surface.meshes[id] = self._mesh_now(id)
            surface.placed[id] = self._placed.get(id)
        try:
            yield
        except BaseException:
            for surface in knowing:
                del surface.meshes[id], surface.placed[id]
            raise

    def _mesh_now(self, id: int) -> tuple[dict[str, np.ndarray], Any] | None:
        own = self._attributes.get(id)
        return (dict(own), self._core.arrays_of(id)) if own else None

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
        own = self._attributes.setdefault(number, {})
        for name, array in checked.items():
            if array is None:
                own.pop(name, None)
            else:
                own[name] = array

    def _attribute(self, values: ArrayLike, name: str, vertices: int) -> np.ndarray:
        array = to_numpy(values, name)
        if array.dtype.kind not in "iuf" or array.ndim not in (1, 2) or len(array) != vertices:
            raise ValueError(
                f"{name}: expected shape ({vertices},) or ({vertices}, C) of numbers, "
                f"given {describe(array)}"
            )
        array = np.array(cast(array, self.dtype))
        array.flags.writeable = False
        return array

    def interpolate(self, hits: Mapping[str, Any], name: str) -> np.ndarray:
        """A vertex attribute at hits: (1-u-v) of the first corner + u of the second + v of the
        third, in the scene's type, shape (...,) or (..., C). NaN for misses and for geometries
        without it. Through instances too. `hits` are of this scene as it is committed now: values are
        those that vertices have now, but for meshes that have changed since. ValueError: no geometry that was hit has it, or they have other numbers of columns."""
        columns = _columns_of(hits)
        lead = columns[0].shape
        prim, geometry, instance, u, v = (column.reshape(-1) for column in columns)
        name = text(name, "name")
        hit = np.flatnonzero(prim != MISSING)
        places, which = np.unique(
            np.stack([instance[hit], geometry[hit]]).astype(UINT32), axis=1, return_inverse=True
        )
        parts, width = [], self._width_of(name)
        for i, (path, id) in enumerate(places.T.tolist()):
            found = self._mesh_with(name, path, id)
            if found is None:
                continue
            values, faces = found
            if width is None:
                width = values.shape[1:]
            if values.shape[1:] != width:
                raise ValueError(f"{name}: {values.shape[1:]} columns here, {width} elsewhere")
            parts.append((hit[which.reshape(-1) == i], values, faces))
        if width is None:
            raise ValueError(f"{name}: no geometry that was hit has such an attribute")
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

    def _width_of(self, name: str) -> tuple[int, ...] | None:
        for own in self._attributes.values():
            if name in own:
                return own[name].shape[1:]
        return None

    def _mesh_with(self, name: str, path: int, id: int) -> tuple[np.ndarray, np.ndarray] | None:
        """An attribute's array and the triangles of a geometry that was hit."""
        scene: Any = self
        surface = self._surface
        for step in self._core.path(path):
            scene = surface.placed.get(step, scene._placed.get(step))
            if scene not in surface.children:
                return None
            surface = surface.children[scene]
        found = surface.meshes[id] if id in surface.meshes else scene._mesh_now(id)
        if found is None or name not in found[0] or found[1] is None:
            return None
        values, mesh = found[0][name], found[1]
        if len(values) != len(mesh[0]):
            raise ValueError(
                f"{name}: geometry {id} had {len(values)} vertices when it was given, "
                f"and has {len(mesh[0])} now"
            )
        return values, mesh[1]

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
