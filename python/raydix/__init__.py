"""Rays, nearest neighbours and closest points on meshes and point clouds: arrays in, dicts of
arrays out."""

from __future__ import annotations

from ._arrays import MISSING
from ._core import BackendUnavailable, DeviceError, InputError, __version__
from .cameras import Camera
from .devices import Device, devices
from .hits import Hits
from .names import builders, kernels, machine, machines, scenes
from .pictures import save_picture, to_png, to_srgb
from .points import Points, load_points
from .scene import Scene, load_scene
from .simulator import simulate
from .trees import Bvh, KdTree, Octree, bvh, kdtree, octree

__all__ = [
    "MISSING",
    "BackendUnavailable",
    "Bvh",
    "Camera",
    "Device",
    "DeviceError",
    "Hits",
    "InputError",
    "KdTree",
    "Octree",
    "Points",
    "Scene",
    "__version__",
    "builders",
    "bvh",
    "devices",
    "kdtree",
    "kernels",
    "load_points",
    "load_scene",
    "machine",
    "machines",
    "octree",
    "save_picture",
    "scenes",
    "simulate",
    "to_png",
    "to_srgb",
]
