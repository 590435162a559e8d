"""The warp simulator: what traversal kernels could reach on SIMT machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import FLOAT32, cast, flag, one_of, path, rows, shown, whole
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
        A name or several of `raydix.kernels()`; those of Aila and Laine if left out.
    machine :
        A name of `raydix.machines()`, or the path of a .json file with one's own.
    builder, max_leaf :
        The tree: AL09's own by default.
    width :
        Lanes of a warp: 1, 2, 4, 8, 16, 32, 64 or 128.
    any_hit :
        Rays end at their first hit.
    memory :
        Also run the memory model.

    Returns
    -------
    One dict for each kernel. "mrays_per_s_bound" is the issue limit alone, with infinitely fast
    memory; "mrays_per_s_scheduled" has the distribution of work and the tail of the launch too;
    "mrays_per_s_memory" is None without the memory model. "simd_efficiency", "issues_per_ray" by
    operation, "histogram" of warp times (64 bins an octave). All rates are simulated ones. Triangles
    are tested with Woop's test, as in the paper.

    Machines and kernels are those of float32. A scene in float64 is simulated as a user of them would
    have to give it: vertices and rays are moved so that the middle of the scene's box is the origin,
    in float64, and rounded to float32 once. The scene itself stays as it is. "hits" may then differ
    from those of `Scene.intersect` by rays at edges.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene: expected a Scene, given {shown(scene)}")
    builder = one_of(builder, "builder", _core.builders())
    leaf = whole(max_leaf, "max_leaf", 1, 255)
    lanes = whole(width, "width", 1, 128)
    options = flag(any_hit, "any_hit"), flag(memory, "memory")
    if kernels is None or isinstance(kernels, str):
        kernels = _core.kernel_family() if kernels is None else [kernels]
    if not isinstance(kernels, (list, tuple)):
        raise TypeError(f"kernels: expected a name or several, given {shown(kernels)}")
    names = [one_of(kernel, "kernels", _core.kernels()) for kernel in kernels]
    model = path(machine, "machine")
    if rays is None:
        rays = scene.primary_rays(size=(256, 192))["rays"]
    launch, _ = rows(rays, "rays", (8,), scene.dtype)
    vertices = scene.vertices
    if scene.dtype != FLOAT32:
        vertices, launch = _about_the_middle(scene, launch)
    tree = _core.Bvh(vertices, scene.faces, builder, 63, leaf, False, scene.threads)
    return _core.simulate(tree, launch, names, model, lanes, *options, scene.threads)


def _about_the_middle(scene: Scene, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and rays of a scene in float64 as float32 kernels can take them."""
    lo, hi = scene.info()["bounds"]
    middle = (np.array(lo) + np.array(hi)) / 2 if lo[0] <= hi[0] else np.zeros(3)
    moved = rays.copy()
    moved[:, :3] -= middle
    return cast(scene.vertices - middle, FLOAT32), cast(moved, FLOAT32)
