"""Meshes and peers that several tests use."""

import importlib
import os
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

import numpy as np
import pytest

import raydix

SHARED = pathlib.Path(__file__).resolve().parents[3] / "shared" / "scenes"


def peer(name):
    """Another library to compare with, or a skip that says why there is none."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        pytest.skip(f"{name} cannot be used here: {error}")


def shared_scene(name):
    file = SHARED / name / f"{name}.ply.xz"
    if not file.is_file():
        pytest.skip(f"no {file}")
    return raydix.Scene(file)


def random_triangles(rng, count, size=0.2):
    """Triangles with no corner in common: (vertices [3 count, 3] float32, faces)."""
    centres = rng.uniform(-1, 1, (count, 1, 3))
    corners = centres + rng.uniform(-size, size, (count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.uint32).reshape(
        -1, 3
    )


def random_rays(rng, count):
    """Rays (count, 8) float32 from a sphere of radius 3 through the middle."""
    origins = rng.normal(size=(count, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = rng.uniform(-1, 1, (count, 3))
    rays = np.empty((count, 8), np.float32)
    rays[:, :3], rays[:, 3], rays[:, 4:7], rays[:, 7] = origins, 0, targets - origins, np.inf
    return rays


def box_mesh(lo, hi):
    """The twelve triangles of a box, turned outward, (8, 3) float64 and (12, 3)."""
    lo, hi = np.asarray(lo, float), np.asarray(hi, float)
    vertices = np.array([[(lo, hi)[i >> a & 1][a] for a in range(3)] for i in range(8)])
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces)


def brute_force_hits(vertices, faces, rays):
    """t of all triangles for all rays in float64 (Moeller and Trumbore): (rays, triangles),
    infinity where there is no hit."""
    v0, v1, v2 = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    e1, e2 = v1 - v0, v2 - v0
    hits = np.full((len(rays), len(faces)), np.inf)
    for i, ray in enumerate(rays.astype(np.float64)):
        o, d = ray[:3], ray[4:7]
        p = np.cross(d, e2)
        det = (e1 * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = o - v0
            u = (s * p).sum(axis=1) / det
            q = np.cross(s, e1)
            v = (q @ d) / det
            t = (e2 * q).sum(axis=1) / det
            good = (
                (det != 0)
                & (u >= 0)
                & (v >= 0)
                & (u + v <= 1)
                & (t >= max(ray[3], 0))
                & (t <= ray[7])
            )
        hits[i, good] = t[good]
    return hits


def shared_cloud(name):
    """The points of a shared scan, (N, 3) float32."""
    file = SHARED / name / f"{name}.ply.xz"
    if not file.is_file():
        pytest.skip(f"no {file}")
    return raydix.load_points(file)


def run_tests(*arguments, **options):
    """Another project's tests in a process of their own, without our settings: {name: "passed",
    "failed", "error" or "skipped"}."""
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.xml"
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-c", os.devnull, f"--junitxml={report}"]
            + [str(argument) for argument in arguments],
            capture_output=True,
            text=True,
            **options,
        )
        assert report.is_file(), done.stdout + done.stderr
        cases = xml.etree.ElementTree.parse(report).iter("testcase")
        return {
            f"{case.get('classname')}::{case.get('name')}": next(
                (
                    {"failure": "failed"}.get(part.tag, part.tag)
                    for part in case
                    if part.tag in ("failure", "error", "skipped")
                ),
                "passed",
            )
            for case in cases
        }
