"""Scenes from files that have nodes."""

import base64
import json

import numpy as np
import pytest
from worlds import BOX

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
