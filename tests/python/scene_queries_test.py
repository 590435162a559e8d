"""Closest points, touches, inside tests and overlaps of whole scenes: those of one mesh of all triangles."""

import numpy as np
import pytest
import support
from worlds import BOX, World, random_world, transform, triangles

import raydix


def out_of(world, precision=np.float32):
    """The world's triangles as one mesh, moved in float64 level by level and rounded once, outsides
    outside; rows of (instance, geometry, prim)."""
    vertices, faces, names = [], [], []

    def moved(points, places):
        points = np.float64(points)
        for place in reversed(places):
            m = np.float64(place)
            points = np.stack(
                [((points[:, 0] * m[r, 0] + points[:, 1] * m[r, 1]) + points[:, 2] * m[r, 2]) + m[r, 3]
                 for r in range(3)], axis=1)  # fmt: skip
        return points.astype(precision)

    def visit(part, places, number):
        """Returns the number of the last path."""
        for id in sorted(part.parts):
            _, what, below = part.parts[id]
            if isinstance(below, World):
                continue
            first = sum(map(len, vertices))
            vertices.append(moved(np.asarray(what, precision), places) if places else np.asarray(what, precision))
            turned = np.prod([np.sign(np.linalg.det(np.float64(p)[:, :3])) for p in places]) < 0
            faces.append(first + (below[:, [0, 2, 1]] if turned else below))
            names.extend((number, id, prim) for prim in range(len(below)))
        last = number
        for id in sorted(part.parts):
            _, place, below = part.parts[id]
            if isinstance(below, World):
                last = visit(below, [*places, place], last + 1)
        return last

    visit(world, [], 0)
    return np.concatenate(vertices), np.concatenate(faces), np.array(names, np.uint32)


def closed_world(rng, **options):
    """Boxes in boxes, some mirrored, one split over two geometries."""
    leaf, middle, world = World(**options), World(**options), World(**options)
    vertices, faces = BOX
    leaf.add_mesh(vertices, faces[:5], id=3)
    leaf.add_mesh(vertices, faces[5:])
    leaf.scene.commit()
    middle.add_instance(leaf, transform(rng, mirror=True))
    middle.add_mesh(vertices * 0.5, faces)
    middle.scene.commit()
    world.add_instance(middle, transform(rng, shear=0.5))
    world.add_mesh(vertices + 1, faces)
    world.add_instance(middle, transform(rng, mirror=True))
    world.scene.commit()
    return world


def same_names(found, names, prims):
    hit = prims != raydix.MISSING
    for i, name in enumerate(("instance", "geometry", "prim")):
        assert found[name].dtype == np.uint32
        np.testing.assert_array_equal(found[name][hit], names[prims[hit], i], err_msg=name)
    np.testing.assert_array_equal(found["prim"] == raydix.MISSING, ~hit)
    assert set(found["geometry"][~hit]) <= {raydix.MISSING}


def test_closest_points_and_touches(rng):
    world = random_world(rng)
    world.scene.commit()
    vertices, faces, names = out_of(world)
    flat = raydix.Scene(vertices, faces)
    points = rng.uniform(-4, 4, (50, 20, 3))
    points[3, 4, 1] = np.nan
    near, wanted = world.scene.closest_point(points), flat.closest_point(points)
    np.testing.assert_array_equal(near["distance"], wanted["distance"])
    np.testing.assert_array_equal(near["point"], wanted["point"])
    same_names(near, names, wanted["prim"])
    assert len(np.unique(near["instance"])) > 4 and set(wanted["geometry"].ravel()) == {0, raydix.MISSING}
    assert (world.scene.closest_point(points, max_distance=0.2)["prim"] == raydix.MISSING).any()
    balls = np.concatenate([rng.uniform(-3, 3, (200, 3)), rng.uniform(0, 1, (200, 1))], axis=1)
    segments = rng.uniform(-3, 3, (300, 6))
    for asked in ({"spheres": balls}, {"segments": segments}):
        found, wanted = world.scene.touched_by(**asked), flat.touched_by(**asked)
        np.testing.assert_array_equal(found["offsets"], wanted["offsets"])
        same_names(found, names, wanted["prim"])
        assert len(found["prim"]) > 100
        flags = world.scene.touches(**asked)
        np.testing.assert_array_equal(flags, np.diff(found["offsets"].astype(int)) > 0)
        assert flags.dtype == bool and 0 < flags.sum() < len(flags)
    with pytest.raises(raydix.InputError, match="max_result_bytes"):
        world.scene.touched_by(spheres=balls, max_result_bytes=100)


def test_sweeps(rng):
    world = random_world(rng)
    world.scene.commit()
    vertices, faces, names = out_of(world)
    flat = raydix.Scene(vertices, faces)
    rays = support.random_rays(rng, 400).reshape(20, 20, -1)
    radii = rng.uniform(0, 0.5, (20, 20))
    radii[0, 0] = -1
    found, wanted = (s.sweep_spheres(rays, radii=radii) for s in (world.scene, flat))
    for name in ("t", "point"):
        np.testing.assert_array_equal(found[name], wanted[name])
    same_names(found, names, wanted["prim"])
    met = found["prim"] != raydix.MISSING
    assert 50 < met.sum() < 400 and not met[0, 0] and found["point"].shape == (20, 20, 3)
    # Where the ball is then, what it touches is as far as its radius; before it, nothing is.
    center = rays[..., :3] + np.where(met, found["t"], 0)[..., None] * rays[..., 4:7]
    apart = np.linalg.norm(center - found["point"], axis=-1)
    later = met & (found["t"] > 0)
    np.testing.assert_allclose(apart[later], radii[later], atol=1e-4)
    assert (apart[met] <= radii[met] + 1e-4).all()


def test_queries_of_scenes_in_float64(rng):
    """Far from the origin, where float32 has steps of half a metre."""
    world = closed_world(rng, precision="float64")
    far = World(precision="float64")
    far.add_instance(world, np.array([[1, 0, 0, 5e5], [0, -1, 0, 4.5e6], [0, 0, 1, 120.0]]))
    far.scene.commit()
    for part, center in ((world, np.zeros(3)), (far, np.array([5e5, 4.5e6, 120]))):
        vertices, faces, names = out_of(part, np.float64)
        flat = raydix.Scene(vertices, faces, precision="float64")
        points = rng.uniform(-3, 3, (60, 3)) + center
        near, wanted = part.scene.closest_point(points), flat.closest_point(points)
        np.testing.assert_array_equal(near["distance"], wanted["distance"])
        np.testing.assert_array_equal(near["point"], wanted["point"])
        found = np.stack([near[n] for n in ("instance", "geometry", "prim")], axis=1)
        np.testing.assert_array_equal(found, names[wanted["prim"]])
        balls = np.concatenate([points, rng.uniform(0, 1, (60, 1))], axis=1)
        touched, wanted = (s.touched_by(spheres=balls) for s in (part.scene, flat))
        np.testing.assert_array_equal(touched["offsets"], wanted["offsets"])
        found = np.stack([touched[n] for n in ("instance", "geometry", "prim")], axis=1)
        np.testing.assert_array_equal(found, names[wanted["prim"]])
        assert len(found) > 10
        np.testing.assert_array_equal(
            part.scene.touches(spheres=balls), np.diff(touched["offsets"]) > 0
        )
        rays = np.concatenate([points, center - points + rng.uniform(-1, 1, (60, 3))], axis=1)
        swept, wanted = (s.sweep_spheres(rays, radii=0.1) for s in (part.scene, flat))
        np.testing.assert_array_equal(swept["t"], wanted["t"])
        hit = wanted["prim"] != raydix.MISSING
        found = np.stack([swept[n] for n in ("instance", "geometry", "prim")], axis=1)
        np.testing.assert_array_equal(found[hit], names[wanted["prim"][hit]])
        assert hit.sum() > 10


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_sweeps_of_one_mesh(rng, precision):
    scene = raydix.Scene(*triangles(rng, 60), precision=precision)
    rays = support.random_rays(rng, 300)
    points = scene.sweep_spheres(rays, radii=0)
    hits = scene.intersect(rays)
    np.testing.assert_array_equal(points["t"], hits["t"])
    np.testing.assert_array_equal(points["prim"], hits["prim"])
    np.testing.assert_array_equal(points["geometry"], hits["geometry"])
    balls = scene.sweep_spheres(rays[:, :3], rays[:, 4:7], radii=0.1, tmax=5)
    assert (balls["t"] <= 5).sum() > (hits["t"] <= 5).sum()
    assert scene.touches(segments=np.zeros((2, 3, 6))).shape == (2, 3)
    for wrong, error in (([1, 2], ValueError), ("a", TypeError)):
        with pytest.raises(error, match="radii: expected"):
            scene.sweep_spheres(rays, radii=wrong)
    with pytest.raises(ValueError, match="touches: expected either"):
        scene.touches()


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_all_meshes_are_one_body(rng, precision):
    world = closed_world(rng, precision=precision)
    vertices, faces, names = out_of(world, np.dtype(precision))
    flat = raydix.Scene(vertices, faces, precision=precision)
    points = rng.uniform(-4, 4, (3000, 3))
    points[7] = np.inf
    assert world.scene.closure() == flat.closure() == {
        "closure": "oriented", "open_edges": 0, "rule": "crossings"}  # fmt: skip
    inside = world.scene.contains(points)
    np.testing.assert_array_equal(inside, flat.contains(points))
    assert 300 < inside.sum() < 2700
    np.testing.assert_array_equal(
        world.scene.signed_distance(points), flat.signed_distance(points)
    )
    numbers = world.scene.winding_number(points)
    np.testing.assert_array_equal(numbers, flat.winding_number(points))
    assert numbers[np.isfinite(numbers)].max() >= 2
    np.testing.assert_array_equal(
        world.scene.contains(points, rule="parity"), flat.contains(points, rule="parity")
    )
    world.scene.set_mask(1, 0)  # the large box
    np.testing.assert_array_equal(world.scene.contains(points), inside)
    world.scene.commit()
    assert world.scene.contains(points).sum() < inside.sum()


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_overlaps_name_both(rng, precision):
    world, other = (random_world(rng, precision=precision) for _ in range(2))
    for each in (world, other):
        each.scene.commit()
    (vertices, faces, names), (more, others, other_names) = (
        out_of(each, np.dtype(precision)) for each in (world, other)
    )
    flat, flat_other = (
        raydix.Scene(v, f, precision=precision) for v, f in ((vertices, faces), (more, others))
    )
    for narrow in (False, True):
        for asked, told, second in (((), (), names), ((other.scene,), (flat_other,), other_names),
                                    ((flat_other,), (flat_other,), None)):  # fmt: skip
            found = world.scene.overlaps(*asked, narrow=narrow)
            wanted = flat.overlaps(*told, narrow=narrow)
            assert len(wanted) > 20
            for i, name in enumerate(("instance", "geometry", "prim")):
                assert found[name].shape == wanted.shape and found[name].dtype == np.uint32
                np.testing.assert_array_equal(found[name][:, 0], names[wanted[:, 0], i])
                last = second[wanted[:, 1], i] if second is not None else wanted[:, 1] * (i == 2)
                np.testing.assert_array_equal(found[name][:, 1], last)
            assert world.scene.count_overlaps(*asked, narrow=narrow) == len(wanted)
    with pytest.raises(raydix.InputError, match="max_result_bytes"):
        world.scene.overlaps(max_result_bytes=1000)


def test_shapes_are_named(rng):
    inner, scene = raydix.Scene(), raydix.Scene(*BOX)
    inner.add_spheres([[0, 0, 0]], 1, id=4)
    inner.add(*triangles(rng, 4))
    inner.commit()
    scene.add(inner, np.eye(4), id=9)
    scene.commit()
    with pytest.raises(raydix.InputError, match=r"geometry 4 \(spheres\)"):
        scene.sweep_spheres([[0, 0, 9, 0, 0, -1]], radii=1)
    text = r"geometry 4 \(spheres\) on path 1 of instances"
    for name, call in {
        "contains": lambda: scene.contains([0, 0, 0]),
        "signed_distance": lambda: scene.signed_distance([0, 0, 0]),
        "winding_number": lambda: scene.winding_number([0, 0, 0]),
        "closure": lambda: scene.closure(),
        "overlap": lambda: scene.overlaps(),
        "overlap ": lambda: scene.count_overlaps(raydix.Scene(*BOX)),
    }.items():
        with pytest.raises(raydix.InputError, match=f"{name.strip()}.*{text}"):
            call()


def test_nothing_and_what_is_not_committed(rng):
    empty = raydix.Scene()
    calls = (lambda s: s.closest_point([0, 0, 0]), lambda s: s.contains([0, 0, 0]),
             lambda s: s.overlaps(), lambda s: s.touched_by(spheres=[[0, 0, 0, 1]]))  # fmt: skip
    for call in calls:
        with pytest.raises(raydix.InputError, match="never committed"):
            call(empty)
    hollow = raydix.Scene()
    hollow.add(np.zeros((0, 3)), np.zeros((0, 3), int))
    hollow.add(np.zeros((0, 3)), np.zeros((0, 3), int))
    for scene in (empty, hollow):
        scene.commit()
        near = scene.closest_point([0, 0, 0])
        assert near["prim"] == raydix.MISSING and near["geometry"] == raydix.MISSING
        assert near["distance"] == np.inf and not scene.contains([0, 0, 0])
        assert len(scene.touched_by(segments=[[0, 0, 0, 1, 1, 1]])["prim"]) == 0
        assert scene.count_overlaps() == 0
    assert len(hollow.overlaps()["prim"]) == 0


def test_what_does_not_fit_is_refused_before_it_is_made(rng):
    scene = raydix.Scene(*triangles(rng, 1000))
    for _ in range(28):
        outer = raydix.Scene()
        outer.add(scene, np.eye(4))
        outer.add(scene, np.eye(4))
        outer.commit()
        scene = outer
    for call in (lambda: scene.contains([0, 0, 0]), lambda: scene.overlaps()):
        with pytest.raises(raydix.InputError, match="needs .* bytes"):
            call()


def test_one_mesh_has_its_id(rng):
    vertices, faces = support.random_triangles(rng, 30, 0.5)
    for precision in ("float32", "float64"):
        scene = raydix.Scene(precision=precision)
        scene.add(vertices, faces, id=5)
        scene.commit()
        near = scene.closest_point([[0, 0, 0], [np.nan, 0, 0]])
        assert near["geometry"].tolist() == [5, raydix.MISSING] and near["instance"].tolist() == [0, 0]
        touched = scene.touched_by(spheres=[[0, 0, 0, 9]])
        assert touched["geometry"].tolist() == [5] * 30 and len(scene.overlaps()[0]) == 2


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_masks(precision):
    """What a mask does not show is not there: a box at 0, one at 10, a ball at 20."""
    box, scene = raydix.Scene(*BOX, precision=precision), raydix.Scene(precision=precision)
    scene.add(*BOX, mask=1)
    scene.add(box, transform_by(10), mask=2)
    scene.add_spheres([[20.5, 0.5, 0.5]], 0.5, mask=4)
    scene.commit()
    lo, hi = BOX[0].min(axis=0), BOX[0].max(axis=0)
    middle, size = (lo + hi) / 2, (hi - lo)[0]
    inside = np.array([middle, middle + [10, 0, 0]])
    for mask, wanted in ((1, [1, 0]), (2, [0, 1]), (3, [1, 1]), (8, [0, 0])):
        wanted = np.array(wanted, bool)
        assert (scene.contains(inside, mask=mask) == wanted).all()
        assert (scene.contains(inside, mask=mask, rule="parity") == wanted).all()
        assert (np.round(scene.winding_number(inside, mask=mask)) == wanted).all()
        assert ((scene.signed_distance(inside, mask=mask) < 0) == wanted).all()
        balls = np.column_stack([inside, [size, size]])
        assert (scene.touches(spheres=balls, mask=mask) == wanted).all()
        touched = np.diff(scene.touched_by(spheres=balls, mask=mask)["offsets"].astype(int))
        assert ((touched > 0) == wanted).all()
        swept = scene.sweep_spheres(inside + [0, 0, 50], [[0, 0, -1.0]] * 2, radii=0.1, mask=mask)
        assert (np.isfinite(swept["t"]) == wanted).all()
        near = scene.closest_point(inside, mask=mask, max_distance=size)
        assert ((near["prim"] != raydix.MISSING) == wanted).all()
    assert scene.closest_point([20.5, 0.5, 0.5])["geometry"] == 2
    assert scene.closest_point([20.5, 0.5, 0.5], mask=3)["instance"] == 1
    with pytest.raises(raydix.InputError, match="sweeps: geometry 2 .spheres. cannot"):
        scene.sweep_spheres(inside, [[0, 0, -1.0]] * 2, radii=1)
    with pytest.raises(raydix.InputError, match="contains: .*geometry 2 .spheres."):
        scene.contains(inside)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_masks_of_overlaps_and_of_one_mesh(precision):
    scene = raydix.Scene(precision=precision)
    scene.add(*BOX, mask=6)
    scene.commit()
    other = raydix.Scene(*BOX, precision=precision)
    assert len(scene.overlaps(other)) == len(scene.overlaps(other, mask=2)) > 12
    assert scene.overlaps(other, mask=1).shape == (0, 2)
    assert scene.count_overlaps(other, mask=1) == scene.count_overlaps(mask=8) == 0
    assert scene.count_overlaps(other, mask=4) == len(scene.overlaps(other))
    middle = (BOX[0].min(axis=0) + BOX[0].max(axis=0)) / 2
    assert scene.contains(middle, mask=2) and not scene.contains(middle, mask=1)
    assert scene.contains(middle) and scene.closest_point(middle, mask=9)["prim"] == raydix.MISSING
    two = raydix.Scene(precision=precision)
    two.add(*BOX, mask=1)
    two.add(*BOX, mask=2)
    two.commit()
    both = two.overlaps()
    assert set(both["geometry"].ravel().tolist()) == {0, 1}
    assert set(two.overlaps(mask=2)["geometry"].ravel().tolist()) <= {1}
    assert two.count_overlaps(mask=2) == len(two.overlaps(mask=2)["prim"]) < len(both["prim"])


def transform_by(x):
    return [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]]
