"""Where queries can run."""

from __future__ import annotations

import dataclasses
import importlib
import re
from typing import Any

import numpy as np

from . import _core
from ._arrays import ALL, FLOAT32, cast, shown
from ._rays import ray_batch
from .hits import COLUMNS, Hits

_CUDA = 2  # DLPack's number


@dataclasses.dataclass(frozen=True)
class Device:
    """`name` is what `Scene(device=...)` takes; `detail` the processor or device, or why it cannot
    be used."""

    name: str
    available: bool
    detail: str


def devices() -> list[Device]:
    """All devices that this library knows, and which of them this build and this machine have: "cpu",
    then one of "cuda", one of "opencl" and one of "hip" (AMD) at least. Those of OpenCL are "opencl:0",
    "opencl:1" and so on; where there is none, "opencl" says why. So it is with "hip"."""
    machine = _core.machine()
    others = [Device(name, not lacks, lacks or what) for name, what, lacks in _core.devices()]
    return [Device("cpu", True, f"{machine['cpu']}, {machine['isa']}"), *others]


def device_name(value: Any) -> str:
    """What `Scene(device=...)` was given. ValueError: no name of a device."""
    if isinstance(value, str) and re.fullmatch(r"cpu|cuda|(opencl|hip)(:[0-9]{1,9})?", value):
        return value
    raise ValueError(
        "device: expected 'cpu', 'cuda', 'opencl', 'opencl:N', 'hip' or 'hip:N', "
        f"given {shown(value)}"
    )


def on_cuda(array: Any) -> bool:
    """Whether an array lies in the memory of an NVIDIA GPU."""
    return (
        not isinstance(array, np.ndarray)
        and hasattr(array, "__dlpack_device__")
        and int(array.__dlpack_device__()[0]) == _CUDA
    )


def _like(result: Any, given: Any, lead: tuple[int, ...]) -> Any:
    """A result of the core as an array of the library that the rays came from; else as it is (it
    has __dlpack__)."""
    home = importlib.import_module(type(given).__module__.split(".")[0])
    if hasattr(home, "from_dlpack"):
        return home.from_dlpack(result).reshape(lead)
    return result


def _packed(rays: Any, directions: Any, tmin: Any, tmax: Any) -> tuple[np.ndarray, tuple[int, ...]]:
    """Rays of any form on the host -> (n, 8) float32."""
    args, lead = ray_batch(rays, directions, tmin, tmax)
    if len(args) == 1:
        return args[0], lead
    origins, along, near, far = args
    packed = np.empty((len(origins), 8), FLOAT32)
    packed[:, :3], packed[:, 3], packed[:, 4:7], packed[:, 7] = origins, near, along, far
    return cast(packed, FLOAT32), lead


def _without_masks(mask: Any, masks: Any) -> None:
    if masks is not None or mask != ALL:
        raise _core.BackendUnavailable("mask: rays on a device have none")


class DeviceRays:
    """The two calls of a Scene that run on a device."""

    def __init__(self, core: Any, device: str) -> None:
        self._core = _core.DeviceScene(core, device)
        self._is_cuda = device == "cuda"

    def _there(
        self, rays: Any, directions: Any, tmin: Any, tmax: Any
    ) -> tuple[Any, tuple[int, ...]]:
        shape = tuple(rays.shape)
        if directions is not None or tmin is not None or tmax is not None or shape[-1:] != (8,):
            raise ValueError(
                f"rays: on a GPU, expected one array of shape (..., 8) float32, given shape {shape}"
            )
        if "float32" not in str(rays.dtype):
            raise TypeError(f"rays: on a GPU, expected float32, given shape {shape} {rays.dtype}")
        gpu = int(rays.__dlpack_device__()[1])
        if gpu != self._core.gpu:
            raise ValueError(
                f"rays: expected an array on GPU {self._core.gpu}, where the scene is, "
                f"given one on GPU {gpu}"
            )
        return rays.reshape(-1, 8), shape[:-1]

    def intersect(
        self,
        rays: Any,
        directions: Any,
        tmin: Any,
        tmax: Any,
        mask: Any,
        masks: Any,
        stream: int,
    ) -> Any:
        _without_masks(mask, masks)
        if self._is_cuda and on_cuda(rays):
            flat, lead = self._there(rays, directions, tmin, tmax)
            columns = self._core.intersect_there(flat, stream)
            return {
                name: _like(column, rays, lead)
                for name, column in zip(COLUMNS, columns, strict=True)
            }
        packed, lead = _packed(rays, directions, tmin, tmax)
        hits = np.empty(lead + (6,), FLOAT32)
        self._core.intersect_here(packed, hits.reshape(-1, 6))
        return Hits(hits)

    def occluded(
        self,
        rays: Any,
        directions: Any,
        tmin: Any,
        tmax: Any,
        mask: Any,
        masks: Any,
        stream: int,
    ) -> Any:
        _without_masks(mask, masks)
        if self._is_cuda and on_cuda(rays):
            flat, lead = self._there(rays, directions, tmin, tmax)
            return _like(self._core.occluded_there(flat, stream), rays, lead)
        packed, lead = _packed(rays, directions, tmin, tmax)
        flags = np.empty(lead, np.bool_)
        self._core.occluded_here(packed, flags.reshape(-1))
        return flags
