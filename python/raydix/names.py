"""What the library knows by name, and where it runs."""

from __future__ import annotations

from typing import Any

from . import _core


def builders() -> list[str]:
    """Names of the builders of `Scene(builder=...)` and `bvh`."""
    return _core.builders()


def kernels() -> list[str]:
    """Names of the traversal kernels that can be simulated."""
    return _core.kernels()


def machine() -> dict[str, Any]:
    """The processor, cores this process may use, instruction set."""
    return _core.machine()


def machines() -> list[str]:
    """Names of the simulated machines."""
    return _core.machines()


def scenes() -> list[dict[str, Any]]:
    """The built-in scenes and their parameters."""
    return _core.scenes()
