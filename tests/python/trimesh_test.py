"""The ray object for trimesh, beside trimesh's own on embreex; Scene beside embreex and Open3D."""

import copy
import pickle

import numpy as np
import pytest
import support

import raydix
import raydix.trimesh


@pytest.fixture
def trimesh():
    return support.peer("trimesh")


@pytest.fixture
def meshes(trimesh, figure):
    """The same mesh twice: with trimesh's ray object on embreex, and with ours."""
    support.peer("embreex")
    theirs = trimesh.Trimesh(figure.vertices, figure.faces, process=False)
    ours = theirs.copy()
    ours.ray = raydix.trimesh.RayMeshIntersector(ours)
    assert type(theirs.ray).__module__.endswith("ray_pyembree")
    return theirs, ours


@pytest.fixture
def rays(rng, figure):
    lo, hi = figure.vertices.min(axis=0), figure.vertices.max(axis=0)
    origins = rng.uniform(lo - 1, hi + 1, (4000, 3))
    return origins, rng.uniform(lo, hi, (4000, 3)) - origins


def test_first_hits_agree(meshes, rays):
    theirs, ours = (mesh.ray.intersects_first(*rays) for mesh in meshes)
    assert ours.dtype == np.int64 and (ours >= 0).sum() > 1000
    assert (
        theirs == ours
    ).mean() > 0.999  # neighbours at an edge, and rounding after embreex's scaling
    a, b = (mesh.ray.intersects_any(*rays) for mesh in meshes)
    assert (a == b).mean() > 0.999 and b.dtype == bool


def test_vertices_without_triangles_do_not_matter(trimesh, figure, rays):
    far = trimesh.Trimesh(
        np.vstack([figure.vertices, [[1e9, 1e9, 1e9], [np.nan, 0, 0]]]), figure.faces, process=False
    )
    wanted = raydix.trimesh.RayMeshIntersector(
        trimesh.Trimesh(figure.vertices, figure.faces, process=False)
    ).intersects_any(*rays)
    assert wanted.sum() > 1000
    found = raydix.trimesh.RayMeshIntersector(far).intersects_any(*rays)
    np.testing.assert_array_equal(found, wanted)


def test_locations_agree(meshes, rays):
    results = []
    for mesh in meshes:
        places, ray, triangle = mesh.ray.intersects_location(*rays, multiple_hits=False)
        order = np.argsort(ray)
        results.append((places[order], ray[order], triangle[order]))
    (a, ray_a, tri_a), (b, ray_b, tri_b) = results
    _, at_a, at_b = np.intersect1d(ray_a, ray_b, return_indices=True)
    assert len(at_a) > 0.999 * max(len(ray_a), len(ray_b))
    same = tri_a[at_a] == tri_b[at_b]
    assert same.mean() > 0.999
    np.testing.assert_allclose(a[at_a][same], b[at_b][same], atol=1e-4)


def test_all_hits_agree(meshes, rays):
    (tri_a, ray_a), (tri_b, ray_b) = (
        mesh.ray.intersects_id(*rays, multiple_hits=True) for mesh in meshes
    )
    a, b = set(zip(ray_a, tri_a, strict=True)), set(zip(ray_b, tri_b, strict=True))
    assert len(b) == len(tri_b) and len(a ^ b) < 0.002 * len(
        b
    )  # theirs steps on by an epsilon and loses some
    tri, ray, places = meshes[1].ray.intersects_id(*rays, max_hits=1, return_locations=True)
    assert len(set(ray)) == len(ray) == len(places) and set(zip(ray, tri, strict=True)) <= b


def test_contains_and_what_builds_on_it(meshes, rng, trimesh):
    theirs, ours = meshes
    points = rng.uniform(ours.vertices.min(axis=0), ours.vertices.max(axis=0), (3000, 3))
    inside = ours.contains(points)
    assert 100 < inside.sum() < 2900
    np.testing.assert_array_equal(inside, raydix.Scene(ours).signed_distance(points) <= 0)
    assert (theirs.contains(points) == inside).mean() > 0.99


def test_edits_copies_and_pickles(trimesh):
    mesh = trimesh.creation.box()
    mesh.ray = raydix.trimesh.RayMeshIntersector(mesh)
    down = [[0, 0, 50.0]], [[0, 0, -1.0]]
    assert mesh.ray.intersects_any(*down).tolist() == [True]
    mesh.apply_translation([1e6, 0, 0])
    assert mesh.ray.intersects_any(*down).tolist() == [False]
    there = [[1e6 + 0.25, 0.1, 50.0]], [[0, 0, -2.0]]
    for ray in (
        mesh.ray,
        copy.copy(mesh.ray),
        copy.deepcopy(mesh.ray),
        pickle.loads(pickle.dumps(mesh.ray)),
    ):
        places, _, _ = ray.intersects_location(*there, multiple_hits=False)
        np.testing.assert_allclose(
            places, [[1e6 + 0.25, 0.1, 0.5]], rtol=0, atol=1e-6
        )  # float32 alone would be off by 0.06
    with pytest.raises(ValueError, match="don't match"):
        mesh.ray.intersects_any(np.zeros((2, 3)), np.zeros((3, 3)))
    assert len(mesh.ray.intersects_first(np.zeros((0, 3)), np.zeros((0, 3)))) == 0


def test_an_edit_that_cannot_be_traced_leaves_no_trace(trimesh):
    mesh = trimesh.creation.box()
    mesh.ray = raydix.trimesh.RayMeshIntersector(mesh)
    right = np.array(mesh.faces)
    from_above = [[0.1, 0.2, 5]], [[0, 0, -1]]
    wanted = mesh.ray.intersects_first(*from_above)
    assert wanted[0] >= 0
    mesh.vertices[0] = 1e6, 0, 0  # another middle
    mesh.faces = right - 8  # NumPy takes such numbers, a scene does not
    with pytest.raises(ValueError):
        mesh.ray.intersects_first(*from_above)
    mesh.vertices = trimesh.creation.box().vertices
    mesh.faces = right
    assert mesh.ray.intersects_first(*from_above) == wanted


def test_scene_takes_a_trimesh(trimesh):
    scene = raydix.Scene(trimesh.creation.icosphere(subdivisions=3))
    assert scene.closure()["closure"] == "oriented"
    assert scene.signed_distance([0, 0, 0]) == pytest.approx(-1, abs=0.01)


def test_embreex_agrees(figure):
    support.peer("embreex")
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    theirs = rtcore_scene.EmbreeScene()
    TriangleMesh(theirs, figure.vertices.astype(np.float32), figure.faces.astype(np.int32))
    rays = figure.primary_rays(size=(320, 240))["rays"]
    prim = theirs.run(rays[:, :3].copy(), rays[:, 4:7].copy())
    ours = figure.intersect(rays)["prim"].astype(np.int64)
    ours[ours == raydix.MISSING] = -1
    assert (prim == ours).mean() > 0.9995


def test_open3d_agrees(figure, rng):
    open3d = support.peer("open3d")
    theirs = open3d.t.geometry.RaycastingScene()
    theirs.add_triangles(figure.vertices, figure.faces)
    rays = figure.primary_rays(size=(320, 240))["rays"]
    six = np.ascontiguousarray(np.concatenate([rays[:, :3], rays[:, 4:7]], axis=1))
    a, b = theirs.cast_rays(six), figure.intersect(six)
    same = a["primitive_ids"].numpy() == b["prim"]
    assert same.mean() > 0.9995
    hit = same & np.isfinite(b["t"])
    np.testing.assert_allclose(a["t_hit"].numpy()[hit], b["t"][hit], rtol=1e-4)
    points = rng.uniform(-1, 2, (5000, 3)).astype(np.float32)
    np.testing.assert_allclose(
        theirs.compute_distance(points).numpy(), figure.closest_point(points)["distance"], atol=2e-6
    )
    assert (
        (theirs.compute_signed_distance(points).numpy() < 0) == figure.contains(points)
    ).mean() > 0.999
