"""What trimesh's own tests import as `generic`, which its archive of sources lacks.

The modules they use, and meshes under the names of the files they read. The meshes are made here and
have what each test is about. RAYDIX_STAND_IN says what rays go to: "embree", trimesh's class over
`raydix.embree`; "trimesh", `raydix.trimesh`.
"""

import collections
import itertools
import json
import logging
import os
import sys
import tempfile
import time
import unittest

import numpy as np

import raydix.embree
import raydix.trimesh

sys.modules["embreex"] = raydix.embree
sys.modules["embreex.rtcore_scene"] = raydix.embree.rtcore_scene
sys.modules["embreex.mesh_construction"] = raydix.embree.mesh_construction

import trimesh  # noqa: E402, after what it imports has been put in its place

assert (
    trimesh.ray.has_embree and trimesh.ray.ray_pyembree.rtcore_scene is raydix.embree.rtcore_scene
)
if os.environ["RAYDIX_STAND_IN"] == "trimesh":
    trimesh.ray.ray_pyembree.RayMeshIntersector = raydix.trimesh.RayMeshIntersector

log = logging.getLogger("trimesh")
deque = collections.deque
__all__ = ["collections", "itertools", "json", "time", "unittest"]

random_numbers = np.random.default_rng(5).random


def random(shape):
    return random_numbers(shape)


def cube_without_an_eighth():
    """From -10 to 10, without the corner where all coordinates are positive."""
    at = np.array([-10.0, 0.0, 10.0])
    full = {cell for cell in itertools.product((0, 1), repeat=3) if cell != (1, 1, 1)}
    corners, faces = [], []
    for cell in full:
        for axis, side in itertools.product(range(3), (0, 1)):
            beside = list(cell)
            beside[axis] += 2 * side - 1
            if tuple(beside) in full:
                continue
            others = [(axis + 1) % 3, (axis + 2) % 3]
            quad = []
            for a, b in (
                ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0))
            ):
                corner = list(cell)
                corner[axis] += side
                corner[others[0]] += a
                corner[others[1]] += b
                quad.append(at[corner])
            faces += [[len(corners), len(corners) + 1, len(corners) + 2]]
            faces += [[len(corners), len(corners) + 2, len(corners) + 3]]
            corners += quad
    return np.array(corners), np.array(faces)


def open_pot():
    """Not closed: a sphere of radius 5 without its top."""
    ball = trimesh.creation.uv_sphere(radius=5)
    return ball.vertices, ball.faces[ball.triangles_center[:, 2] < 3]


def parts(*meshes):
    whole = trimesh.util.concatenate(meshes)
    return whole.vertices, whole.faces


def box(*extents):
    mesh = trimesh.creation.box(extents=extents)
    return mesh.vertices, mesh.faces


MESHES = {
    "unit_sphere.STL": lambda: parts(trimesh.creation.icosphere(subdivisions=2)),
    "unit_cube.STL": lambda: box(1, 1, 1),
    "7_8ths_cube.stl": cube_without_an_eighth,
    "teapot.stl": open_pot,
    "featuretype.STL": lambda: parts(
        trimesh.creation.annulus(1, 2, 3),
        trimesh.creation.capsule().apply_translation([4, 0, 0]),
        trimesh.creation.box(extents=[3, 2, 1]).apply_translation([0, 5, 0]),
    ),
    "1002_tray_bottom.STL": lambda: box(20, 12, 0.5),
    "origin_inside.STL": lambda: parts(trimesh.creation.box().subdivide()),
    "20mm-xyz-cube.stl": lambda: box(20, 20, 20),
}
NAMES = itertools.cycle(MESHES)


def get_mesh(file_name, **kwargs):
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, file_name)
        trimesh.Trimesh(*MESHES[file_name](), process=False).export(file)
        mesh = trimesh.load_mesh(file, **kwargs)
    mesh.source.file_path = file_name
    return mesh


def get_meshes(count):
    return [get_mesh(next(NAMES)) for _ in range(count)]


def rays_at(radius):
    origins = random((200, 3)) * 6 * radius - 3 * radius
    return {"ray_origins": origins, "ray_directions": random((200, 3)) * radius - origins}


data = {
    "ray_data": {
        "load_kwargs": [
            {"file_name": name, "use_embree": use_embree}
            for name in ("unit_sphere.STL", "7_8ths_cube.stl", "teapot.stl")
            for use_embree in (True, False)
        ],
        "rays": {
            "unit_sphere.STL": rays_at(1),
            "7_8ths_cube.stl": rays_at(10),
            "teapot.stl": rays_at(5),
        },
    }
}
