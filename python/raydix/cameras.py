"""Cameras: where pictures and primary rays start."""

from __future__ import annotations

import dataclasses


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
            tuple(self.position),
            tuple(self.target),
            tuple(self.up),
            float(self.vfov),
            self.name,
        )
