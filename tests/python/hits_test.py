"""Hits: keys and attributes, what else they can have, and how they behave as a dict."""

import copy
import pickle
import threading

import numpy as np
import pytest
import support
from worlds import BOX

import raydix

NAMES = ["t", "prim", "u", "v", "geometry", "instance"]
precisions = pytest.mark.parametrize("precision", ["float32", "float64"])


@precisions
def test_a_dict_of_arrays_and_attributes(precision, rng):
    scene = raydix.Scene(*support.random_triangles(rng, 200), precision=precision)
    rays = support.random_rays(rng, 60).reshape(3, 20, 8)
    hits = scene.intersect(rays)
    assert list(hits) == NAMES and len(hits) == 6 and "t" in hits and "normal" not in hits
    plain = dict(hits)
    assert type(plain) is dict and list(plain) == NAMES and {**hits}.keys() == plain.keys()
    for name, values in hits.items():
        assert values is hits[name] is getattr(hits, name)
        assert values.shape == (3, 20)
        assert values.dtype == (precision if name in "tuv" else np.uint32)
    np.testing.assert_array_equal(hits.hit, np.isfinite(hits.t))
    assert f"{hits.hit.sum()} hits" in repr(hits) and "(3, 20)" in repr(hits)
    assert "prim" in dir(hits)
    with pytest.raises(KeyError, match="normal"):
        hits["normal"]
    with pytest.raises(AttributeError, match="no 'normal' in these hits; they have t, prim"):
        hits.normal  # noqa: B018
    for other in (copy.copy(hits), copy.deepcopy(hits), pickle.loads(pickle.dumps(hits))):
        assert other == hits
    assert hits != scene.intersect(rays + 1) and hits != 3
    listed = scene.all_hits(rays)
    assert list(listed) == [*NAMES, "offsets"] and listed.offsets[-1] == len(listed.t)


@precisions
def test_one_ray_is_that_of_a_batch(precision, rng):
    """The short way of single rays, whatever their arrays are, against rows of eight."""
    scene = raydix.Scene(*support.random_triangles(rng, 500), precision=precision)
    rays = support.random_rays(rng, 200)
    batch = scene.intersect(rays[:, :3], rays[:, 4:7], tmin=0.0)
    found = 0
    for i, ray in enumerate(rays):
        forms = [(ray[:3], ray[4:7]), (ray[None, :3], ray[None, 4:7])]
        forms.append((np.float64(ray[:3]), ray[4:7].copy()))
        forms.append((ray[:3].tolist(), tuple(ray[4:7].tolist())))
        forms.append((ray[::-1][5:][::-1], np.asfortranarray(ray[4:7])))
        for origins, directions in forms:
            one = scene.intersect(origins, directions)
            for name in NAMES:
                assert one[name].shape == np.shape(origins)[:-1]
                assert one[name].item() == batch[name][i]
        found += bool(one.hit)
    assert found > 20


def test_what_one_ray_is_not(rng):
    scene = raydix.Scene(*BOX)
    for origins, directions, text in (
        ([0, 0], [0, 0, 1], "origins"),
        (np.zeros(3, complex), np.zeros(3), "origins"),
        (np.zeros((2, 3)), np.zeros((4, 3)), "directions"),
        ("abc", np.zeros(3), "origins"),
    ):
        with pytest.raises((TypeError, ValueError), match=text):
            scene.intersect(origins, directions)
    assert scene.intersect(np.zeros((0, 3)), np.zeros((0, 3))).t.shape == (0,)
    assert scene.intersect(np.array([0, 0, 9]), np.array([0, 0, -1])).t == 6  # whole numbers
    # One origin for many directions is no single ray.
    assert scene.intersect(np.zeros(3), rng.normal(size=(4, 3))).t.shape == (4,)


@precisions
def test_positions_and_normals(precision, rng):
    """Against the triangles, in float64."""
    vertices, faces = support.random_triangles(rng, 300)
    scene = raydix.Scene(vertices, faces, precision=precision)
    rays = support.random_rays(rng, 400)
    hits = scene.intersect(rays, also=("position", "normal"))
    assert list(hits) == [*NAMES, "position", "normal"]
    hit = hits.hit
    assert hit.sum() > 50 and np.isnan(hits.position[~hit]).all()
    corners = np.float64(scene.vertices)[scene.faces[hits.prim[hit]]]
    u, v = np.float64(hits.u[hit])[:, None], np.float64(hits.v[hit])[:, None]
    point = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    tolerance = 1e-6 if precision == "float32" else 1e-11
    assert hits.position.dtype == hits.normal.dtype == precision
    np.testing.assert_allclose(hits.position[hit], point, atol=tolerance)
    np.testing.assert_allclose(hits.normal[hit], across, atol=tolerance)
    single = scene.intersect(rays[hit][0, :3], rays[hit][0, 4:7], also="normal")
    np.testing.assert_array_equal(single.normal, hits.normal[hit][0])


@precisions
def test_vertex_attributes(precision):
    leaf = raydix.Scene(*BOX, precision=precision)
    leaf.set_attributes(place=BOX[0], height=BOX[0][:, 2])
    scene = raydix.Scene(precision=precision)
    scene.add(*BOX)
    scene.add(leaf, [[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0]])
    scene.add([[0, 20, 0], [1, 20, 0], [0, 21, 0]], [[0, 1, 2]])
    scene.commit()
    scene.set_attributes(0, place=BOX[0] * 2)
    down = [[x, y, 9, 0, 0, -1] for x, y in ((0.25, 0.5), (10.25, 0.5), (0.25, 20.25), (99, 0))]
    hits = scene.intersect(down, also=["place", "position"])
    assert hits.place.dtype == precision and hits.place.shape == (4, 3)
    np.testing.assert_allclose(hits.place[0], hits.position[0] * 2, atol=1e-5)
    np.testing.assert_allclose(hits.place[1], [0.25, 0.5, 3], atol=1e-5)  # in the leaf's own space
    assert np.isnan(hits.place[2:]).all()  # a geometry without it, and a miss
    assert hits.hit.tolist() == [True, True, True, False]
    np.testing.assert_allclose(scene.interpolate(hits, "height")[1], 3)
    with pytest.raises(ValueError, match="no geometry that was hit has such"):
        scene.interpolate(hits, "colour")
    scene.set_attributes(0, place=None)
    assert np.isnan(scene.interpolate(hits, "place")[0]).all()


@precisions
def test_attributes_are_those_of_the_commit_that_was_hit(precision):
    """Corners in another order, other vertices, a mesh that is gone: hits are of the old ones until
    the next commit, and so in scenes that show the commit before."""
    corners, heights = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [0.0, 10.0, 20.0]
    ray = [0.5, 0.25, -1, 0, 0, 1]  # u = 0.5, v = 0.25

    def at(scene):
        return scene.intersect(ray, also="height").height

    leaf = raydix.Scene(corners, [[0, 1, 2]], precision=precision)
    outer, top = (raydix.Scene(precision=precision) for _ in range(2))
    outer.add(leaf, np.eye(4))
    outer.commit()
    top.add(outer, np.eye(4))
    top.commit()
    leaf.set_attributes(0, height=heights)
    scenes = (leaf, outer, top)
    assert [at(scene) for scene in scenes] == [10, 10, 10]
    leaf.update(0, corners, [[2, 0, 1]])
    assert [at(scene) for scene in scenes] == [10, 10, 10]
    leaf.set_attributes(0, height=[0.0, 20.0, 40.0])  # of the vertices to come
    assert [at(scene) for scene in scenes] == [10, 10, 10]
    leaf.commit()
    assert [at(scene) for scene in scenes] == [20, 10, 10]
    leaf.update(0, corners + [[9, 9, 9]], [[1, 2, 0]])
    leaf.set_attributes(0, height=[1.0, 1.0, 1.0, 1.0])
    leaf.commit()
    assert [at(scene) for scene in scenes] == [1, 10, 10]
    outer.commit()
    assert [at(scene) for scene in scenes] == [1, 1, 10]
    outer.remove(0)
    assert [at(scene) for scene in scenes] == [1, 1, 10]
    top.commit()
    assert [at(scene) for scene in scenes] == [1, 1, 1]
    leaf.remove(0)
    assert [at(scene) for scene in scenes] == [1, 1, 1]
    # A change that is refused changes nothing, and values of vertices that stay show at once.
    mesh = raydix.Scene(corners, [[0, 1, 2]], precision=precision, strict=True)
    mesh.set_attributes(0, height=heights)
    with pytest.raises(raydix.InputError):
        mesh.update(0, np.full((3, 3), np.nan))
    mesh.set_attributes(0, height=[0.0, 0.0, 40.0])
    assert at(mesh) == 10
    mesh.refit(np.add(corners, [0, 0, 1]))
    assert at(mesh) == 10


def test_the_number_of_columns_is_that_of_what_was_hit():
    corners, ray, miss = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [0.5, 0.25, -1, 0, 0, 1], [9, 9, 9] * 2
    scene = raydix.Scene(corners, [[0, 1, 2]])
    scene.set_attributes(0, h=[0.0, 10.0, 20.0])
    scene.update(0, corners)
    scene.set_attributes(0, h=np.zeros((3, 2)))
    assert scene.intersect([ray], also="h").h.tolist() == [10]
    assert scene.intersect([miss], also="h").h.shape == (1,)
    scene.commit()
    assert scene.intersect([ray], also="h").h.tolist() == [[0, 0]]
    scene.remove(0)
    assert scene.intersect([miss], also="h").h.shape == (1, 2)
    other = raydix.Scene(corners, [[0, 1, 2]])
    other.add(np.add(corners, [10, 0, 0]), [[0, 1, 2]])
    other.commit()
    other.set_attributes(0, h=[1.0, 1.0, 1.0])
    other.set_attributes(1, h=np.ones((3, 2)))
    there = [10.5, 0.25, -1, 0, 0, 1]
    assert other.intersect([there], also="h").h.tolist() == [[1, 1]]
    with pytest.raises(ValueError, match="h: meshes that were hit have it in columns"):
        other.intersect([ray, there], also="h")


def test_attributes_while_others_commit():
    """Whichever commit a ray meets, its corner with the value 10 is where it was."""
    corners, heights = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [0.0, 10.0, 20.0]
    orders = [[0, 1, 2]], [[1, 2, 0]], [[2, 0, 1]]
    scene = raydix.Scene(corners, orders[0])
    scene.set_attributes(0, height=heights)
    counts, ended = [0, 0], threading.Event()

    def change(which):
        while not ended.is_set():
            scene.update(0, corners, orders[counts[which] % 3])
            scene.commit()
            counts[which] += 1

    writers = [threading.Thread(target=change, args=[which]) for which in range(2)]
    for writer in writers:
        writer.start()
    found, rays = set(), 0
    while min(counts) < 400 or rays < 100:  # a busy machine may let either wait for long
        found.add(float(scene.intersect([0.5, 0.25, -1, 0, 0, 1], also="height").height))
        rays += 1
    ended.set()
    for writer in writers:
        writer.join()
    assert found == {10.0}


def test_attributes_that_are_wrong(tmp_path):
    scene = raydix.Scene(*BOX)
    scene.add_spheres([[0, 0, 9]], 1)
    for values, text in (
        ({"uv": np.zeros((7, 2))}, r"uv: expected shape \(8,\) or \(8, C\)"),
        ({"uv": np.zeros((8, 2, 2))}, "uv: expected shape"),
        ({"uv": ["a"] * 8}, "uv: expected"),
        ({"normal": np.zeros((8, 3))}, "'normal' is taken"),
        ({"prim": np.zeros(8)}, "'prim' is taken"),
        ({"hit": np.zeros(8)}, "'hit' is taken"),
        ({"items": np.zeros(8)}, "'items' is taken"),
        ({"offsets": np.zeros(8)}, "'offsets' is taken"),
    ):
        with pytest.raises((TypeError, ValueError), match=text):
            scene.set_attributes(0, **values)
    with pytest.raises(raydix.InputError, match="geometry 1 is no mesh"):
        scene.set_attributes(1, uv=np.zeros(1))
    with pytest.raises(raydix.InputError, match="there is no geometry 7"):
        scene.set_attributes(7, uv=np.zeros(8))
    scene.set_attributes(0, uv=np.zeros((8, 2)))
    scene.update(0, np.zeros((9, 3)) + np.arange(9)[:, None], [[0, 1, 2]])
    scene.update(0, np.concatenate([BOX[0], [[0, 0, 0]]]), BOX[1])
    scene.commit()
    with pytest.raises(ValueError, match="geometry 0 had 8 vertices .* has 9 now"):
        scene.intersect([0, 0, 20, 0, 0, -1], also="uv", skip={"prim": 0, "geometry": 1, "instance": 0})


def test_hits_of_triangles_that_are_gone():
    scene = raydix.Scene(*BOX)
    scene.set_attributes(0, uv=BOX[0])
    hits = scene.intersect(np.array([[0, 0, 9, 0, 0, 0, -1, np.inf]], np.float32))
    values = scene.interpolate(hits, "uv")
    scene.update(0, BOX[0], BOX[1][:1])
    np.testing.assert_array_equal(scene.interpolate(hits, "uv"), values)
    scene.commit()
    gone = "uv: triangle .* was hit, and its mesh has 1 by the last commit"
    with pytest.raises(raydix.InputError, match=gone):
        scene.interpolate(hits, "uv")


@precisions
@pytest.mark.parametrize("name", ["prim", "geometry", "instance"])
def test_numbers_that_are_no_ids(precision, name):
    """They are refused, not wrapped around."""
    scene = raydix.Scene(*BOX, precision=precision)
    rays = np.array([[0.5, 0.25, 9, 0, 0, -1]])
    hits = dict(scene.intersect(rays))
    np.testing.assert_array_equal(scene.normals({**hits, name: hits[name].astype(np.int64)}), [[0, 0, 1]])
    for wrong, error in ((2**32, ValueError), (-(2**32), ValueError), (-1, ValueError), (0.0, TypeError)):
        for call in (scene.positions, scene.normals):
            with pytest.raises(error, match=f"hits, {name}: expected"):
                call({**hits, name: np.array([wrong])})
            with pytest.raises(error, match=f"hits, {name}: expected"):
                call({**hits, name: np.array([wrong])}, rays)
