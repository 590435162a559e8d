"""raydix.embree against embreex, where that is installed, and trimesh's class on top of it."""

import importlib.util
import sys

import numpy as np
import pytest
import support
from worlds import BOX

from raydix.embree import mesh_construction, rtcore_scene

DOWN = np.float32([[0.5, 0.25, 9], [99, 0, 9]]), np.float32([[0, 0, -2]])


def scenes(rng):
    """The same two meshes here and in embreex."""
    theirs = pytest.importorskip("embreex.rtcore_scene", reason="embreex is not installed")
    meshes = pytest.importorskip("embreex.mesh_construction")
    vertices, faces = support.random_triangles(rng, 300)
    vertices, faces = np.float32(vertices), np.int32(faces)
    made = []
    for scene, mesh in (
        (rtcore_scene.EmbreeScene(), mesh_construction.TriangleMesh),
        (theirs.EmbreeScene(robust=True), meshes.TriangleMesh),
    ):
        mesh(scene, vertices, faces)
        mesh(scene, vertices[faces[:100]] + np.float32(0.25))
        made.append(scene)
    return made


def test_answers_of_embreex(rng):
    ours, theirs = scenes(rng)
    rays = np.float32(support.random_rays(rng, 800))
    asked = np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 4:7])
    far = np.float32(rng.uniform(0.5, 3, 800))
    for more in ({}, {"dists": far}):
        for query in ("INTERSECT", "OCCLUDED", "DISTANCE"):
            mine = ours.run(*asked, query=query, **more)
            other = theirs.run(*asked, query=query, **more)
            assert mine.dtype == other.dtype and mine.shape == other.shape
            np.testing.assert_allclose(mine, other, rtol=1e-4)
        mine = ours.run(*asked, output=True, **more)
        other = theirs.run(*asked, output=True, **more)
        assert list(mine) == list(other)
        assert (mine["geomID"] == 1).sum() > 20 and (mine["primID"] == -1).sum() > 20
        for name in mine:
            assert mine[name].dtype == other[name].dtype and mine[name].shape == other[name].shape
            hit = mine["primID"] >= 0  # of a miss it says nothing
            np.testing.assert_allclose(mine[name][hit], other[name][hit], rtol=1e-3, atol=1e-4)


def test_without_embreex():
    scene = rtcore_scene.EmbreeScene(robust=True)
    mesh_construction.TriangleMesh(scene, BOX[0], BOX[1])
    assert scene.is_committed == 0
    prim = scene.run(*DOWN)
    assert scene.is_committed == 1 and prim.dtype == np.int32 and prim[1] == -1 and prim[0] >= 0
    assert scene.run(*DOWN, query="DISTANCE").tolist() == [3, np.float32(1e37)]
    assert scene.run(*DOWN, query="OCCLUDED").tolist() == [0, -1]
    assert scene.run(*DOWN, dists=2).tolist() == [-1, -1]
    found = scene.run(*DOWN, output=1)
    assert found["Ng"].tolist() == [[0, 0, 8], [0, 0, 0]] and found["geomID"].tolist() == [0, -1]
    mesh_construction.TriangleMesh(scene, np.float32(BOX[0] + [99, 0, 0])[BOX[1]])
    assert scene.run(*DOWN, output=1)["geomID"].tolist() == [0, 1]


def test_what_is_refused():
    scene = rtcore_scene.EmbreeScene()
    for call, text in (
        (lambda: scene.run(*DOWN, query="NEAREST"), "query: expected one of"),
        (lambda: scene.run(*DOWN, query="OCCLUDED", output=1), "output"),
        (lambda: scene.run(DOWN[0][0], DOWN[1][0]), "expected shapes"),
        (lambda: scene.run(DOWN[0], np.zeros((3, 3))), "expected shapes"),
        (lambda: scene.run(DOWN[0], np.zeros((2, 2))), "vec_directions: expected"),
        (lambda: mesh_construction.TriangleMesh(scene, np.zeros((3, 3))), "vertices: expected"),
        (lambda: mesh_construction.TriangleMesh(scene, BOX[0], [[0, 1, 8]]), "indices: face 0"),
    ):
        with pytest.raises((TypeError, ValueError), match=text):
            call()


def test_trimesh_on_top(monkeypatch, rng):
    """trimesh's own ray class, which imports embreex by name."""
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    import raydix.embree

    monkeypatch.setitem(sys.modules, "embreex", raydix.embree)
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", rtcore_scene)
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", mesh_construction)
    spec = importlib.util.find_spec("trimesh.ray.ray_pyembree")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    mesh = trimesh.creation.icosphere(subdivisions=3)
    intersector = module.RayMeshIntersector(mesh)
    points = rng.uniform(-1.5, 1.5, (300, 3))
    radius = np.linalg.norm(points, axis=1)
    clear = (radius < 0.98) | (radius > 1)
    np.testing.assert_array_equal(intersector.contains_points(points)[clear], radius[clear] < 0.99)
    along = -points / radius[:, None]
    first = intersector.intersects_first(points * 9, along)
    assert (first >= 0).all() and intersector.intersects_any(points * 9, along).all()
