"""Scenes placed many times by affine transforms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import FLOAT32, UINT32, cast, describe, thread_count, to_numpy, whole
from ._rays import ray_batch

if TYPE_CHECKING:
    from .scene import Scene


def _transforms(value: Any, dtype: np.dtype) -> np.ndarray:
    array = to_numpy(value, "transforms")
    if array.dtype.kind not in "iuf":
        raise TypeError(
            "transforms: expected shape (M, 3, 4) or (M, 4, 4) float32 or float64, "
            f"given {describe(array)}"
        )
    if array.ndim != 3 or array.shape[1:] not in ((3, 4), (4, 4)):
        raise ValueError(
            f"transforms: expected shape (M, 3, 4) or (M, 4, 4), given {describe(array)}"
        )
    if array.shape[1] == 4 and not (array[:, 3] == (0, 0, 0, 1)).all():
        raise ValueError("transforms: expected affine ones, with (0, 0, 0, 1) in the last row")
    return cast(array[:, :3], dtype).reshape(-1, 12)


def _indices(value: ArrayLike, name: str, count: int) -> np.ndarray:
    array = to_numpy(value, name)
    if array.dtype.kind not in "iu" or array.shape != (count,):
        raise ValueError(
            f"{name}: expected shape ({count},) of whole numbers, given {describe(array)}"
        )
    most = np.iinfo(UINT32).max
    if count and (array.min() < 0 or array.max() > most):
        raise ValueError(f"{name}: expected 0 to {most}, given {array.min()} to {array.max()}")
    return cast(array, UINT32)


def _mask(value: Any) -> int:
    return whole(value, "mask", 0, int(np.iinfo(UINT32).max))


class Instances:
    """Scenes placed many times. Memory goes with the number of scenes and that of places, not their
    product.

    Parameters
    ----------
    scenes :
        The objects to place, all of one precision, in which rays are answered. What a `refit` of
        one changes, the next call here sees.
    transforms :
        Shape (M, 3, 4) or (M, 4, 4): from the object's space to the world's. They may mirror and
        shear, but not flatten.
    objects :
        Shape (M,): which of `scenes` stands in each place; all the first if left out.
    masks :
        Shape (M,) of 32-bit masks: rays see a place if its mask & theirs is not 0.

    ValueError (InputError) names the place whose transform is singular or not finite.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        transforms: ArrayLike,
        objects: ArrayLike | None = None,
        *,
        masks: ArrayLike | None = None,
        threads: int = 0,
    ) -> None:
        from .scene import Scene

        self.threads = threads = thread_count(threads)
        try:
            self.scenes = list(scenes)
            known = all(isinstance(scene, Scene) for scene in self.scenes)
        except TypeError:
            known = False
        if not known:
            raise TypeError(f"scenes: expected a sequence of Scene, given {scenes!r}")
        types = {scene.dtype for scene in self.scenes}
        if len(types) > 1:
            raise ValueError("scenes: expected all in float32 or all in float64, given both")
        self.dtype = types.pop() if types else FLOAT32
        """That of the scenes: what rays are answered in."""
        rows = _transforms(transforms, self.dtype)
        count = len(rows)
        which = np.zeros(count, UINT32) if objects is None else _indices(objects, "objects", count)
        mask = (
            np.full(count, 0xFFFFFFFF, UINT32) if masks is None else _indices(masks, "masks", count)
        )
        if count and not self.scenes:
            raise ValueError(f"scenes: expected one or more for {count} transforms, given none")
        if count and which.max() >= len(self.scenes):
            raise ValueError(
                f"objects: expected numbers below {len(self.scenes)}, given {int(which.max())}"
            )
        core = _core.Instances if self.dtype == FLOAT32 else _core.InstancesD
        self._core = core(
            tuple(scene._core for scene in self.scenes), rows, which, mask, threads
        )

    def move(self, transforms: ArrayLike) -> None:
        """New places, as many as before. The objects' own trees are not touched."""
        rows = _transforms(transforms, self.dtype)
        if len(rows) != len(self):
            raise ValueError(
                f"transforms: expected {len(self)}, as many as there are places, given {len(rows)}"
            )
        self._core.move(rows, self.threads)

    def intersect(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = 0xFFFFFFFF,
    ) -> dict[str, np.ndarray]:
        """As `Scene.intersect`, with two more arrays: "instance", the place, and "object", its
        position in `scenes` (uint32; 0xFFFFFFFF: nothing was hit).

        `t` is in units of the ray's direction in the world. At equal t the lower place wins, then
        the lower triangle.
        """
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        hits = self._core.intersect(*args, _mask(mask), self.threads)
        hits = hits.reshape((*lead, hits.shape[-1]))
        ids = hits.view(UINT32)  # one, or two of which the second is unused, in a scalar's room
        words = self.dtype.itemsize // UINT32.itemsize
        return {
            "t": hits[..., 0],
            "prim": ids[..., words],
            "u": hits[..., 2],
            "v": hits[..., 3],
            "object": ids[..., 4 * words],
            "instance": ids[..., 4 * words + 1],
        }

    def occluded(
        self,
        rays: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tmin: Any = None,
        tmax: Any = None,
        mask: int = 0xFFFFFFFF,
    ) -> np.ndarray:
        """Whether each ray hits anything that it may see: bool, with the leading shape of the
        rays."""
        args, lead = ray_batch(rays, directions, tmin, tmax, self.dtype)
        flags = np.empty(lead, np.bool_)
        self._core.occluded(*args, flags.reshape(-1), _mask(mask), self.threads)
        return flags

    def __len__(self) -> int:
        return len(self._core)
