"""Scenes from files that have nodes, and whole scenes in .rdx files."""

import base64
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
import support
from worlds import ALL, BOX, DOWN, random_world, same_hits, transform, triangles

import raydix


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


def test_cameras_of_another_program(tmp_path):
    file = tmp_path / "one.gltf"
    file.write_text(triangle_gltf([{"mesh": 0}], [0]))
    (tmp_path / "cameras.json").write_text('[{"id": 0}]')
    with pytest.warns(UserWarning, match="cameras.json: camera 1: position is missing"):
        scene = raydix.Scene(file)
    assert len(scene.cameras) == 1


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
    near = scene.closest_point([[10.2, 0.2, 1], [0.2, 0.2, 2]])
    assert near["distance"].tolist() == [1, 2] and near["prim"].tolist() == [0, 0]
    assert near["instance"].tolist() == hits["instance"][[0, 2]].tolist()
    assert scene.closure()["closure"] == "open"
    with pytest.raises(raydix.InputError, match=f"faces: geometry {first} is an instance"):
        scene.faces
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


@pytest.mark.parametrize("options", [{}, {"compact": True}, {"quality": "high"}])
def test_saved_scenes_have_the_same_hits(rng, tmp_path, options):
    world = random_world(rng).scene
    world.name = "a world"
    world.commit(**options)
    world.save(tmp_path / "world.rdx")
    loaded = raydix.load_scene(tmp_path / "world.rdx", threads=1)
    (tmp_path / "world.rdx").unlink()
    assert loaded.committed and list(loaded) == list(world) and loaded.name == "a world"
    assert loaded.threads == 1 and "5 geometries" in repr(loaded)
    np.testing.assert_array_equal(loaded.bounds, world.bounds)
    rays = support.random_rays(rng, 500)
    rays[:, :3] *= 2
    for mask in (1, 0b1000, ALL):
        wanted = world.intersect(rays, mask=mask)
        same_hits(loaded.intersect(rays, mask=mask), wanted)
        same_hits(loaded.all_hits(rays, mask=mask), world.all_hits(rays, mask=mask))
    assert (wanted["instance"] > 0).sum() > 20
    np.testing.assert_array_equal(loaded.positions(wanted), world.positions(wanted))
    for number in set(wanted["instance"].tolist()):
        assert loaded.path(number) == world.path(number)
    points = rng.uniform(-3, 3, (100, 3))
    for call in ("closest_point", "touched_by"):
        asked = {"spheres": np.pad(points, ((0, 0), (0, 1)), constant_values=0.5)}
        asked = asked if call == "touched_by" else {"points": points}
        same_hits(getattr(loaded, call)(**asked), getattr(world, call)(**asked))
    same_hits(loaded.overlaps(narrow=True), world.overlaps(narrow=True))
    np.testing.assert_array_equal(loaded.signed_distance(points), world.signed_distance(points))
    with pytest.raises(raydix.InputError, match="faces: geometry 0 is an instance"):
        loaded.faces


def test_loaded_scenes_change_as_those_that_were_saved(rng, tmp_path):
    """Each change, made to both; the file does not change."""
    world = random_world(rng).scene
    world.commit(usage="moving")
    world.save(tmp_path / "world.rdx")
    loaded = raydix.load_scene(tmp_path / "world.rdx")
    rays = support.random_rays(rng, 300)
    rays[:, :3] *= 2
    place, vertices, more = transform(rng), triangles(rng, 15)[0], triangles(rng, 8)
    leaf = raydix.Scene(*triangles(rng, 10))
    changes = (
        lambda s: s.set_transform(0, place),
        lambda s: s.update(1, vertices),  # the triangles are those of the file
        lambda s: s.set_mask(4, 1),
        lambda s: s.remove(2),
        lambda s: s.add(leaf, place),
        lambda s: s.update(4, *more),
        lambda s: s.add(*more),
    )
    for change in changes:
        reports = []
        for scene in (world, loaded):
            change(scene)
            reports.append(scene.commit())
        for name in ("meshes", "instances", "triangles", "paths"):
            assert reports[0][name] == reports[1][name]
        assert list(world) == list(loaded)
        for mask in (1, ALL):
            same_hits(loaded.intersect(rays, mask=mask), world.intersect(rays, mask=mask))
    for id in (0, 4):
        for scene in (world, loaded):
            with pytest.raises(raydix.InputError, match=f"geometry {id}"):
                scene.add(leaf, place, id=id)
    with pytest.raises(raydix.InputError, match="geometry 0 is an instance, not a mesh"):
        loaded.update(0, vertices)
    with pytest.raises(raydix.InputError, match="geometry 1 is a mesh, not an instance"):
        loaded.set_transform(1, place)
    before = raydix.load_scene(tmp_path / "world.rdx")
    outer = raydix.Scene()
    outer.add(before, place)
    del before
    outer.commit()
    assert outer.occluded(rays).any()
    outer.save(tmp_path / "outer.rdx")  # what it places comes from a file
    same_hits(raydix.load_scene(tmp_path / "outer.rdx").intersect(rays), outer.intersect(rays))


def test_one_mesh_of_a_file_answers_all_queries(rng, tmp_path):
    vertices, faces = triangles(rng, 200, 0.2)
    points = rng.uniform(-1, 1, (100, 3))
    scene = raydix.Scene(vertices, faces)
    two = raydix.Scene(vertices, faces)
    two.add(*BOX, id=4_000_000_000)
    two.commit()
    for saved, name in ((scene, "one.rdx"), (two, "two.rdx")):
        saved.save(tmp_path / name)
    loaded, rest = (raydix.load_scene(tmp_path / name) for name in ("one.rdx", "two.rdx"))
    assert (rest.closest_point(points)["geometry"] == 4_000_000_000).any()
    with pytest.raises(raydix.InputError, match="geometry 4000000000 is a second mesh"):
        rest.stats()
    assert list(rest) == [0, 4_000_000_000]
    rest.remove(4_000_000_000)
    rest.commit()
    for one in (loaded, rest):
        np.testing.assert_array_equal(one.vertices, vertices)
        np.testing.assert_array_equal(one.faces, faces)
        near, wanted = one.closest_point(points), scene.closest_point(points)
        same_hits(near, wanted)
        assert one.stats()["tree_hash"] == scene.stats()["tree_hash"]
        one.check()
        moved = raydix.Scene(vertices + np.float32(0.125), faces)
        one.refit(vertices + np.float32(0.125))
        rays = support.random_rays(rng, 300)
        same_hits(one.intersect(rays), moved.intersect(rays))
        same_hits(one.closest_point(points), moved.closest_point(points))
    empty = raydix.Scene()
    empty.commit()
    empty.save(tmp_path / "empty.rdx")
    assert not raydix.load_scene(tmp_path / "empty.rdx").occluded(DOWN)


def test_cameras_go_with_the_scene(tmp_path):
    scene = raydix.Scene("builtin:figure?triangles=5000")
    scene.save(tmp_path / "figure.rdx")
    loaded = raydix.load_scene(tmp_path / "figure.rdx")
    assert loaded.cameras == scene.cameras and loaded.name == scene.name
    np.testing.assert_array_equal(loaded.render(size=(40, 30)), scene.render(size=(40, 30)))


def test_files_that_hold_no_scene(tmp_path):
    scene = raydix.Scene(*BOX)
    with pytest.raises(raydix.InputError, match="nowhere"):
        scene.save(tmp_path / "nowhere" / "box.rdx")
    scene.set_mask(0, 2)
    with pytest.raises(raydix.InputError, match="commit"):
        scene.save(tmp_path / "box.rdx")
    with pytest.raises(raydix.InputError, match="never committed"):
        raydix.Scene().save(tmp_path / "box.rdx")
    assert not (tmp_path / "box.rdx").exists()
    scene.commit()
    scene.save(tmp_path / "box.rdx")
    data = bytearray((tmp_path / "box.rdx").read_bytes())
    for broken in (b"", bytes(data[:100]), bytes(data[:-70]), bytes(data[:64]) + b"x" * 400):
        (tmp_path / "broken.rdx").write_bytes(broken)
        with pytest.raises(raydix.InputError, match="broken.rdx"):
            raydix.load_scene(tmp_path / "broken.rdx")
    with pytest.raises(raydix.InputError, match="missing.rdx"):
        raydix.load_scene(tmp_path / "missing.rdx")
    with pytest.raises(TypeError):
        raydix.load_scene(3)


@pytest.mark.parametrize("place", ["notes\0y.rdx", b"notes\0y.rdx", pathlib.Path("notes\0y.rdx")])
def test_paths_with_a_nul_are_refused(place, tmp_path, monkeypatch):
    """The system takes the part before it: another file would be written, or nothing for ever."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes").write_text("mine")
    (tmp_path / "p").write_text("0 0 0")
    told = r"^notes\\x00y.rdx: a path must not hold a NUL"
    with pytest.raises(raydix.InputError, match=told):
        raydix.load_scene(place)
    picture = np.zeros((2, 2, 3))
    for call in (
        lambda: raydix.Scene("p\0.xyz"),
        lambda: raydix.load_points(b"p\0.xyz"),
        lambda: raydix.save_picture("p\0.png", picture),
        lambda: raydix.simulate(raydix.Scene(*BOX), np.ones((1, 8)), machine="p\0.json"),
    ):
        with pytest.raises(raydix.InputError, match=r"^p\\x00.*: a path must not hold a NUL"):
            call()
    # In a process of its own: what failed before held the interpreter's lock for ever.
    code = """
import signal, sys, numpy as np, raydix
signal.alarm(60)
scene = raydix.Scene(np.eye(3), [[0, 1, 2]])
try:
    scene.save("notes\\0y.rdx")
except raydix.InputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "notes\\x00y.rdx: a path must not hold a NUL character\n", done.stderr
    assert sorted(os.listdir(tmp_path)) == ["notes", "p"]
    assert (tmp_path / "notes").read_text() == "mine"


def test_paths_of_any_encoding(tmp_path, rng):
    """Names that are no UTF-8, as str with surrogates, as bytes, and as a path."""
    world, rays = random_world(rng).scene, support.random_rays(rng, 200)
    world.commit()
    for name in (b"\xff.rdx", "\udcfe.rdx", "häuser.rdx"):
        file = os.path.join(os.fsencode(tmp_path), os.fsencode(name))
        for form in (file, os.fsdecode(file), pathlib.Path(os.fsdecode(file))):
            world.save(form)
            assert raydix.load_scene(form).intersect(rays) == world.intersect(rays)
    file = os.path.join(os.fsencode(tmp_path), b"\xff.xyz")
    pathlib.Path(os.fsdecode(file)).write_text("0 0 0\n1 2 3\n")
    for form in (file, os.fsdecode(file)):
        assert raydix.load_points(form).tolist() == [[0, 0, 0], [1, 2, 3]]
        with pytest.warns(UserWarning, match="2 vertices without triangles"):
            scene = raydix.Scene(form)
        assert len(scene.vertices) == 2
        scene.save(tmp_path / "named.rdx")
        assert raydix.load_scene(tmp_path / "named.rdx").name
    raydix.save_picture(file[:-4] + b".png", np.zeros((2, 2, 3)))
    assert os.path.exists(file[:-4] + b".png")
    with pytest.raises(raydix.InputError, match=r"\\xFD.rdx"):
        raydix.load_scene(b"/no such folder/\xfd.rdx")
