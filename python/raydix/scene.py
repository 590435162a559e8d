"""Scenes: rays, closest points, inside and outside, overlaps."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from . import _core
from ._arrays import (
    ALL,
    FLOAT32,
    UINT32,
    code_bits,
    flag,
    float_type,
    mesh_faces,
    mesh_vertices,
    number,
    one_of,
    path,
    require_float32,
    result_bytes,
    shown,
    thread_count,
    whole,
)
from ._filters import hit_filter
from ._rays import ray_batch, ray_masks
from .cameras import Camera
from .contents import QUALITIES, USAGES, SceneContents, mesh_of
from .devices import DeviceRays, device_name
from .hits import Hits
from .pictures import SceneViews
from .queries import SceneQueries
from .saved import SavedScene, state_of
from .surface import SurfaceOfHits, also_names

_NO_NAMES = ()


def _warn_of_points(count: int) -> None:
    if count != 0:
        warnings.warn(
            f"{count:,} vertices without triangles: rays and distances find nothing here, and save "
            "leaves them out; raydix.Points finds neighbours among points",
            UserWarning,
            stacklevel=4,
        )


def tree_options(options: dict[str, Any]) -> tuple:
    """What the core takes for the binary tree, of the arguments of a Scene by their names."""
    builder, rounds = QUALITIES[options["quality"]]
    if options["builder"] is not None:
        builder, rounds = one_of(options["builder"], "builder", _core.builders()), 0
    if options["reinsertion_rounds"] is not None:
        rounds = whole(options["reinsertion_rounds"], "reinsertion_rounds", 0, 255)
    leaf = whole(options["max_leaf"], "max_leaf", 1, 255)
    bits = code_bits(options["bits"])
    return builder, rounds, bits, leaf, options["strict"], options["threads"]


class Scene(SceneContents, SceneQueries, SurfaceOfHits, SavedScene, SceneViews):
    """What rays are traced through and queries ask: triangle meshes, spheres, capsules, and
    instances of other scenes.

    `Scene(vertices, faces)` is one mesh with id 0, committed. So is a file; one of glTF with nodes
    or several primitives has an instance for each node, or a mesh for each primitive. `Scene()` is empty: `add` fills it,
    `commit` takes what was added and changed in, and queries answer from the last commit.

    Parameters
    ----------
    vertices :
        None: an empty scene. Shape (V, 3), float32 or float64; or, with `faces` left out, the path
        of a file of triangles (.ply, .obj, .stl, .gltf, .glb, .off, each also with .gz, .xz or
        .zst; `load_scene` is for .rdx, `load_points` for points: a file or built-in scene of
        points alone is taken with a UserWarning, since nothing is found in it), the name of a built-in scene ("builtin:atrium?triangles=10000"), or an object with the attributes
        `vertices` and `faces`, such as a `trimesh.Trimesh`.
    faces :
        Shape (F, 3), whole numbers: three vertex indices for each triangle.
    quality :
        What trees are for: "fast" is built each frame, "balanced" once for some million rays,
        "high" once for many.
    builder :
        The name of a builder for the binary tree of one mesh, instead of that of `quality`: see
        `raydix.builders`. Inside tests, signed distances and overlaps ask that tree, in float64
        closest points and touches too. Rays and all else go through others, which `quality` alone
        decides.
    reinsertion_rounds :
        Of the binary tree: rounds of reinsertion after the build, 0 to 255. Each moves large
        subtrees to cheaper places. None: what `quality` asks for (2 for "balanced", 4 for "high",
        else 0), and 0 where `builder` is given.
    max_leaf :
        Of the binary tree: triangles in a leaf at most.
    bits :
        Of the binary tree: bits of the Morton codes, 30 or 63.
    strict :
        Triangles with a NaN, an infinite or a huge (beyond 1e12) vertex raise InputError when they
        are given. Spheres, capsules and points like that, or with a negative radius, raise it at
        the next `commit`. Otherwise they are left out.
    usage, compact :
        As in `commit`.
    threads :
        Threads for builds and queries; 0: all the machine has. No result depends on it.
    device :
        "cpu"; "cuda", an NVIDIA GPU; "opencl" or "opencl:N", the first or another OpenCL device of
        `raydix.devices()`; "hip" or "hip:N", a GPU of AMD. `intersect` and `occluded` then run there, with the same hits, and with
        "cuda" take arrays of CuPy, PyTorch and others that lie there. All other queries run on the
        processor. Meshes are traced there, instances are not. What is missing is named by the first
        such call: BackendUnavailable.
    precision :
        "float32" (also None), or "float64": coordinates as they are given, and all answers computed
        and returned in float64. For meshes far from the origin (float32 has steps of half a metre
        at 5,000,000) and for more than seven digits. Rays then take up to about twice as long.

    Notes
    -----
    The arrays are copied: changing them later does not change the scene; `update` does. With
    precision "float32", coordinates given as float64, NumPy's usual type, are rounded once, here,
    and every answer is about the rounded mesh. The trees of `Scene(vertices, faces)` are built when
    a query first needs them: that of rays for rays or a change, the binary one for other queries.
    Any number of threads may ask at once. Triangles whose box has a diagonal above 0 and
    below 1e-12 are left out, as those that are not finite.

    `signed_distance`, `contains`, `winding_number`, `closure` and `overlaps` take all meshes, on
    every path of instances, as one mesh in the world: vertices are moved in float64 and rounded
    once. What that takes is told first: InputError names the bytes if they are more than half of
    what is left. Spheres and capsules are an InputError that names the geometry. The meshes of a
    scene of one mesh count whatever its mask is; of others those with mask 0 do not.

    `refit`, `vertices`, `faces`, `stats`, `wide_stats`, `info`, `check` and `raydix.simulate` need
    a scene of one mesh and nothing else: InputError names the geometry that stands in the way.

    In float64 the first of `closest_point`, `touches`, `touched_by` and `sweep_spheres` after a
    commit makes one mesh in the world too, and a tree over it, which later ones ask.

    With precision "float64" compact=True raises NotImplementedError: there is no such layout. Another
    device than "cpu" raises BackendUnavailable. Files raise ValueError, because they are read in float32;
    `load_scene` reads a .rdx file in the type that it was saved in. Instances are of scenes in float64 too: others raise TypeError. Numbers other
    than 0 below 2**-500 count as 0.

    Scenes can be pickled and copied: one of `load_scene` that has not changed goes over as the path
    of its file, whose memory both processes then share; one mesh as its arrays, and its trees are
    built again; all else as the bytes of a .rdx file. Vertex attributes go along, but not those of
    scenes that stand in this one.

    Raises ValueError (InputError is one) and TypeError that name the argument, what was expected
    and what was given.
    """

    def __init__(
        self,
        vertices: ArrayLike | str | bytes | os.PathLike | Any = None,
        faces: ArrayLike | None = None,
        *,
        quality: str = "balanced",
        builder: str | None = None,
        reinsertion_rounds: int | None = None,
        max_leaf: int = 4,
        bits: int = 63,
        strict: bool = False,
        threads: int = 0,
        device: str = "cpu",
        precision: DTypeLike = None,
        usage: str = "fixed",
        compact: bool = False,
    ) -> None:
        one_of(quality, "quality", QUALITIES)
        one_of(usage, "usage", USAGES)
        strict, compact = flag(strict, "strict"), flag(compact, "compact")
        device = device_name(device)
        self.dtype = float_type(precision, "precision")
        """float32 or float64: what the scene computes in and its results are."""
        self.threads = threads = thread_count(threads)
        self.device = device
        self._file: tuple[Any, int, int, int] | None = None
        self._options: dict[str, Any] = {
            "quality": quality,
            "builder": builder,
            "reinsertion_rounds": reinsertion_rounds,
            "max_leaf": max_leaf,
            "bits": bits,
            "strict": strict,
            "threads": threads,
            "device": device,
            "precision": self.dtype.name,
            "usage": usage,
            "compact": compact,
        }
        self.name = ""
        self._cameras: list[Camera] = []
        self._fitted: Camera | None = None
        self._there: DeviceRays | None = None
        if device != "cpu" and self.dtype != FLOAT32:
            raise _core.BackendUnavailable(
                f"device={device!r}: scenes in float64 are not traced there"
            )
        if compact:
            require_float32(self, "compact=True")
        options = (*tree_options(self._options), quality, usage, compact)
        self._core: Any = self._make(vertices, faces, options)

    def _make(self, vertices: Any, faces: Any, options: tuple) -> Any:
        """The core of an empty scene, of a file, a built-in scene, or a mesh."""
        core_type = _core.SceneTrees if self.dtype == FLOAT32 else _core.SceneTreesD
        if vertices is None:
            if faces is not None:
                raise TypeError("vertices: expected shape (V, 3) for these faces, given None")
            return core_type(*options)
        if faces is None:
            if isinstance(vertices, (str, bytes, os.PathLike)):
                if self.dtype == FLOAT32:
                    core, self.name, cameras = _core.SceneTrees.load(
                        path(vertices, "vertices"), 1, *options
                    )
                    self._cameras = [Camera(**camera) for camera in cameras]
                    if core.is_mesh() and len(core.faces) == 0:
                        _warn_of_points(len(core.vertices))
                    return core
                vertices, faces = self._built_in(os.fsdecode(vertices))
                if len(faces) == 0:
                    _warn_of_points(len(vertices))
            else:
                vertices, faces = mesh_of(vertices)
        corners = mesh_vertices(vertices, dtype=self.dtype)
        triangles = mesh_faces(faces, len(corners))
        return core_type(corners, triangles, *options)

    def _built_in(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """The mesh of a built-in scene for one in float64."""
        if not name.startswith("builtin:"):
            raise ValueError(
                f"precision: files are read in float32, given 'float64' and the path {shown(name)}; "
                "give vertices and faces as another library has read them; load_scene reads .rdx files"
            )
        loaded = _core.load_scene(path(name, "vertices"), 1)
        self.name = loaded["name"]
        return loaded["vertices"], loaded["faces"]

    def _forget(self) -> None:
        """What was made of the last commit."""
        self._there = self._fitted = self._file = None

    def _on_device(self) -> DeviceRays:
        there = self._there
        if there is None:
            with self._core.held():  # no commit comes between the making and the keeping
                there = self._there = DeviceRays(self._core, self.device)
        return there

    @property
    def vertices(self) -> np.ndarray:
        """Shape (V, 3) in `dtype`, a read-only view of the copy that the last commit saw. It
        stays as it is when the scene changes."""
        return self._core.vertices

    @property
    def faces(self) -> np.ndarray:
        """Shape (F, 3) uint32, as `vertices`."""
        return self._core.faces

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        double = "" if self.dtype == FLOAT32 else ", float64"
        if self.committed and self._core.is_mesh():
            counts = f"{len(self.faces):,} triangles, {len(self.vertices):,} vertices"
        else:
            counts = f"{len(self):,} geometr{'y' if len(self) == 1 else 'ies'}"
        changed = "" if self.committed else ", changes without a commit"
        return f"<raydix.Scene{name}: {counts}{double}{changed}>"

    def intersect(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
        keep: ArrayLike | Mapping[Any, ArrayLike] | None = None,
        skip: ArrayLike | Mapping[str, Any] | None = None,
        also: Sequence[str] | str = _NO_NAMES,
        stream: int = 0,
    ) -> Hits:
        """The closest hit of each ray.

        Parameters
        ----------
        rays :
            Shape (..., 8): origin, tmin, direction, tmax (ox oy oz tmin dx dy dz tmax); or (...,
            6): origin, direction; or, with `directions`, (..., 3): origins. float32 or float64,
            converted to the scene's type; any strides. Those of that type and of shape (..., 8) in
            one run are read where they lie, without a copy.
        directions :
            Shape (..., 3), any length but 0; t is in its units.
        tmin, tmax :
            Numbers or arrays, 0 and infinity if left out: hits outside of [tmin, tmax] do not
            count. Not with (..., 8).
        mask, masks :
            32 bits of all rays, or of each ray, an array that fits their leading shape. A ray sees
            a geometry if its mask & the geometry's is not 0, and the same holds for each instance
            on the way to it.
        keep :
            Which primitives rays see, instead of all: bool, shape (primitives,), of geometry 0. Or
            a dict of such arrays by the geometry's id, or by (instance, id) for what stands in
            instances; those that it does not name are seen. InputError: an array of another length
            than its geometry has primitives.
        skip :
            What each ray leaves out: a dict of arrays "prim", "geometry" and "instance" with the
            leading shape of the rays, such as the hits that they start from; or an array of
            positions in the mesh of geometry 0.
        also :
            What else the hits are to have: "position", "normal", or names that `set_attributes`
            gave vertices, such as "uv". One name or several. Computed on the processor, from the
            commit that the hits are of.
        stream :
            Only with device="cuda" and rays that lie on the GPU, float32 of shape (..., 8): the
            CUDA stream to run on, as a number (`cupy.cuda.get_current_stream().ptr`). Results are
            then a plain dict of arrays of the same library, on the GPU, and not waited for.

        Returns
        -------
        Hits, a dict of arrays with the leading shape of the rays, which are attributes too
        (`hits.t`): "t" (the scene's type; infinity: nothing
        was hit), "prim" (uint32, the position in the mesh's `faces`; 0xFFFFFFFF: nothing), "u" and
        "v" (the scene's type): the point is (1-u-v)*v0 + u*v1 + v*v2; "geometry" (uint32, the
        mesh's id in its scene; 0xFFFFFFFF: nothing) and "instance" (uint32; 0: a geometry of the
        scene itself, else a number for `path`). "t" is in units of the ray's direction, through
        instances too. At equal t the lower "instance" wins, then "geometry", then "prim". Rays
        through an edge hit at least one of its triangles (Woop, Benthin, Wald 2013). Rays with NaN,
        a zero direction or tmin > tmax miss. All are views of one array.

        On a device (`Scene(device=...)`) all rays have the mask of 32 bits set, and hits are the
        same, bit for bit. Scenes with instances, spheres or capsules, `mask`, `masks`, `keep` and
        `skip` raise BackendUnavailable there.
        """
        names = () if also is _NO_NAMES else also_names(also)
        if names:
            with self._core.held():  # both of one commit
                found = Scene.intersect(
                    self,
                    rays,
                    directions,
                    tmin=tmin,
                    tmax=tmax,
                    mask=mask,
                    masks=masks,
                    keep=keep,
                    skip=skip,
                    stream=stream,
                )
                return self._with(found, names, rays, directions)
        if (
            directions is not None
            and tmin is tmax is masks is keep is skip is None
            and mask is ALL
            and self.device == "cpu"
        ):
            row = np.empty(self._core.hit_columns, self.dtype)
            dimensions = self._core.hit_of(rays, directions, row)
            if dimensions:
                return Hits(row if dimensions == 1 else row[None])
        if self.device != "cpu":
            self._refuse_filter(keep, skip)
            return self._on_device().intersect(rays, directions, tmin, tmax, mask, masks, stream)
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        seen = ray_masks(mask, masks, lead)
        only = hit_filter(keep, skip, lead)
        columns = self._core.hit_columns
        hits = np.empty((*lead, columns), self.dtype)
        self._core.intersect(
            *args, hits if hits.ndim == 2 else hits.reshape(-1, columns), *seen, self.threads, only
        )
        return Hits(hits)

    def occluded(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
        keep: ArrayLike | Mapping[Any, ArrayLike] | None = None,
        skip: ArrayLike | Mapping[str, Any] | None = None,
        stream: int = 0,
    ) -> np.ndarray:
        """Whether each ray hits anything at all: bool, with the leading shape of the rays. Rays as
        in `intersect`.

        For rays that lie on a GPU: uint8, 1 or 0, there.
        """
        if self.device != "cpu":
            self._refuse_filter(keep, skip)
            return self._on_device().occluded(rays, directions, tmin, tmax, mask, masks, stream)
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        seen = ray_masks(mask, masks, lead)
        only = hit_filter(keep, skip, lead)
        flags = np.empty(lead, np.bool_)
        self._core.occluded(*args, flags.reshape(-1), *seen, self.threads, only)
        return flags

    def count(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
        keep: ArrayLike | Mapping[Any, ArrayLike] | None = None,
        skip: ArrayLike | Mapping[str, Any] | None = None,
    ) -> np.ndarray:
        """How many triangles each ray hits: uint32, with the leading shape of the rays. Rays as in
        `intersect`.

        Edges are half open, as in `all_hits`: on a closed mesh the number is even for rays that
        start outside, through edges and vertices too.
        """
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        seen = ray_masks(mask, masks, lead)
        only = hit_filter(keep, skip, lead)
        counts = np.empty(lead, UINT32)
        self._core.count(*args, counts.reshape(-1), *seen, self.threads, only)
        return counts

    def all_hits(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = ALL,
        masks: ArrayLike | None = None,
        keep: ArrayLike | Mapping[Any, ArrayLike] | None = None,
        skip: ArrayLike | Mapping[str, Any] | None = None,
        max_result_bytes: int = 0,
    ) -> Hits:
        """Every hit of every ray, from one traversal. Rays as in `intersect`.

        Returns Hits with "offsets" too (uint64, one more than there are rays); those of ray i, counted in
        C order, stand at offsets[i] to offsets[i + 1] of the arrays of `intersect`, sorted by (t,
        instance, geometry, prim). Each triangle counts once a ray and path; an edge belongs to one
        of its two triangles, so that crossings of a closed mesh are counted exactly.
        `max_result_bytes` bounds the peak memory of the call, the arrays included; 0: half of what
        is left. InputError if it would take more: no hit is ever dropped.
        """
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        seen = ray_masks(mask, masks, lead)
        only = hit_filter(keep, skip, lead)
        most = result_bytes(max_result_bytes)
        offsets, hits, _ = self._core.all_hits(*args, most, *seen, self.threads, only)
        return Hits(hits, {"offsets": offsets})

    def _refuse_filter(self, keep: Any, skip: Any) -> None:
        if keep is not None or skip is not None:
            raise _core.BackendUnavailable(f"device={self.device!r}: hits are not filtered there")

    def refit(self, vertices: ArrayLike) -> dict[str, float]:
        """Moves the vertices, shape (V, 3) as before, converted to the scene's type, and commits;
        the trees keep their hierarchies, their boxes are fitted again. Where only rays are asked,
        `update` and `commit(usage="moving")` do without the binary tree.

        Returns "sah", "sah_at_build" and their "ratio", of the binary tree: from about 1.5 on a new
        Scene is usually worth its time. InputError, the scene unchanged: triangles that were valid
        are so no more,
        or the other way round; a tree with parts of triangles (builders split and sbvh, quality
        "high"); other changes without a commit. Waits for queries of other threads.
        """
        corners = mesh_vertices(vertices, dtype=self.dtype)
        if len(corners) != len(self.vertices):
            raise ValueError(
                f"vertices: expected shape ({len(self.vertices)}, 3), given {corners.shape}"
            )
        try:
            return self._core.refit(corners, self.threads)
        finally:
            self._forget()

    def info(self) -> dict[str, Any]:
        """Counts, bounds and degenerate elements of the mesh."""
        return self._core.info()

    def stats(self) -> dict[str, Any]:
        """Figures of the binary tree, its hash, and the milliseconds of its stages ("ms")."""
        return self._core.stats()

    def wide_stats(self) -> dict[str, Any]:
        """Figures of the wide tree that rays go through, built for this call as a commit builds
        it. "sah" is None if the tree is empty or its root has no area."""
        return self._core.wide_stats()

    def closure(self) -> dict[str, Any]:
        """ "closure": "open", "closed" or "oriented"; "open_edges": edges of an odd number of
        triangles; "rule": the rule that "automatic" stands for in `contains`."""
        kind, open_edges, rule = self._core.closure()
        return {"closure": kind, "open_edges": open_edges, "rule": rule}

    def check(self) -> None:
        """Verifies every invariant of the binary tree (in float64: of its boxes); RuntimeError
        names the first that does not hold. Of trees that were made from Morton codes (quality
        "fast", LBVH builders) their order is one, until a `refit`."""
        ok, broken = self._core.check()
        if not ok:
            raise RuntimeError(broken)


def load_scene(file: str | bytes | os.PathLike, *, threads: int = 0, device: str = "cpu") -> Scene:
    """The scene that `Scene.save` wrote, committed: with its name, its cameras, and the options of
    its last commit. Rays have the same hits. A scene in float64 is one again, with every number as it
    was, to the bit.

    The file is checked and mapped. Of a scene in float32 nothing is built, and processes that load it
    share the memory of its trees; of one in float64 they share vertices and triangles, and its trees
    are built. The file may be deleted, but not changed, while a scene uses it. `threads` and `device`
    as in `Scene`.

    InputError that names the file and what is wrong with it; so for a .rdx file that holds a tree
    and no scene.
    """
    return read_scene(Scene, file, threads, device)


def read_scene(
    kind: type[Scene], file: str | bytes | os.PathLike, threads: int, device: str
) -> Scene:
    """As `load_scene`, of a subclass."""
    name = path(file, "file")
    precision = "float64" if _core.holds_scene_double(name) else "float32"
    scene = object.__new__(kind)
    Scene.__init__(scene, threads=threads, device=device, precision=precision)
    scene._core, scene.name, cameras = type(scene._core).load_rdx(name, scene.threads)
    scene._cameras = [Camera(**camera) for camera in cameras]
    scene._options.update(scene._core.commit_options())
    scene._file = state_of(os.path.abspath(file))
    return scene
