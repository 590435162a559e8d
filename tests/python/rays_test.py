"""Scene: rays in all their forms, against brute force."""

import numpy as np
import pytest
import support

import raydix
from raydix import _rays

TRIANGLE = (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), np.array([[0, 1, 2]]))
DOWN = np.array([0.25, 0.25, 1, 0, 0, 0, -1, np.inf], np.float32)


@pytest.fixture
def random_scene(rng):
    vertices, faces = support.random_triangles(rng, 300)
    return raydix.Scene(vertices, faces), vertices, faces, support.random_rays(rng, 400)


@pytest.mark.parametrize("quality", ["fast", "balanced", "high"])
def test_closest_hits_equal_brute_force(random_scene, quality):
    _, vertices, faces, rays = random_scene
    hits = raydix.Scene(vertices, faces, quality=quality).intersect(rays)
    wanted = support.brute_force_hits(vertices, faces, rays)
    assert (hits["prim"] != raydix.MISSING).sum() > 100
    assert np.array_equal(np.isfinite(hits["t"]), np.isfinite(wanted.min(axis=1)))
    found = np.isfinite(hits["t"])
    np.testing.assert_allclose(hits["t"][found], wanted.min(axis=1)[found], rtol=1e-5)
    np.testing.assert_array_equal(hits["prim"][found], wanted.argmin(axis=1)[found])


def test_reinsertion_rounds(rng):
    vertices, faces = support.random_triangles(rng, 20000)
    rays = support.random_rays(rng, 500)
    plain = raydix.Scene(vertices, faces, builder="karras")
    better = raydix.Scene(vertices, faces, builder="karras", reinsertion_rounds=3)
    assert plain.stats()["reinsertion_rounds"] == 0 and better.stats()["reinsertion_rounds"] == 3
    assert better.stats()["sah"] < plain.stats()["sah"]
    hits, wanted = better.intersect(rays), plain.intersect(rays)
    for field in wanted:
        np.testing.assert_array_equal(hits[field], wanted[field])
    assert raydix.Scene(vertices, faces, quality="high").stats()["reinsertion_rounds"] == 4
    for options in ({"reinsertion_rounds": -1}, {"reinsertion_rounds": 256}, {"max_leaf": 0},
                    {"max_leaf": 256}, {"bits": 31}):  # fmt: skip
        with pytest.raises(ValueError, match=f"^{next(iter(options))}: expected"):
            raydix.Scene(vertices, faces, **options)


def test_occluded_count_and_all_hits_equal_brute_force(random_scene):
    scene, vertices, faces, rays = random_scene
    wanted = np.isfinite(support.brute_force_hits(vertices, faces, rays))
    np.testing.assert_array_equal(scene.occluded(rays), wanted.any(axis=1))
    np.testing.assert_array_equal(scene.count(rays), wanted.sum(axis=1))
    found = scene.all_hits(rays)
    assert found["offsets"].dtype == np.uint64 and found["offsets"][-1] == wanted.sum()
    for i in range(len(rays)):
        row = slice(int(found["offsets"][i]), int(found["offsets"][i + 1]))
        assert set(found["prim"][row]) == set(np.flatnonzero(wanted[i]))
        assert (np.diff(found["t"][row]) >= 0).all()


def test_barycentrics_give_the_point(random_scene):
    scene, vertices, faces, rays = random_scene
    hits = scene.intersect(rays)
    found = hits["prim"] != raydix.MISSING
    corners = vertices[faces[hits["prim"][found]]]
    u, v = hits["u"][found][:, None], hits["v"][found][:, None]
    on_triangle = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    on_ray = rays[found, :3] + hits["t"][found][:, None] * rays[found, 4:7]
    np.testing.assert_allclose(on_triangle, on_ray, atol=2e-5)


def forms(rays):
    """The same rays in every form that is accepted."""
    six = np.concatenate([rays[..., :3], rays[..., 4:7]], axis=-1)
    wide = np.zeros(rays.shape[:-1] + (16,), np.float32)
    wide[..., ::2] = rays
    locked = rays.copy()
    locked.flags.writeable = False
    return {
        "eight": (rays,),
        "eight, float64": (rays.astype(np.float64),),
        "eight, every second float": (wide[..., ::2],),
        "eight, backwards twice": (rays[::-1].copy()[::-1],),
        "eight, Fortran order": (np.asfortranarray(rays),),
        "eight, read-only": (locked,),
        "eight, the other byte order": (rays.astype(">f4"),),
        "eight, at an odd byte": (
            np.frombuffer(b"x" + rays.tobytes(), np.uint8)[1:].view(np.float32).reshape(rays.shape),
        ),
        "six": (six,),
        "six, float64": (six.astype(np.float64),),
        "six, a list": (six.tolist(),),
        "two arrays": (six[..., :3], six[..., 3:]),
        "two arrays, mixed": (six[..., :3].astype(np.float64), np.ascontiguousarray(six[..., 3:])),
    }


def test_every_form_gives_the_same_bits(random_scene):
    scene, _, _, rays = random_scene
    for shape in [(400, 8), (20, 20, 8), (2, 10, 4, 5, 8)]:
        wanted = scene.intersect(rays)
        for name, form in forms(rays.reshape(shape)).items():
            hits = scene.intersect(*form)
            for field in ("t", "prim", "u", "v"):
                assert hits[field].shape == shape[:-1], name
                np.testing.assert_array_equal(
                    hits[field].reshape(-1), wanted[field], err_msg=f"{name}, {field}"
                )
            np.testing.assert_array_equal(
                scene.occluded(*form).reshape(-1), scene.occluded(rays), err_msg=name
            )
            np.testing.assert_array_equal(
                scene.count(*form).reshape(-1), scene.count(rays), err_msg=name
            )


def test_one_ray_has_no_leading_shape():
    scene = raydix.Scene(*TRIANGLE)
    hit = scene.intersect(DOWN)
    assert hit["t"].shape == () and hit["t"] == 1 and hit["prim"] == 0 and hit["u"] == 0.25
    assert scene.occluded(DOWN).shape == () and scene.occluded(DOWN)
    assert scene.count(DOWN) == 1


def test_limits_are_numbers_or_arrays():
    scene = raydix.Scene(*TRIANGLE)
    origins, directions = np.tile(DOWN[:3], (4, 1)), DOWN[4:7]
    assert scene.intersect(origins, directions, tmax=0.5)["prim"].tolist() == [raydix.MISSING] * 4
    assert scene.occluded(
        origins, directions, tmin=[0, 1, 1.5, 0], tmax=[1, 2, 2, 0.9]
    ).tolist() == [True, True, False, False]
    assert scene.occluded(origins, directions, tmax=np.float64(1)).all()
    with pytest.raises(
        ValueError, match=r"tmin: expected a number or shape \(4,\), given shape \(3,\)"
    ):
        scene.intersect(origins, directions, tmin=[0, 1, 2])
    with pytest.raises(ValueError, match="have their own"):
        scene.intersect(DOWN, tmax=3)


@pytest.mark.parametrize(
    "error, text, args",
    [
        (
            ValueError,
            r"rays: expected shape \(..., 8\) or \(..., 6\) float32 or float64, "
            r"given shape \(5, 7\) float32",
            (np.zeros((5, 7), "f4"),),
        ),
        (
            TypeError,
            r"rays: expected shape .* given shape \(5, 8\) complex128",
            (np.zeros((5, 8), complex),),
        ),
        (TypeError, r"rays: expected .* given shape \(\) <U3", ("abc",)),
        (
            ValueError,
            r"directions: expected shape \(..., 3\) .* given shape \(4, 2\) float64",
            (np.zeros((4, 3)), np.zeros((4, 2))),
        ),
        (
            ValueError,
            r"directions: expected a shape that fits origins, \(4, 3\), given shape \(5, 3\)",
            (np.zeros((4, 3)), np.zeros((5, 3))),
        ),
        (TypeError, "rays: expected", (None,)),
    ],
)
def test_errors_name_argument_shape_and_dtype(error, text, args):
    for call in ("intersect", "occluded", "count", "all_hits"):
        with pytest.raises(error, match=text):
            getattr(raydix.Scene(*TRIANGLE), call)(*args)


def test_invalid_rays_miss():
    scene = raydix.Scene(*TRIANGLE)
    rays = np.tile(DOWN, (6, 1))
    rays[0, 0], rays[1, 4:7], rays[2, 3], rays[3, 5], rays[4, 3:8:4] = (
        np.nan,
        0,
        np.nan,
        np.inf,
        (2, 1),
    )
    assert scene.occluded(rays).tolist() == [False] * 5 + [True]
    single = [scene.intersect(ray)["prim"] != raydix.MISSING for ray in rays]
    assert single == [False] * 5 + [True]
    assert scene._core.intersect(rays, np.empty((6, 6), "f4")) == (1, 5)
    assert [
        scene._core.intersect(rays[i : i + 1], np.empty((1, 6), "f4")) for i in range(6)
    ] == [(0, 1)] * 5 + [(1, 0)]


def test_nothing_to_hit_and_nothing_to_ask():
    for scene in (
        raydix.Scene(np.zeros((0, 3)), np.zeros((0, 3), int)),
        raydix.Scene([], []),
        raydix.Scene(np.ones((5, 3)), []),
    ):
        assert (
            np.isinf(scene.intersect(DOWN)["t"])
            and not scene.occluded(DOWN)
            and scene.count(DOWN) == 0
        )
        assert scene.all_hits(DOWN)["offsets"].tolist() == [0, 0]
    scene = raydix.Scene(*TRIANGLE)
    for shape in [(0, 8), (0, 6), (3, 0, 8), (0,)]:
        assert scene.intersect(np.zeros(shape))["t"].shape == shape[:-1] if len(shape) > 1 else (0,)
    assert scene.all_hits(np.zeros((0, 8)))["offsets"].tolist() == [0]
    assert scene.all_hits(np.zeros((0, 8)))["prim"].dtype == np.uint32


def test_float32_rays_in_one_run_are_not_copied(random_scene):
    scene, _, _, rays = random_scene
    for shape in [(400, 8), (4, 100, 8)]:
        (given,), _ = _rays.ray_batch(rays.reshape(shape), None, None, None)
        assert given.ctypes.data == rays.ctypes.data
    hits = scene.intersect(rays)
    assert (
        hits["t"].base is not None and hits["t"].ctypes.data + 4 == hits["prim"].ctypes.data
    )  # one array, four views


def test_a_mesh_far_away_keeps_its_edges_shut(rng):
    """Rays into a closed mesh with coordinates near 1e5 never slip between two triangles."""
    vertices, faces = support.box_mesh([0, 0, 0], [1, 1, 1])
    for _ in range(3):  # each triangle in four
        middles = {}
        vertices, new = list(map(tuple, vertices)), []
        for f in faces:
            m = []
            for a, b in ((0, 1), (1, 2), (2, 0)):
                key = tuple(sorted((f[a], f[b])))
                if key not in middles:
                    middles[key] = len(vertices)
                    vertices.append(tuple((np.array(vertices[f[a]]) + vertices[f[b]]) / 2))
                m.append(middles[key])
            new += [(f[0], m[0], m[2]), (m[0], f[1], m[1]), (m[2], m[1], f[2]), tuple(m)]
        faces = np.array(new)
    corners = np.array(vertices, np.float32) + np.float32(1e5)
    scene = raydix.Scene(corners, faces)
    targets = np.concatenate(
        [corners, corners[faces].mean(axis=1), (corners[faces[:, 0]] + corners[faces[:, 1]]) / 2]
    )
    middle = corners.mean(axis=0)
    assert scene.occluded(np.broadcast_to(middle, targets.shape), targets - middle).all()
    assert (scene.count(np.broadcast_to(middle, targets.shape), targets - middle) % 2 == 1).all()


def test_shared_scene_equals_itself_on_every_quality():
    scenes = [raydix.Scene(support.shared_scene("bunny"), quality=q) for q in ("fast", "high")]
    rays = scenes[0].primary_rays(size=(160, 120))["rays"]
    first, second = (scene.intersect(rays) for scene in scenes)
    assert (first["prim"] != raydix.MISSING).any()
    for field in first:
        np.testing.assert_array_equal(first[field], second[field])


def test_all_hits_of_many_pieces_have_one_limit():
    """Triangles behind one another, more rays than fit into the first piece."""
    z = np.arange(300.0)
    vertices = np.stack(
        [np.array([[-10, -10, h], [10, -10, h], [0, 10, h]]) for h in z]
    ).reshape(-1, 3)
    for precision in ("float32", "float64"):
        scene = raydix.Scene(vertices, np.arange(900).reshape(-1, 3), precision=precision)
        rays = np.tile(np.array([0, 0, -1, 0, 0, 0, 1, np.inf]), (400_000, 1))
        with pytest.raises(raydix.InputError, match="max_result_bytes lets it have 100000000"):
            scene.all_hits(rays, max_result_bytes=100_000_000)
        few = scene.all_hits(rays[:1000], max_result_bytes=100_000_000)
        assert few["offsets"].tolist() == list(range(0, 300_001, 300))
        assert (scene.count(rays[:5000]) == 300).all()


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_packed_records(precision, rng):
    """Columns of records whose rows begin at any byte, as files of sensors have them."""
    scene = raydix.Scene(*support.random_triangles(rng, 300), precision=precision)
    rays = support.random_rays(rng, 50)
    calls = (scene.intersect, scene.occluded, scene.count, scene.all_hits)
    for kind in (np.float32, np.float64):
        packed = np.zeros(
            50,
            [("ring", "u1"), ("origin", kind, 3), ("along", kind, 3), ("far", kind), ("ray", kind, 8)],
        )
        packed["origin"], packed["along"], packed["far"] = rays[:, :3], rays[:, 4:7], 9
        packed["ray"] = rays
        six = np.zeros(50, [("ring", "u1"), ("ray", kind, 6)])
        six["ray"] = rays[:, [0, 1, 2, 4, 5, 6]]
        origins, along = (packed[name].copy() for name in ("origin", "along"))
        for call in calls:
            wanted = call(origins, along)
            for found in (call(packed["origin"], packed["along"]), call(six["ray"])):
                np.testing.assert_equal(found, wanted)
            np.testing.assert_equal(call(packed["ray"]), call(packed["ray"].copy()))
            np.testing.assert_equal(
                call(origins, along, tmax=packed["far"]), call(origins, along, tmax=9)
            )
            flat = packed["origin"].reshape(5, 10, 3), packed["along"].reshape(5, 10, 3)
            np.testing.assert_equal(call(*flat), call(*(part.copy() for part in flat)))
