"""Spheres and capsules in scenes, and filters by arrays, against NumPy."""

import numpy as np
import pytest
import raydix


def _rays(count, seed=1):
    random = np.random.default_rng(seed)
    rays = np.empty((count, 6), np.float32)
    rays[:, :3] = random.uniform(-2, 2, (count, 3))
    rays[:, 3:] = random.uniform(-1, 1, (count, 3)) - rays[:, :3]
    return rays


def _first_sphere(rays, centers, radii):
    """The least t of each ray, in double; infinity: none."""
    o, d = rays[:, None, :3].astype(float) - centers[None], rays[:, None, 3:].astype(float)
    a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - radii.astype(float) ** 2
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - a * c)
    near, far = (-b - root) / a, (-b + root) / a
    t = np.where(near >= 0, near, np.where(far >= 0, far, np.nan))
    return np.where(np.isnan(t), np.inf, t).min(axis=1)


def test_spheres_are_hit_where_they_are():
    random = np.random.default_rng(2)
    centers = random.uniform(-1, 1, (200, 3)).astype(np.float32)
    radii = random.uniform(0.01, 0.2, 200).astype(np.float32)
    scene = raydix.Scene()
    assert scene.add_spheres(centers, radii) == 0
    report = scene.commit()
    assert report["shapes"] == 1 and report["primitives"] == 200
    rays = _rays(3000)
    hits = scene.intersect(rays)
    expected = _first_sphere(rays, centers, radii)
    met = hits["prim"] != 0xFFFFFFFF
    assert (np.isfinite(expected) == met).mean() > 0.999
    assert np.allclose(hits["t"][met], expected[met], rtol=1e-4)
    assert (scene.occluded(rays) == met).all()
    points = scene.positions(hits, rays)[met]
    outward = (points - centers[hits["prim"][met]]) / radii[hits["prim"][met], None]
    assert np.allclose(scene.normals(hits, rays)[met], outward, atol=1e-3)
    assert np.isnan(scene.normals(hits, rays[:, :3], rays[:, 3:])[~met]).all()
    with pytest.raises(raydix.InputError, match="spheres.*give the rays too"):
        scene.positions(hits)


def test_shapes_mix_with_meshes_and_instances(tmp_path):
    ball = raydix.Scene()
    ball.add_spheres([[0, 0, 0]], 1)
    ball.commit()
    scene = raydix.Scene()
    place = np.eye(4)
    place[:3, 3] = (5, 0, 0)
    scene.add(ball, place)
    rod = scene.add_capsules([[0, 0, 0]], [[0, 4, 0]], [0.5])
    scene.add([[-9, -9, -5], [9, -9, -5], [0, 9, -5]], [[0, 1, 2]])
    scene.commit()
    down = [[5, 0, 9, 0, 0, -1], [0, 3, 9, 0, 0, -1], [2, -2, 9, 0, 0, -1]]
    hits = scene.intersect(down)
    assert hits["t"].tolist() == [8, 8.5, 14]
    assert hits["geometry"].tolist() == [0, rod, 2]
    assert hits["instance"].tolist() == [1, 0, 0]
    assert hits["u"][1] == 0.75
    scene.update_capsules(rod, [[0, 0, 0]], [[0, 4, 0]], 1)
    scene.commit()
    assert scene.intersect(down)["t"].tolist() == [8, 8, 14]
    with pytest.raises(raydix.InputError, match="geometry 1 is capsules, not spheres"):
        scene.update_spheres(rod, [[0, 0, 0]], 1)
    with pytest.raises(raydix.InputError, match="geometry 1 holds shapes, not a mesh"):
        scene.update(rod, [[0, 0, 0]] * 3)
    scene.save(tmp_path / "shapes.rdx")
    loaded = raydix.load_scene(tmp_path / "shapes.rdx")
    wanted = scene.intersect(down)
    assert {name: column.tolist() for name, column in loaded.intersect(down).items()} == {
        name: column.tolist() for name, column in wanted.items()
    }
    with pytest.raises(raydix.InputError, match="geometry 1 holds shapes, not a mesh"):
        loaded.update(rod, [[0, 0, 0]] * 3)
    loaded.update_capsules(rod, [[0, 0, 0]], [[0, 4, 0]], 2)
    loaded.commit()
    assert loaded.intersect(down)["t"].tolist() == [8, 7, 14]
    with pytest.raises(raydix.InputError, match="vertices: geometry 0 holds shapes"):
        ball.vertices
    near = scene.closest_point([[5, 0, 3], [0, 2, 0.5], [3, -2, -4]])
    assert near["distance"].tolist() == [2, 0, 1]
    assert near["instance"].tolist() == [1, 0, 0] and near["geometry"].tolist() == [0, rod, 2]
    touched = scene.touched_by(spheres=[[5, 0, 3, 2], [5, 0, 3, 1.9]])
    assert touched["offsets"].tolist() == [0, 1, 1] and touched["instance"].tolist() == [1]


def test_bad_shapes_are_named():
    scene = raydix.Scene()
    with pytest.raises(ValueError, match=r"centers: expected shape \(N, 3\)"):
        scene.add_spheres([1, 2, 3], 1)
    with pytest.raises(ValueError, match=r"radii: expected a number or shape \(2,\)"):
        scene.add_spheres([[0, 0, 0], [1, 1, 1]], [1, 2, 3])
    with pytest.raises(ValueError, match="ends: expected shape"):
        scene.add_capsules([[0, 0, 0]], [[0, 0, 0], [1, 1, 1]], 1)
    for wrong in (-1, np.nan, np.inf):
        with pytest.raises(ValueError, match="radius: expected a finite number"):
            scene.add_points([[0, 0, 0]], wrong)
    with pytest.raises(ValueError, match=r"points: expected shape \(N, 3\)"):
        scene.add_points([1, 2, 3], 1)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_points_are_spheres_of_one_radius(precision):
    random = np.random.default_rng(6)
    points = random.uniform(-1, 1, (300, 3))
    rays = _rays(2000)
    one, other = raydix.Scene(precision=precision), raydix.Scene(precision=precision)
    assert one.add_points(points, 0.1, mask=3, id=4) == other.add_spheres(points, 0.1, id=4) == 4
    for radius in (0.1, 0, 0.25):
        one.update_points(4, points, radius)
        other.update_spheres(4, points, radius)
        one.commit(), other.commit()
        hits, wanted = one.intersect(rays), other.intersect(rays)
        for name, column in wanted.items():
            np.testing.assert_array_equal(hits[name], column)
        near, wanted = one.closest_point(rays[:, :3]), other.closest_point(rays[:, :3])
        for name, column in wanted.items():
            np.testing.assert_array_equal(near[name], column)
    assert (hits["prim"] != raydix.MISSING).sum() > 500
    assert (one.intersect(rays, mask=4)["prim"] == raydix.MISSING).all()
    with pytest.raises(raydix.InputError, match="geometry 4 is points, not spheres"):
        one.update_spheres(4, points, 1)


def test_shapes_in_float64_keep_their_digits():
    """At a map's coordinates, where float32 has steps of half a metre."""
    home = np.array([500_000.0, 4_500_000.0, 120.0])
    ball, scene = raydix.Scene(precision="float64"), raydix.Scene(precision="float64")
    ball.add_spheres([[0, 0, 0], [3, 0, 0]], [1, 0.5])
    ball.commit()
    scene.add(ball, np.concatenate([np.eye(3), home[:, None]], axis=1))
    rod = scene.add_capsules([home + [0, 5, 0]], [home + [4, 5, 0]], 1)
    scene.commit()
    rays = np.array([[0, 0, 9, 0, 0, -1], [3, 0, 9, 0, 0, -1], [1, 5, 9, 0, 0, -1]], float)
    rays[:, :3] += home
    hits = scene.intersect(rays)
    assert hits["t"].tolist() == [8, 8.5, 8]
    assert hits["prim"].tolist() == [0, 1, 0] and hits["instance"].tolist() == [1, 1, 0]
    assert hits["u"].tolist() == [0, 0, 0.25]
    kept = scene.intersect(rays, keep={(1, 0): np.array([False, True])})
    assert kept["t"].tolist() == [np.inf, 8.5, 8]
    skipped = scene.intersect(rays, skip=hits)
    assert skipped["t"].tolist() == [np.inf] * 3
    assert scene.count(rays, keep={rod: np.array([False])}).tolist() == [1, 1, 0]
    near = scene.closest_point(home + [[0, 0, 3], [3, 0, 0.25], [5.5, 5, 0]])
    assert near["distance"].tolist() == [2, 0, 0.5] and near["u"].tolist() == [0, 0, 1]
    touched = scene.touched_by(spheres=[[*(home + [0, 0, 3]), 2]])
    assert touched["instance"].tolist() == [1] and touched["prim"].tolist() == [0]
    with pytest.raises(raydix.InputError, match="sweeps: geometry 1 .capsules. cannot be swept"):
        scene.sweep_spheres(rays, radii=1)


def test_filters_are_filtered_hits():
    mesh = raydix.Scene("builtin:figure?triangles=5000")
    box = mesh.bounds
    rays = _rays(4000)
    rays[:, :3] = box[0] + (box[1] - box[0]) * (rays[:, :3] + 2) / 4
    keep = np.random.default_rng(3).random(len(mesh.faces)) < 0.5
    every = mesh.all_hits(rays)
    seen = keep[every["prim"]]
    ray = np.repeat(np.arange(len(rays)), np.diff(every["offsets"]).astype(int))
    counts = np.bincount(ray[seen], minlength=len(rays))
    first = np.full(len(rays), 0xFFFFFFFF, np.uint32)
    for i, prim in zip(ray[seen][::-1], every["prim"][seen][::-1]):
        first[i] = prim
    hits = mesh.intersect(rays, keep=keep)
    assert (hits["prim"] == first).mean() > 0.999  # edges belong to both triangles here
    assert (mesh.occluded(rays, keep={0: keep}) == (first != 0xFFFFFFFF)).mean() > 0.999
    assert (mesh.count(rays, keep=keep) == counts).all()
    assert mesh.all_hits(rays, keep=keep)["prim"].tolist() == every["prim"][seen].tolist()
    assert (mesh.intersect(rays[:3], keep=keep)["prim"] == hits["prim"][:3]).all()


def test_rays_leave_out_what_they_start_from():
    mesh = raydix.Scene("builtin:figure?triangles=5000")
    rays = _rays(2000, 5)
    hits = mesh.intersect(rays)
    met = hits["prim"] != 0xFFFFFFFF
    again = mesh.intersect(rays, skip=hits)
    assert (again["prim"][met] != hits["prim"][met]).all()
    assert (again["t"][met] >= hits["t"][met]).all()
    assert (again["prim"] == mesh.intersect(rays, skip=hits["prim"])["prim"]).all()
    assert (mesh.intersect(rays.reshape(40, 50, 6), skip=hits["prim"].reshape(40, 50))["prim"].ravel()
            == again["prim"]).all()


def test_filters_name_what_is_wrong():
    mesh = raydix.Scene("builtin:figure?triangles=5000")
    rays = _rays(2000)
    with pytest.raises(ValueError, match="skip: expected shape"):
        mesh.intersect(rays, skip=[1, 2, 3])
    with pytest.raises(TypeError, match="keep: expected bool"):
        mesh.intersect(rays, keep=np.zeros(len(mesh.faces)))
    double = raydix.Scene(mesh.vertices, mesh.faces, precision="float64")
    n = len(mesh.faces)
    nowhere = np.array([[0, 0, 1e6, 0, 0, 1]], float)
    for scene in (mesh, double):
        for given in (0, 1, n - 1, n + 1, 2 * n):
            for call in (scene.intersect, scene.occluded, scene.count, scene.all_hits):
                text = f"keep: geometry 0 has {n} primitives, but its array has {given} values"
                with pytest.raises(raydix.InputError, match=text):
                    call(nowhere, keep=np.ones(given, bool))
                with pytest.raises(raydix.InputError, match="keep"):
                    call(rays[:0], keep=np.ones(given, bool))


def test_lengths_of_filters_are_those_of_each_geometry():
    """Whatever rays hit. What is not there is passed over."""
    leaf, world = raydix.Scene(), raydix.Scene()
    leaf.add_spheres([[0, 0, 0], [3, 0, 0]], 1)
    leaf.commit()
    world.add_points([[0, 0, 9]], 1)
    world.add(leaf, np.eye(4))
    world.add(np.zeros((0, 3)), np.zeros((0, 3), int))
    world.commit()
    down = np.array([[0, 0, 20, 0, 0, -1.0]])
    assert world.intersect(down, keep={0: [False]}).instance.item() == 1
    assert world.intersect(down, keep={5: [False], (9, 0): np.zeros(0, bool), (1, 7): [True] * 3}).t.item() == 10
    assert world.intersect(down, keep={0: [False], (1, 0): [False, True]}).t.item() == np.inf
    for place, count in ((0, 1), ((1, 0), 2)):
        for wrong in (count - 1, count + 1):
            with pytest.raises(raydix.InputError, match=f"has {count} primitives, but .* {wrong} v"):
                world.intersect(down, keep={place: np.ones(wrong, bool)})


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_strict_scenes_refuse_shapes(precision):
    scene = raydix.Scene(strict=True, precision=precision)
    ball = scene.add_spheres([[0, 0, 0], [np.nan, 0, 0]], 1)
    with pytest.raises(raydix.InputError, match="geometry 0: sphere 1: not finite"):
        scene.commit()
    scene.update_spheres(ball, [[0, 0, 0]], -1)
    with pytest.raises(raydix.InputError, match="geometry 0: sphere 0"):
        scene.commit(quality="fast")
    scene.update_spheres(ball, [[0, 0, 0]], 1)
    assert scene.commit()["left_out"] == 0
    for add in (
        lambda: scene.add_capsules([[0, 0, 0]], [[np.inf, 0, 0]], 1),
        lambda: scene.add_points([[2e12, 0, 0]], 1),
    ):
        id = add()
        with pytest.raises(raydix.InputError, match=f"geometry {id}: "):
            scene.commit()
        scene.remove(id)
    assert scene.commit()["shapes"] == 1


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_shapes_are_drawn_and_sampled(precision):
    """Two balls, one in an instance, from straight above."""
    leaf, world = raydix.Scene(precision=precision), raydix.Scene(precision=precision)
    leaf.add_spheres([[0, 0, 0]], 1)
    leaf.commit()
    world.add_spheres([[-2, 0, 0]], 1)
    world.add(leaf, [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0]])
    world.commit()
    camera = raydix.Camera(position=(0, 0, 9), target=(0, 0, 0), up=(0, 1, 0))
    picture = world.render(camera, view="normal", size=(64, 48)).reshape(-1, 3)
    seen = world.primary_rays(camera, size=(64, 48))
    rays = seen["rays"]
    hits = world.intersect(rays)
    normals = world.normals(hits, rays)[hits.hit]
    np.testing.assert_allclose(
        picture[seen["pixels"][hits.hit]], 0.5 + 0.5 * normals, atol=2e-3 if precision == "float64" else 1e-5
    )
    assert set(hits.instance[hits.hit].tolist()) == {0, 1}
    secondary = world.secondary_rays(rays, samples=3)
    assert len(secondary) == 3 * hits.hit.sum() > 100
    assert not world.occluded(secondary).all()
