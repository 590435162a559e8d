"""Scenes of several meshes and instances in float64, near the origin and far from it."""

import numpy as np
import pytest
import support
from worlds import ALL, BOX, DOWN, World, random_world, same_names, transform, triangles

import raydix

UTM = np.array([500_000.0, 4_500_000.0, 120.0])
"""Where float32 has steps of half a metre."""


def double(*mesh, **options):
    return raydix.Scene(*mesh, precision="float64", **options)


def exact_transform(rng, **options):
    """A transform that float32 does not have."""
    return transform(rng, **options).astype(np.float64) + rng.uniform(-1e-9, 1e-9, (3, 4))


def moved(by):
    return np.concatenate([np.eye(3), np.reshape(by, (3, 1))], axis=1)


def agrees(world, rays, masks):
    """Compares all calls with every triangle, tested in float64."""
    times, names = world.hits(rays, masks)
    ordered = np.sort(times, axis=1)
    hits = world.scene.intersect(rays, masks=masks)
    hit = hits["prim"] != raydix.MISSING
    np.testing.assert_allclose(hits["t"], ordered[:, 0], rtol=1e-8)
    clear = hit & (ordered[:, 1] > ordered[:, 0] * (1 + 1e-7))
    same_names(hits, clear, names[times.argmin(axis=1)])
    counts = np.isfinite(times).sum(axis=1)
    np.testing.assert_array_equal(world.scene.occluded(rays, masks=masks), hit)
    np.testing.assert_array_equal(world.scene.count(rays, masks=masks), counts)
    listed = world.scene.all_hits(rays, masks=masks)
    np.testing.assert_array_equal(np.diff(listed["offsets"]).astype(int), counts)
    np.testing.assert_allclose(listed["t"], ordered[np.isfinite(ordered)], rtol=1e-8)
    for i in range(len(rays)):
        row = slice(int(listed["offsets"][i]), int(listed["offsets"][i + 1]))
        got = zip(*(listed[n][row].tolist() for n in ("instance", "geometry", "prim")), strict=True)
        assert set(got) == {tuple(name) for name in names[np.isfinite(times[i])].tolist()}
    return int(clear.sum())


@pytest.mark.parametrize("usage", ["fixed", "moving"])
def test_hits_equal_brute_force(rng, usage):
    seen = 0
    for _ in range(3):
        world = random_world(rng, precision="float64")
        world.add_instance(world.parts[0][2], exact_transform(rng, shear=0.3))
        report = world.scene.commit(usage=usage)
        assert report["meshes"] == 2 and report["instances"] == 4
        assert report["paths"] == world.flat()[1]
        rays = support.random_rays(rng, 300).astype(np.float64)
        rays[:, :3] *= 2
        rays[:40, 7] = 0.7
        masks = rng.integers(0, 16, 300).astype(np.uint32)
        masks[:200] = ALL
        seen += agrees(world, rays, masks)
        for path, instance, *_ in world.flat()[0]:
            assert world.scene.path(instance) == path
        lo, hi = world.scene.bounds
        assert world.scene.bounds.dtype == np.float64
        flat = np.concatenate([part[4] for part in world.flat()[0]])
        assert (lo <= flat.min(axis=0) + 1e-9).all() and (hi >= flat.max(axis=0) - 1e-9).all()
    assert seen > 200


def test_places_far_from_the_origin_cost_no_digits(rng):
    """A scene at a map's coordinates, as meshes and as an instance."""
    near = World(precision="float64")
    near.add_mesh(*triangles(rng, 40))
    near.add_mesh(*triangles(rng, 40), mask=2)
    near.scene.commit()
    placed = double()
    placed.add(near.scene, moved(UTM))
    placed.commit()
    meshes = double()
    for mask, vertices, faces in near.parts.values():
        meshes.add(vertices.astype(np.float64) + UTM, faces, mask=mask)
    meshes.commit()
    rays = support.random_rays(rng, 2000).astype(np.float64)
    rays[:, :3] = np.round(rays[:, :3] * 2.0**20) / 2.0**20  # UTM can be added exactly
    there = rays.copy()
    there[:, :3] += UTM
    for mask in (1, 2, ALL):
        wanted = near.scene.intersect(rays, mask=mask)
        hit = wanted["prim"] != raydix.MISSING
        assert hit.sum() > 100
        found, as_meshes = placed.intersect(there, mask=mask), meshes.intersect(there, mask=mask)
        for name in ("t", "u", "v", "prim", "geometry"):
            np.testing.assert_array_equal(found[name], wanted[name])
        np.testing.assert_array_equal(found["instance"], hit.astype(np.uint32))
        same = as_meshes["prim"] == wanted["prim"]  # vertices were rounded to 2**-30
        assert same.mean() > 0.999
        np.testing.assert_allclose(as_meshes["t"][same & hit], wanted["t"][same & hit], rtol=1e-7)
    np.testing.assert_allclose(placed.bounds, near.scene.bounds + UTM, atol=1e-6)


def test_ties_go_to_the_lower_instance_geometry_and_triangle():
    leaf, world = double(*BOX), double()
    world.add(leaf, np.eye(4), id=3)
    for id in (9, 5, 7):
        world.add(*BOX, id=id)
    world.add(leaf, np.eye(4))
    world.commit()
    rays = np.array([[0.5, 0.25, 9, 0, 0, -1]] * 12)
    one = leaf.intersect(rays)
    for batch in (rays, rays[:2]):  # many, and few
        hits = world.intersect(batch)
        np.testing.assert_array_equal(hits["t"], 6)
        np.testing.assert_array_equal(hits["prim"], one["prim"][: len(batch)])
        np.testing.assert_array_equal(hits["geometry"], 5)
        np.testing.assert_array_equal(hits["instance"], 0)
    listed = world.all_hits(rays[0])
    assert listed["t"].tolist() == [6] * 5 + [12] * 5
    assert listed["geometry"].tolist() == [5, 7, 9, 0, 0] * 2
    assert listed["instance"].tolist() == [0, 0, 0, 1, 2] * 2
    for id in (5, 7, 9):
        world.remove(id)
    world.commit()
    assert world.intersect(rays)["instance"].tolist() == [1] * 12


def test_moving_meshes_and_places(rng):
    vertices, faces = triangles(rng, 300, 0.1)
    vertices = vertices.astype(np.float64)
    world, leaf = World(precision="float64", usage="moving"), World(precision="float64")
    ids = [world.add_mesh(vertices + UTM + [3 * i, 0, 0], faces) for i in range(3)]
    leaf.add_mesh(*triangles(rng, 30))
    leaf.scene.commit()
    place = world.add_instance(leaf, moved(UTM))
    world.scene.commit()
    rays = support.random_rays(rng, 100).astype(np.float64)
    rays[:, :3] = np.round(rays[:, :3] * 2.0**20) / 2.0**20 + UTM
    everything = np.full(len(rays), ALL, np.uint32)
    for step in range(1, 4):
        shape = vertices * (1 + 0.01 * step) + UTM
        world.scene.update(ids[1], shape)
        world.parts[ids[1]] = (ALL, shape, faces)
        where = moved(UTM + [0.1 * step, 0, 0])
        world.scene.set_transform(place, where)
        world.parts[place] = (ALL, where, leaf)
        report = world.scene.commit()
        assert report["trees_refitted"] == 1 and report["trees_built"] == 0
        times, _ = world.hits(rays, everything)
        # Moeller and Trumbore at these coordinates has some eight digits.
        hits = world.scene.intersect(rays)
        same = np.isclose(hits["t"], times.min(axis=1), rtol=1e-6)
        assert same.mean() > 0.98 and np.isfinite(hits["t"]).sum() > 20


def test_one_mesh_of_several_is_asked_again(rng):
    """Queries of one mesh name what stands in the way, and answer when it is gone."""
    mesh = double(*BOX)
    placed, pair = double(), double(*BOX)
    placed.add(mesh, np.eye(4))
    placed.commit()
    pair.add(*triangles(rng, 5), mask=2)
    points = rng.uniform(-2, 2, (50, 3))
    wanted = mesh.closest_point(points)["distance"]
    np.testing.assert_array_equal(pair.closest_point(points)["distance"], wanted)
    pair.commit()
    calls = {
        "stats": lambda s: s.stats(),
        "check": lambda s: s.check(),
        "refit": lambda s: s._core.refit(BOX[0]),
        "vertices": lambda s: s.vertices,
    }
    for scene, text in ((placed, "geometry 0 is an instance"), (pair, "1 is a second mesh")):
        for name, call in calls.items():
            with pytest.raises(raydix.InputError, match=f"^{name}: .*{text}.*one mesh"):
                call(scene)
        assert "geometr" in repr(scene) and "float64" in repr(scene)
    pair.remove(1)
    pair.commit()
    np.testing.assert_array_equal(pair.closest_point(points)["distance"], wanted)
    pair.check()
    pair.refit(BOX[0] + UTM)
    assert pair.committed and pair.intersect([*(UTM + [0, 0, 9]), 0, 0, -1])["t"] == 6
    with pytest.raises(raydix.InputError, match="hold itself"):
        mesh.add(placed, np.eye(4))


def test_a_scene_that_was_never_committed_says_so():
    scene = double()
    assert not scene.committed and len(scene) == 0
    scene.add(*BOX)
    for call in (lambda: scene.intersect(DOWN), lambda: scene.bounds, lambda: scene.vertices,
                 lambda: scene.contains([0, 0, 0])):  # fmt: skip
        with pytest.raises(raydix.InputError, match="never committed"):
            call()
    scene.commit()
    assert scene.intersect(DOWN)["t"] == 6 and scene.contains([0, 0, 0])
