"""What a Scene holds: meshes, spheres, capsules, instances of other scenes; changes, commits."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import (
    ALL,
    MISSING,
    UINT32,
    cast,
    describe,
    flag,
    mesh_faces,
    mesh_vertices,
    number,
    one_of,
    require_dtype,
    require_float32,
    shown,
    thread_count,
    to_numpy,
    uint32s,
    whole,
)

QUALITIES = {"fast": ("apetrei", 0), "balanced": ("ploc", 2), "high": ("sbvh", 4)}
"""Which builder and how many rounds of reinsertion each quality stands for."""
USAGES = ("fixed", "moving")


def mesh_of(source: Any) -> tuple[Any, Any]:
    """Vertices and faces of another library's mesh."""
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return source.vertices, source.faces
    if isinstance(source, (str, os.PathLike)):
        raise TypeError(
            "vertices: a path is read by Scene(path) alone; "
            "add(Scene(path), transform) places that scene"
        )
    raise TypeError(
        "vertices: expected a path, a mesh with .vertices and .faces, "
        "or an array together with faces, "
        f"given {type(source).__name__} alone"
    )


def transforms(value: Any, dtype: np.dtype) -> tuple[np.ndarray, bool]:
    """(M, 12) of `dtype`, and whether there was one alone."""
    array = to_numpy(value, "transform")
    expected = "transform: expected shape (3, 4), (4, 4), (M, 3, 4) or (M, 4, 4)"
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{expected} float32 or float64, given {describe(array)}")
    if array.ndim not in (2, 3) or array.shape[-2:] not in ((3, 4), (4, 4)):
        raise ValueError(f"{expected}, given {describe(array)}")
    if array.shape[-2] == 4 and not (array[..., 3, :] == (0, 0, 0, 1)).all():
        raise ValueError("transform: expected affine ones, with (0, 0, 0, 1) in the last row")
    return cast(array[..., :3, :], dtype).reshape(-1, 12), array.ndim == 2


def _one_or_many(value: Any, name: str) -> np.ndarray:
    """A whole number, or several: (n,) uint32."""
    if not isinstance(value, (list, tuple)) and not getattr(value, "ndim", 0):
        return np.array([whole(value, name, 0, ALL)], UINT32)
    array = uint32s(value, name)
    if array.ndim != 1:
        raise ValueError(f"{name}: expected a whole number or shape (M,), given {describe(array)}")
    return array


def _points(value: Any, name: str, dtype: np.dtype) -> np.ndarray:
    array = to_numpy(value, name)
    expected = f"{name}: expected shape (N, 3)"
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{expected} float32 or float64, given {describe(array)}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{expected}, given {describe(array)}")
    return cast(array, dtype)


def _with_radii(radii: Any, *points: np.ndarray) -> np.ndarray:
    """Rows of points and a radius."""
    given = to_numpy(radii, "radii")
    count = len(points[0])
    expected = f"radii: expected a number or shape ({count},)"
    if given.dtype.kind not in "iuf":
        raise TypeError(f"{expected} float32 or float64, given {describe(given)}")
    if given.shape not in ((), (count,)):
        raise ValueError(f"{expected}, given {describe(given)}")
    return np.column_stack((*points, np.broadcast_to(cast(given, points[0].dtype), count)))


def sphere_rows(centers: ArrayLike, radii: ArrayLike, dtype: np.dtype) -> np.ndarray:
    """Centers and radii, (N, 4)."""
    return _with_radii(radii, _points(centers, "centers", dtype))


def capsule_rows(
    starts: ArrayLike, ends: ArrayLike, radii: ArrayLike, dtype: np.dtype
) -> np.ndarray:
    """Both ends and radii, (N, 7)."""
    first, last = _points(starts, "starts", dtype), _points(ends, "ends", dtype)
    if first.shape != last.shape:
        raise ValueError(f"ends: expected shape {first.shape}, given {describe(last)}")
    return _with_radii(radii, first, last)


def point_rows(points: ArrayLike, radius: Any, dtype: np.dtype) -> np.ndarray:
    """Points and their one radius, (N, 4)."""
    given = _points(points, "points", dtype)
    return _with_radii(np.asarray(_radius(radius), dtype), given)


def _radius(value: Any) -> float:
    radius = number(value, "radius")
    if not 0 <= radius < np.inf:
        raise ValueError(f"radius: expected a finite number, 0 or more, given {shown(value)}")
    return radius


def _mask_and_id(mask: Any, id: Any) -> tuple[int, int | None]:
    return whole(mask, "mask", 0, ALL), None if id is None else whole(id, "id", 0, ALL)


class SceneContents:
    """What a Scene holds."""

    _core: Any
    dtype: np.dtype
    _options: dict[str, Any]

    def _forget(self) -> None: ...

    @overload
    def add(
        self, vertices: ArrayLike, faces: ArrayLike, /, *, mask: int = ALL, id: int | None = None
    ) -> int: ...
    @overload
    def add(
        self,
        scene: SceneContents,
        transform: ArrayLike,
        /,
        *,
        mask: ArrayLike = ALL,
        id: int | None = None,
    ) -> int | np.ndarray: ...
    @overload
    def add(self, source: Any, /, *, mask: int = ALL, id: int | None = None) -> int: ...
    def add(
        self, source: Any, where: Any = None, /, *, mask: Any = ALL, id: int | None = None
    ) -> Any:
        """Adds a geometry: `add(vertices, faces)` a mesh, `add(scene, transform)` an instance of
        another scene. Rays meet it after the next `commit`.

        A mesh is given as for `Scene`, as arrays or as an object with `vertices` and `faces`, and
        copied. An instance shows the other scene as its last commit left it when this scene is
        committed.

        Parameters
        ----------
        transform :
            Shape (3, 4) or (4, 4), affine, from the other scene's space to this one's; rounded to
            the scene's type. It may mirror and shear, but not flatten. Shape (M, 3, 4) or (M, 4, 4)
            places the scene M times.
        mask :
            32 bits. A ray sees the geometry if mask & its own mask is not 0. For M transforms also
            shape (M,).
        id :
            The geometry's number; None: the next one. Ids count from 0, and none is given twice.

        Returns
        -------
        The id; for M transforms M ids, shape (M,) uint32.

        Raises InputError: an index past the vertices, an id that was used before, a transform that
        is singular or not finite, a scene that would hold itself. TypeError: a scene in another
        type than this one. Of M transforms, all are added or none.
        """
        wanted = None if id is None else whole(id, "id", 0, ALL)
        if not isinstance(source, SceneContents):
            vertices, faces = (source, where) if where is not None else mesh_of(source)
            corners = mesh_vertices(vertices, dtype=self.dtype)
            triangles = mesh_faces(faces, len(corners))
            return self._core.add_mesh(corners, triangles, whole(mask, "mask", 0, ALL), wanted)
        require_dtype(source, self.dtype, "scene")
        if where is None:
            raise TypeError("transform: expected shape (3, 4) or (4, 4), given None")
        rows, one = transforms(where, self.dtype)
        if wanted is not None and not one:
            raise ValueError(f"id: expected None for {len(rows)} transforms, given {shown(id)}")
        masks = _one_or_many(mask, "mask")
        if len(masks) != 1 and (one or len(masks) != len(rows)):
            raise ValueError(f"mask: expected one or {len(rows)}, given {len(masks)}")
        ids = self._core.add_instances(source._core, rows, masks, wanted)
        return ids[0] if one else np.array(ids, UINT32)

    def add_spheres(
        self, centers: ArrayLike, radii: ArrayLike, *, mask: int = ALL, id: int | None = None
    ) -> int:
        """Adds spheres as one geometry, of which "prim" of a hit counts: `centers` of shape (N, 3),
        `radii` of shape (N,), or one number for all. Rays hit them from both sides; one that
        starts inside hits where it leaves.

        Spheres that are not finite, have a negative radius or reach beyond 1e12 are left out; of a
        strict scene `commit` refuses them.
        Copied, in the scene's type. `mask`, `id` and the result as in `add`.
        """
        made = self._spheres(centers, radii)
        return self._core.add_spheres(made, *_mask_and_id(mask, id))

    def add_capsules(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        radii: ArrayLike,
        *,
        mask: int = ALL,
        id: int | None = None,
    ) -> int:
        """Adds capsules as one geometry: all points within a radius of a segment. `starts` and
        `ends` of shape (N, 3). "u" of a hit is the place along the axis, 0 at the start. All else
        as in `add_spheres`."""
        made = self._capsules(starts, ends, radii)
        return self._core.add_capsules(made, *_mask_and_id(mask, id))

    def add_points(
        self, points: ArrayLike, radius: float, *, mask: int = ALL, id: int | None = None
    ) -> int:
        """Adds points of one radius as one geometry: `points` of shape (N, 3), `radius` a number,
        0 or more. Rays hit them as spheres. All else as in `add_spheres`."""
        made = _points(points, "points", self.dtype)
        return self._core.add_points(made, _radius(radius), *_mask_and_id(mask, id))

    def update_spheres(self, id: int, centers: ArrayLike, radii: ArrayLike) -> None:
        """Gives a geometry of spheres others, from the next `commit` on. InputError: no such
        geometry, or another kind of it."""
        self._core.update_spheres(whole(id, "id", 0, ALL), self._spheres(centers, radii))

    def update_capsules(
        self, id: int, starts: ArrayLike, ends: ArrayLike, radii: ArrayLike
    ) -> None:
        """As `update_spheres`."""
        self._core.update_capsules(whole(id, "id", 0, ALL), self._capsules(starts, ends, radii))

    def update_points(self, id: int, points: ArrayLike, radius: float) -> None:
        """As `update_spheres`."""
        made = _points(points, "points", self.dtype)
        self._core.update_points(whole(id, "id", 0, ALL), made, _radius(radius))

    def _spheres(self, centers: ArrayLike, radii: ArrayLike) -> np.ndarray:
        return sphere_rows(centers, radii, self.dtype)

    def _capsules(self, starts: ArrayLike, ends: ArrayLike, radii: ArrayLike) -> np.ndarray:
        return capsule_rows(starts, ends, radii, self.dtype)

    def update(self, id: int, vertices: ArrayLike, faces: ArrayLike | None = None) -> None:
        """Gives a mesh other vertices, shape (V, 3), and other `faces`, or those that it has. Rays
        meet them after the next `commit`. The arrays are copied.

        InputError: no such geometry, an instance, an index past the vertices.
        """
        corners = mesh_vertices(vertices, dtype=self.dtype)
        triangles = None if faces is None else mesh_faces(faces, len(corners))
        self._core.update(whole(id, "id", 0, ALL), corners, triangles)

    def remove(self, id: int) -> None:
        """Takes a geometry out, from the next `commit` on. Its id is not given again."""
        self._core.remove(whole(id, "id", 0, ALL))

    def set_transform(self, id: ArrayLike, transform: ArrayLike) -> None:
        """Moves an instance, from the next `commit` on: `transform` as in `add`. Or several: ids of
        shape (M,), transforms of shape (M, 3, 4) or (M, 4, 4).

        InputError: no such geometry, a mesh, a transform that is singular or not finite; then none
        of them has moved.
        """
        rows, _ = transforms(transform, self.dtype)
        ids = _one_or_many(id, "id")
        if len(ids) != len(rows):
            raise ValueError(f"transform: expected {len(ids)}, one for each id, given {len(rows)}")
        self._core.set_transforms(ids, rows)

    def set_mask(self, id: ArrayLike, mask: ArrayLike) -> None:
        """Gives a geometry another mask, from the next `commit` on. Or several: ids of shape (M,),
        one mask for all or shape (M,)."""
        ids, masks = _one_or_many(id, "id"), _one_or_many(mask, "mask")
        if len(masks) not in (1, len(ids)):
            raise ValueError(f"mask: expected one or {len(ids)}, given {len(masks)}")
        self._core.set_masks(ids, masks)

    def commit(
        self,
        *,
        quality: str | None = None,
        usage: str | None = None,
        compact: bool | None = None,
        refit_limit: float | None = None,
        threads: int | None = None,
        progress: Callable[[float], Any] | None = None,
    ) -> dict[str, Any]:
        """Takes all changes in: from now on, queries see them. Waits for queries of other threads.
        Ctrl-C ends it and leaves the scene as it was.

        Each option that is None is as in the commit before, and for the first as `Scene` was given.

        Parameters
        ----------
        quality :
            "fast", "balanced" or "high": of the trees that rays go through.
        usage :
            "fixed": meshes share trees, and a change of one builds its tree again. "moving": a tree
            for each mesh; only those of meshes that changed are built or refitted.
        compact :
            The small layout of trees: half the bytes or less, for somewhat slower rays. There is
            none in float64: True raises NotImplementedError.
        refit_limit :
            With "moving": a mesh whose vertices moved keeps its tree, with boxes fitted again,
            while the tree's SAH (surface area heuristic) is at most so many times that at its
            build; 1.5 at first. Below 1, trees are always built again. So are compact trees and
            those of quality "high" with parts of triangles.
        threads :
            As in `Scene`. Hits do not depend on it.
        progress :
            Called with the part of the commit that is done, 0 to 1 and at last 1, one call at a
            time, from any thread. What it raises ends the commit, leaves the scene as it was, and
            comes out of this call. Scenes that it asks or changes raise InputError.

        Returns
        -------
        dict: "ms"; "meshes", "instances" and "triangles" of the scene itself; "shapes", its
        geometries of spheres, capsules and points, and "primitives", how many those are; "left_out",
        triangles and shapes that are not finite or out of range; "trees_built", "trees_refitted"; "sah_ratio", the largest SAH after a refit over that at the build;
        "parts_refitted", whether the tree over meshes and instances was refitted; "bytes" that
        rays read of the scene itself; "paths", instances counted on every way to them.

        InputError, the last commit still stands: an instance of a scene that was never committed, a
        scene that reaches beyond 1e12, more than 32 levels of instances or 2**32 - 2 paths.
        """
        compact = None if compact is None else flag(compact, "compact")
        if compact:
            require_float32(self, "compact=True")
        if progress is not None and not callable(progress):
            raise TypeError(f"progress: expected a function, given {shown(progress)}")
        report = self._core.commit(
            quality if quality is None else one_of(quality, "quality", QUALITIES),
            usage if usage is None else one_of(usage, "usage", USAGES),
            compact,
            None if refit_limit is None else number(refit_limit, "refit_limit"),
            None if threads is None else thread_count(threads),
            progress,
        )
        self._forget()
        self._options.update(self._core.commit_options())
        return report

    @property
    def committed(self) -> bool:
        """Whether nothing has changed since the last commit."""
        return self._core.committed()

    @property
    def bounds(self) -> np.ndarray:
        """Of the last commit: the corners of a box around all triangles, shape (2, 3) in `dtype`;
        the first is above the second where there are none. It is the smallest one around meshes;
        around instances it is that of their scenes' moved boxes. In float32 a mesh whose triangles
        all have no area may be left out of it."""
        return np.array(self._core.bounds(), self.dtype)

    def path(self, number: int) -> list[int]:
        """Where a hit is: the ids of the instances that lead to it, the outermost first. `number`:
        its "instance". Empty for 0, a geometry of the scene itself. InputError if the last commit
        has no such path."""
        return self._core.path(whole(number, "number", 0, MISSING))

    def __len__(self) -> int:
        """How many geometries there are, changes without a commit included."""
        return len(self._core)

    def __iter__(self) -> Iterator[int]:
        """The ids of the geometries, ascending."""
        return iter(self._core.ids())

    def __contains__(self, id: Any) -> bool:
        """Whether there is a geometry with this id."""
        return isinstance(id, (int, np.integer)) and 0 <= id <= ALL and int(id) in self._core
