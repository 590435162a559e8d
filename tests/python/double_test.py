"""Scenes in float64: far from the origin as near it, types and shapes, what they do not have."""

import threading

import numpy as np
import pytest
import support

import raydix

UTM = np.array([500_000.0, 4_500_000.0, 0.0])
"""Easting and northing of a place in central Europe. float32 has steps of half a metre there."""


def double(vertices, faces, **options):
    return raydix.Scene(vertices, faces, precision="float64", **options)


def on_a_grid(values):
    """Multiples of 2**-20: adding UTM to them is exact, so that both meshes are the same."""
    return np.round(values * 2.0**20) / 2.0**20


def soup(rng, count=2000):
    vertices, faces = support.random_triangles(rng, count)
    return on_a_grid(vertices.astype(np.float64)), faces


def rays_at_the_origin(rng, count=5000):
    rays = support.random_rays(rng, count).astype(np.float64)
    rays[:, :3] = on_a_grid(rays[:, :3])
    return rays


def moved(rays):
    there = rays.copy()
    there[:, :3] += UTM
    return there


def test_rays_at_utm_offsets_hit_as_at_the_origin(rng):
    vertices, faces = soup(rng)
    rays = rays_at_the_origin(rng)
    here = double(vertices, faces).intersect(rays)
    there = double(vertices + UTM, faces).intersect(moved(rays))
    assert (here["prim"] != raydix.MISSING).sum() > 1000
    np.testing.assert_array_equal(there["prim"], here["prim"])
    hit = here["prim"] != raydix.MISSING
    np.testing.assert_allclose(there["t"][hit], here["t"][hit], rtol=1e-9)
    for name in ("u", "v"):
        np.testing.assert_allclose(there[name][hit], here[name][hit], rtol=1e-9, atol=1e-9)
    rounded = raydix.Scene(vertices + UTM, faces).intersect(moved(rays))
    assert (rounded["prim"] != here["prim"]).mean() > 0.5  # what float32 makes of it


def test_points_at_utm_offsets(rng):
    vertices, faces = soup(rng)
    points = on_a_grid(rng.uniform(-2, 2, (3000, 3)))
    here = double(vertices, faces).closest_point(points)
    there = double(vertices + UTM, faces).closest_point(points + UTM)
    np.testing.assert_allclose(there["distance"], here["distance"], rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(there["point"], here["point"] + UTM, rtol=1e-9)
    rounded = raydix.Scene(vertices + UTM, faces).closest_point(points + UTM)
    assert np.median(abs(rounded["distance"] - here["distance"])) > 0.01
    np.testing.assert_allclose(
        np.linalg.norm(there["point"] - (points + UTM), axis=1), there["distance"], atol=1e-8
    )


def test_hits_equal_brute_force_in_float64(rng):
    vertices, faces = soup(rng, 100)
    rays = rays_at_the_origin(rng, 300)
    scene = double(vertices, faces)
    wanted = support.brute_force_hits(vertices, faces, rays)
    hits = scene.intersect(rays)
    np.testing.assert_allclose(hits["t"], wanted.min(axis=1), rtol=1e-12)
    found = scene.all_hits(rays)
    np.testing.assert_array_equal(np.diff(found["offsets"]), np.isfinite(wanted).sum(axis=1))
    np.testing.assert_array_equal(scene.count(rays), np.isfinite(wanted).sum(axis=1))
    np.testing.assert_array_equal(scene.occluded(rays), np.isfinite(wanted).any(axis=1))
    ordered = np.sort(wanted, axis=1)
    np.testing.assert_allclose(found["t"], ordered[np.isfinite(ordered)], rtol=1e-12)
    ray = np.repeat(np.arange(len(rays)), np.diff(found["offsets"]).astype(int))
    np.testing.assert_allclose(found["t"], wanted[ray, found["prim"]], rtol=1e-12)


def test_contains_is_exact_for_a_hundred_thousand_points(rng):
    """A box of 2 mm, 4,500 km away: on its faces, edges and corners too. float32 has a point."""
    lo = np.array([500_000.001, 4_500_000.002, 123.003])
    hi = lo + 0.002
    points = rng.uniform(lo - 0.001, hi + 0.001, (100_000, 3))
    planes = rng.integers(0, 3, (30_000, 3))
    points[:30_000] = np.where(planes == 0, lo, np.where(planes == 1, hi, points[:30_000]))
    wanted = ((points >= lo) & (points <= hi)).all(axis=1)
    assert 10_000 < wanted.sum() < 90_000
    box = support.box_mesh(lo, hi)
    scene = double(*box)
    assert (scene.contains(points) != wanted).sum() == 0
    assert (scene.contains(points, rule="parity") != wanted).sum() == 0
    assert (raydix.Scene(*box).contains(points) != wanted).sum() > 1000
    signed = scene.signed_distance(points[30_000:])
    np.testing.assert_array_equal(signed < 0, wanted[30_000:])
    inside = np.minimum(points - lo, hi - points).min(axis=1)[30_000:]
    np.testing.assert_allclose(-signed[signed < 0], inside[signed < 0], atol=2e-9)
    assert abs(abs(scene.winding_number(points[wanted][-10:])) - 1).max() < 1e-6
    assert scene.closure() == {"closure": "oriented", "open_edges": 0, "rule": "crossings"}


FORMS = {
    "eight": lambda rays: (rays,),
    "eight, float32": lambda rays: (rays.astype(np.float32),),
    "eight, strided": lambda rays: (np.repeat(rays, 2, axis=0)[::2],),
    "eight, the other byte order": lambda rays: (rays.astype(">f8"),),
    "six": lambda rays: (np.concatenate([rays[..., :3], rays[..., 4:7]], axis=-1),),
    "two arrays": lambda rays: (rays[..., :3], rays[..., 4:7]),
    "two arrays, mixed": lambda rays: (rays[..., :3], rays[..., 4:7].astype(np.float32)),
    "few": lambda rays: (rays.reshape(-1, 8)[:5],),
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_and_shapes_of_rays(rng, form):
    vertices, faces = soup(rng, 200)
    # Numbers that float32 has too, so that all forms are the same rays.
    rays = support.random_rays(rng, 4 * 25).astype(np.float64).reshape(4, 25, 8)
    scene = double(vertices, faces)
    given = FORMS[form](rays)
    lead = given[0].shape[:-1]
    hits, wanted = scene.intersect(*given), scene.intersect(rays)
    for name, dtype in (("t", "f8"), ("prim", "u4"), ("u", "f8"), ("v", "f8")):
        assert hits[name].dtype == dtype and hits[name].shape == lead
        same = wanted[name] if lead == (4, 25) else wanted[name].reshape(-1)[: lead[0]]
        np.testing.assert_array_equal(hits[name], same)
    assert scene.occluded(*given).shape == lead and scene.count(*given).shape == lead
    listed = scene.all_hits(*given)
    assert listed["t"].dtype == listed["u"].dtype == "f8" and listed["prim"].dtype == "u4"
    assert len(listed["offsets"]) == np.prod(lead) + 1


def test_limits_are_in_float64():
    scene = double([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    origin, down = [0.2, 0.2, 1.0], [0, 0, -1]
    assert scene.intersect(origin, down)["t"] == 1
    assert not scene.occluded(origin, down, tmax=np.nextafter(1, 0))
    assert not scene.occluded(origin, down, tmin=np.nextafter(1, 2))
    assert scene.occluded([origin] * 2, down, tmin=[1, np.nextafter(1, 2)]).tolist() == [
        True,
        False,
    ]
    bad = [[np.nan, 0, 1, 0, 0, -1], [0.2, 0.2, 1, 0, 0, 0], [0.2, 0.2, 1, 0, 0, np.inf]]
    assert not scene.occluded(bad).any() and scene.count(bad).tolist() == [0, 0, 0]


def test_types_and_shapes_of_points(rng):
    scene = double(*soup(rng, 50))
    points = rng.uniform(-1, 1, (3, 7, 3))
    for given in (points, points.astype(np.float32), points.tolist()):
        near = scene.closest_point(given)
        assert near["point"].shape == (3, 7, 3) and near["point"].dtype == "f8"
        for name, dtype in (("distance", "f8"), ("prim", "u4"), ("u", "f8"), ("v", "f8")):
            assert near[name].shape == (3, 7) and near[name].dtype == dtype
        assert scene.signed_distance(given).dtype == "f8"
        assert scene.contains(given).shape == scene.winding_number(given).shape == (3, 7)
    far = scene.closest_point([[9, 9, 9], [np.nan, 0, 0]], max_distance=1)
    assert far["prim"].tolist() == [raydix.MISSING] * 2 and np.isinf(far["distance"]).all()
    with pytest.raises(ValueError, match="max_distance"):
        scene.closest_point([0, 0, 0], max_distance=-1)


def test_overlaps_and_touches(rng):
    vertices, faces = soup(rng, 300)
    other_vertices, other_faces = soup(rng, 200)
    here, other = double(vertices, faces), double(other_vertices, other_faces)
    there = double(vertices + UTM, faces)
    other_there = double(other_vertices + UTM, other_faces)
    for narrow in (False, True):
        for a, b in ((here.overlaps(narrow=narrow), there.overlaps(narrow=narrow)),
                     (here.overlaps(other, narrow=narrow),
                      there.overlaps(other_there, narrow=narrow))):  # fmt: skip
            assert len(a) > 10 and a.dtype == "u4"
            np.testing.assert_array_equal(a, b)
        assert here.count_overlaps(other, narrow=narrow) == len(here.overlaps(other, narrow=narrow))
        # A scene beside itself is two of the same: nothing is left out.
        again = double(vertices, faces)
        assert here.count_overlaps(here, narrow=narrow) == here.count_overlaps(again, narrow=narrow)
        np.testing.assert_array_equal(here.overlaps(here, narrow=narrow), here.overlaps(again, narrow=narrow))
    corners = vertices[faces]
    lo, hi = corners.min(axis=1), corners.max(axis=1)
    meet = ((lo[:, None] <= hi[None]) & (lo[None] <= hi[:, None])).all(axis=-1)
    assert len(here.overlaps()) == np.triu(meet, 1).sum()  # no corner is shared in a soup
    spheres = np.concatenate([on_a_grid(rng.uniform(-1, 1, (20, 3))), np.full((20, 1), 0.25)], 1)
    segments = on_a_grid(rng.uniform(-1, 1, (20, 6)))
    for a, b in (
        (here.touched_by(spheres=spheres),
         there.touched_by(spheres=spheres + np.append(UTM, 0))),
        (here.touched_by(segments=segments), there.touched_by(segments=segments + np.tile(UTM, 2))),
    ):  # fmt: skip
        assert a["offsets"][-1] > 10
        np.testing.assert_array_equal(a["offsets"], b["offsets"])
        np.testing.assert_array_equal(a["prim"], b["prim"])
    with pytest.raises(TypeError, match="other: expected a scene in float64.*one in float32"):
        here.overlaps(raydix.Scene(vertices, faces))
    with pytest.raises(TypeError, match="other: expected a scene in float32.*one in float64"):
        raydix.Scene(vertices, faces).count_overlaps(here)


def test_refit(rng):
    vertices, faces = soup(rng, 500)
    rays = rays_at_the_origin(rng, 1000)
    scene = double(vertices, faces)
    before = scene.intersect(rays)
    quality = scene.refit(vertices + UTM)
    assert set(quality) == {"sah", "sah_at_build", "ratio"} and quality["ratio"] < 1.1
    assert scene.vertices.dtype == np.float64
    np.testing.assert_array_equal(scene.vertices, vertices + UTM)
    np.testing.assert_array_equal(scene.intersect(moved(rays))["prim"], before["prim"])
    scattered = scene.refit(rng.permutation(vertices))
    assert scattered["ratio"] > 2 and scattered["sah_at_build"] == quality["sah_at_build"]
    scene.refit(vertices)
    for name, values in scene.intersect(rays).items():
        np.testing.assert_array_equal(values, before[name])
    with pytest.raises(ValueError, match=r"vertices: expected shape \(1500, 3\)"):
        scene.refit(vertices[:-1])
    broken = vertices.copy()
    broken[0] = np.nan
    tiny = vertices.copy()
    tiny[:3] = np.array([[0, 0, 0], [1e-13, 0, 0], [0, 1e-13, 0]])
    for wrong in (broken, tiny):
        with pytest.raises(raydix.InputError):
            scene.refit(wrong)
        np.testing.assert_array_equal(scene.intersect(rays)["t"], before["t"])
        np.testing.assert_array_equal(scene.vertices, vertices)


def test_many_threads_ask_at_once(rng):
    """The tree is built once, when the first of them asks; answers are the same as from one."""
    vertices, faces = soup(rng)
    rays, points = moved(rays_at_the_origin(rng)), rng.uniform(-1, 1, (2000, 3)) + UTM
    alone = double(vertices + UTM, faces, threads=1)
    wanted = (alone.intersect(rays)["t"], alone.closest_point(points)["distance"],
              alone.signed_distance(points))  # fmt: skip
    scene, wrong = double(vertices + UTM, faces), []

    def ask():
        for _ in range(3):
            got = (scene.intersect(rays)["t"], scene.closest_point(points)["distance"],
                   scene.signed_distance(points))  # fmt: skip
            wrong.extend(i for i in range(3) if not np.array_equal(got[i], wanted[i]))
            scene.refit(vertices + UTM)

    threads = [threading.Thread(target=ask) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_builders_give_the_same_hits(rng):
    vertices, faces = soup(rng, 300)
    rays = moved(rays_at_the_origin(rng, 500))
    wanted = double(vertices + UTM, faces).intersect(rays)
    for options in [{"builder": name} for name in raydix.builders()] + [{"quality": "high"}]:
        scene = double(vertices + UTM, faces, **options)
        for name, values in scene.intersect(rays).items():
            np.testing.assert_array_equal(values, wanted[name])
        scene.check()
        assert scene.stats()["left_out"] == 0
    assert scene.stats()["builder"] == "sbvh"  # which "high" is
    one = raydix.Scene(vertices, faces, builder="sweep").stats()
    assert scene.stats()["bytes"] > one["bytes"]


def test_empty_and_degenerate_meshes():
    empty = double(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert not empty.occluded([0, 0, 1, 0, 0, -1]) and not empty.contains([0, 0, 0])
    assert empty.closest_point([0, 0, 0])["prim"] == raydix.MISSING
    assert len(empty.overlaps()) == 0 and len(double(np.eye(3), []).faces) == 0
    bad = np.eye(3)
    bad[0, 0] = np.inf
    assert double(bad, [[0, 1, 2]]).stats()["left_out"] == 1
    with pytest.raises(raydix.InputError):
        double(bad, [[0, 1, 2]], strict=True).stats()
    with pytest.raises(ValueError, match="face 0 is"):
        double(np.eye(3), [[0, 1, 3]])
    options = ("ploc", 0, 63, 4, False, 0, "balanced", "fixed", False)
    with pytest.raises(raydix.InputError, match="triangle 0 has an index past the 3 vertices"):
        raydix._core.SceneTreesD(np.eye(3), np.uint32([[0, 1, 9]]), *options)


def test_which_precision():
    box = support.box_mesh([0, 0, 0], [1, 1, 1])
    for given in (None, "float32", np.float32, np.dtype("f4")):
        scene = raydix.Scene(*box, precision=given)
        assert scene.dtype == scene.vertices.dtype == np.float32 and "float64" not in repr(scene)
    for given in ("float64", np.float64, float, np.dtype(np.float64)):
        scene = raydix.Scene(*box, precision=given)
        assert scene.dtype == scene.vertices.dtype == np.float64 and "float64" in repr(scene)
    for wrong in ("double precision", "float16", np.int64, 64):
        with pytest.raises(ValueError, match="precision: expected 'float32' or 'float64'"):
            raydix.Scene(*box, precision=wrong)
    assert double(box[0].astype(np.float32), box[1]).vertices.dtype == np.float64
    builtin = raydix.Scene("builtin:figure?triangles=5000", precision="float64")
    assert builtin.closest_point([0, 0, 0])["distance"].dtype == np.float64


def test_what_is_not_there_says_so(tmp_path):
    scene = double(*support.box_mesh([0, 0, 0], [1, 1, 1]))
    with pytest.raises(NotImplementedError, match="^trees as arrays: not there for a scene in float64"):
        raydix.bvh(scene)
    for device in ("cuda", "opencl"):
        with pytest.raises(raydix.BackendUnavailable, match=f"device='{device}': scenes in float64"):
            double(scene.vertices, scene.faces, device=device)
    with pytest.raises(ValueError, match="precision: files are read in float32"):
        raydix.Scene(tmp_path / "mesh.ply", precision="float64")
