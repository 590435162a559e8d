"""raydix.open3d against Open3D, where that is installed, and what is promised without it."""

import numpy as np
import pytest
import support
from worlds import BOX

from raydix.open3d import RaycastingScene



def both(*meshes):
    """The same meshes in both libraries, and what makes tensors."""
    o3d = pytest.importorskip("open3d", reason="open3d is not installed")
    ours, theirs = RaycastingScene(), o3d.t.geometry.RaycastingScene()
    tensor = o3d.core.Tensor
    for vertices, faces in meshes:
        vertices, faces = np.float32(vertices), np.uint32(faces)
        assert ours.add_triangles(vertices, faces) == theirs.add_triangles(
            tensor(vertices), tensor(faces)
        )
    return ours, theirs, tensor


def assert_alike(ours, theirs, exact=(), near=()):
    """Same keys, shapes and types; values equal or close."""
    theirs = {name: values.numpy() for name, values in theirs.items()}
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        assert values.dtype == theirs[name].dtype and values.shape == theirs[name].shape, name
    for name in exact:
        np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)
    for name in near:
        np.testing.assert_allclose(ours[name], theirs[name], atol=2e-4, err_msg=name)


def two_soups(rng):
    first = support.random_triangles(rng, 300)
    vertices, faces = support.random_triangles(rng, 200)
    return first, (vertices + 0.5, faces)


def six(rng, count):
    return np.float32(support.random_rays(rng, count)[:, [0, 1, 2, 4, 5, 6]])


def test_rays_against_open3d(rng):
    ours, theirs, tensor = both(*two_soups(rng))
    rays = six(rng, 600).reshape(20, 30, 6)
    found, wanted = ours.cast_rays(rays), theirs.cast_rays(tensor(rays))
    ids = ("geometry_ids", "primitive_ids")
    assert_alike(found, wanted, ids, ("t_hit", "primitive_uvs", "primitive_normals"))
    assert (found["primitive_ids"] != ours.INVALID_ID).sum() > 100
    assert ours.INVALID_ID == theirs.INVALID_ID
    for limits in ({}, {"tnear": 0.5, "tfar": 1.5}):
        mine, other = ours.test_occlusions(rays, **limits), theirs.test_occlusions(
            tensor(rays), **limits
        )
        assert mine.dtype == bool
        np.testing.assert_array_equal(mine, other.numpy())
    counts = ours.count_intersections(rays)
    assert counts.dtype == np.int32
    np.testing.assert_array_equal(counts, theirs.count_intersections(tensor(rays)).numpy())
    listed, others = ours.list_intersections(rays), theirs.list_intersections(tensor(rays))
    assert_alike(listed, others, ("ray_splits", "ray_ids"))
    order = np.lexsort((others["t_hit"].numpy(), others["ray_ids"].numpy()))  # theirs is none
    np.testing.assert_allclose(listed["t_hit"], others["t_hit"].numpy()[order], atol=2e-5)
    np.testing.assert_array_equal(
        listed["primitive_ids"], others["primitive_ids"].numpy()[order]
    )


def test_distances_against_open3d(rng):
    other_box = (BOX[0] + [10, 0, 0], BOX[1])
    ours, theirs, tensor = both(BOX, other_box)
    points = np.float32(rng.uniform(-4, 14, (5, 60, 3)))
    for call in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        mine, other = getattr(ours, call)(points), getattr(theirs, call)(tensor(points)).numpy()
        assert mine.dtype == other.dtype and mine.shape == other.shape
        np.testing.assert_allclose(mine, other, atol=2e-5, err_msg=call)
    soups = both(*two_soups(rng))
    near, wanted = (
        soups[0].compute_closest_points(points),
        soups[1].compute_closest_points(soups[2](points)),
    )
    assert_alike(near, wanted, near=("points",))
    same = near["primitive_ids"] == wanted["primitive_ids"].numpy()
    assert same.mean() > 0.9  # corners belong to several triangles
    np.testing.assert_allclose(
        near["primitive_normals"][same], wanted["primitive_normals"].numpy()[same], atol=1e-4
    )


def test_cameras_against_open3d():
    ours, theirs, tensor = both(BOX)
    looking = (60, [0, 0, 0], [3, 2, 1], [0, 0, 1], 8, 5)
    np.testing.assert_allclose(
        ours.create_rays_pinhole(*looking), theirs.create_rays_pinhole(*looking).numpy(), atol=1e-6
    )
    intrinsic = np.array([[100, 0, 2], [0, 110, 1.5], [0, 0, 1.0]])
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = np.linalg.qr(np.arange(9).reshape(3, 3) + np.eye(3))[0]
    extrinsic[:3, 3] = 1, 2, 3
    np.testing.assert_allclose(
        RaycastingScene.create_rays_pinhole(intrinsic, extrinsic, 4, 3),
        theirs.create_rays_pinhole(tensor(intrinsic), tensor(extrinsic), 4, 3).numpy(),
        atol=1e-6,
    )
    rays = ours.create_rays_pinhole(
        fov_deg=60, center=[0, 0, 0], eye=[3, 2, 9], up=[0, 1, 0], width_px=4, height_px=3
    )
    assert rays.shape == (3, 4, 6) and rays.dtype == np.float32
    assert ours.test_occlusions(rays)[1, 1:3].all()


def test_meshes_of_open3d():
    o3d = pytest.importorskip("open3d", reason="open3d is not installed")
    box = o3d.geometry.TriangleMesh.create_box()
    scene = RaycastingScene()
    assert scene.add_triangles(box) == 0
    assert scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(box)) == 1
    inside = scene.compute_occupancy(o3d.core.Tensor([[0.5, 0.25, 0.125]], o3d.core.float32))
    assert inside.tolist() == [1]


def test_without_open3d():
    scene = RaycastingScene()
    assert scene.cast_rays(np.zeros((2, 6)) + 1)["t_hit"].tolist() == [np.inf, np.inf]
    assert scene.add_triangles(*BOX) == 0
    down = [[0.5, 0.25, 9, 0, 0, -2], [9, 9, 9, 0, 0, 1]]
    hits = scene.cast_rays(down)
    assert hits["t_hit"].tolist() == [3, np.inf] and hits["geometry_ids"][1] == scene.INVALID_ID
    assert hits["primitive_normals"].tolist() == [[0, 0, 1], [0, 0, 0]]
    assert scene.count_intersections(down).tolist() == [2, 0]
    listed = scene.list_intersections(down)
    assert listed["ray_splits"].tolist() == [0, 2, 2] and listed["ray_ids"].tolist() == [0, 0]
    assert scene.compute_signed_distance([[0, 0, 0], [3, 0, 0]]).tolist() == [-1, 2]
    # A mesh that comes later is seen.
    assert scene.add_triangles(np.float32(BOX[0] + [20, 0, 0]), BOX[1]) == 1
    assert scene.compute_closest_points([[30, 0, 0]])["geometry_ids"].tolist() == [1]
    assert "2 geometries" in repr(scene)


def test_what_open3d_calls_refuse():
    scene = RaycastingScene()
    for call, text in (
        (lambda: scene.cast_rays(np.zeros((3, 5))), "rays: expected"),
        (lambda: scene.compute_distance(np.zeros((3, 2))), "query_points: expected"),
        (lambda: scene.compute_occupancy(np.zeros((3, 3)), nsamples=2), "nsamples"),
        (lambda: scene.add_triangles(BOX[0], [[0, 1, 8]]), "face 0"),
        (lambda: scene.add_triangles(BOX[0]), "expected a mesh or two arrays"),
        (lambda: scene.create_rays_pinhole(60, [0, 0, 0], [0, 0, 1], [0, 0, 1], 4, 4), "up is"),
        (lambda: scene.create_rays_pinhole(60, [0, 0, 0]), "expected intrinsic_matrix"),
        (lambda: scene.create_rays_pinhole(np.eye(3), np.eye(3), 4, 4), "expected matrices"),
        (lambda: scene.create_rays_pinhole(np.eye(3), np.eye(4), 0, 4), "width_px: expected"),
    ):
        with pytest.raises((TypeError, ValueError), match=text):
            call()
