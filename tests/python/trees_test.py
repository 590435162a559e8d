"""Trees as arrays, pictures, the simulator, devices, and the stubs."""

import importlib.util
import pathlib
import subprocess
import sys

import numpy as np
import pytest
import support

import raydix
from raydix.devices import DeviceRays
from raydix.trees import BVH_NODE, KD_NODE, OCTREE_NODE


@pytest.fixture
def mesh(rng):
    return support.random_triangles(rng, 1000)


def test_nodes_of_a_bvh_hold_their_triangles(mesh):
    vertices, faces = mesh
    tree = raydix.bvh(vertices, faces)
    nodes, order = tree.nodes, tree.order
    assert nodes.dtype == BVH_NODE and sorted(order) == list(range(1000))
    corners = vertices[faces[order]]
    used = np.ones(len(nodes), bool)
    used[1] = False  # padding
    leaves = np.flatnonzero((nodes["count"] > 0) & used)
    for leaf in leaves:
        run = corners[nodes["first"][leaf] : nodes["first"][leaf] + nodes["count"][leaf]]
        np.testing.assert_array_equal(nodes["lo"][leaf], run.min(axis=(0, 1)))
        np.testing.assert_array_equal(nodes["hi"][leaf], run.max(axis=(0, 1)))
    inner = np.flatnonzero((nodes["count"] == 0) & used)
    for side in ("lo", "hi"):
        merge = np.minimum if side == "lo" else np.maximum
        children = nodes[side][nodes["first"][inner]], nodes[side][nodes["first"][inner] + 1]
        np.testing.assert_array_equal(nodes[side][inner], merge(*children))
    stats = tree.stats()
    assert stats["leaves"] == len(leaves) and stats["nodes"] == len(leaves) + len(inner)
    with pytest.raises(ValueError):
        nodes["count"][0] = 1


def test_builders_and_their_figures(mesh):
    assert raydix.builders()[:4] == ["karras", "lauterbach", "garanzha", "apetrei"]
    trees = {name: raydix.bvh(*mesh, builder=name) for name in raydix.builders()}
    for tree in trees.values():
        tree.check()
        assert tree.ms["total"] > 0
    assert len({trees[name].stats()["tree_hash"] for name in raydix.builders()[:4]}) == 1
    assert trees["sweep"].stats()["sah"] < trees["karras"].stats()["sah"]
    assert trees["karras"].stats()["epo"] is None and trees["karras"].stats(epo=True)["epo"] > 0
    assert raydix.bvh(*mesh, max_leaf=1, bits=30).stats()["leaves"] == 1000
    with pytest.raises(raydix.InputError, match="bits"):
        raydix.bvh(*mesh, bits=31)


def test_octree_as_arrays(rng):
    points = rng.uniform(size=(3000, 3)).astype(np.float32)
    tree = raydix.octree(points, max_leaf=8)
    nodes = tree.nodes
    assert nodes.dtype == OCTREE_NODE
    np.testing.assert_array_equal(points[tree.order], tree.points)
    leaves = np.flatnonzero(nodes["child_mask"] == 0)
    assert nodes["point_count"][leaves].sum() == 3000 and nodes["point_count"][leaves].max() <= 8
    boxes = tree.boxes(leaves)
    for box, node in zip(boxes, nodes[leaves], strict=True):
        held = tree.points[node["first_point"] : node["first_point"] + node["point_count"]]
        assert (held >= box[:3]).all() and (held <= box[3:]).all()
    located = tree.locate(points)
    assert (nodes["child_mask"][located] == 0).all() and tree.locate([9, 9, 9]) == 0xFFFFFFFF
    box = np.array([0.2, 0.2, 0.2, 0.5, 0.4, 0.9], np.float32)
    inside = np.flatnonzero(((points >= box[:3]) & (points <= box[3:])).all(axis=1))
    np.testing.assert_array_equal(tree.points_in_boxes(box)["indices"], inside)
    assert tree.stats()["nodes"] == len(nodes) == sum(tree.stats()["nodes_per_level"])
    tree.check()
    with pytest.raises(raydix.InputError):
        tree.boxes([len(nodes)])


def test_kdtree_as_arrays(rng):
    points = rng.uniform(size=(2000, 3)).astype(np.float32)
    tree = raydix.kdtree(points)
    nodes = tree.nodes
    assert nodes.dtype == KD_NODE and sorted(tree.order) == list(range(2000))
    used = np.arange(len(nodes)) != 1
    leaves = nodes[used & (nodes["link"] & 3 == 3)]
    assert (leaves["link"] >> 2).sum() == 2000
    ordered = points[tree.order]

    def visit(node):
        """All positions below a node; checks the plane on the way."""
        axis, link = int(nodes["link"][node] & 3), int(nodes["link"][node] >> 2)
        if axis == 3:
            first = int(nodes["plane"][node : node + 1].view(np.uint32)[0])
            return list(range(first, first + link))
        left, right = visit(2 * link + 2), visit(2 * link + 3)
        plane = nodes["plane"][node]
        assert (ordered[left, axis] < plane).all() and (ordered[right, axis] >= plane).all()
        return left + right

    assert visit(0) == list(range(2000))
    tree.check()
    assert "2,000 primitives" in repr(tree) and tree.left_out == 0


@pytest.mark.parametrize("make", [raydix.bvh, raydix.octree, raydix.kdtree])
def test_empty_trees(make):
    tree = make(np.zeros((0, 3)))
    assert len(tree.nodes) == 0 == len(tree.order)
    tree.check()


def test_pictures(figure, tmp_path):
    for view in raydix.pictures.VIEWS:
        picture = figure.render(view=view, size=(60, 40), samples=1)
        assert (
            picture.shape == (40, 60, 3)
            and picture.dtype == np.float32
            and np.isfinite(picture).all()
            and picture.std() > 0
        )
    np.testing.assert_array_equal(picture, figure.render(view=view, size=(60, 40), samples=1))
    assert raydix.to_png(picture).startswith(b"\x89PNG")
    raydix.save_picture(tmp_path / "a.png", picture)
    assert (tmp_path / "a.png").stat().st_size > 100
    assert raydix.to_srgb([[[0, 1, 0.0031308]], [[2, -1, 0.5]]]).tolist() == [
        [[0, 255, 10]],
        [[255, 0, 188]],
    ]
    with pytest.raises(raydix.InputError, match="shaded"):
        figure.render(view="nice")
    with pytest.raises(raydix.InputError):
        raydix.save_picture(tmp_path / "a.gif", picture)
    normals = figure.render(view="normal", size=(60, 40))
    rays = figure.primary_rays(size=(60, 40))
    seen = np.zeros(60 * 40, bool)
    seen[rays["pixels"]] = figure.occluded(rays["rays"])
    np.testing.assert_array_equal(normals.max(axis=2) > 0, seen.reshape(40, 60))


def test_notebooks_see_a_table_and_a_picture(figure):
    shown = figure._repr_html_()
    assert f"{len(figure.faces):,}" in shown and "data:image/png;base64," in shown and "nodes" in shown
    assert "data:image" not in raydix.Scene([], [])._repr_html_()


def test_rays_of_cameras(figure):
    rays = figure.primary_rays(raydix.Camera((0, 1, 5), (0, 1, 0)), size=(8, 4))
    assert rays["rays"].shape == (32, 8) and sorted(rays["pixels"]) == list(range(32))
    np.testing.assert_allclose(np.linalg.norm(rays["rays"][:, 4:7], axis=1), 1, atol=1e-6)
    primary = figure.primary_rays(size=(64, 64))["rays"]
    hits = int(figure.occluded(primary).sum())
    for kind in ("ao", "diffuse", "diffuse_shuffled"):
        assert figure.secondary_rays(primary, kind, samples=3).shape == (3 * hits, 8)
    with pytest.raises(raydix.InputError, match="kind: expected one of ao"):
        figure.secondary_rays(primary, "wild")
    assert [scene["name"] for scene in raydix.scenes()]


def test_the_simulator(figure):
    rays = figure.primary_rays(size=(64, 64))["rays"]
    results = raydix.simulate(figure, rays, kernels=["packet", "while_while"], machine="gtx285")
    assert [r["kernel"] for r in results] == ["packet", "while_while"]
    for result in results:
        assert (
            result["rays"] == 4096
            and 0 < result["simd_efficiency"] <= 1
            and result["mrays_per_s_memory"] is None
        )
        assert (
            0 < result["mrays_per_s_scheduled"] <= result["mrays_per_s_bound"]
            and result["histogram"].sum() > 0
        )
        assert (
            abs(int(result["hits"]) - int(figure.occluded(rays).sum())) < 10
        )  # another triangle test at edges
    assert raydix.simulate(figure, rays, kernels="if_if", memory=True)[0]["mrays_per_s_memory"] > 0
    assert "while_while" in raydix.kernels() and "h200" in raydix.machines()
    family = [r["kernel"] for r in raydix.simulate(figure, rays[:256])]
    assert family == raydix.kernels()[:11]
    assert raydix.kernels()[11:] == ["cwbvh", "short_stack", "persistent_cwbvh", "persistent_short_stack"]
    (wide,) = raydix.simulate(figure, rays, kernels="cwbvh", width=128)
    assert wide["kernel"] == "cwbvh" and wide["rays"] == 4096
    (short,) = raydix.simulate(figure, rays, kernels="short_stack")
    assert short["kernel"] == "short_stack" and short["hits"] == wide["hits"]
    with pytest.raises(raydix.InputError, match="gtx480"):
        raydix.simulate(figure, rays, machine="abacus")


def test_rays_on_another_gpu_are_refused():
    class RaysThere:
        """As an array of a library for GPUs; nothing of it is read."""

        shape, dtype = (3, 8), "float32"

        def __dlpack_device__(self):
            return 2, 1

    class Core:
        gpu = 0

    rays = DeviceRays.__new__(DeviceRays)
    rays._core, rays._is_cuda = Core(), True
    for call in (rays.intersect, rays.occluded):
        with pytest.raises(ValueError, match="rays: expected an array on GPU 0, .* on GPU 1"):
            call(RaysThere(), None, None, None, 0xFFFFFFFF, None, 0)


def test_devices():
    cpu, cuda, *_ = raydix.devices()
    assert cpu.name == "cpu" and cpu.available and cuda.name == "cuda" and cuda.detail
    scene = raydix.Scene(*support.box_mesh([0, 0, 0], [1, 1, 1]), device="cuda")
    rays = np.float32([[0.5, 0.4, 9, 0, 0, 0, -1, np.inf], [5, 5, 9, 0, 0, 0, -1, np.inf]])
    if not cuda.available:
        with pytest.raises(raydix.BackendUnavailable):
            scene.intersect(rays)
        return
    wanted = raydix.Scene(scene).intersect(rays)
    for field, values in scene.intersect(rays).items():
        np.testing.assert_array_equal(values, wanted[field])
    np.testing.assert_array_equal(scene.occluded(rays), [True, False])


def test_scenes_on_devices():
    """Of several meshes: the same hits there. What they cannot trace is named, with and without a
    device."""
    box = support.box_mesh([0, 0, 0], [1, 1, 1])
    scenes = [raydix.Scene(device=device) for device in ("cpu", "cuda")]
    for scene in scenes:
        for id, shift, mask in ((1, 0, 1), (2, 0, 2), (18, 3, 0xFFFFFFFF), (30, 6, 0)):
            scene.add(box[0] + np.float32([shift, 0, 0]), box[1], mask=mask, id=id)
        scene.commit()
    cpu, cuda = scenes
    rays = np.float32([[x, 0.4, 9, 0, 0, 0, -1, np.inf] for x in (0.5, 3.5, 6.5, 20)])
    wanted = cpu.intersect(rays)
    assert wanted["geometry"].tolist() == [1, 18, raydix.MISSING, raydix.MISSING]
    if raydix.devices()[1].available:
        for field, values in cuda.intersect(rays).items():
            np.testing.assert_array_equal(values, wanted[field])
        np.testing.assert_array_equal(cuda.occluded(rays), [True, True, False, False])
        with pytest.raises(raydix.BackendUnavailable, match="mask: rays on a device have none"):
            cuda.intersect(rays, mask=1)
    else:
        with pytest.raises(raydix.BackendUnavailable, match="CUDA"):
            cuda.intersect(rays)
    cuda.add(cpu, np.eye(4), id=70)
    cuda.commit()
    for call in (cuda.intersect, cuda.occluded):
        with pytest.raises(raydix.BackendUnavailable, match="geometry 70 is an instance"):
            call(rays)
    never = raydix.Scene(device="cuda")
    with pytest.raises(raydix.InputError, match="never committed"):
        never.intersect(rays)


def test_stubs_say_what_the_module_has(tmp_path):
    if importlib.util.find_spec("nanobind") is None:
        pytest.skip("nanobind is not installed, which makes the stubs")
    made = tmp_path / "_core.pyi"
    subprocess.run(
        [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "raydix._core", "-o", made],
        check=True,
    )
    kept = pathlib.Path(raydix.__file__).with_name("_core.pyi")
    assert made.read_text() == kept.read_text(), "run scripts/python-stubs"
