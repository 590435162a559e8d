"""Scenes: what they refuse, and what they say then."""

import pathlib
import warnings

import numpy as np
import pytest
from worlds import BOX, DOWN, same_hits

import raydix


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
    calls = {
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
            with pytest.raises(raydix.InputError, match=f"^{name}: {text}.*one mesh"):
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
    for path in ("bunny.ply", pathlib.Path("bunny.ply")):
        with pytest.raises(TypeError, match=r"a path is read by Scene\(path\) alone"):
            scene.add(path)
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
        with pytest.raises(raydix.InputError, match="triangle 12 is not finite .* as is 1 other"):
            call()
    id = scene.add(*BOX)
    with pytest.raises(raydix.InputError, match="geometry 0: triangle 12"):
        scene.update(id, bad, faces)
    assert len(scene) == 1 and raydix.Scene(bad, faces).commit()["triangles"] == 15


def test_strict_scenes_in_float64():
    """What a double tree leaves out: float32 would keep the last but one."""
    bad = np.concatenate([BOX[0], [[np.nan, 0, 0]], 1e-13 * np.eye(3)])
    faces = np.concatenate([BOX[1], [[9, 10, 11], [8, 0, 1]]])
    scene = raydix.Scene(strict=True, precision="float64")
    for call in (
        lambda: scene.add(bad, faces),
        lambda: raydix.Scene(bad, faces, strict=True, precision="float64"),
    ):
        with pytest.raises(raydix.InputError, match="mesh: triangle 12: not finite .* 1 other"):
            call()
    id = scene.add(*BOX)
    with pytest.raises(raydix.InputError, match="geometry 0: triangle 12"):
        scene.update(id, bad, faces)
    assert scene.commit()["triangles"] == 12


def test_what_float64_scenes_lack():
    scene = raydix.Scene(*BOX, precision="float64")
    for name, call in {
        "compact=True": lambda: raydix.Scene(*BOX, precision="float64", compact=True),
        "compact=True ": lambda: scene.commit(compact=True),
    }.items():
        text = f"^{name.strip()}: not there .* float64"
        with pytest.raises(NotImplementedError, match=text):
            call()
    with pytest.raises(raydix.BackendUnavailable, match="device='cuda': scenes in float64"):
        raydix.Scene(precision="float64", device="cuda")


def test_types_of_scenes_do_not_mix():
    single, double = raydix.Scene(*BOX), raydix.Scene(*BOX, precision="float64")
    for world, leaf, text in (
        (single, double, "scene: expected a scene in float32, as this one, given one in float64"),
        (double, single, "scene: expected a scene in float64, as this one, given one in float32"),
    ):
        with pytest.raises(TypeError, match=text):
            world.add(leaf, np.eye(4))
        with pytest.raises(TypeError):
            world._core.add_instances(
                leaf._core, np.zeros((0, 12), world.dtype), np.zeros(1, np.uint32), None
            )
        assert len(world) == 1 and world.committed


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_batches_of_nothing_are_checked_as_others(precision):
    none, rays = np.zeros((0, 3)), np.zeros((0, 8))
    balls = raydix.Scene(precision=precision)
    balls.add_spheres([[0, 0, 0]], 1.0)
    balls.commit()
    mesh = raydix.Scene(*BOX, precision=precision)
    for text, call in (
        ("never committed", lambda s: s.closest_point(none)),
        ("never committed", lambda s: s.intersect(none, none)),
        ("never committed", lambda s: s.occluded(none, none)),
        ("never committed", lambda s: s.all_hits(rays)),
        ("never committed", lambda s: s.contains(none)),
        ("never committed", lambda s: s.touched_by(spheres=np.zeros((0, 4)))),
        ("spheres", lambda _: balls.contains(none)),
        ("spheres", lambda _: balls.signed_distance(none)),
        ("max_distance is -1", lambda _: mesh.closest_point(none, max_distance=-1)),
        ("max_distance is -1", lambda _: mesh.signed_distance(none, max_distance=-1)),
    ):
        with pytest.raises(raydix.InputError, match=text):
            call(raydix.Scene(precision=precision))
    assert mesh.closest_point(none)["distance"].shape == (0,)
    assert mesh.intersect(none, none).t.shape == (0,)
    assert mesh.all_hits(rays)["offsets"].tolist() == [0]
    assert mesh.touched_by(spheres=np.zeros((0, 4)))["offsets"].tolist() == [0]


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_points_alone_come_with_a_warning(precision):
    with pytest.warns(UserWarning, match="20 vertices without triangles") as told:
        scene = raydix.Scene("builtin:uniform?points=20", precision=precision)
    assert told[0].filename == __file__ and len(scene.vertices) == 20
    assert not scene.occluded([0.5, 0.5, 5], [0, 0, -1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        raydix.Scene("builtin:figure?triangles=5000", precision=precision)
        raydix.Scene(np.eye(3), [], precision=precision)
