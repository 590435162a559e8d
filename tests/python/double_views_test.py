"""Scenes in float64: cameras, rays of cameras, pictures, figures and the simulator, near the origin and far
from it."""

import dataclasses

import numpy as np
import pytest
import support

import raydix

UTM = np.array([500_000.0, 4_500_000.0, 120.0])
"""Where float32 has steps of half a metre."""


def ball(count=24):
    """A closed ball of triangles about the origin, in numbers that float32 has."""
    turns, heights = np.meshgrid(np.linspace(0, 2 * np.pi, count), np.linspace(-1, 1, count))
    wide = np.sqrt(1 - heights**2)
    vertices = np.stack([wide * np.cos(turns), heights, wide * np.sin(turns)], axis=-1)
    at = np.arange(count * count).reshape(count, count)
    a, b, c, d = (part.reshape(-1) for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.round(vertices.reshape(-1, 3) * 2**12) / 2**12, faces


def ball_on_floor():
    vertices, faces = ball()
    floor = np.array([[-3, -1, -3], [-3, -1, 3], [3, -1, 3], [3, -1, -3]])
    more = len(vertices) + np.array([[0, 1, 2], [0, 2, 3]])
    return np.concatenate([vertices, floor]), np.concatenate([faces, more])


def moved_camera(camera, by):
    return dataclasses.replace(
        camera,
        position=tuple(np.add(camera.position, by)),
        target=tuple(np.add(camera.target, by)),
    )


@pytest.fixture(scope="module")
def pair():
    """The same mesh in float32 at the origin and in float64 far from it."""
    vertices, faces = ball()
    return raydix.Scene(vertices, faces), raydix.Scene(vertices + UTM, faces, precision="float64")


def test_the_fitted_camera_is_where_the_scene_is(pair):
    near, far = pair
    wanted, found = near.cameras[0], far.cameras[0]
    for what in ("position", "target"):
        np.testing.assert_allclose(getattr(found, what) - UTM, getattr(wanted, what), atol=1e-6)
    assert (found.up, found.vfov) == (wanted.up, wanted.vfov)
    empty = raydix.Scene(precision="float64")
    empty.commit()
    assert empty.cameras == [raydix.Camera()]


def test_primary_rays_are_those_of_float32_before_rounding(pair):
    near, far = pair
    camera = near.cameras[0]
    wanted = near.primary_rays(camera, size=(40, 30))
    found = far.primary_rays(moved_camera(camera, UTM), size=(40, 30))
    assert found["rays"].dtype == np.float64 and wanted["rays"].dtype == np.float32
    np.testing.assert_array_equal(found["pixels"], wanted["pixels"])
    rays = found["rays"] - np.r_[UTM, np.zeros(5)]
    np.testing.assert_allclose(rays[:, :7], wanted["rays"][:, :7], atol=2e-7)
    np.testing.assert_allclose(np.linalg.norm(rays[:, 4:7], axis=1), 1, atol=4e-16)
    assert (rays[:, 7] == np.inf).all() and (rays[:, 3] == 0).all()


@pytest.mark.parametrize("view", ["shaded", "normal", "depth", "primitive", "ao", "diffuse"])
def test_pictures_are_those_of_float32(view):
    vertices, faces = ball_on_floor()
    near = raydix.Scene(vertices, faces)
    far = raydix.Scene(vertices + UTM, faces, precision="float64")
    camera, size = near.cameras[0], (64, 48)
    wanted = near.render(camera, view=view, size=size, samples=8)
    found = far.render(moved_camera(camera, UTM), view=view, size=size, samples=8)
    assert found.shape == (48, 64, 3) and found.dtype == np.float32
    assert wanted.std() > 0.01
    # Single rays at edges may go either way.
    assert np.mean(np.abs(found - wanted).max(axis=2) > 0.02) < 0.02
    np.testing.assert_array_equal(
        found, far.render(moved_camera(camera, UTM), view=view, size=size, samples=8)
    )


def test_pictures_of_instances_and_shapes_far_away():
    vertices, faces = ball()
    leaf = raydix.Scene(vertices + UTM, faces, precision="float64")
    whole = raydix.Scene(precision="float64")
    whole.add(leaf, np.c_[np.eye(3), [3, 0, 0]])
    whole.add_spheres([UTM], 1)
    whole.commit()
    assert whole.cameras[0].target == pytest.approx(UTM + [1.5, 0, 0], abs=1e-3)
    picture = whole.render(view="primitive", size=(64, 32))
    hits = whole.intersect(whole.primary_rays(size=(64, 32))["rays"])
    assert {1, 0} == set(hits.instance[hits.hit].tolist())
    assert (picture > 0).any(axis=2).sum() == hits.hit.sum()
    assert "<img" in whole._repr_html_() and "triangles" in leaf._repr_html_()


def test_secondary_rays(pair):
    near, far = pair
    primary = near.primary_rays(size=(40, 30))["rays"]
    there = far.primary_rays(moved_camera(near.cameras[0], UTM), size=(40, 30))["rays"]
    for kind in ("ao", "diffuse"):
        wanted = near.secondary_rays(primary, kind, samples=4)
        found = far.secondary_rays(there, kind, samples=4)
        assert found.dtype == np.float64
        # A ray at the silhouette may hit in one of them alone.
        assert abs(len(found) - len(wanted)) <= 4 * 4 and len(found) > 800
        radii = np.linalg.norm(found[:, :3] - UTM, axis=1)
        assert 0.98 < radii.min() and radii.max() < 1.0001
        if kind == "ao":
            assert np.ptp(found[:, 7]) == 0 and found[0, 7] == wanted[0, 7]
    # They start outside: a ball hides nothing from rays that leave it.
    ao = far.secondary_rays(there, "ao", samples=16)
    assert far.occluded(ao).mean() < 0.01
    with pytest.raises(raydix.InputError, match="kind: expected one of ao, diffuse"):
        far.secondary_rays(there, "wild")


def test_figures(pair):
    near, far = pair
    wanted, found = near.info(), far.info()
    for name in ("vertices", "triangles", "zero_area_triangles", "left_out_triangles"):
        assert found[name] == wanted[name]
    np.testing.assert_array_equal(np.array(found["bounds"]), far.bounds)
    assert found["bytes"] == far.vertices.nbytes + far.faces.nbytes
    wide = far.wide_stats()
    assert wide["width"] == 8 and wide["nodes"] > 0
    assert wide["bytes"] == wide["node_bytes"] + wide["triangle_bytes"]
    assert wide["references"] == len(far.faces) - found["zero_area_triangles"]


def test_info_counts_what_is_wrong_in_float64():
    tiny = 1e-13
    vertices = np.array(
        [
            [0, 0, 0],
            [1, 0, 0],
            [0, 1, 0],
            [1 / 3, 2 / 3, 5],  # in no triangle
            [np.nan, 0, 0],
            [2e12, 0, 0],
            [tiny, 0, 0],
            [2, 1e-300, 0],
        ]
    )
    faces = [[0, 1, 2], [0, 1, 1], [0, 1, 4], [0, 1, 5], [0, 6, 6], [0, 1, 7]]
    found = raydix.Scene(vertices, faces, precision="float64").info()
    assert found["non_finite_vertices"] == 1 and found["out_of_range_vertices"] == 1
    assert found["unreferenced_vertices"] == 1 and found["repeated_index_triangles"] == 2
    # Numbers below 2**-500 count as 0: the last one has no area.
    assert found["zero_area_triangles"] == 3 and found["left_out_triangles"] == 3
    assert found["bounds"] == ((0.0, 0.0, 0.0), (2.0, 1.0, 5.0))
    # float32 cannot tell the third corner from the line, float64 can.
    thin = np.array([[0, 0, 0], [1, 1, 0], [2, 2 + 1e-12, 0]])
    counts = [
        raydix.Scene(thin, [[0, 1, 2]], precision=p).info()["zero_area_triangles"]
        for p in ("float32", "float64")
    ]
    assert counts == [1, 0]


def test_the_simulator_takes_the_scene_about_its_middle(pair):
    near, far = pair
    rays = near.primary_rays(size=(64, 48))["rays"]
    there = far.primary_rays(moved_camera(near.cameras[0], UTM), size=(64, 48))["rays"]
    wanted = raydix.simulate(near, rays, kernels="while_while")[0]
    found = raydix.simulate(far, there, kernels="while_while")[0]
    assert abs(int(found["hits"]) - int(wanted["hits"])) <= 4 and int(found["hits"]) > 500
    assert found["mrays_per_s_bound"] == pytest.approx(wanted["mrays_per_s_bound"], rel=0.05)
    assert far.vertices.dtype == np.float64
    assert raydix.simulate(far, kernels="if_if")[0]["hits"] > 0


def test_what_is_wrong_is_said(pair):
    far = pair[1]
    with pytest.raises(raydix.InputError, match="steps"):
        far.render(view="steps", size=(8, 8))
    with pytest.raises(raydix.InputError, match="position equals target"):
        far.render(raydix.Camera(position=tuple(UTM), target=tuple(UTM)), size=(8, 8))
    with pytest.raises(raydix.InputError, match="view: expected one of shaded"):
        far.render(view="sideways", size=(8, 8))
    with pytest.raises(raydix.InputError):
        far.primary_rays(size=(0, 4))
    with pytest.raises(raydix.InputError, match="never committed"):
        raydix.Scene(precision="float64").render(raydix.Camera(), size=(8, 8))
    with pytest.raises(NotImplementedError, match="compact=True"):
        raydix.Scene(*support.box_mesh([0, 0, 0], [1, 1, 1]), precision="float64", compact=True)
