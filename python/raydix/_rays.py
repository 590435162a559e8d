"""Rays in any of their forms -> the arguments of a call of the core."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._arrays import (
    ALL,
    FLOAT32,
    FLOAT64,
    describe,
    floats,
    number,
    to_numpy,
    uint32s,
    whole,
)
from .hits import COLUMNS, Hits


def _limit(value: Any, name: str, lead: tuple[int, ...]) -> Any:
    """tmin or tmax: a number as it is; an array that fits the rays as (...) of their leading
    shape."""
    if isinstance(value, (int, float)):
        return number(value, name)
    limit = to_numpy(value, name)
    if limit.dtype.kind not in "iuf":
        raise TypeError(
            f"{name}: expected a number or shape {lead} float32 or float64, given {describe(limit)}"
        )
    if limit.ndim == 0:
        return float(limit)
    try:
        return np.broadcast_to(limit, lead)
    except ValueError:
        raise ValueError(
            f"{name}: expected a number or shape {lead}, given {describe(limit)}"
        ) from None


def floats_of(value: Any, name: str, lead: tuple[int, ...]) -> np.ndarray:
    """A number, or an array that fits the leading shape, as one of that shape."""
    return np.broadcast_to(_limit(value, name, lead), lead)


def _stepped(array: np.ndarray) -> np.ndarray:
    """The array, or a copy if its steps are no multiples of an item, as in packed records."""
    if any(step % array.itemsize for step in array.strides):
        return np.ascontiguousarray(array)
    return array


def _columns(
    origins: np.ndarray, directions: np.ndarray, tmin: Any, tmax: Any
) -> tuple[tuple, tuple[int, ...]]:
    """Origins, directions and limits (n,) of one type, read where they lie if they have it."""
    if origins.shape != directions.shape:
        try:
            shape = np.broadcast_shapes(origins.shape, directions.shape)
        except ValueError:
            raise ValueError(
                f"directions: expected a shape that fits origins, {origins.shape}, "
                f"given {describe(directions)}"
            ) from None
        origins, directions = np.broadcast_to(origins, shape), np.broadcast_to(directions, shape)
    lead = origins.shape[:-1]
    parts = [origins, directions]
    near = 0.0 if tmin is None else _limit(tmin, "tmin", lead)
    far = np.inf if tmax is None else _limit(tmax, "tmax", lead)
    arrays = parts + [limit for limit in (near, far) if not isinstance(limit, float)]
    if origins.dtype != FLOAT32 or any(array.dtype != FLOAT32 for array in arrays):
        arrays = [array.astype(FLOAT64, copy=False) for array in arrays]
    if origins.ndim != 2:
        arrays = [
            array.reshape(-1, 3) if i < 2 else array.reshape(-1) for i, array in enumerate(arrays)
        ]
    arrays = [_stepped(array) for array in arrays]
    limits = iter(arrays[2:])
    return (
        *arrays[:2],
        *(limit if isinstance(limit, float) else next(limits) for limit in (near, far)),
    ), lead


def ray_batch(
    rays: Any, directions: Any, tmin: Any, tmax: Any, dtype: np.dtype = FLOAT32
) -> tuple[tuple, tuple[int, ...]]:
    """The arguments that stand for the rays, and their leading shape.

    `dtype`, the scene's, of shape (..., 8) in one run goes over as it is; all other forms are read
    where they lie.
    """
    if directions is not None:
        return _columns(
            floats(rays, "origins", (3,)), floats(directions, "directions", (3,)), tmin, tmax
        )
    if type(rays) is not np.ndarray or rays.ndim != 2 or rays.shape[1] != 8:
        rays = floats(rays, "rays", (8, 6))
    if rays.shape[-1] == 6:
        return _columns(rays[..., :3], rays[..., 3:], tmin, tmax)
    if tmin is not None or tmax is not None:
        raise ValueError("tmin, tmax: rays of shape (..., 8) have their own, in columns 3 and 7")
    flags = rays.flags
    if rays.dtype == dtype and flags.c_contiguous and flags.aligned:
        return (rays if rays.ndim == 2 else rays.reshape(-1, 8),), rays.shape[:-1]
    rays = floats(rays, "rays", (8,))
    return _columns(rays[..., :3], rays[..., 4:7], rays[..., 3], rays[..., 7])


def ray_masks(mask: Any, masks: Any, lead: tuple[int, ...]) -> tuple[int, np.ndarray | None]:
    """The mask of all rays, or one for each: (n,) uint32."""
    if masks is None and mask is ALL:
        return ALL, None
    if masks is None:
        return whole(mask, "mask", 0, ALL), None
    if mask != ALL:
        raise ValueError("mask, masks: expected one of them, given both")
    each = uint32s(masks, "masks")
    try:
        each = np.broadcast_to(each, lead)
    except ValueError:
        raise ValueError(f"masks: expected shape {lead}, given {describe(each)}") from None
    return ALL, np.ascontiguousarray(each).reshape(-1)


def ray_rows(
    rays: Any, directions: Any, lead: tuple[int, ...], dtype: np.dtype = FLOAT32
) -> np.ndarray:
    """Rays of any form but their limits as rows (n, 8) of the scene's type."""
    args, shape = ray_batch(rays, directions, None, None, dtype)
    if shape != lead:
        raise ValueError(f"rays: expected one for each hit, shape {lead}, given {shape}")
    if len(args) == 1:
        return args[0]
    made = np.zeros((len(args[0]), 8), dtype)
    with np.errstate(over="ignore"):  # beyond float32 it is infinite
        made[:, :3], made[:, 4:7], made[:, 7] = args[0], args[1], np.inf
    return made


_expected_hits = f"hits: expected a dict of arrays {', '.join(COLUMNS)}, as of Scene.intersect"


def hit_rows(hits: Any, dtype: np.dtype, columns: int) -> np.ndarray:
    """Columns of hits as rows, (..., columns) of the scene's type, as the core writes them."""
    if isinstance(hits, Hits) and hits._rows.dtype == dtype and hits._rows.shape[-1] == columns:
        return np.ascontiguousarray(hits._rows)
    try:
        given = {name: np.asarray(hits[name]) for name in COLUMNS}
    except (KeyError, IndexError, TypeError, ValueError):
        raise TypeError(_expected_hits) from None
    for name in ("prim", "geometry", "instance"):
        given[name] = uint32s(given[name], f"hits, {name}")
    try:
        rows = np.zeros((*given["t"].shape, columns), dtype)
        for name, column in Hits(rows).items():
            column[...] = given[name]
    except (TypeError, ValueError):
        raise TypeError(_expected_hits) from None
    return rows
