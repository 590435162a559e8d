"""Objects that go to other processes, and copies."""

import copy
import multiprocessing
import pickle
import threading
import time

import numpy as np
import pytest
import support
from worlds import BOX

import raydix
import raydix.open3d
import raydix.scipy
from raydix.embree import rtcore_scene
from raydix.embree.mesh_construction import TriangleMesh

RAYS = np.array([[0, 0, 9, 0, 0, 0, -1, np.inf], [9, 9, 9, 0, 0, 0, -1, np.inf]], np.float32)
COPIES = {
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}
copies = pytest.mark.parametrize("made", COPIES.values(), ids=COPIES)
precisions = pytest.mark.parametrize("precision", ["float32", "float64"])


def mixed_world(precision):
    """Meshes with ids and masks of their own, shapes, and an instance."""
    leaf = raydix.Scene(*BOX, precision=precision)
    scene = raydix.Scene(precision=precision, quality="fast", usage="moving")
    scene.add(*BOX, mask=6, id=4)
    scene.add(leaf, [[1, 0, 0, 5], [0, 2, 0, 0], [0, 0, 1, 0]], mask=5, id=9)
    scene.add_spheres([[0, 9, 0], [3, 9, 0]], [1, 2], id=10)
    scene.add_capsules([[0, -9, 0]], [[4, -9, 0]], 1, id=11)
    scene.add_points([[-9, 0, 0]], 0.5, id=12)
    scene.add_spheres([[0, 0, 50]], 1, id=13)
    scene.remove(13)
    scene.set_transform(9, [[1, 0, 0, 6], [0, 2, 0, 0], [0, 0, 1, 0]])
    scene.update_points(12, [[-9, 0, 0], [-9, 3, 0]], 1)
    scene.commit()
    return scene


def assert_same_hits(a, b, rng):
    rays = support.random_rays(rng, 3000)
    rays[:, :3] *= 8
    assert a.intersect(rays) == b.intersect(rays)
    assert a.intersect(rays, mask=4) == b.intersect(rays, mask=4)
    assert np.isfinite(a.intersect(rays).t).sum() > 100


@copies
@precisions
def test_a_mesh(made, precision, rng):
    scene = raydix.Scene(*BOX, precision=precision, quality="high", max_leaf=2, threads=1)
    scene.set_attributes(uv=np.arange(16).reshape(8, 2))
    other = made(scene)
    assert other is not scene and other.options == scene.options and repr(other) == repr(scene)
    assert_same_hits(scene, other, rng)
    np.testing.assert_array_equal(
        scene.intersect(RAYS, also="uv").uv, other.intersect(RAYS, also="uv").uv
    )
    moved = scene.vertices + 1
    scene.refit(moved)
    np.testing.assert_array_equal(other.vertices, moved - 1)
    np.testing.assert_array_equal(made(scene).vertices, moved)


@copies
@precisions
def test_a_world(made, precision, rng):
    scene = mixed_world(precision)
    other = made(scene)
    assert list(other) == list(scene) == [4, 9, 10, 11, 12]
    assert other.options == scene.options and other.dtype == scene.dtype
    assert_same_hits(scene, other, rng)


def test_an_empty_scene_and_changes_without_a_commit():
    scene = COPIES["pickle"](raydix.Scene(quality="fast"))
    assert len(scene) == 0 and scene.options["quality"] == "fast"
    scene.add(*BOX)
    with pytest.raises(raydix.InputError, match="changes without a commit"):
        pickle.dumps(scene)


def in_worker(things, rays):
    """What a process that knows nothing but its arguments finds."""
    scene, points, tree = things
    return scene.intersect(rays), points.knn(rays[:, :3], 2), tree.query(rays[:, :3], k=2)


def test_processes_that_are_spawned(rng, tmp_path):
    """Scenes by arrays, by bytes and by the path of a mapped file."""
    mixed_world("float32").save(tmp_path / "world.rdx")
    mapped = raydix.load_scene(tmp_path / "world.rdx")
    assert len(pickle.dumps(mapped)) < 2000  # a path, not the scene
    points = rng.normal(size=(100, 3))
    rays = support.random_rays(rng, 200)
    for_all = raydix.Points(points), raydix.scipy.cKDTree(points)
    jobs = [
        ((scene, *for_all), rays) for scene in (raydix.Scene(*BOX), mapped, mixed_world("float64"))
    ]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.starmap(in_worker, jobs)
    for (things, _), (hits, near, (distances, indices)) in zip(jobs, found, strict=True):
        own = in_worker(things, rays)
        assert hits == own[0]
        np.testing.assert_array_equal(near["indices"], own[1]["indices"])
        np.testing.assert_array_equal(distances, own[2][0])
        np.testing.assert_array_equal(indices, own[2][1])


def test_a_mapped_file_that_changes(tmp_path):
    file = tmp_path / "box.rdx"
    raydix.Scene(*BOX).save(file)
    scene = raydix.load_scene(file)
    by_path = pickle.dumps(scene)
    other = raydix.Scene(BOX[0] + 100, BOX[1])
    other.save(file)
    with pytest.raises(raydix.InputError, match="changed since the scene was pickled"):
        pickle.loads(by_path)
    # The scene itself still has what it mapped, and so has its copy.
    assert pickle.loads(pickle.dumps(scene)).intersect(RAYS) == scene.intersect(RAYS)
    scene.update(0, BOX[0] + 1)
    scene.commit()
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(scene)).vertices, scene.vertices)


@copies
@pytest.mark.parametrize("dimension", [2, 3])
@precisions
def test_points(made, dimension, precision, rng):
    array = rng.normal(size=(500, dimension)).astype(precision)
    array[7] = np.nan
    points = raydix.Points(array, tree="bvh", threads=1)
    other = made(points)
    assert repr(other) == repr(points) and other.options == points.options
    queries = rng.normal(size=(50, dimension))
    for name, values in points.knn(queries, 9).items():
        np.testing.assert_array_equal(values, other.knn(queries, 9)[name])
    assert 7 not in other.knn(queries[0], 500)["indices"]
    assert len(other.neighbours(1.0)["offsets"]) == 501


@copies
def test_trees(made, rng):
    vertices, faces = support.random_triangles(rng, 300)
    for make in (raydix.bvh, raydix.octree, raydix.kdtree):
        tree = make(vertices, faces, threads=1)
        other = made(tree)
        assert type(other) is type(tree) and repr(other) == repr(tree)
        np.testing.assert_array_equal(other.nodes, tree.nodes)
        np.testing.assert_array_equal(other.order, tree.order)


@copies
def test_scipy_stand_in(made, rng):
    data = rng.normal(size=(100, 3))
    tree = raydix.scipy.cKDTree(data, leafsize=7)
    other = made(tree)
    assert other.leafsize == 7 and repr(other) == repr(tree)
    for a, b in zip(other.query(data, 3), tree.query(data, 3), strict=True):
        np.testing.assert_array_equal(a, b)


@copies
def test_stand_ins_for_open3d_and_embreex(made):
    """Also before their first question, which builds the trees."""
    vertices, faces = BOX
    down = np.float32([[0.5, 0.25, 9, 0, 0, -2]])
    casting = raydix.open3d.RaycastingScene(nthreads=1)
    casting.add_triangles(vertices, faces)
    embree = rtcore_scene.EmbreeScene()
    TriangleMesh(embree, vertices, faces)
    for _ in range(2):
        other = made(casting)
        assert repr(other) == repr(casting)
        for name, found in other.cast_rays(down).items():
            np.testing.assert_array_equal(found, casting.cast_rays(down)[name])
        other = made(embree)
        assert repr(other) == repr(embree)
        assert other.run(down[:, :3], down[:, 3:]) == embree.run(down[:, :3], down[:, 3:]) >= 0


@copies
@precisions
def test_scenes_without_geometries(made, precision):
    scene = raydix.Scene(precision=precision)
    assert not made(scene).committed
    scene.commit()
    assert made(scene).committed and not made(scene).intersect(RAYS).hit.any()
    assert made(scene).add(*BOX) == 0
    id = scene.add(*BOX)
    scene.remove(id)  # other ids than those of a scene that never had one
    with pytest.raises(raydix.InputError, match="changes without a commit"):
        made(scene)
    scene.commit()
    other = made(scene)
    assert other.committed and len(other) == 0 and other.options == scene.options
    assert other.add(*BOX) == 1


@copies
@precisions
def test_ids_are_not_given_twice(made, precision):
    scene = raydix.Scene(*BOX, precision=precision)
    scene.remove(scene.add(*BOX))
    scene.commit()
    other = made(scene)
    assert list(other) == [0] and other.intersect(RAYS) == scene.intersect(RAYS)
    assert other.add(*BOX) == 2


def test_points_while_another_thread_adds(rng):
    points = np.arange(30.0).reshape(10, 3)
    index, done = raydix.Points(points), threading.Event()

    def change():
        while not done.is_set():
            index.remove(index.add(rng.random((5, 3))))

    changer = threading.Thread(target=change)
    changer.start()
    try:
        end = time.monotonic() + 2
        while time.monotonic() < end:
            found = pickle.loads(pickle.dumps(index)).knn(points, 1)
            assert found["indices"][:, 0].tolist() == list(range(10))
            assert not found["distances"].any()
    finally:
        done.set()
        changer.join()


@pytest.mark.parametrize("made", [copy.copy, copy.deepcopy])
def test_copies_of_stand_ins_are_their_own(made):
    scene = raydix.open3d.RaycastingScene()
    scene.add_triangles(*BOX)
    other = made(scene)
    other.add_triangles(*BOX)
    assert other.count_intersections(RAYS[:, [0, 1, 2, 4, 5, 6]]).tolist() == [4, 0]
    assert scene.count_intersections(RAYS[:, [0, 1, 2, 4, 5, 6]]).tolist() == [2, 0]
    embree = rtcore_scene.EmbreeScene()
    TriangleMesh(embree, *BOX)
    TriangleMesh(made(embree), *BOX)
    assert len(embree._scene) == 1


def strict_scenes(precision):
    """One that goes over as its arrays, one as bytes."""
    options = dict(strict=True, builder="apetrei", max_leaf=9, bits=30, precision=precision)
    mesh, world = raydix.Scene(*BOX, **options), raydix.Scene(**options)
    world.add(*BOX, id=3)
    for scene in (mesh, world):
        scene.commit(usage="moving", refit_limit=0.5)
    return mesh, world


@copies
@precisions
def test_options_go_along(made, precision):
    moved = BOX[0] * [1, 2, 3]
    for scene in strict_scenes(precision):
        other = made(made(scene))
        assert other.options == scene.options and other.stats() == {**scene.stats(), "ms": other.stats()["ms"]}
        with pytest.raises(raydix.InputError, match="not finite"):
            other.add([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        ball = other.add_spheres([[0, 0, 0]], -1)
        with pytest.raises(raydix.InputError, match=f"geometry {ball}: sphere 0"):
            other.commit()
        other.remove(ball)
        id = next(iter(other))
        other.update(id, moved)
        assert other.commit()["trees_built"] == 1  # refit_limit is below 1
        assert other.commit(refit_limit=2)["trees_built"] == 0


class NamedScene(raydix.Scene):
    def __init__(self, title):
        super().__init__(*BOX)
        self.title = title
        self.itself = self


class NamedPoints(raydix.Points):
    def __init__(self, title, **options):
        super().__init__(np.eye(3), **options)
        self.title = title


@copies
def test_subclasses_and_attributes(made, tmp_path):
    scene = NamedScene("a box")
    placed = NamedScene("two boxes")
    placed.add(*BOX)
    placed.commit()
    for thing in (scene, placed):
        other = made(thing)
        assert type(other) is NamedScene and other.title == thing.title
        assert list(other) == list(thing) and other.intersect(RAYS) == thing.intersect(RAYS)
    for strict in (False, True):
        points = NamedPoints("three", strict=strict)
        points.remove(1)
        other = made(points)
        assert type(other) is NamedPoints and other.title == "three"
        assert other.knn([0, 1, 0], 2)["indices"].tolist() == points.knn([0, 1, 0], 2)["indices"].tolist()
    scene.save(tmp_path / "box.rdx")
    mapped = raydix.load_scene(tmp_path / "box.rdx")
    mapped.note = [1, 2]
    assert made(mapped).note == [1, 2] and type(made(mapped)) is raydix.Scene


@precisions
def test_pickles_of_before(precision):
    """Without a class, without a limit of refits."""
    scene = mixed_world(precision)
    for whole in (scene, raydix.Scene(*BOX, precision=precision)):
        make, (what, more), _ = whole.__reduce_ex__(4)
        less = {name: value for name, value in more.items() if name not in ("type", "refit_limit")}
        other = make(what, less)
        assert type(other) is raydix.Scene and other.intersect(RAYS) == whole.intersect(RAYS)
