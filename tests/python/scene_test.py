"""Scenes of several geometries: ids, instances, masks, changes and commits."""

import types

import numpy as np
import pytest
import support
from worlds import ALL, BOX, DOWN, random_world, same_hits, same_names, transform, triangles

import raydix

both_precisions = pytest.mark.parametrize("precision", ["float32", "float64"])


@pytest.mark.parametrize("usage", ["fixed", "moving"])
def test_hits_equal_brute_force(rng, usage):
    for _ in range(4):
        world = random_world(rng)
        report = world.scene.commit(usage=usage)
        assert report["meshes"] == 2 and report["instances"] == 3
        assert report["paths"] == world.flat()[1] == 3 + 2 * 2
        rays = support.random_rays(rng, 400)
        rays[:, :3] *= 2
        rays[:50, 7] = 0.7
        masks = rng.integers(0, 16, 400).astype(np.uint32)
        masks[:200] = ALL
        times, names = world.hits(rays, masks)
        hits = world.scene.intersect(rays, masks=masks)
        ordered = np.sort(times, axis=1)
        # Rays that pass an edge within rounding may go either way: there is another triangle just
        # behind, or the ray is left out.
        hit = hits["prim"] != raydix.MISSING
        agree = np.isclose(hits["t"], ordered[:, 0], rtol=1e-4, atol=1e-5) | (
            ~hit & np.isinf(ordered[:, 0])
        )
        assert hit.sum() > 60 and agree.mean() > 0.99
        clear = agree & hit & (ordered[:, 1] > ordered[:, 0] + 1e-3)
        same_names(hits, clear, names[times.argmin(axis=1)])
        np.testing.assert_array_equal(world.scene.occluded(rays, masks=masks), hit)

        counts = np.isfinite(times).sum(axis=1)
        listed = world.scene.all_hits(rays, masks=masks)
        assert (np.diff(listed["offsets"]).astype(int) == counts).mean() > 0.99
        np.testing.assert_array_equal(
            world.scene.count(rays, masks=masks), np.diff(listed["offsets"])
        )
        first = listed["offsets"][:-1][hit].astype(int)
        for name in ("t", "instance", "geometry", "prim"):
            np.testing.assert_array_equal(listed[name][first], hits[name][hit])
        for i in range(400):
            row = slice(int(listed["offsets"][i]), int(listed["offsets"][i + 1]))
            got = {tuple(k) for k in zip(*(listed[n][row].tolist() for n in
                   ("instance", "geometry", "prim")), strict=True)}  # fmt: skip
            if len(got) == counts[i]:
                assert got == {tuple(k) for k in names[np.isfinite(times[i])].tolist()}

        for path, instance, *_ in world.flat()[0]:
            assert world.scene.path(instance) == path
        lo, hi = world.scene.bounds
        flat = np.concatenate([part[4] for part in world.flat()[0]])
        assert (lo <= flat.min(axis=0) + 1e-4).all() and (hi >= flat.max(axis=0) - 1e-4).all()
        assert (hi - lo < 6 * np.ptp(flat, axis=0)).all()  # boxes of boxes, turned


@both_precisions
def test_one_mask_or_one_each(rng, precision):
    world = random_world(rng, precision=precision)
    world.scene.commit()
    rays = support.random_rays(rng, 60)
    rays[:, :3] *= 2
    for mask in (1, 0b1000, ALL):
        wanted = world.scene.intersect(rays, mask=mask)
        for given in (np.full(60, mask, np.uint32), np.int64(mask), [mask]):
            same_hits(world.scene.intersect(rays, masks=given), wanted)
        few = world.scene.intersect(rays[:5], masks=np.full(5, mask, np.uint32))
        same_hits(few, {name: values[:5] for name, values in wanted.items()})
        parts = rays[:, :3].astype(np.float64), rays[:, 4:7]
        same_hits(world.scene.intersect(*parts, mask=mask), wanted)
        shaped = world.scene.intersect(rays.reshape(6, 10, 8), masks=np.full((6, 1), mask))
        assert shaped["geometry"].shape == shaped["instance"].shape == (6, 10)
        same_hits({n: v.reshape(-1) for n, v in shaped.items()}, wanted)
        hit = wanted["prim"] != raydix.MISSING
        assert hit.any()
        np.testing.assert_array_equal(world.scene.occluded(rays, mask=mask), hit)
        np.testing.assert_array_equal(world.scene.occluded(rays[:3], mask=mask), hit[:3])
        np.testing.assert_array_equal(world.scene.count(rays, mask=mask) > 0, hit)
        assert len(world.scene.all_hits(rays, mask=mask)["t"]) >= hit.sum()
    many = np.tile(rays, (40_000, 1))  # more than one piece
    masks = rng.integers(1, 4, len(many)).astype(np.uint32)
    found = world.scene.intersect(many, masks=masks)
    np.testing.assert_array_equal(world.scene.occluded(many, masks=masks),
                                  found["prim"] != raydix.MISSING)  # fmt: skip
    for mask in range(1, 4):
        same_hits(
            {n: v[masks == mask][:60] for n, v in found.items()},
            {n: np.resize(v, len(many))[masks == mask][:60]
             for n, v in world.scene.intersect(rays, mask=mask).items()},
        )  # fmt: skip


@both_precisions
@pytest.mark.parametrize("rays", [1, 5, 2000])
def test_rays_of_mask_0_see_nothing(rays, precision):
    scene, batch = raydix.Scene(*BOX, precision=precision), np.tile(DOWN, (rays, 1))
    assert not scene.occluded(batch, mask=0).any() and scene.occluded(batch).all()
    leaf = raydix.Scene(*BOX, precision=precision)
    scene.add(leaf, np.eye(4) + [[0, 0, 0, 50], [0] * 4, [0] * 4, [0] * 4])
    scene.commit()
    for masks in ({"mask": 0}, {"masks": np.zeros(rays, np.uint32)}):
        assert not scene.occluded(batch, **masks).any()
        assert (scene.intersect(batch, **masks)["prim"] == raydix.MISSING).all()
        assert not scene.count(batch, **masks).any()
    assert scene.occluded(batch).all()


def test_one_mesh_commits_by_itself(rng):
    vertices, faces = triangles(rng, 200, 0.2)
    rays = support.random_rays(rng, 500)
    hits = raydix.Scene(vertices, faces).intersect(rays)
    hit = hits["prim"] != raydix.MISSING
    assert hit.any() and not hit.all()
    np.testing.assert_array_equal(hits["geometry"], np.where(hit, 0, raydix.MISSING))
    assert not hits["instance"].any()
    assert list(hits) == ["t", "prim", "u", "v", "geometry", "instance"]
    scene = raydix.Scene()
    assert scene.add(vertices, faces) == 0
    report = scene.commit(quality="high")
    assert report["meshes"] == report["trees_built"] == 1 and report["triangles"] == 200
    same_hits(scene.intersect(rays), hits)
    assert report["bytes"] > scene.commit(compact=True)["bytes"]
    same_hits(scene.intersect(rays), hits)
    for options in ({"compact": True}, {"usage": "moving"}, {"quality": "fast"}):
        same_hits(raydix.Scene(vertices, faces, **options).intersect(rays), hits)


def test_answers_are_of_the_last_commit():
    scene = raydix.Scene()
    queries = {
        "intersect": lambda: scene.intersect(DOWN),
        "occluded": lambda: scene.occluded(np.tile(DOWN, (20, 1))),
        "count": lambda: scene.count(DOWN),
        "all_hits": lambda: scene.all_hits(DOWN),
        "bounds": lambda: scene.bounds,
        "path": lambda: scene.path(0),
        "render": lambda: scene.render(raydix.Camera(), size=(8, 8)),
        "positions": lambda: scene.positions(raydix.Scene(*BOX).intersect(DOWN)),
        "contains": lambda: scene.contains([0, 0, 0]),
        "vertices": lambda: scene.vertices,
        "stats": scene.stats,
    }
    first = scene.add(*BOX)
    for query in queries.values():
        with pytest.raises(raydix.InputError, match="never committed"):
            query()
    assert not scene.committed and "1 geometry, changes without a commit" in repr(scene)
    assert scene._repr_html_() is None  # notebooks then show repr
    scene.commit()
    assert scene.committed and scene.intersect(DOWN)["t"] == 6 and scene.contains([0, 0, 0])
    scene.update(first, BOX[0] + [0, 0, 5])
    assert not scene.committed and scene.intersect(DOWN)["t"] == 6 and scene.contains([0, 0, 0])
    assert scene.vertices[:, 2].max() == 3
    scene.commit()
    assert scene.intersect(DOWN)["t"] == 1 and not scene.contains([0, 0, 0])
    scene.set_mask(first, 2)
    assert scene.occluded(DOWN, mask=1)
    scene.commit()
    assert not scene.occluded(DOWN, mask=1) and scene.occluded(DOWN, mask=2)
    scene.remove(first)
    assert scene.occluded(DOWN) and len(scene) == 0
    scene.commit()
    assert not scene.occluded(DOWN) and scene.bounds[0, 0] > scene.bounds[1, 0]
    assert scene.closest_point([0, 0, 0])["prim"] == raydix.MISSING and len(scene.faces) == 0
    made = raydix.Scene(*BOX)  # is committed, though nothing has been built
    made.remove(0)
    assert made.occluded(DOWN) and not made.committed


@both_precisions
def test_ids_and_what_there_is(precision):
    scene = raydix.Scene(*BOX, precision=precision)
    assert len(scene) == 1 and 0 in scene
    assert 1 not in scene and "0" not in scene and -1 not in scene
    assert scene.add(*BOX, id=7) == 7 and scene.add(*BOX) == 1
    assert list(scene) == [0, 1, 7] and "3 geometries" in repr(scene)
    scene.remove(1)
    shape = types.SimpleNamespace(vertices=BOX[0], faces=BOX[1])  # as another library has it
    assert scene.add(shape, mask=4) == 2
    assert list(scene) == [0, 2, 7] and 1 not in scene
    for id in (0, 1, 2, 7):
        with pytest.raises(raydix.InputError, match=f"geometry {id}: this id was given before"):
            scene.add(*BOX, id=id)
    for call in (
        lambda: scene.remove(1),
        lambda: scene.set_mask(1, 2),
        lambda: scene.update(1, BOX[0]),
        lambda: scene.set_transform(1, np.eye(4)),
    ):
        with pytest.raises(raydix.InputError, match="there is no geometry 1"):
            call()


def random_change(rng, scene, fresh):
    """One change of `scene`; `fresh` is what a scene with the same geometries is made of."""
    kind = rng.integers(6)
    ids = sorted(fresh)
    id = int(rng.choice(ids)) if ids else None
    if kind == 0 or not ids:
        mesh, mask = triangles(rng, int(rng.integers(0, 30))), int(rng.integers(1, 4))
        fresh[scene.add(*mesh, mask=mask)] = [mask, *mesh]
    elif kind == 1:
        leaf = raydix.Scene(*triangles(rng, 20), precision=scene.dtype)
        place = transform(rng)
        fresh[scene.add(leaf, place)] = [ALL, leaf, place]
    elif kind == 2 and len(ids) > 2:
        scene.remove(id)
        del fresh[id]
    elif kind == 3:
        mask = int(rng.integers(1, 4))
        scene.set_mask(id, mask)
        fresh[id][0] = mask
    elif isinstance(fresh[id][1], raydix.Scene):
        fresh[id][2] = transform(rng)
        scene.set_transform(id, fresh[id][2])
    elif kind == 4:
        fresh[id][1] = fresh[id][1] + np.float32(0.05) * rng.normal(size=3).astype(np.float32)
        scene.update(id, fresh[id][1])
    else:
        fresh[id][1:] = triangles(rng, int(rng.integers(0, 30)))
        scene.update(id, *fresh[id][1:])


@both_precisions
@pytest.mark.parametrize("usage", ["fixed", "moving"])
def test_changes_equal_a_fresh_scene(rng, usage, precision):
    scene, geometries = raydix.Scene(usage=usage, precision=precision), {}
    rays = support.random_rays(rng, 300)
    for _ in range(40):
        for _ in range(int(rng.integers(1, 4))):
            random_change(rng, scene, geometries)
        scene.commit()
        fresh = raydix.Scene(precision=precision)
        for id, (mask, *parts) in sorted(geometries.items()):
            fresh.add(*parts, mask=mask, id=id)
        fresh.commit()
        assert list(scene) == list(fresh) == sorted(geometries)
        for mask in (1, ALL):
            same_hits(scene.intersect(rays, mask=mask), fresh.intersect(rays, mask=mask))
            same_hits(scene.all_hits(rays, mask=mask), fresh.all_hits(rays, mask=mask))
        np.testing.assert_array_equal(scene.bounds, fresh.bounds)


@both_precisions
def test_commits_tell_what_they_did(rng, precision):
    vertices, faces = triangles(rng, 500, 0.1)
    scene = raydix.Scene(usage="moving", precision=precision)
    ids = [scene.add(vertices + np.float32([4 * i, 0, 0]), faces) for i in range(3)]
    report = scene.commit()
    assert set(report) == {"ms", "meshes", "instances", "triangles", "trees_built", "trees_refitted",
                           "sah_ratio", "parts_refitted", "bytes", "paths", "shapes", "primitives", "left_out"}  # fmt: skip
    assert report["meshes"] == report["trees_built"] == 3 and report["triangles"] == 1500
    assert report["left_out"] == 0
    scene.update(ids[1], vertices * np.float32(1.01))
    report = scene.commit()  # still moving
    assert report["trees_refitted"] == 1 and report["trees_built"] == 0
    assert 0.9 < report["sah_ratio"] < 1.5
    scene.update(ids[1], rng.permutation(vertices))
    report = scene.commit()
    assert report["trees_built"] == 1 and report["sah_ratio"] > 1.5
    scene.update(ids[1], rng.permutation(vertices))
    assert scene.commit(refit_limit=1e9)["trees_refitted"] == 1
    scene.update(ids[1], vertices)
    assert scene.commit(refit_limit=0)["trees_built"] == 1
    assert scene.commit(usage="fixed")["trees_built"] == 1  # one for all
    assert scene.commit()["trees_built"] == 0


@both_precisions
def test_scenes_that_are_placed_change(rng, precision):
    leaf = raydix.Scene(precision=precision)
    id = leaf.add(*BOX)
    world = raydix.Scene(precision=precision)
    world.add(leaf, np.eye(4))
    with pytest.raises(raydix.InputError, match="instance 0: .* never committed"):
        world.commit()
    leaf.commit()
    world.commit()
    assert world.intersect(DOWN)["t"] == 6
    leaf.update(id, BOX[0] + [0, 0, 2])
    leaf.commit()
    assert leaf.intersect(DOWN)["t"] == 4 and world.intersect(DOWN)["t"] == 6
    world.commit()
    assert world.intersect(DOWN)["t"] == 4
    leaf.refit(BOX[0])
    world.commit()
    assert world.intersect(DOWN)["t"] == 6
    del leaf
    world.commit()  # it keeps what it places
    hits = world.intersect(DOWN)
    assert hits["instance"] == 1 and world.path(1) == [0] and world.path(0) == []
    with pytest.raises(raydix.InputError, match="no path 2"):
        world.path(2)


@both_precisions
def test_many_places_at_once(rng, precision):
    """M transforms in one call are M calls."""
    leaf = raydix.Scene(*triangles(rng, 30), precision=precision)
    places = np.stack([transform(rng, mirror=i % 2 == 0) for i in range(20)])
    masks = rng.integers(1, 4, 20)
    whole, single = raydix.Scene(precision=precision), raydix.Scene(precision=precision)
    ids = whole.add(leaf, places, mask=masks)
    assert ids.tolist() == list(range(20)) and ids.dtype == np.uint32
    for place, mask in zip(places, masks, strict=True):
        single.add(leaf, np.vstack([place, [0, 0, 0, 1]]), mask=mask)
    rays = support.random_rays(rng, 300)
    for scene in (whole, single):
        assert scene.commit()["paths"] == 20
    same_hits(whole.intersect(rays, mask=1), single.intersect(rays, mask=1))
    moved = places[::-1]
    whole.set_transform(ids, moved)
    whole.set_mask(ids, 2)
    for id, place in zip(ids, moved, strict=True):
        single.set_transform(id, place)
        single.set_mask(int(id), 2)
    whole.commit()
    single.commit()
    wanted = single.intersect(rays)
    same_hits(whole.intersect(rays), wanted)
    assert (wanted["instance"] > 0).any() and not whole.occluded(rays, mask=1).any()
    flat = places.copy()
    flat[7] = 0
    for call in (lambda: whole.set_transform(ids, flat), lambda: whole.add(leaf, flat)):
        with pytest.raises(raydix.InputError, match="singular or not finite"):
            call()
        assert whole.committed
    with pytest.raises(raydix.InputError, match="transform, row 7: "):
        whole.add(leaf, flat)
    assert len(whole) == 20
    assert whole.add(leaf, places[0]) == 20  # no number was given
    whole.remove(20)
    whole.commit()
    same_hits(whole.intersect(rays), wanted)  # none of them has moved
    whole.set_transform(ids[:0], flat[:0])
    assert len(whole.add(leaf, flat[:0])) == 0


@both_precisions
def test_the_scene_has_its_own_copies(rng, precision):
    vertices, faces = BOX[0].astype(precision), BOX[1].astype(np.uint32)
    scene = raydix.Scene(precision=precision)
    for _ in range(2):
        scene.add(vertices, faces)
    vertices += 100
    scene.commit()
    assert scene.occluded(DOWN)
    scene.update(0, vertices)
    scene.update(1, vertices)
    vertices -= 100
    faces[:] = 0
    scene.commit()
    assert not scene.occluded(DOWN) and scene.bounds[0, 0] == 99


def test_points_and_normals_of_hits(rng):
    """Against the triangles, moved to the world in float64."""
    world = random_world(rng)
    world.scene.commit()
    rays = support.random_rays(rng, 600)
    rays[:, :3] *= 2
    hits = world.scene.intersect(rays.reshape(20, 30, 8))
    points, normals = world.scene.positions(hits), world.scene.normals(hits)
    assert points.shape == normals.shape == (20, 30, 3) and points.dtype == normals.dtype == "f4"
    hit = hits["prim"] != raydix.MISSING
    assert hit.sum() > 60
    assert np.isnan(points[~hit]).all() and np.isnan(normals[~hit]).all()
    along = rays.reshape(20, 30, 8)
    np.testing.assert_allclose(
        points[hit],
        along[hit][:, :3] + hits["t"][hit][:, None] * along[hit][:, 4:7],
        atol=1e-4,
    )
    parts = {(instance, geometry): (vertices, faces, path)
             for path, instance, geometry, _, vertices, faces in world.flat()[0]}  # fmt: skip
    for i, j in np.argwhere(hit):
        vertices, faces, _ = parts[hits["instance"][i, j], hits["geometry"][i, j]]
        a, b, c = vertices[faces[hits["prim"][i, j]]]
        wanted = np.cross(b - a, c - a)
        sine = np.linalg.norm(np.cross(wanted, normals[i, j])) / np.linalg.norm(wanted)
        assert sine < 1e-3 and abs(np.linalg.norm(normals[i, j]) - 1) < 1e-5
    listed = world.scene.all_hits(rays)
    assert world.scene.positions(listed).shape == (len(listed["t"]), 3)
    one = world.scene.intersect(rays[np.flatnonzero(hit.reshape(-1))[0]])
    assert world.scene.positions(one).shape == (3,)
    box = raydix.Scene()
    mirror = box.add(raydix.Scene(*BOX), np.diag([1, 1, -1, 1]))
    box.commit()
    assert box.normals(box.intersect(DOWN)).tolist() == [0, 0, 1]  # the outside stays outside
    wrong = box.intersect(DOWN)
    box.remove(mirror)
    box.commit()
    with pytest.raises(raydix.InputError, match="path"):
        box.positions(wrong)
    for bad in ({}, wrong["t"], None, {"t": np.zeros(3)}):
        with pytest.raises(TypeError, match="hits: expected a dict of arrays t, prim"):
            box.normals(bad)


def test_vertices_of_a_commit_are_kept(rng):
    """`positions` reads the mesh that the last commit saw, of scenes that are placed too."""
    leaf, world = raydix.Scene(*BOX), raydix.Scene()
    world.add(leaf, np.eye(4))
    world.commit()
    hits, own = world.intersect(DOWN), leaf.intersect(DOWN)
    leaf.update(0, BOX[0] + 100)
    assert leaf.positions(own).tolist() == [0, 0, 3]
    leaf.commit()
    leaf.refit(BOX[0] + 200)
    leaf.remove(0)
    leaf.commit()
    del leaf
    rng.normal(size=100_000)  # something else where the old arrays were
    assert world.positions(hits).tolist() == [0, 0, 3]


@pytest.mark.parametrize("below_changes", [False, True])
def test_few_moved_instances(rng, below_changes):
    """Commits of few moves give what a scene made afresh gives, and hits their attributes."""
    rays = np.concatenate([rng.uniform(-1, 9, (300, 3)), rng.normal(size=(300, 3))], axis=1)
    leaf = raydix.Scene(*BOX)
    leaf.set_attributes(0, h=np.arange(8.0))
    places = np.tile(np.eye(4)[:3], (64, 1, 1))
    places[:, :, 3] = 2 * np.stack(np.unravel_index(np.arange(64), (4, 4, 4)), axis=1)
    scene = raydix.Scene()
    ids = scene.add(leaf, places)
    scene.commit(usage="moving")
    for _ in range(6):
        which = int(rng.integers(64))
        places[which, :, 3] += rng.uniform(-0.4, 0.4, 3)
        scene.set_transform(ids[which], places[which])
        if below_changes:
            leaf.update(0, leaf.vertices * 0.95, leaf.faces)
            leaf.commit()
            leaf.set_attributes(0, h=np.arange(8.0))
        report = scene.commit(usage="moving")
        assert report["parts_refitted"] and report["trees_built"] == 0 and report["instances"] == 64
        fresh = raydix.Scene()
        fresh.add(leaf, places)
        fresh.commit()
        hits, wanted = (s.intersect(rays, also="h") for s in (scene, fresh))
        assert hits.hit.any()
        for name in ("t", "prim", "instance", "h"):
            np.testing.assert_array_equal(hits[name], wanted[name])
