"""The warp simulator: what traversal kernels could reach on SIMT machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from . import _core
from ._arrays import FLOAT32, require_float32, rows
from .scene import Scene


def simulate(
    scene: Scene,
    rays: ArrayLike | None = None,
    *,
    kernels: str | Sequence[str] | None = None,
    machine: str = "gtx480",
    builder: str = "split",
    max_leaf: int = 8,
    width: int = 32,
    any_hit: bool = False,
    memory: bool = False,
) -> list[dict[str, Any]]:
    """Runs one launch of rays through traversal kernels of Aila and Laine (2009, 2012) on a
    simulated machine.

    Parameters
    ----------
    rays :
        (N, 8) float32, in the order in which threads take them; the first camera's primary rays,
        256 x 192, if left out.
    kernels :
        A name or several of `raydix.kernels()`; all if left out.
    machine :
        A name of `raydix.machines()`, or the path of a .json file with one's own.
    builder, max_leaf :
        The tree: AL09's own by default.
    width :
        Lanes of a warp: 1, 2, 4, 8, 16, 32 or 64.
    any_hit :
        Rays end at their first hit.
    memory :
        Also run the memory model.

    Returns
    -------
    One dict for each kernel. "mrays_per_s_bound" is the issue limit alone, with infinitely fast
    memory; "mrays_per_s_scheduled" has the distribution of work and the tail of the launch too;
    "mrays_per_s_memory" is None without the memory model. "simd_efficiency", "issues_per_ray" by
    operation, "histogram" of warp times (8 bins an octave). All rates are simulated ones. Triangles
    are tested with Woop's test, as in the paper.
    """
    require_float32(scene, "simulate")
    if rays is None:
        rays = scene.primary_rays(size=(256, 192))["rays"]
    launch, _ = rows(rays, "rays", (8,), FLOAT32)
    if kernels is None:
        kernels = _core.kernels()
    elif isinstance(kernels, str):
        kernels = [kernels]
    tree = _core.Bvh(scene.vertices, scene.faces, builder, 63, max_leaf, False, scene.threads)
    return _core.simulate(
        tree, launch, list(kernels), machine, width, any_hit, memory, scene.threads
    )
