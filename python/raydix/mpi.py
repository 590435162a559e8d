"""Points and scenes spread over the ranks of MPI, with the bits of one process.

Every call that says "collective" must be made by all ranks of the communicator, in the same order.
Each rank gives its own queries, any number of them or none, and gets their answers in its own
order. What goes wrong on one rank is raised on all: the same type, and a message that begins with
that rank.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from . import _core
from ._arrays import (
    ALL,
    FLOAT32,
    FLOAT64,
    cast,
    describe,
    float_type,
    floats,
    mesh_faces,
    mesh_vertices,
    number,
    require_dtype,
    rows,
    thread_count,
    whole,
)
from ._rays import ray_batch, ray_masks
from .contents import (
    QUALITIES,
    capsule_rows,
    mesh_of,
    one_of,
    point_rows,
    sphere_rows,
    transforms,
)
from .scene import Scene

try:
    from mpi4py import MPI
except ImportError as error:
    raise ImportError(
        f"raydix.mpi needs mpi4py, which cannot be imported here ({error}): "
        "Debian package python3-mpi4py, or pip install mpi4py"
    ) from error
try:
    from . import _mpi
    from ._mpi import CommunicationError
except ImportError as error:
    raise ImportError(
        f"raydix.mpi needs the module raydix._mpi, which cannot be imported here ({error}). It is "
        "built where pip compiles raydix and finds MPI (Debian package libopenmpi-dev) and mpi4py, "
        "and needs that MPI library again where it runs"
    ) from error

__all__ = ["MISSING", "CommunicationError", "DistributedPoints", "DistributedScene"]

MISSING = 0xFFFFFFFFFFFFFFFF
"""Stands for "nothing" in arrays of 64-bit numbers: no triangle was hit, no point is near."""

_MOST = 2**64 - 1
_PARTITIONS = ("as_given", "curve")
_ERRORS = {
    error.__name__: error
    for error in (
        _core.InputError,
        _core.BackendUnavailable,
        TypeError,
        ValueError,
        MemoryError,
        NotImplementedError,
        RuntimeError,
    )
}


def _require_one_library() -> None:
    """ImportError if mpi4py has loaded another MPI library than this package was built with."""
    ours, theirs = _mpi.library(), MPI.Get_library_version().rstrip("\0")
    same = ours.rstrip("\0") == theirs
    if same and MPI.Is_initialized() and not MPI.Is_finalized():
        same = _mpi.is_running()
    if not same:
        raise ImportError(
            "raydix.mpi and mpi4py use different MPI libraries: "
            f"{ours.splitlines()[0]!r} and {theirs.splitlines()[0]!r}"
        )


_require_one_library()


def _agree(comm: MPI.Comm, error: Exception | None) -> None:
    """Collective. Raises on all ranks the error of the lowest rank that has one."""
    failed = np.array([comm.size if error is None else comm.rank], np.int64)
    comm.Allreduce(MPI.IN_PLACE, failed, MPI.MIN)
    if failed[0] == comm.size:
        return
    told = None
    if comm.rank == failed[0]:
        kinds = [kind.__name__ for kind in type(error).__mro__ if kind.__name__ in _ERRORS]
        told = (kinds[0] if kinds else "RuntimeError", str(error))
    kind, text = comm.bcast(told, int(failed[0]))
    raise _ERRORS[kind](f"rank {failed[0]}: {text}") from error


@contextmanager
def _on_all(comm: MPI.Comm) -> Iterator[None]:
    """Collective. What is raised in the block on one rank is raised on all after it."""
    error = None
    try:
        yield
    except Exception as raised:
        error = raised
    _agree(comm, error)


def _checked(comm: Any) -> MPI.Comm:
    """Every rank sees the same here, so that none has to be told."""
    if not isinstance(comm, MPI.Comm):
        raise TypeError(f"comm: expected a communicator of mpi4py, given {comm!r}")
    if comm == MPI.COMM_NULL:
        raise ValueError("comm: expected a communicator of ranks, given MPI.COMM_NULL")
    if comm.Is_inter():
        raise ValueError("comm: expected a communicator within one group, given one between two")
    return comm


def _one_type(comm: MPI.Comm, array: np.ndarray) -> np.dtype:
    """Collective. The array's type; on ranks whose array is empty that of the others."""
    used = np.array([len(array) and array.dtype == kind for kind in (FLOAT32, FLOAT64)], np.int64)
    comm.Allreduce(MPI.IN_PLACE, used, MPI.MAX)
    if len(array) or not used.any():
        return array.dtype if len(array) else FLOAT32
    return FLOAT32 if used[0] else FLOAT64


def _free(comm: MPI.Comm) -> None:
    if not MPI.Is_finalized():
        comm.Free()


def _bytes(value: Any, name: str) -> int:
    return whole(value, name, 0, _MOST)


class _Distributed:
    """What points and scenes over ranks share: the communicator, options, figures, the end."""

    _core: Any
    dtype: np.dtype

    def _open(self, comm: MPI.Comm) -> None:
        self._comm = comm.Dup()
        self._end = weakref.finalize(self, _free, self._comm)
        self._report: dict[str, Any] | None = None

    @staticmethod
    def _options(
        partition: str,
        strict: bool,
        threads: int,
        exchange_bytes: int,
        message_bytes: int,
        boxes_per_rank: int,
    ) -> tuple:
        return (
            one_of(partition, "partition", _PARTITIONS) == "curve",
            bool(strict),
            thread_count(threads),
            _bytes(exchange_bytes, "exchange_bytes"),
            whole(message_bytes, "message_bytes", 1, 2**31 - 1),
            whole(boxes_per_rank, "boxes_per_rank", 1, 4096),
        )

    def _ask(self, call: str, *arguments: Any) -> list[np.ndarray]:
        """Collective. What a call of the core gives but for its figures, which are kept."""
        *arrays, self._report = getattr(self._core, call)(*arguments)
        return arrays

    def _open_comm(self) -> MPI.Comm:
        if self._core is None:
            raise ValueError(f"this {type(self).__name__} was freed")
        return self._comm

    @property
    def holding(self) -> dict[str, Any]:
        """What there is: a new dict. Of all ranks: "size", elements given, "left_out" of them. Of
        this rank: "local", elements that it holds, "first", the number of the first that it gave,
        "bytes" that queries read, "replicated_bytes" of them that every rank holds. Of a scene
        also "paths", the ways to instances on this rank, and "first_path", those on the ranks
        before. "report" of the construction."""
        self._open_comm()
        return self._core.holding()

    @property
    def report(self) -> dict[str, Any]:
        """What the last call took on this rank, or the construction: a new dict. "rounds";
        "questions" asked of ranks, this one included; "answered", those of all ranks that this one
        answered; "messages" and "bytes" sent to other ranks; "collectives", calls that all ranks
        took part in; "compute_seconds", processor time of all threads."""
        return self.holding["report"] if self._report is None else dict(self._report)

    def free(self) -> None:
        """Collective. Gives memory and communicators back. Without this call the last reference
        does so when it goes, which must then happen in the same order on all ranks."""
        self._core = None
        self._end()

    def __enter__(self) -> Any:
        self._open_comm()
        return self

    def __exit__(self, *_: Any) -> None:
        self.free()

    def __reduce__(self) -> tuple:
        raise TypeError(f"a {type(self).__name__} cannot be pickled or copied")


class DistributedPoints(_Distributed):
    """Points in three dimensions, spread over the ranks of a communicator. Collective.

    Parameters
    ----------
    comm :
        A communicator of mpi4py within one group. A duplicate of it is used.
    points :
        What this rank gives: shape (N, 3), float32 or float64, the same type on all ranks; ranks
        without points take that of the others. Queries are answered in this type. Point i of rank r
        has the number i + (points of the ranks before r). Copied.
    partition :
        "curve": all points are sorted along one Morton curve, and each rank holds a run of it of
        about equal length, so that queries reach few ranks. "as_given": each rank keeps what it
        gave. No answer depends on it.
    strict :
        As in `raydix.Points`.
    threads :
        Of each rank; 0: all the machine has.
    exchange_bytes :
        The most bytes that a rank takes in during a round, one long answer aside.
    message_bytes :
        The most bytes of one message.
    boxes_per_rank :
        Boxes around what a rank holds that every rank knows, 1 to 4,096.

    Answers have the bits of `raydix.Points` with the points of all ranks, one after the other. The
    numbers in them have 64 bits.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        points: ArrayLike,
        *,
        partition: str = "curve",
        strict: bool = False,
        threads: int = 0,
        exchange_bytes: int = 64 << 20,
        message_bytes: int = 1 << 20,
        boxes_per_rank: int = 64,
    ) -> None:
        self._core = None
        comm = _checked(comm)
        with _on_all(comm):
            options = self._options(
                partition, strict, threads, exchange_bytes, message_bytes, boxes_per_rank
            )
            array = floats(points, "points", (3,))
            if array.ndim != 2:
                raise ValueError(
                    f"points: expected shape (N, 3) float32 or float64, given {describe(array)}"
                )
        self.dtype = _one_type(comm, array)
        made = _mpi.DistributedPointsF if self.dtype == FLOAT32 else _mpi.DistributedPointsD
        self._core = made(comm.py2f(), cast(array, self.dtype), options)
        self._open(comm)

    def knn(
        self, queries: ArrayLike, k: int, *, max_result_bytes: int = 0
    ) -> dict[str, np.ndarray]:
        """Collective. The k nearest points of each query of this rank, as `raydix.Points.knn`. All
        ranks give the same k.

        `queries`: shape (..., 3). Returns "indices" (uint64) and "distances", both of shape
        (..., k); missing neighbours have the index `MISSING` and an infinite distance.
        `max_result_bytes` bounds this rank's result; 0: half of the memory that is left.
        """
        with _on_all(self._open_comm()):
            asked, lead = rows(queries, "queries", (3,), self.dtype)
            count, most = whole(k, "k", 1, 2**31), _bytes(max_result_bytes, "max_result_bytes")
        indices, distances = self._ask("knn", asked, count, most)
        shape = (*lead, count)
        return {"indices": indices.reshape(shape), "distances": distances.reshape(shape)}

    def radius(
        self, queries: ArrayLike, r: float, *, sort: bool = False, max_result_bytes: int = 0
    ) -> dict[str, np.ndarray]:
        """Collective. All points within the distance `r` of each query of this rank, as
        `raydix.Points.radius`. All ranks give the same `r` and `sort`.

        Returns "offsets" (uint64, one more than queries), "indices" (uint64), "distances": row i is
        offsets[i] to offsets[i + 1].
        """
        with _on_all(self._open_comm()):
            asked, _ = rows(queries, "queries", (3,), self.dtype)
            reach = float(self.dtype.type(number(r, "r")))
            most = _bytes(max_result_bytes, "max_result_bytes")
        offsets, indices, distances = self._ask("radius", asked, reach, bool(sort), most)
        return {"offsets": offsets, "indices": indices, "distances": distances}

    def box(self, boxes: ArrayLike, *, max_result_bytes: int = 0) -> dict[str, np.ndarray]:
        """Collective. All points in each closed box of this rank, shape (..., 6): lowest corner,
        highest corner. Returns "offsets" and "indices" as in `radius`, rows ascending."""
        with _on_all(self._open_comm()):
            asked, _ = rows(boxes, "boxes", (6,), self.dtype)
            most = _bytes(max_result_bytes, "max_result_bytes")
        offsets, indices, _ = self._ask("box", asked, most)
        return {"offsets": offsets, "indices": indices}

    def __len__(self) -> int:
        """Points that all ranks gave."""
        return self.holding["size"]

    def __repr__(self) -> str:
        if self._core is None:
            return "<raydix.mpi.DistributedPoints: freed>"
        return (
            f"<raydix.mpi.DistributedPoints: {len(self):,} points of {self._comm.size} ranks, "
            f"{self.dtype}>"
        )


def _struct(dtype: np.dtype, *before: tuple) -> np.dtype:
    """A hit or a closest point as the library lays it out: scalars, then whole numbers."""
    names = (("geometry", np.uint32), ("instance", np.uint32), ("prim", np.uint64))
    return np.dtype([(*field[:1], dtype, *field[1:]) for field in before] + list(names), align=True)


_HITS = {t: _struct(t, ("t",), ("u",), ("v",)) for t in (FLOAT32, FLOAT64)}
_PLACES = {
    t: _struct(t, ("point", (3,)), ("distance",), ("u",), ("v",)) for t in (FLOAT32, FLOAT64)
}


def _fields(found: np.ndarray, layout: np.dtype, lead: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Rows of bytes as a dict of views."""
    structs = found.reshape(-1).view(layout).reshape(lead)
    return {name: structs[name] for name in layout.names}


_SHAPES = {
    "spheres": (sphere_rows, ("centers", "radii")),
    "capsules": (capsule_rows, ("starts", "ends", "radii")),
    "points": (point_rows, ("points", "radius")),
}


class DistributedScene(_Distributed):
    """Meshes, shapes and instances spread over the ranks of a communicator, asked as one
    `raydix.Scene` that got all of it by `add` and `add_spheres`, `add_capsules` and `add_points`,
    in rank order. Collective.

    Parameters
    ----------
    comm :
        As in `DistributedPoints`.
    geometries :
        What this rank gives: a list, which may be empty, of

        - ``(vertices, faces)``, a mesh as arrays; or an object with `vertices` and `faces`, but no
          path;
        - ``(scene, transform)``, an instance of a `raydix.Scene` as its last commit left it. It
          stays on this rank, and may hold whatever a scene holds. Later changes of it are not seen.
          The transform is as in `raydix.Scene.add`, (3, 4) or (4, 4);
        - ``{"spheres": (centers, radii)}``, ``{"capsules": (starts, ends, radii)}`` or ``{"points":
          (points, radius)}``, as `raydix.Scene.add_spheres` and others take them. They stay on this
          rank;
        - ``{"geometry": a mesh or an instance}``; this and those of shapes may have a "mask" too.

        What all ranks give are geometries 0, 1, 2, ... in rank order. Arrays are copied.
    one_geometry :
        The meshes are parts of one geometry, 0, and "prim" counts through them, in rank order. For
        a mesh that no rank holds whole; not with shapes.
    quality :
        Of the trees on each rank: "fast", "balanced" or "high". Hits do not depend on it.
    precision :
        "float32" (also None) or "float64", as in `raydix.Scene`.
    partition, threads, exchange_bytes, message_bytes, boxes_per_rank :
        As in `DistributedPoints`.
    strict :
        As in `raydix.Scene`.

    "prim" has 64 bits. Paths to instances count from 1 through the ranks: "instance" less
    ``holding["first_path"]`` of the rank that gave it counts the paths of that rank.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        geometries: Sequence[Any],
        *,
        one_geometry: bool = False,
        quality: str = "balanced",
        precision: DTypeLike = None,
        partition: str = "curve",
        strict: bool = False,
        threads: int = 0,
        exchange_bytes: int = 64 << 20,
        message_bytes: int = 1 << 20,
        boxes_per_rank: int = 64,
    ) -> None:
        self._core = None
        comm = _checked(comm)
        with _on_all(comm):
            options = self._options(
                partition, strict, threads, exchange_bytes, message_bytes, boxes_per_rank
            )
            level = list(QUALITIES).index(one_of(quality, "quality", QUALITIES))
            self.dtype = float_type(precision, "precision")
            if not isinstance(geometries, (list, tuple)):
                raise TypeError(
                    "geometries: expected a list of meshes and instances, "
                    f"given {type(geometries).__name__}"
                )
            given = [self._given(one, f"geometries[{i}]") for i, one in enumerate(geometries)]
        made = _mpi.DistributedSceneF if self.dtype == FLOAT32 else _mpi.DistributedSceneD
        self._core = made(comm.py2f(), given, options, bool(one_geometry), level)
        self._open(comm)

    def _given(self, one: Any, name: str) -> tuple:
        """What it is, the mask, and its two arguments for the core."""
        if not isinstance(one, dict):
            return self._mesh_or_instance(one, name, ALL)
        kinds = [kind for kind in one if kind != "mask"]
        if len(kinds) != 1 or kinds[0] not in ("geometry", *_SHAPES):
            raise TypeError(
                f"{name}: expected a dict of one of 'geometry', 'spheres', 'capsules' and "
                f"'points', and 'mask', given {list(one)}"
            )
        (kind,) = kinds
        mask = whole(one.get("mask", ALL), f"{name}, mask", 0, ALL)
        if kind == "geometry":
            return self._mesh_or_instance(one[kind], name, mask)
        to_rows, parts = _SHAPES[kind]
        if not isinstance(one[kind], (list, tuple)) or len(one[kind]) != len(parts):
            raise TypeError(f"{name}, {kind}: expected a tuple of {', '.join(parts)}")
        try:
            rows_of_shapes = to_rows(*one[kind], self.dtype)
        except (TypeError, ValueError) as error:
            raise type(error)(f"{name}, {kind}: {error}") from None
        return "capsules" if kind == "capsules" else "spheres", mask, rows_of_shapes, None

    def _mesh_or_instance(self, one: Any, name: str, mask: int) -> tuple:
        if hasattr(one, "vertices") and not isinstance(one, Scene):
            one = mesh_of(one)
        if not isinstance(one, (list, tuple)) or len(one) != 2:
            raise TypeError(
                f"{name}: expected (vertices, faces), (scene, transform), a mesh with .vertices "
                f"and .faces, or a dict, given {type(one).__name__}"
            )
        first, second = one
        if not isinstance(first, Scene):
            corners = mesh_vertices(first, f"{name}, vertices", self.dtype)
            return "mesh", mask, corners, mesh_faces(second, len(corners), f"{name}, faces")
        require_dtype(first, self.dtype, name)
        places, is_one = transforms(second, self.dtype)
        if not is_one:
            raise ValueError(f"{name}: expected one transform, given {len(places)}")
        return "instance", mask, first._core.lend(), places

    def _rays(
        self, rays: Any, directions: Any, tmin: Any, tmax: Any, mask: Any, masks: Any
    ) -> tuple[tuple, tuple[int, ...]]:
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        return (*args, *ray_masks(mask, masks, lead)), lead

    def trace(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
    ) -> dict[str, np.ndarray]:
        """Collective. The closest hit of each ray of this rank, as `raydix.Scene.intersect`; rays
        and masks are given as there.

        Returns a dict of arrays with the leading shape of the rays: "t", "u", "v", "geometry",
        "instance", and "prim" (uint64). Nothing hit: infinity, 0xFFFFFFFF and `MISSING`.
        """
        with _on_all(self._open_comm()):
            args, lead = self._rays(rays, directions, tmin, tmax, mask, masks)
        (found,) = self._ask("trace", *args)
        return _fields(found, _HITS[self.dtype], lead)

    def trace_any(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
    ) -> np.ndarray:
        """Collective. Whether each ray of this rank hits anything, as `raydix.Scene.occluded`:
        bool, with their leading shape."""
        with _on_all(self._open_comm()):
            args, lead = self._rays(rays, directions, tmin, tmax, mask, masks)
        (found,) = self._ask("trace_any", *args)
        return found.view(np.bool_).reshape(lead)

    def trace_all(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
        max_result_bytes: int = 0,
    ) -> dict[str, np.ndarray]:
        """Collective. All hits of each ray of this rank, as `raydix.Scene.all_hits`: the arrays of
        `trace`, of shape (hits,), and "offsets" (uint64, one more than rays): those of ray i, in C
        order, are offsets[i] to offsets[i + 1]. `max_result_bytes` bounds this rank's result; 0:
        half of the memory that is left."""
        with _on_all(self._open_comm()):
            args, _ = self._rays(rays, directions, tmin, tmax, mask, masks)
            most = _bytes(max_result_bytes, "max_result_bytes")
        offsets, found = self._ask("trace_all", *args, most)
        return {"offsets": offsets, **_fields(found, _HITS[self.dtype], (len(found),))}

    def closest_points(
        self, points: ArrayLike, *, max_distance: float = np.inf, mask: int = ALL
    ) -> dict[str, np.ndarray]:
        """Collective. The point of the scene that is closest to each query of this rank, as
        `raydix.Scene.closest_point`. All ranks give the same `max_distance` and `mask`.

        Returns "point" (..., 3), "distance", "u", "v", "geometry", "instance" and "prim" (uint64).
        Shapes count as `raydix.Scene.closest_point` has them.
        """
        with _on_all(self._open_comm()):
            asked, lead = rows(points, "points", (3,), self.dtype)
            reach = float(self.dtype.type(number(max_distance, "max_distance")))
            seen = whole(mask, "mask", 0, ALL)
        (found,) = self._ask("closest_points", asked, reach, seen)
        return _fields(found, _PLACES[self.dtype], lead)

    def contains(self, points: ArrayLike) -> np.ndarray:
        """Collective. Whether each point of this rank is inside, as `raydix.Scene.contains` with
        the rule "parity" of all meshes together: bool. Exact for closed meshes."""
        with _on_all(self._open_comm()):
            asked, lead = rows(points, "points", (3,), self.dtype)
        (found,) = self._ask("contains", asked)
        return found.view(np.bool_).reshape(lead)

    def __repr__(self) -> str:
        if self._core is None:
            return "<raydix.mpi.DistributedScene: freed>"
        return (
            f"<raydix.mpi.DistributedScene: {self.holding['size']:,} elements of "
            f"{self._comm.size} ranks, {self.dtype}>"
        )
