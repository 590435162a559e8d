"""Scenes in float64 in .rdx files: what comes back is what was saved, to the bit."""

import copy
import multiprocessing
import os
import pickle

import numpy as np
import pytest
import support
from worlds import BOX

import raydix

AWKWARD = np.array([1 / 3, -0.0, 5e-324, 4_500_000.123456789, 1e-310, np.pi])
"""Numbers that do not survive a way through float32."""


def awkward_mesh(rng, count=60):
    vertices, faces = support.random_triangles(rng, count)
    vertices = vertices.astype(np.float64) + rng.uniform(-1e-9, 1e-9, vertices.shape)
    vertices[:2] = AWKWARD.reshape(2, 3)
    vertices[5] = np.nan
    return vertices, faces


def world(rng):
    """Meshes, an empty one, holes in the ids, shapes, and instances of instances."""
    leaf = raydix.Scene(*awkward_mesh(rng), precision="float64", quality="high")
    leaf.add_spheres(rng.normal(size=(4, 3)), rng.uniform(0.1, 0.3, 4))
    leaf.commit()
    middle = raydix.Scene(precision="float64")
    middle.add(leaf, np.c_[np.eye(3) + 1e-12, [1 / 3, 0, 0]], mask=3)
    middle.add(np.zeros((0, 3)), np.zeros((0, 3), int))
    middle.commit(quality="fast")
    whole = raydix.Scene(precision="float64", quality="fast", usage="moving")
    whole.add(*awkward_mesh(rng), mask=6, id=4)
    whole.add(middle, np.c_[np.eye(3), [0.1, 0.2, 0.3]], mask=5, id=9)
    whole.add(leaf, np.c_[np.diag([1, -1, 1]), [0.7, 0, 0]], id=90)
    whole.add_capsules(rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), [0.1, 1 / 3, 0.2], id=91)
    whole.add_points(rng.normal(size=(5, 3)), 1 / 7, id=92)
    whole.remove(whole.add(*BOX, id=95))
    whole.commit()
    return whole


def double_rays(rng, count=2000):
    return support.random_rays(rng, count).astype(np.float64)


def test_all_of_a_world_comes_back(rng, tmp_path):
    scene, file = world(rng), tmp_path / "world.rdx"
    scene.name = "far away"
    scene.save(file)
    loaded = raydix.load_scene(file, threads=2)
    assert loaded.dtype == np.float64 and loaded.committed and loaded.name == "far away"
    assert list(loaded) == list(scene) == [4, 9, 90, 91, 92]
    assert (loaded.options["quality"], loaded.options["usage"]) == ("fast", "moving")
    rays = double_rays(rng)
    for options in ({}, {"mask": 1}, {"mask": 2}):
        assert scene.intersect(rays, **options) == loaded.intersect(rays, **options)
    assert scene.intersect(rays).hit.sum() > 300 and scene.all_hits(rays) == loaded.all_hits(rays)
    hits = scene.intersect(rays)
    for instance in np.unique(hits.instance):
        assert scene.path(instance) == loaded.path(instance)
    np.testing.assert_array_equal(scene.normals(hits, rays), loaded.normals(hits, rays))
    np.testing.assert_array_equal(scene.bounds, loaded.bounds)
    points = rng.normal(size=(50, 3))
    for name, column in scene.closest_point(points).items():
        np.testing.assert_array_equal(column, loaded.closest_point(points)[name])
    # Ids that were given stay given, and the scene goes on as one.
    with pytest.raises(raydix.InputError, match="95"):
        loaded.add(*BOX, id=95)
    assert loaded.add(*BOX) == scene.add(*BOX)
    for one in (scene, loaded):
        one.set_transform(90, np.c_[np.eye(3), [0, 0, 1]])
        one.commit()
    assert scene.intersect(rays) == loaded.intersect(rays)


def test_numbers_are_the_same_to_the_bit(rng, tmp_path):
    vertices, faces = awkward_mesh(rng)
    scene, file = raydix.Scene(vertices, faces, precision="float64"), tmp_path / "mesh.rdx"
    scene.save(file)
    loaded = raydix.load_scene(file)
    assert loaded.vertices.tobytes() == vertices.tobytes()
    np.testing.assert_array_equal(loaded.faces, faces)
    loaded.save(tmp_path / "again.rdx")
    assert (tmp_path / "again.rdx").read_bytes() == file.read_bytes()
    loaded.refit(vertices + 1)
    np.testing.assert_array_equal(loaded.vertices, vertices + 1)


def test_cameras_go_along(tmp_path):
    scene = raydix.Scene("builtin:figure?triangles=5000", precision="float64")
    camera = raydix.Camera((1 / 3, 4.5e6, -0.1), (0, 1 / 7, 0), (0, 1, 0), 100 / 3, "south")
    scene._cameras = [camera]
    scene.save(tmp_path / "scene.rdx")
    assert raydix.load_scene(tmp_path / "scene.rdx").cameras == [camera]


def hits_in_another_process(scene, rays, queue):
    queue.put(scene.intersect(rays)["t"])


def test_a_loaded_scene_is_pickled_as_its_path(rng, tmp_path):
    world(rng).save(tmp_path / "world.rdx")
    loaded, rays = raydix.load_scene(tmp_path / "world.rdx"), double_rays(rng, 200)
    assert len(pickle.dumps(loaded)) < 2000
    for other in (pickle.loads(pickle.dumps(loaded)), copy.deepcopy(loaded)):
        assert other.dtype == np.float64 and other.intersect(rays) == loaded.intersect(rays)
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    child = context.Process(target=hits_in_another_process, args=(loaded, rays, queue))
    child.start()
    np.testing.assert_array_equal(queue.get(timeout=60), loaded.intersect(rays)["t"])
    child.join()
    os.utime(tmp_path / "world.rdx", (0, 0))
    assert pickle.loads(pickle.dumps(loaded)).intersect(rays) == loaded.intersect(rays)


def test_what_is_wrong_is_said(rng, tmp_path):
    scene, file = world(rng), tmp_path / "world.rdx"
    scene.save(file)
    good = file.read_bytes()
    raydix.Scene(*BOX).save(tmp_path / "float.rdx")
    assert raydix.load_scene(tmp_path / "float.rdx").dtype == np.float32
    for core, other in (("SceneTrees", file), ("SceneTreesD", tmp_path / "float.rdx")):
        with pytest.raises(raydix.InputError, match="header: this file holds a scene in"):
            getattr(raydix._core, core).load_rdx(os.fsencode(other), 0)
    for at in rng.integers(0, len(good), 40):
        bad = bytearray(good)
        bad[at] ^= 1 << rng.integers(8)
        file.write_bytes(bad)
        with pytest.raises(raydix.InputError, match="world.rdx: "):
            raydix.load_scene(file)
    for length in (0, 63, 64, 500, len(good) - 1):
        file.write_bytes(good[:length])
        with pytest.raises(raydix.InputError, match="world.rdx: "):
            raydix.load_scene(file)
    scene.add(*BOX)
    with pytest.raises(raydix.InputError, match="changes that no commit"):
        scene.save(file)
    with pytest.raises(raydix.InputError):
        raydix.load_scene(tmp_path / "none.rdx")
