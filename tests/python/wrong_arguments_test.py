"""Arguments of the wrong kind: every call says on one line which one, what it takes and what came."""

import datetime
import warnings

import numpy as np
import pytest
from worlds import BOX

import raydix
from raydix.scipy import cKDTree

V, F = BOX
RAYS = np.array([[0.2, 0.2, 5, 0, 0, 0, -1, np.inf]], np.float32)
ORIGIN, DOWN = [[0.1, 0.1, 5]], [[0, 0, -1.0]]

WEIRD = [
    None,
    "x",
    b"x",
    "a\0b",
    -1,
    1.5,
    2**64,
    -(2**70),
    10**400,
    float("nan"),
    float("inf"),
    True,
    [],
    [[]],
    [1, 2],
    {},
    {"t": 1},
    object(),
    datetime.date(2026, 1, 1),
    np.array(3),
    np.array([1, 2, 3]),
    np.array("a"),
    np.array([None]),
    np.zeros((0, 3)),
    np.zeros((2, 3), complex),
    np.zeros((2, 3), bool),
    np.zeros((2, 3), "M8[s]"),
    np.zeros((2, 3), np.longdouble),
    np.zeros(3, [("a", "f4")]),
    np.zeros((50, 50)),
    np.ma.array([1.0, 2.0, 3.0]),
    1 + 2j,
    np.complex64(1),
    [[1, 2, 3], [4, 5]],
    range(3),
    np.full((2, 3), 1e300),
    np.zeros((1, 8), np.float32),
    np.zeros((1, 4)),
    np.zeros((1, 3), np.int64),
]


def calls_of_scenes(precision):
    scene = raydix.Scene(V, F, precision=precision)
    rays = RAYS.astype(scene.dtype)
    hits = scene.intersect(rays)

    def fresh(call):
        return lambda w: call(raydix.Scene(V, F, precision=precision), w)

    calls = {
        "intersect rays": lambda w: scene.intersect(w),
        "intersect directions": lambda w: scene.intersect([0, 0, 5.0], w),
        "intersect origins": lambda w: scene.intersect(w, [0, 0, -1.0]),
        "count": lambda w: scene.count(w),
        "all_hits": lambda w: scene.all_hits(w),
        "all_hits bytes": lambda w: scene.all_hits(rays, max_result_bytes=w),
        "closest_point": lambda w: scene.closest_point(w),
        "closest_point reach": lambda w: scene.closest_point([0, 0, 0], max_distance=w),
        "signed_distance": lambda w: scene.signed_distance(w),
        "signed_distance rule": lambda w: scene.signed_distance([0, 0, 0], rule=w),
        "contains rule": lambda w: scene.contains([0, 0, 0], rule=w),
        "winding_number rule": lambda w: scene.winding_number([0, 0, 0], rule=w),
        "overlaps": lambda w: scene.overlaps(w),
        "overlaps narrow": lambda w: scene.overlaps(narrow=w),
        "overlaps bytes": lambda w: scene.overlaps(max_result_bytes=w),
        "count_overlaps narrow": lambda w: scene.count_overlaps(narrow=w),
        "touched_by": lambda w: scene.touched_by(spheres=w),
        "touched_by bytes": lambda w: scene.touched_by(segments=[[0] * 6], max_result_bytes=w),
        "sweep radii": lambda w: scene.sweep_spheres(rays, radii=w),
        "positions": lambda w: scene.positions(w),
        "positions rays": lambda w: scene.positions(hits, w),
        "interpolate": lambda w: scene.interpolate(w, "uv"),
        "interpolate name": lambda w: scene.interpolate(hits, w),
        "path": lambda w: scene.path(w),
        "primary_rays camera": lambda w: scene.primary_rays(w, size=(2, 2)),
        "primary_rays size": lambda w: scene.primary_rays(size=w),
        "primary_rays width": lambda w: scene.primary_rays(size=(w, 2)),
        "render camera": lambda w: scene.render(w, size=(4, 4), samples=1),
        "Camera": lambda w: scene.render(raydix.Camera(w), size=(4, 4), samples=1),
        "Camera vfov": lambda w: scene.render(raydix.Camera(vfov=w), size=(4, 4), samples=1),
        "Camera name": lambda w: scene.render(raydix.Camera(name=w), size=(4, 4), samples=1),
        "secondary_rays": lambda w: scene.secondary_rays(w, samples=1),
        "secondary_rays kind": lambda w: scene.secondary_rays(rays, w, samples=1),
        "secondary_rays samples": lambda w: scene.secondary_rays(rays, samples=w),
        "save": lambda w: scene.save(w),
        "set_attributes": fresh(lambda s, w: s.set_attributes(0, uv=w)),
        "set_attributes id": fresh(lambda s, w: s.set_attributes(w, uv=V)),
        "refit": fresh(lambda s, w: s.refit(w)),
        "add": fresh(lambda s, w: s.add(w)),
        "add faces": fresh(lambda s, w: s.add(V, w)),
        "add mask": fresh(lambda s, w: s.add(V, F, mask=w)),
        "add transform": fresh(lambda s, w: s.add(scene, w)),
        "add_spheres": fresh(lambda s, w: s.add_spheres(w, 1)),
        "add_spheres radii": fresh(lambda s, w: s.add_spheres(V, w)),
        "add_points radius": fresh(lambda s, w: s.add_points(V, w)),
        "update id": fresh(lambda s, w: s.update(w, V)),
        "remove": fresh(lambda s, w: s.remove(w)),
        "set_transform id": fresh(lambda s, w: s.set_transform(w, np.eye(4))),
        "set_mask": fresh(lambda s, w: s.set_mask(0, w)),
    }
    for name in ("tmin", "tmax", "mask", "masks", "keep", "skip", "also"):
        calls[f"intersect {name}"] = lambda w, name=name: scene.intersect(ORIGIN, DOWN, **{name: w})
    for name in ("view", "size", "samples", "ao_radius", "seed"):
        calls[f"render {name}"] = lambda w, name=name: scene.render(
            **{"size": (4, 4), "samples": 1, name: w}
        )
    for name in ("quality", "usage", "compact", "refit_limit", "threads", "progress"):
        calls[f"commit {name}"] = fresh(lambda s, w, name=name: s.commit(**{name: w}))
    return calls


def calls_of_the_rest():
    scene = raydix.Scene(V, F)
    points = raydix.Points(V)
    tree, octree, near = raydix.bvh(V, F), raydix.octree(V), cKDTree(V)
    calls = {
        "Scene": lambda w: raydix.Scene(w),
        "Scene faces": lambda w: raydix.Scene(V, w),
        "Points": lambda w: raydix.Points(w),
        "knn": lambda w: points.knn(w, 2),
        "knn k": lambda w: points.knn([0, 0, 0.0], w),
        "knn bytes": lambda w: points.knn([0, 0, 0.0], 1, max_result_bytes=w),
        "radius r": lambda w: points.radius([0, 0, 0.0], w),
        "radius sort": lambda w: points.radius([0, 0, 0.0], 1, sort=w),
        "radius padded": lambda w: points.radius([0, 0, 0.0], 1, padded=w),
        "count r": lambda w: points.count([0, 0, 0.0], w),
        "box": lambda w: points.box(w),
        "pairs": lambda w: points.pairs(w),
        "pairs bytes": lambda w: points.pairs(0.1, max_result_bytes=w),
        "remove": lambda w: raydix.Points(V).remove(w),
        "load_points": lambda w: raydix.load_points(w),
        "load_scene": lambda w: raydix.load_scene(w),
        "stats epo": lambda w: tree.stats(epo=w),
        "stats node_cost": lambda w: tree.stats(node_cost=w),
        "boxes": lambda w: octree.boxes(w),
        "locate": lambda w: octree.locate(w),
        "points_in_boxes": lambda w: octree.points_in_boxes([[0] * 6], max_result_bytes=w),
        "simulate": lambda w: raydix.simulate(w, RAYS),
        "to_png": lambda w: raydix.to_png(np.zeros((2, 2, 3)), tone_map=w),
        "save_picture": lambda w: raydix.save_picture(w, np.zeros((2, 2, 3))),
        "cKDTree k": lambda w: near.query([0, 0, 0], k=w),
        "cKDTree p": lambda w: near.query([0, 0, 0], p=w),
        "cKDTree r": lambda w: near.query_ball_point([0, 0, 0], w),
        "cKDTree pairs": lambda w: near.query_pairs(w),
        "cKDTree workers": lambda w: near.query([0, 0, 0], workers=w),
    }
    for name in ("quality", "builder", "reinsertion_rounds", "max_leaf", "bits", "strict", "threads",
                 "device", "precision", "usage", "compact"):  # fmt: skip
        calls[f"Scene {name}"] = lambda w, name=name: raydix.Scene(V, F, **{name: w}).stats()
    for name in ("tree", "strict", "threads"):
        calls[f"Points {name}"] = lambda w, name=name: raydix.Points(V, **{name: w})
    for make, names in (
        (raydix.bvh, "builder bits max_leaf strict threads"),
        (raydix.octree, "bits max_level max_leaf strict threads"),
        (raydix.kdtree, "bits max_leaf strict threads"),
    ):
        for name in names.split():
            calls[f"{make.__name__} {name}"] = lambda w, make=make, name=name: make(
                V, F, **{name: w}
            )
    for name in ("rays", "kernels", "machine", "builder", "max_leaf", "width", "any_hit", "memory"):
        calls[f"simulate {name}"] = lambda w, name=name: raydix.simulate(
            scene, **{"rays": RAYS, "kernels": "if_if", name: w}
        )
    return calls


@pytest.mark.parametrize("what", ["float32", "float64", "rest"])
def test_wrong_arguments_are_one_line(what, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # some of the wrong values are names of files
    calls = calls_of_the_rest() if what == "rest" else calls_of_scenes(what)
    wrong = []
    for name, call in calls.items():
        for number, value in enumerate(WEIRD):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    call(value)
            except (TypeError, ValueError, NotImplementedError, raydix.BackendUnavailable) as error:
                text = str(error)
                if "\n" in text or "incompatible function" in text or len(text) > 400:
                    wrong.append((name, number, type(error).__name__, text[:200]))
                elif type(error) is TypeError and ": " not in text:
                    wrong.append((name, number, "names no argument", text))
            except Exception as error:
                wrong.append((name, number, type(error).__name__, str(error)[:200]))
    assert not wrong


def test_what_the_messages_say():
    scene, points = raydix.Scene(V, F), raydix.Points(V.astype(np.float32))
    scene.set_attributes(0, uv=V)
    hits = scene.intersect(RAYS)
    for call, error, text in (
        (lambda: scene.intersect(RAYS, mask=np.zeros((2, 3))), TypeError,
         "mask: expected a whole number, 0 to 4294967295, given an array of shape (2, 3) float64"),
        (lambda: scene.intersect(ORIGIN, DOWN, skip={"t": 1}), ValueError,
         "skip: expected prim, geometry, instance, given ['t']"),
        (lambda: scene.interpolate({"t": 1}, "uv"), TypeError, "hits: expected a dict"),
        (lambda: scene.interpolate(hits, 5), TypeError, "name: expected a str, given 5"),
        (lambda: scene.render(5), ValueError, "camera: expected a whole number"),
        (lambda: scene.primary_rays(camera="x"), TypeError, "camera: expected a whole number"),
        (lambda: raydix.simulate(None, RAYS), TypeError, "scene: expected a Scene, given None"),
        (lambda: scene.closest_point([0, 0, 0], max_distance=10**400), ValueError,
         "max_distance: expected a number that float64 can hold, given 1000"),
        (lambda: scene.contains([0, 0, 0], rule=None), ValueError, "rule: expected one of automatic"),
        (lambda: scene.overlaps(narrow="yes"), TypeError, "narrow: expected True or False, given 'y"),
        (lambda: scene.intersect(None, DOWN), TypeError, "origins: expected shape"),
        (lambda: points.radius([0, 0, 0], "0.5"), TypeError, "r: expected a number, given '0.5'"),
        (lambda: raydix.load_scene(5), TypeError, "file: expected a path, given 5"),
        (lambda: raydix.octree(V).boxes([2**32]), ValueError, "nodes: expected 0 to 4294967295"),
        (lambda: raydix.octree(V).boxes([0.7]), TypeError, "nodes: expected whole numbers"),
        (lambda: raydix.octree(V).boxes([np.nan]), TypeError, "nodes: expected whole numbers"),
        (lambda: raydix.octree(V).boxes([-1]), ValueError, "nodes: expected 0 to 4294967295"),
        (lambda: scene.intersect(RAYS, mask=np.float32(2**32)), ValueError, "mask: expected a whole"),
        (lambda: scene.closest_point([0, 0, 0], mask=-1), ValueError, "mask: expected a whole number"),
        (lambda: scene.contains([0, 0, 0], mask="x"), TypeError, "mask: expected a whole number"),
        (lambda: raydix.to_png(np.zeros((2, 0, 3))), raydix.InputError,
         "picture: expected at least one pixel, given shape (2, 0, 3)"),
        (lambda: scene.intersect(np.ma.masked_array(RAYS, RAYS == 5)), raydix.InputError,
         "rays: expected no masked values, given 1"),
        (lambda: raydix.Points(np.ma.masked_invalid([[0, 0, np.nan]])), raydix.InputError,
         "points: expected no masked values, given 1"),
        (lambda: raydix.machine(1), TypeError, "machine() takes 0 positional arguments"),
        (lambda: raydix.scenes("x"), TypeError, "scenes() takes 0 positional arguments"),
    ):  # fmt: skip
        with pytest.raises(error) as raised:
            call()
        assert str(raised.value).startswith(text)


def test_numbers_that_are_large_and_arrays_that_are_not_plain():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = raydix.Points(V.astype(np.float32)).radius([0, 0, 0], 1e300)
        assert len(found["indices"]) == len(V)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            matrix = np.matrix(RAYS.astype(np.float64))
        scene = raydix.Scene(V, F)
        assert scene.intersect(matrix) == scene.intersect(RAYS)
        assert scene.count(matrix).tolist() == scene.count(RAYS).tolist()
        assert scene.intersect(np.ma.masked_array(RAYS)) == scene.intersect(RAYS)  # none is masked
        beyond = np.array([[1e300, 0, -1e300]])
        for found in (
            scene.sweep_spheres(ORIGIN, beyond, radii=1),
            scene.sweep_spheres(ORIGIN, DOWN, radii=1e300),
            scene.sweep_spheres(ORIGIN, DOWN, radii=1, tmin=1e300),
        ):
            assert found["t"].tolist() == [np.inf]
