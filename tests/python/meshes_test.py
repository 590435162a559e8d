"""Scene: closest points, inside and outside, overlaps, refit, where meshes come from."""

import numpy as np
import pytest
import support

import raydix

BOX = support.box_mesh([-1, -2, -3], [1, 2, 3])


def distance_to_box(points, lo, hi):
    outside = np.maximum(np.maximum(lo - points, points - hi), 0)
    inside = np.minimum(points - lo, hi - points).min(axis=-1)
    return np.where(inside >= 0, -inside, np.sqrt((outside**2).sum(axis=-1)))


def test_distances_to_a_box(rng):
    scene = raydix.Scene(*BOX)
    points = rng.uniform(-5, 5, (7, 100, 3)).astype(np.float32)
    wanted = distance_to_box(points.astype(np.float64), BOX[0].min(axis=0), BOX[0].max(axis=0))
    near = scene.closest_point(points)
    np.testing.assert_allclose(near["distance"], abs(wanted), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(scene.signed_distance(points), wanted, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(scene.contains(points), wanted <= 0)
    np.testing.assert_allclose(
        np.linalg.norm(near["point"] - points, axis=-1), near["distance"], rtol=1e-5, atol=1e-6
    )
    assert near["prim"].shape == near["u"].shape == (7, 100) and near["point"].shape == (7, 100, 3)


def test_closest_point_equals_brute_force(rng):
    vertices, faces = support.random_triangles(rng, 60)
    points = rng.uniform(-2, 2, (50, 3)).astype(np.float32)
    near = raydix.Scene(vertices, faces).closest_point(points)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 2), axis=-1).reshape(-1, 2)
    grid = grid[grid.sum(axis=1) <= 1]
    corners = vertices[faces].astype(np.float64)
    samples = (
        corners[:, None, 0]
        + grid[:, :1] * (corners[:, None, 1] - corners[:, None, 0])
        + grid[:, 1:] * (corners[:, None, 2] - corners[:, None, 0])
    )
    sampled = np.linalg.norm(samples[None] - points[:, None, None].astype(np.float64), axis=-1).min(
        axis=(1, 2)
    )
    assert (near["distance"] <= sampled + 1e-6).all() and (near["distance"] >= sampled - 0.01).all()


def test_far_and_invalid_points():
    scene = raydix.Scene(*BOX)
    near = scene.closest_point([[9, 0, 0], [np.nan, 0, 0], [1.5, 0, 0]], max_distance=1)
    assert near["distance"].tolist() == [np.inf, np.inf, 0.5]
    assert near["prim"][:2].tolist() == [raydix.MISSING] * 2
    assert not scene.contains([np.nan, 0, 0]) and not scene.contains([np.inf, 0, 0])
    assert (
        np.isnan(scene.winding_number([np.nan, 0, 0])) and abs(scene.winding_number([0, 0, 0])) == 1
    )
    for wrong in (-1, np.nan):
        with pytest.raises(ValueError, match="max_distance"):
            scene.closest_point([0, 0, 0], max_distance=wrong)
    with pytest.raises(raydix.InputError, match="rule: expected one of automatic"):
        scene.contains([0, 0, 0], rule="guess")
    with pytest.raises(
        ValueError,
        match=r"points: expected shape \(..., 3\) float32 or float64, given shape \(2,\) float64",
    ):
        scene.contains([1.0, 2.0])


def test_contains_is_exact_for_a_million_points(rng):
    """A scaled and moved closed mesh: its box is known, so is the answer, at edges, faces and
    corners too."""
    scale, shift = np.float32(37.3), np.array([1234.5, -77.25, 9.125], np.float32)
    vertices = BOX[0].astype(np.float32) * scale + shift
    lo, hi = vertices.min(axis=0), vertices.max(axis=0)
    points = rng.uniform(lo - 20, hi + 20, (1_000_000, 3)).astype(np.float32)
    planes = rng.integers(
        0, 3, (300_000, 3)
    )  # a third each: on the lower plane, on the upper, anywhere
    points[:300_000] = np.where(planes == 0, lo, np.where(planes == 1, hi, points[:300_000]))
    wanted = ((points >= lo) & (points <= hi)).all(axis=1)
    assert 100_000 < wanted.sum() < 900_000
    assert (raydix.Scene(vertices, BOX[1]).contains(points) != wanted).sum() == 0


def test_contains_through_vertices_and_edges():
    """Rays from these points to infinity along an axis pass through corners and edges of an
    octahedron."""
    vertices = np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float
    )
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    grid = np.linspace(-2, 2, 33)
    points = np.stack(np.meshgrid(grid, grid, grid), axis=-1)
    for rule in ("automatic", "crossings", "parity"):
        np.testing.assert_array_equal(
            raydix.Scene(vertices, faces).contains(points, rule=rule), abs(points).sum(axis=-1) <= 1
        )


def test_open_meshes_say_so():
    scene = raydix.Scene(BOX[0], BOX[1][1:])
    assert scene.closure() == {"closure": "open", "open_edges": 3, "rule": "winding"}
    assert raydix.Scene(*BOX).closure() == {
        "closure": "oriented",
        "open_edges": 0,
        "rule": "crossings",
    }
    assert scene.contains([0.1, 0, 0]) and not scene.contains([0, 9, 0])


def test_overlaps_equal_brute_force(rng):
    scenes = []
    for _ in range(2):
        vertices, faces = support.random_triangles(rng, 200)
        corners = vertices[faces]
        scenes.append((raydix.Scene(vertices, faces), corners.min(axis=1), corners.max(axis=1)))
    (a, lo_a, hi_a), (b, lo_b, hi_b) = scenes

    def meet(lo, hi, lo2, hi2):
        return ((lo[:, None] <= hi2[None]) & (lo2[None] <= hi[:, None])).all(axis=-1)

    np.testing.assert_array_equal(a.overlaps(b), np.argwhere(meet(lo_a, hi_a, lo_b, hi_b)))
    np.testing.assert_array_equal(
        a.overlaps(), np.argwhere(np.triu(meet(lo_a, hi_a, lo_a, hi_a), 1))
    )
    assert (
        a.count_overlaps(b) == len(a.overlaps(b))
        and a.overlaps(a).tolist() == np.argwhere(meet(lo_a, hi_a, lo_a, hi_a)).tolist()
    )
    narrow = a.overlaps(b, narrow=True)
    assert 0 < len(narrow) < len(a.overlaps(b)) and set(map(tuple, narrow)) <= set(
        map(tuple, a.overlaps(b))
    )
    with pytest.raises(raydix.InputError, match="more than 8 bytes"):
        a.overlaps(b, max_result_bytes=8)


def test_touched_by_shapes():
    scene = raydix.Scene(*BOX)
    found = scene.touched_by(spheres=[[0, 0, 0, 0.5], [0, 0, 0, 1], [0, 0, 0, 9]])
    assert (
        np.diff(found["offsets"]).tolist()[0] == 0 and np.diff(found["offsets"]).tolist()[2] == 12
    )
    assert len(scene.touched_by(segments=[[0, 0, 0, 5, 0.1, 0.2]])["prim"]) == 1
    with pytest.raises(ValueError, match="either spheres or segments"):
        scene.touched_by()


def test_refit_follows_the_vertices(rng):
    vertices, faces = support.random_triangles(rng, 500)
    scene = raydix.Scene(vertices, faces)
    rays = support.random_rays(rng, 500)
    before = scene.intersect(rays)
    moved = (vertices * 0.7 + 0.1).astype(np.float32)
    quality = scene.refit(moved)
    assert quality["ratio"] == pytest.approx(quality["sah"] / quality["sah_at_build"])
    fresh = raydix.Scene(moved, faces)
    for field, values in scene.intersect(rays).items():
        np.testing.assert_array_equal(values, fresh.intersect(rays)[field])
    assert not np.array_equal(before["t"], scene.intersect(rays)["t"])
    np.testing.assert_array_equal(scene.vertices, moved)
    scene.check()
    with pytest.raises(ValueError, match=r"expected shape \(1500, 3\), given \(1499, 3\)"):
        scene.refit(moved[1:])
    with pytest.raises(raydix.InputError):
        scene.refit(np.where(np.arange(1500)[:, None] == 7, np.nan, moved))
    np.testing.assert_array_equal(
        scene.intersect(rays)["t"], fresh.intersect(rays)["t"]
    )  # as before the error


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("builder", ["karras", "apetrei", "ploc"])
def test_check_knows_refitted_trees(rng, builder, precision):
    vertices, faces = support.random_triangles(rng, 500)
    scene = raydix.Scene(vertices, faces, builder=builder, precision=precision)
    scene.refit(vertices @ np.float32([[3, 0, 1], [0, -1, 0], [0, 2, 1]]))  # another order along x, y, z
    scene.check()
    scene.refit(vertices)
    scene.check()


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_a_refused_refit_changes_no_answer(rng, precision):
    vertices, faces = support.random_triangles(rng, 200)
    scene = raydix.Scene(vertices, faces, precision=precision)
    rays, points = support.random_rays(rng, 300), rng.uniform(-1, 1, (50, 3))
    wanted = scene.count(rays), scene.occluded(rays), scene.closest_point(points)["distance"]
    small = vertices.copy()  # valid numbers, found too small when the boxes are made
    small[faces[7]] = [[0, 0, 0], [1e-13, 0, 0], [0, 1e-13, 0]]
    for bad in (small, np.where(np.arange(len(vertices))[:, None] == 5, np.nan, vertices)):
        with pytest.raises(raydix.InputError):
            scene.refit(bad)
        np.testing.assert_array_equal(scene.count(rays), wanted[0])
        np.testing.assert_array_equal(scene.occluded(rays), wanted[1])
        np.testing.assert_array_equal(scene.closest_point(points)["distance"], wanted[2])
        scene.check()
    assert scene.refit(vertices)["ratio"] == pytest.approx(1)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_views_of_vertices_outlive_refits_and_scenes(rng, precision):
    vertices, faces = support.random_triangles(rng, 300_000)
    scene = raydix.Scene(vertices, faces, precision=precision)
    first = scene.vertices
    scene.refit(vertices + np.float32(1))
    second, again = scene.vertices, scene.vertices
    scene.refit(vertices + np.float32(2))
    scene.refit(vertices + np.float32(3))
    np.testing.assert_array_equal(first, vertices)
    np.testing.assert_array_equal(second, (vertices + np.float32(1)).astype(second.dtype))
    assert not second.flags.writeable and second.ctypes.data == again.ctypes.data
    third = scene.vertices
    del scene
    np.testing.assert_array_equal(third, (vertices + np.float32(3)).astype(third.dtype))


def test_vertices_without_triangles():
    scene = raydix.Scene(BOX[0], [])
    scene.check()
    scene.refit(np.asarray(BOX[0]) + 1)
    assert scene.vertices.min() == np.asarray(BOX[0]).min() + 1
    assert not scene.occluded([0, 0, 9, 0, 0, -1])


def test_numbers_of_threads():
    for wrong in (-1, 1025, 1_000_000):
        with pytest.raises(ValueError, match="threads: expected"):
            raydix.Points(BOX[0], threads=wrong).knn(np.zeros((4, 3)), 1)
        with pytest.raises(ValueError, match="threads: expected"):
            raydix.Scene(*BOX, threads=wrong).intersect(np.zeros((100, 8)))


def test_errors_name_the_argument():
    scene, cloud = raydix.Scene(*BOX), raydix.Points(BOX[0])
    calls = {
        "k": lambda wrong: cloud.knn(BOX[0], wrong),
        "r": lambda wrong: cloud.radius(BOX[0], wrong),
        "r ": lambda wrong: cloud.count(BOX[0], wrong),
        "r  ": lambda wrong: cloud.pairs(wrong),
        "max_distance": lambda wrong: scene.closest_point(BOX[0], max_distance=wrong),
        "mask": lambda wrong: scene.occluded(np.zeros((1, 8)), mask=wrong),
        "other": lambda wrong: scene.overlaps(wrong),
        "id": lambda wrong: scene.add(*BOX, id=wrong),
        "number": lambda wrong: scene.path(wrong),
        "refit_limit": lambda wrong: scene.commit(refit_limit=wrong),
        "threads": lambda wrong: raydix.Scene(*BOX, threads=wrong),
    }
    for name, call in calls.items():
        with pytest.raises(TypeError, match=f"^{name.strip()}: expected .*, given .*three"):
            call("three")
    for name, call in {"k": calls["k"], "mask": calls["mask"], "threads": calls["threads"]}.items():
        for wrong in (np.nan, np.inf, 1.5, -1, 2**40):
            with pytest.raises(ValueError, match=f"^{name}: expected a whole number, .* given"):
                call(wrong)


def test_where_meshes_come_from(tmp_path, figure):
    file = tmp_path / "box.obj"
    file.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in BOX[0])
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in BOX[1])
    )
    from_file = raydix.Scene(file)
    assert (
        len(from_file.faces) == 12 and from_file.name == "box.obj" and "12 triangles" in repr(from_file)
    )
    np.testing.assert_array_equal(from_file.vertices, BOX[0].astype(np.float32))
    assert len(figure.faces) > 10_000 and len(figure.cameras) >= 1
    copy = raydix.Scene(figure)  # has .vertices and .faces, as a trimesh.Trimesh has
    np.testing.assert_array_equal(copy.faces, figure.faces)
    with pytest.raises(raydix.InputError, match="nowhere.ply"):
        raydix.Scene(tmp_path / "nowhere.ply")
    with pytest.raises(TypeError, match="vertices: expected a path, a mesh"):
        raydix.Scene(np.zeros((3, 3)))


@pytest.mark.parametrize(
    "error, text, vertices, faces",
    [
        (
            ValueError,
            r"vertices: expected shape \(..., 3\) .* given shape \(4, 2\) float64",
            np.zeros((4, 2)),
            [[0, 1, 2]],
        ),
        (
            ValueError,
            r"faces: expected shape \(F, 3\) of whole numbers, given shape \(1, 4\) int64",
            np.zeros((4, 3)),
            [[0, 1, 2, 3]],
        ),
        (
            TypeError,
            r"faces: expected .* given shape \(1, 3\) float64",
            np.zeros((4, 3)),
            [[0.0, 1, 2]],
        ),
        (
            ValueError,
            r"faces: face 1 is \[0, 1, 4\], but there are 4 vertices",
            np.zeros((4, 3)),
            [[0, 1, 2], [0, 1, 4]],
        ),
        (ValueError, r"faces: face 0 is \[-1, 1, 2\]", np.zeros((4, 3)), [[-1, 1, 2]]),
        (TypeError, "vertices: expected", np.zeros((4, 3), complex), [[0, 1, 2]]),
    ],
)
def test_errors_of_meshes(error, text, vertices, faces):
    with pytest.raises(error, match=text):
        raydix.Scene(vertices, faces)


def test_options_are_checked_and_invalid_triangles_left_out():
    vertices = BOX[0].copy()
    vertices[0, 0] = np.nan
    scene = raydix.Scene(vertices, BOX[1])
    touching = int((BOX[1] == 0).any(axis=1).sum())
    assert (
        scene.info()["left_out_triangles"]
        == touching
        == scene.stats()["left_out"]
        == scene.wide_stats()["left_out"]
    )
    assert scene.wide_stats()["sah"] > 0
    assert raydix.Scene([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]).wide_stats()["sah"] is None
    with pytest.raises(raydix.InputError):
        raydix.Scene(vertices, BOX[1], strict=True).stats()
    with pytest.raises(
        ValueError, match="quality: expected one of fast, balanced, high, given 'best'"
    ):
        raydix.Scene(*BOX, quality="best")
    with pytest.raises(raydix.InputError, match="karras"):
        raydix.Scene(*BOX, builder="carrots")
    with pytest.raises(ValueError, match="device: expected 'cpu', 'cuda', 'opencl'"):
        raydix.Scene(*BOX, device="tpu")


def test_the_scene_has_its_own_copy_of_the_mesh():
    vertices, faces = BOX[0].astype(np.float32), BOX[1].astype(np.uint32)
    scene = raydix.Scene(vertices, faces)
    vertices += 100
    faces[:] = 0
    assert scene.occluded([0, 0, 9, 0, 0, -1])
    with pytest.raises(ValueError):
        scene.vertices[0, 0] = 5


def test_a_shared_mesh_scaled_and_moved_stays_closed(rng):
    """Igea, 100 times as large and far away: crossings along two directions, winding numbers and
    distances agree on every point."""
    given = support.shared_scene("igea")
    assert given.closure()["closure"] == "oriented"
    scene = raydix.Scene(
        given.vertices * np.float32(100) + np.float32([3e4, -2e4, 500]), given.faces
    )
    lo, hi = np.array(scene.info()["bounds"])
    points = rng.uniform(lo, hi, (100_000, 3)).astype(np.float32)
    inside = scene.contains(points)
    assert 20_000 < inside.sum() < 80_000
    distance = scene.signed_distance(points)
    apart = distance != 0  # a point beside the surface may be 0 away in float32, on either side
    assert apart.mean() > 0.999
    np.testing.assert_array_equal(distance[apart] < 0, inside[apart])
    np.testing.assert_array_equal(scene.winding_number(points) != 0, inside)
    for direction in ([0, 0, 1], [0.3, -0.5, 0.2]):
        np.testing.assert_array_equal(scene.count(points, np.float32(direction)) % 2 == 1, inside)


def test_the_order_of_queries_does_not_matter(rng):
    """A wide tree made from the binary one, if that was there first, is the one made from the mesh."""
    vertices, faces = support.random_triangles(rng, 3000)
    rays = support.random_rays(rng, 1000)
    for quality in ("fast", "balanced", "high"):
        first, second = (raydix.Scene(vertices, faces, quality=quality) for _ in range(2))
        first.stats()
        stats = [scene.wide_stats() | {"ms": 0} for scene in (first, second)]
        assert stats[0] == stats[1]
        for field, values in first.intersect(rays).items():
            np.testing.assert_array_equal(values, second.intersect(rays)[field])
