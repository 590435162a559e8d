"""Cameras: where pictures and primary rays start."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ._arrays import number, shown, text, to_numpy


@dataclasses.dataclass(frozen=True)
class Camera:
    """A pinhole camera. right = cross(target - position, up); `vfov` is the vertical angle in
    degrees."""

    position: tuple[float, float, float] = (0.0, 0.0, 1.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    vfov: float = 45.0
    name: str = ""

    def _fields(self) -> tuple:
        return (
            _place(self.position, "camera, position"),
            _place(self.target, "camera, target"),
            _place(self.up, "camera, up"),
            number(self.vfov, "camera, vfov"),
            text(self.name, "camera, name"),
        )


def _place(value: Any, name: str) -> tuple[float, ...]:
    place = to_numpy(value, name)
    if place.shape != (3,) or place.dtype.kind not in "iuf":
        raise TypeError(f"{name}: expected three numbers, given {shown(value)}")
    return tuple(place.astype(np.float64).tolist())
