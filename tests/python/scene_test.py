"""Scenes of several geometries: ids, instances, masks, changes and commits."""

import base64
import concurrent.futures
import json
import subprocess
import sys
import threading
import types

import numpy as np
import pytest
import support

import raydix

BOX = support.box_mesh([-1, -2, -3], [1, 2, 3])
DOWN = [0, 0, 9, 0, 0, -1]
ALL = 0xFFFFFFFF


def transform(rng, mirror=False, shear=0.0):
    """A turn, a size, a shear and a move: (3, 4) float32."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if (np.linalg.det(turn) < 0) != mirror:
        turn[:, 0] *= -1
    slide = np.eye(3)
    slide[0, 1] = shear
    linear = turn @ slide @ np.diag(rng.uniform(0.5, 1.5, 3))
    return np.concatenate([linear, rng.uniform(-2, 2, (3, 1))], axis=1).astype(np.float32)


class World:
    """A scene, and the same once more as plain data, to look at every triangle."""

    def __init__(self, **options):
        self.scene = raydix.Scene(**options)
        self.parts = {}  # id -> (mask, vertices, faces) or (mask, transform, world)

    def add_mesh(self, vertices, faces, mask=ALL, **options):
        id = self.scene.add(vertices, faces, mask=mask, **options)
        self.parts[id] = (mask, vertices, faces)
        return id

    def add_instance(self, world, place, mask=ALL, **options):
        id = self.scene.add(world.scene, place, mask=mask, **options)
        self.parts[id] = (mask, place, world)
        return id

    def flat(self):
        """(path, instance, geometry, masks on the way, vertices in float64, faces), and how many
        paths."""
        found, paths = [], 0
        for id in sorted(self.parts):
            mask, what, below = self.parts[id]
            if not isinstance(below, World):
                found.append(([], 0, id, [mask], what.astype(np.float64), below))
                continue
            first = paths + 1
            inner, more = below.flat()
            paths += 1 + more
            what = np.float64(what)
            for path, instance, geometry, masks, vertices, faces in inner:
                moved = vertices @ what[:, :3].T + what[:, 3]
                found.append(
                    ([id, *path], first + instance, geometry, [mask, *masks], moved, faces)
                )
        return found, paths

    def hits(self, rays, masks):
        """t of every triangle for every ray, infinity where there is no hit, and what each
        triangle is: (instance, geometry, prim)."""
        times, names = [], []
        for _, instance, geometry, on_way, vertices, faces in self.flat()[0]:
            t = support.brute_force_hits(vertices, faces, rays)
            seen = np.logical_and.reduce([(masks & mask) != 0 for mask in on_way])
            times.append(np.where(seen[:, None], t, np.inf))
            names += [(instance, geometry, prim) for prim in range(len(faces))]
        return np.concatenate(times, axis=1), np.array(names)


def triangles(rng, count, size=0.6):
    return support.random_triangles(rng, count, size)


def random_world(rng):
    """Meshes and instances on three levels, some mirrored, some sheared, some behind masks."""
    leaf = World()
    leaf.add_mesh(*triangles(rng, 12))
    leaf.add_mesh(*triangles(rng, 9), mask=0b0111, id=4)
    leaf.scene.commit()
    middle = World()
    middle.add_instance(leaf, transform(rng, mirror=True))
    middle.add_mesh(*triangles(rng, 7))
    middle.add_instance(leaf, transform(rng, shear=0.7), mask=0b1101)
    middle.scene.commit()
    world = World()
    world.add_instance(middle, transform(rng), mask=0b1110)
    world.add_mesh(*triangles(rng, 15))
    world.add_instance(leaf, transform(rng, mirror=True, shear=-0.4))
    world.add_instance(middle, transform(rng, mirror=True))
    world.add_mesh(*triangles(rng, 5), mask=0b0010)
    return world


def same_hits(found, wanted):
    for name, values in wanted.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


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
        best = names[times.argmin(axis=1)]
        for i, name in enumerate(("instance", "geometry", "prim")):
            np.testing.assert_array_equal(hits[name][clear], best[clear, i])
            assert hits[name].dtype == np.uint32
        assert set(hits["instance"][~hit]) <= {0}
        assert set(hits["geometry"][~hit]) <= {raydix.MISSING}
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


def test_one_mask_or_one_each(rng):
    world = random_world(rng)
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


LISTS = "lists of rays do not ask for masks at meshes whose own mask has all bits (scene_walk.h)"


@pytest.mark.parametrize(
    "rays", [1, 5, pytest.param(2000, marks=pytest.mark.xfail(reason=LISTS, strict=True))]
)
def test_rays_of_mask_0_see_nothing(rays):
    scene, batch = raydix.Scene(*BOX), np.tile(DOWN, (rays, 1))
    assert not scene.occluded(batch, mask=0).any() and scene.occluded(batch).all()
    scene.add(raydix.Scene(*BOX), np.eye(4) + [[0, 0, 0, 50], [0] * 4, [0] * 4, [0] * 4])
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


def test_ids_and_what_there_is():
    scene = raydix.Scene(*BOX)
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
        leaf, place = raydix.Scene(*triangles(rng, 20)), transform(rng)
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


@pytest.mark.parametrize("usage", ["fixed", "moving"])
def test_changes_equal_a_fresh_scene(rng, usage):
    scene, geometries = raydix.Scene(usage=usage), {}
    rays = support.random_rays(rng, 300)
    for _ in range(40):
        for _ in range(int(rng.integers(1, 4))):
            random_change(rng, scene, geometries)
        scene.commit()
        fresh = raydix.Scene()
        for id, (mask, *parts) in sorted(geometries.items()):
            fresh.add(*parts, mask=mask, id=id)
        fresh.commit()
        assert list(scene) == list(fresh) == sorted(geometries)
        for mask in (1, ALL):
            same_hits(scene.intersect(rays, mask=mask), fresh.intersect(rays, mask=mask))
            same_hits(scene.all_hits(rays, mask=mask), fresh.all_hits(rays, mask=mask))
        np.testing.assert_array_equal(scene.bounds, fresh.bounds)


def test_commits_tell_what_they_did(rng):
    vertices, faces = triangles(rng, 500, 0.1)
    scene = raydix.Scene(usage="moving")
    ids = [scene.add(vertices + np.float32([4 * i, 0, 0]), faces) for i in range(3)]
    report = scene.commit()
    assert set(report) == {"ms", "meshes", "instances", "triangles", "trees_built",
                           "trees_refitted", "sah_ratio", "bytes", "paths"}  # fmt: skip
    assert report["meshes"] == report["trees_built"] == 3 and report["triangles"] == 1500
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


def test_scenes_that_are_placed_change(rng):
    leaf = raydix.Scene()
    id = leaf.add(*BOX)
    world = raydix.Scene()
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


def test_many_places_at_once(rng):
    """M transforms in one call are M calls."""
    leaf = raydix.Scene(*triangles(rng, 30))
    places = np.stack([transform(rng, mirror=i % 2 == 0) for i in range(20)])
    masks = rng.integers(1, 4, 20)
    whole, single = raydix.Scene(), raydix.Scene()
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
    assert len(whole) == 20
    whole.commit()
    same_hits(whole.intersect(rays), wanted)  # none of them has moved
    whole.set_transform(ids[:0], flat[:0])
    assert len(whole.add(leaf, flat[:0])) == 0


def test_queries_of_one_mesh_name_what_stands_in_the_way(rng):
    mesh = raydix.Scene(*BOX)
    placed, pair = raydix.Scene(), raydix.Scene(*BOX)
    placed.add(mesh, np.eye(4))
    placed.commit()
    pair.add(*BOX)
    pair.commit()
    both = raydix.Scene(*BOX)
    both.add(mesh, np.eye(4), id=3)
    both.commit()
    points = np.zeros((3, 3))
    calls = {
        "closest_point": lambda s: s.closest_point(points),
        "signed_distance": lambda s: s.signed_distance(points),
        "contains": lambda s: s.contains(points),
        "winding_number": lambda s: s.winding_number(points),
        "overlaps": lambda s: s.overlaps(),
        "overlaps ": lambda s: mesh.overlaps(s),
        "overlaps  ": lambda s: s.count_overlaps(mesh),
        "touched_by": lambda s: s.touched_by(spheres=[[0, 0, 0, 1]]),
        "closure": lambda s: s.closure(),
        "stats": lambda s: s.stats(),
        "wide_stats": lambda s: s.wide_stats(),
        "info": lambda s: s.info(),
        "check": lambda s: s.check(),
        "refit": lambda s: s._core.refit(BOX[0].astype(np.float32)),
        "vertices": lambda s: s.vertices,
        "faces": lambda s: s.faces,
    }
    for scene, text in (
        (placed, "geometry 0 is an instance"),
        (pair, "geometry 1 is a second mesh"),
        (both, "geometry 3 is an instance"),
    ):
        for name, call in calls.items():
            with pytest.raises(raydix.InputError, match=f"^{name.strip()}: {text}.*one mesh"):
                call(scene)
        assert "geometr" in repr(scene)
        assert "geometries" in scene._repr_html_() and "data:image" in scene._repr_html_()
        rays = scene.primary_rays(size=(32, 32))["rays"]
        seen = int(scene.occluded(rays).sum())
        assert seen > 0 and scene.secondary_rays(rays, samples=2).shape == (2 * seen, 8)
        picture = scene.render(view="normal", size=(32, 32))
        assert (picture.max(axis=2) > 0).sum() == seen
    pair.remove(0)
    pair.commit()  # one mesh, with id 1
    assert pair.contains([0, 0, 0]) and pair.intersect(DOWN)["geometry"] == 1
    both.remove(0)
    with pytest.raises(raydix.InputError, match="the scene would hold itself"):
        mesh.add(both, np.eye(4))
    with pytest.raises(raydix.InputError, match="the scene would hold itself"):
        both.add(both, np.eye(4))


def test_errors_of_changes(rng):
    scene, leaf = raydix.Scene(*BOX), raydix.Scene(*BOX)
    instance = scene.add(leaf, np.eye(4))
    scene.commit()
    before = scene.intersect(DOWN)
    wrong_transforms = {
        "expected shape": (np.eye(3), np.zeros((2, 2, 3, 4)), np.zeros(12)),
        "last row": (np.ones((4, 4)),),
        "singular or not finite": (
            np.zeros((3, 4)),
            np.full((3, 4), np.nan),
            np.eye(4) * [1, 1, 0, 1],
        ),
    }
    for text, values in wrong_transforms.items():
        for value in values:
            for call in (lambda v: scene.add(leaf, v), lambda v: scene.set_transform(instance, v)):
                with pytest.raises(ValueError, match=text):
                    call(value)
    for wrong in ("ab", None, np.array(["a"])):
        with pytest.raises(TypeError, match="transform: expected"):
            scene.add(leaf, wrong)
    with pytest.raises(TypeError, match="given int alone"):
        scene.add(3)
    with pytest.raises(TypeError, match="faces"):
        scene.add(BOX[0], np.eye(4))
    for id in (-1, 2**32, 1.5):
        with pytest.raises(ValueError, match="id: expected a whole number"):
            scene.remove(id)
    for mask in (-1, 2**32, np.nan):
        for call in (lambda m: scene.add(*BOX, mask=m), lambda m: scene.set_mask(0, m),
                     lambda m: scene.intersect(DOWN, mask=m)):  # fmt: skip
            with pytest.raises(ValueError, match="mask: expected a whole number"):
                call(mask)
    rays = np.tile(DOWN, (10, 1))
    for masks, error in ((np.zeros(9, int), ValueError), (-np.ones(10, int), ValueError),
                         (np.zeros(10), TypeError), ("three", TypeError)):  # fmt: skip
        with pytest.raises(error, match="masks: expected"):
            scene.intersect(rays, masks=masks)
    with pytest.raises(ValueError, match="mask, masks: expected one of them"):
        scene.intersect(rays, mask=1, masks=np.ones(10, int))
    with pytest.raises(raydix.InputError, match="is an instance, not a mesh"):
        scene.update(instance, BOX[0])
    with pytest.raises(raydix.InputError, match="is a mesh, not an instance"):
        scene.set_transform(0, np.eye(4))
    with pytest.raises(raydix.InputError, match="index past the 4 vertices"):
        scene.update(0, BOX[0][:4])
    with pytest.raises(ValueError, match=r"faces: face 0 is \[0, 0, 9\]"):
        scene.update(0, BOX[0], [[0, 0, 9]])
    with pytest.raises(ValueError, match="expected None for 2 transforms"):
        scene.add(leaf, np.tile(np.eye(4), (2, 1, 1)), id=9)
    with pytest.raises(ValueError, match="mask: expected one or 2, given 3"):
        scene.add(leaf, np.tile(np.eye(4), (2, 1, 1)), mask=[1, 2, 3])
    with pytest.raises(ValueError, match="transform: expected 1, one for each id, given 2"):
        scene.set_transform(instance, np.tile(np.eye(4), (2, 1, 1)))
    for options in ({"quality": "best"}, {"usage": "often"}, {"refit_limit": -1}, {"threads": -1},
                    {"refit_limit": np.nan}):  # fmt: skip
        with pytest.raises(ValueError, match=f"{next(iter(options))}: expected"):
            scene.commit(**options)
    with pytest.raises(ValueError, match="usage: expected one of fixed, moving, given 'often'"):
        raydix.Scene(usage="often")
    with pytest.raises(TypeError, match="vertices: expected"):
        raydix.Scene(faces=BOX[1])
    assert list(scene) == [0, instance] and scene.committed
    same_hits(scene.intersect(DOWN), before)
    far = raydix.Scene()
    far.add(leaf, np.eye(4) * [1e12, 1, 1, 1])
    with pytest.raises(raydix.InputError, match="instance 0: it reaches beyond"):
        far.commit()
    with pytest.raises(raydix.InputError, match="never committed"):
        far.intersect(DOWN)


def test_strict_scenes():
    bad = np.concatenate([BOX[0], [[np.nan, 0, 0]]])
    faces = np.concatenate([BOX[1], [[8, 0, 1], [0, 1, 2], [8, 8, 8]]])
    scene = raydix.Scene(strict=True)
    for call in (lambda: scene.add(bad, faces), lambda: raydix.Scene(bad, faces, strict=True)):
        with pytest.raises(raydix.InputError, match="triangle 12 is not finite .* as are 1 others"):
            call()
    id = scene.add(*BOX)
    with pytest.raises(raydix.InputError, match="geometry 0: triangle 12"):
        scene.update(id, bad, faces)
    assert len(scene) == 1 and raydix.Scene(bad, faces).commit()["triangles"] == 15


def test_the_scene_has_its_own_copies(rng):
    vertices, faces = BOX[0].astype(np.float32), BOX[1].astype(np.uint32)
    scene = raydix.Scene()
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


def test_float64_scenes_are_one_mesh():
    scene = raydix.Scene(*BOX, precision="float64")
    hits = scene.intersect([DOWN, [9, 9, 9, 0, 0, -1]])
    assert hits["geometry"].tolist() == [0, raydix.MISSING] and hits["instance"].tolist() == [0, 0]
    assert hits["geometry"].dtype == hits["instance"].dtype == np.uint32
    assert scene.intersect(DOWN)["geometry"].shape == ()
    assert scene.all_hits(DOWN)["geometry"].tolist() == [0, 0]
    assert len(scene) == 1 and list(scene) == [0] and 0 in scene and 1 not in scene
    assert scene.committed and scene.bounds.tolist() == [[-1, -2, -3], [1, 2, 3]]
    other = raydix.Scene()
    for name, call in {
        "an empty scene": lambda: raydix.Scene(precision="float64"),
        "usage='moving'": lambda: raydix.Scene(*BOX, precision="float64", usage="moving"),
        "compact=True": lambda: raydix.Scene(*BOX, precision="float64", compact=True),
        "add": lambda: scene.add(*BOX),
        "add ": lambda: other.add(scene, np.eye(4)),
        "update": lambda: scene.update(0, BOX[0]),
        "remove": lambda: scene.remove(0),
        "set_transform": lambda: scene.set_transform(0, np.eye(4)),
        "set_mask": lambda: scene.set_mask(0, 1),
        "commit": scene.commit,
        "path": lambda: scene.path(0),
        "mask": lambda: scene.occluded(DOWN, mask=1),
        "masks": lambda: scene.count(DOWN, masks=1),
        "positions": lambda: scene.positions(hits),
        "normals": lambda: scene.normals(hits),
    }.items():
        text = f"^{name.strip()}: not there .* float64"
        with pytest.raises(NotImplementedError, match=text):
            call()
    with pytest.raises(raydix.InputError, match="mask"):
        scene._core.occluded(np.zeros((1, 8)), np.zeros(1, bool), 1)


def test_threads_trace_while_others_commit(rng):
    """Each answer is of one commit, whole; scenes that hold each other do not wait for ever."""
    leaf = raydix.Scene(*triangles(rng, 300, 0.2))
    world, top = raydix.Scene(usage="moving"), raydix.Scene()
    id = world.add(leaf, np.eye(4))
    world.add(leaf, transform(rng))
    world.commit()
    top.add(world, np.eye(4))
    top.commit()
    rays = support.random_rays(rng, 100)
    places = np.eye(4), np.eye(4) + [[0, 0, 0, 0.3], [0] * 4, [0] * 4, [0] * 4]
    states = []
    for place in places:
        world.set_transform(id, place)
        world.commit()
        states.append(world.intersect(rays)["t"].tobytes())
    assert states[0] != states[1]
    seen, done = set(), threading.Event()

    def ask(scene):
        while not done.is_set():
            seen.add(scene.intersect(rays)["t"].tobytes())
            leaf.contains([[0, 0, 0]])

    def change_top():
        while not done.is_set():
            top.commit()
            raydix.Scene().add(top, np.eye(4))

    def change_leaf():
        while not done.is_set():
            leaf.set_mask(0, ALL)
            leaf.commit()

    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        jobs = [pool.submit(ask, scene) for scene in (world, world, top)]
        jobs += [pool.submit(change_top), pool.submit(change_leaf)]
        for i in range(60):
            world.set_transform(id, places[i % 2])
            world.commit()
        done.set()
        for job in jobs:
            job.result(timeout=60)
    assert seen <= set(states)


def run_python(code):
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


MEMORY = """
import numpy as np
import raydix
def held():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096
warm = raydix.Scene("builtin:figure?triangles=5000")
warm.occluded(np.zeros((100, 8), np.float32))
shape = raydix.Scene("builtin:figure?triangles=1000000")
vertices, faces = shape.vertices.copy(), shape.faces.copy()
del shape
start = held()
scene = raydix.Scene(vertices, faces)
copied = held()
scene.occluded(np.zeros((100, 8), np.float32))
traced = held()
arrays, wide = vertices.nbytes + faces.nbytes, scene.commit()["bytes"]
binary = scene.stats()["bytes"]
print(copied - start, traced - copied, held() - traced, arrays, wide, binary)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_rays_need_no_binary_tree():
    """A scene of one mesh holds one copy of the arrays, and what rays read once they are traced."""
    copied, traced, asked, arrays, wide, binary = map(int, run_python(MEMORY))
    assert copied < arrays + 10_000_000
    assert traced < wide + 0.6 * binary  # scratch memory that was not given back counts too
    assert asked > 0.5 * binary


def test_a_signal_handler_may_not_commit():
    """A commit would wait for the batch that the handler interrupted: an error, not a hang."""
    out = run_python("""
import signal
import numpy as np
import raydix
scene = raydix.Scene("builtin:figure?triangles=20000")
refused = []
def handler(*_):
    try:
        scene.commit()
    except raydix.InputError as error:
        refused.append(str(error))
signal.signal(signal.SIGALRM, handler)
signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
while not refused:
    scene.occluded(np.broadcast_to(np.float32([0, 50, 0]), (20_000_000, 3)), np.float32([0, 0, 1]))
signal.setitimer(signal.ITIMER_REAL, 0)
scene.commit()
print(refused[0])
""")
    assert out[0] == "commit:" and "handler" in out


def test_a_signal_handler_in_a_commit():
    """It may not ask the scene, which is locked: an error, not a hang. What it throws ends the
    commit, and the scene stays as it was."""
    out = run_python("""
import signal
import numpy as np
import raydix
random = np.random.default_rng(1)
scene = raydix.Scene("builtin:figure?triangles=20000")
wanted = scene.occluded([0, 0, 0, 0, 1, 0])
n = 400_000
scene.add(random.random((n, 3)), random.integers(0, n, (n, 3)))
refused = []
def handler(*_):
    for call in (scene.commit, lambda: scene.occluded([0, 0, 0, 0, 1, 0])):
        try:
            call()
        except raydix.InputError as error:
            refused.append(str(error))
    raise KeyError("enough")
signal.signal(signal.SIGALRM, handler)
signal.setitimer(signal.ITIMER_REAL, 0.2)
try:
    scene.commit(quality="high", threads=1)
    print("done")
except KeyError as error:
    signal.setitimer(signal.ITIMER_REAL, 0)
    print(error.args[0], len(refused), scene.committed, scene.occluded([0, 0, 0, 0, 1, 0]) == wanted)
    print(refused[0])
    scene.remove(1)
    print(scene.commit()["meshes"])
""")
    assert out[:4] == ["enough", "2", "False", "True"] and out[-1] == "1"
    assert "handler" in out


def test_hits_of_trees_are_given_a_geometry():
    """Rows of four, as a GPU gives them: t, prim, u, v."""
    rows = np.zeros((2, 3, 4), np.float32)
    rows.view(np.uint32)[..., 1] = [[0, raydix.MISSING, 5]] * 2
    columns = raydix._rays.hit_columns(rows, 7)
    assert columns["prim"].tolist() == [[0, raydix.MISSING, 5]] * 2
    assert columns["geometry"].tolist() == [[7, raydix.MISSING, 7]] * 2
    assert not columns["instance"].any() and columns["instance"].dtype == np.uint32


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


def triangle_gltf(nodes, roots, meshes=2):
    """One triangle and one of twice its size, as two meshes of a glTF document, or the first."""
    corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [2, 0, 0], [0, 2, 0]])
    data = base64.b64encode(corners.tobytes()).decode()
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": roots}],
            "nodes": nodes,
            "meshes": [{"primitives": [{"attributes": {"POSITION": i}}]} for i in range(meshes)],
            "accessors": [
                {"bufferView": i, "componentType": 5126, "count": 3, "type": "VEC3"}
                for i in range(2)
            ],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 36 * i, "byteLength": 36} for i in range(2)
            ],
            "buffers": [{"uri": f"data:application/octet-stream;base64,{data}", "byteLength": 72}],
        }
    )


def test_files_keep_their_nodes(tmp_path):
    file = tmp_path / "nodes.gltf"
    nodes = [
        {"mesh": 0, "translation": [10, 0, 0], "children": [1]},
        {"mesh": 1, "translation": [0, 10, 0]},
        {"mesh": 0},
    ]
    file.write_text(triangle_gltf(nodes, [0, 2]))
    scene = raydix.Scene(file)
    assert scene.name == "nodes.gltf" and scene.committed and len(scene.cameras) == 1
    assert len(scene) == 2 and "2 geometries" in repr(scene)
    first, last = scene
    rays = [[x, y, 1, 0, 0, -1] for x, y in ((10.2, 0.2), (10.9, 10.9), (0.2, 0.2), (0.9, 0.9))]
    hits = scene.intersect(rays)
    assert hits["t"].tolist() == [1, 1, 1, np.inf]
    assert hits["geometry"].tolist() == [0, 1, 0, raydix.MISSING]
    assert hits["prim"].tolist() == [0, 0, 0, raydix.MISSING]
    assert [scene.path(int(i))[:1] for i in hits["instance"]] == [[first], [first], [last], []]
    assert len(scene.path(int(hits["instance"][1]))) == 2
    with pytest.raises(raydix.InputError, match=f"geometry {first} is an instance"):
        scene.closest_point([0, 0, 0])
    with pytest.raises(raydix.InputError, match="vertices"):
        raydix.Scene(scene)
    scene.set_transform(last, np.eye(4) + [[0] * 4, [0] * 4, [0, 0, 0, 0.5], [0] * 4])
    scene.set_mask(first, 2)
    with pytest.raises(raydix.InputError, match="singular"):
        scene.set_transform([last, first], np.stack([np.eye(4), np.eye(4) * [0, 1, 1, 1]]))
    with pytest.raises(raydix.InputError, match="is an instance, not a mesh"):
        scene.update(first, BOX[0])
    scene.commit()
    assert scene.intersect(rays)["t"].tolist() == [1, 1, 0.5, np.inf]
    assert scene.occluded(rays, mask=1).tolist() == [False, False, True, False]
    world = raydix.Scene()
    world.add(scene, np.eye(4))
    scene.remove(first)
    scene.commit()
    assert world.commit()["paths"] == 2
    assert world.occluded(rays).tolist() == [False, False, True, False]

    file.write_text(triangle_gltf([{"mesh": 0}], [0], meshes=1))
    one = raydix.Scene(file, strict=True)
    assert list(one) == [0] and len(one.faces) == 1 and not one.contains([9, 9, 9])
    file.write_text(triangle_gltf([{"mesh": 0}, {"mesh": 1, "scale": [1, 1, 3]}], [0, 1]))
    assert len(raydix.Scene(file, strict=True)) == 2
    assert len(raydix.load_points(file)) == 6
