"""What is not finite or out of range is counted in every document and named in the tables; info of files and of saved scenes."""
import base64
import json
import struct
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main, ply  # noqa: E402

FAR = ply([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2e12, 0, 0), (0, 0, "nan")], [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
LINE = "2 triangles left out: not finite, or out of range"
SIZE = ("--size", "8x8", "--camera", "0")


def nodes(count, third=1.0):
    """One triangle in nodes at x = 0, 10, 20, ...; `third`: the x of its second corner."""
    data = struct.pack("<12f", 0, 0, 0, third, 0, 0, 0, 1, 0, 5, 5, 5) + struct.pack("<6H", 0, 1, 2, 0, 0, 2)
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(count))}],
        "nodes": [{"mesh": 0, "translation": [10 * k, 0, 0]} for k in range(count)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "buffers": [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]})


class LeftOut(ProgramTest):
    def check(self, *arguments, count=2, line=LINE):
        with self.subTest(arguments):
            self.assertEqual(self.document(*arguments)["scene"]["left_out"], count)
            self.assertIn(line, self.succeed(*arguments).out)

    def test_every_command_counts_them(self):
        far = self.write("far.ply", FAR)
        trace = ("trace", far, "--repeat", "1", *SIZE)
        for options in ((), ("--kernel", "scalar"), ("--tree", "kdtree"), ("--device", "sim")):
            self.check(*trace, *options)
        for view in ("shaded", "tree", "slice"):
            self.check("render", far, *SIZE, "-o", "far.png", "--view", view)
        self.check("simulate", far, *SIZE, "--rays", "primary", "--kernel", "while_while")
        for kind in ("--closest", "--signed-distance", "--pairs"):
            self.check("query", far, kind, "--repeat", "0")
            self.check("query", far, kind, "--repeat", "0", "--builder", "ploc")
        self.check("build", far, "--layout", "wide8", "--repeat", "1", "-o", "far.rdx")
        self.check("trace", "far.rdx", "--repeat", "1", *SIZE)
        self.check("render", "far.rdx", *SIZE, "-o", "far.png")
        for tree in ("bvh", "octree", "kdtree"):
            self.check("build", far, "--tree", tree, "--repeat", "1", line="2 left out")
        for scene in (far, "far.rdx"):
            self.check("info", scene, line="left out     2 triangles of a tree")

    def test_scenes_of_nodes(self):
        """Each geometry counts once, however often nodes show it."""
        self.write("nodes.gltf", nodes(3, 2e12))
        self.check("trace", "nodes.gltf", "--repeat", "1", *SIZE, count=1, line="1 triangle left out")
        self.check("build", "nodes.gltf", "--repeat", "1", "-o", "far.rdx", count=1, line="1 triangle left out")
        self.check("render", "far.rdx", *SIZE, "-o", "far.png", count=1, line="1 triangle left out")

    def test_none(self):
        fine = self.write("fine.ply", ply([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
        self.assertEqual(self.document("trace", fine, *SIZE, "--repeat", "1")["scene"]["left_out"], 0)
        self.assertNotIn("left out", self.succeed("trace", fine, *SIZE, "--repeat", "1").out)

    def test_points(self):
        cloud = self.write("cloud.ply", ply([(0, 0, 0), (1, 0, "nan"), (0, 3e12, 0), (1, 1, 1)]))
        self.check("info", cloud, line="left out     2 points of a tree")
        self.assertEqual(self.document("query", cloud, "--knn", "1")["scene"]["left_out"], 2)


class Info(ProgramTest):
    def test_a_saved_scene_shows_what_its_file_showed(self):
        self.write("nodes.gltf", nodes(3))
        self.succeed("build", "nodes.gltf", "--repeat", "1", "-o", "nodes.rdx")
        wanted, scene = (self.document("info", name)["scene"] for name in ("nodes.gltf", "nodes.rdx"))
        self.assertEqual((wanted["triangles"], wanted["bounds"]), (6, [[0, 0, 0], [25, 5, 5]]))
        self.assertEqual((wanted["zero_area_triangles"], wanted["unreferenced_vertices"]), (3, 3))
        for field in wanted.keys() - {"name", "bytes", "geometries", "instances"}:
            self.assertEqual(scene[field], wanted[field], field)
        text = [self.succeed("info", name).out for name in ("nodes.gltf", "nodes.rdx")]
        for line in ("triangles    6", "bounds       (0, 0, 0) to (25, 5, 5)", "zero area    3 triangles"):
            for out in text:
                self.assertIn(line, out)

    def test_bounds_of_maps(self):
        file = self.write("map.ply", ply([(500000.25, 5400000.5, 0), (500001.25, 5400001.5, 1), (500000.5, 5400001, 0)], [(0, 1, 2)]))
        self.assertIn("bounds       (500000.25, 5400000.5, 0) to (500001.25, 5400001.5, 1)", self.succeed("info", file).out)


if __name__ == "__main__":
    main()
