"""Which hits count, by arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import _core
from ._arrays import ALL, describe, shown, to_numpy, uint32s, whole


def _place_of(key: Any) -> tuple[int, int]:
    """(instance, geometry) of a key: a geometry's id, or both."""
    if isinstance(key, tuple):
        if len(key) != 2:
            raise ValueError(
                f"keep: expected a geometry's id or (instance, id), given {shown(key)}"
            )
        return whole(key[0], "keep: instance", 0, ALL), whole(key[1], "keep: geometry", 0, ALL)
    return 0, whole(key, "keep: geometry", 0, ALL)


def _flags(value: Any, name: str) -> np.ndarray:
    flags = to_numpy(value, name)
    if flags.dtype != np.bool_:
        raise TypeError(f"{name}: expected bool, given {describe(flags)}")
    if flags.ndim != 1:
        raise ValueError(f"{name}: expected shape (primitives,), given {describe(flags)}")
    return np.ascontiguousarray(flags)


_NAMES = ("prim", "geometry", "instance")


def _column(value: Any, lead: tuple[int, ...], name: str) -> np.ndarray:
    column = uint32s(value, name)
    if column.shape != lead:
        raise ValueError(f"{name}: expected shape {lead}, that of the rays, given {describe(column)}")
    return np.ascontiguousarray(column).reshape(-1)


def hit_filter(keep: Any, skip: Any, lead: tuple[int, ...]) -> Any:
    """What the core takes; None if all hits count. `lead`: the rays' leading shape."""
    if keep is None and skip is None:
        return None
    made = _core.HitFilter()
    if skip is not None:
        if isinstance(skip, Mapping):
            if any(name not in skip for name in _NAMES):
                raise ValueError(
                    f"skip: expected {', '.join(_NAMES)}, given {shown(list(skip))}"
                )
            columns = [_column(skip[name], lead, f"skip, {name}") for name in _NAMES]
        else:
            prims = _column(skip, lead, "skip")
            columns = [prims, np.zeros_like(prims), np.zeros_like(prims)]
        made.skip(*columns)
    if keep is not None:
        for key, values in (keep if isinstance(keep, Mapping) else {0: keep}).items():
            made.keep(*_place_of(key), _flags(values, "keep"))
    return made
