"""Files with meshes and nodes: geometries and instances in hits and pictures, and --flatten."""
import base64
import json
import struct
import sys

sys.dont_write_bytecode = True
from program import MISS, ProgramTest, main, read_hits, read_npy, write_npy  # noqa: E402

# Geometries 0 and 1: squares at z = 0 and z = 1 (mesh 0); geometry 2: a square at z = 0 (mesh 1).
# Nodes in depth-first order: node 2 (mesh 1) is path 1; node 0 (mesh 0, at x = 10) path 2; node 1 below it (mesh 1,
# mirrored in x, at z = 2) path 3.
RAYS = [((0.75, 0.25, 5), (5.0, 0, 2, 1)), ((0.25, 0.75, 5), (5.0, 1, 2, 1)), ((10.75, 0.25, 5), (4.0, 0, 1, 2)),
        ((9.25, 0.25, 5), (3.0, 0, 2, 3)), ((9.75, 0.75, 5), (3.0, 1, 2, 3)), ((5, 0.5, 5), None)]
FLAT_PRIMS = [0, 1, 4, 6, 7, MISS]
# (instance, geometry, prim) of the triangles of the flat mesh.
FLAT_NAMES = [(1, 2, 0), (1, 2, 1), (2, 0, 0), (2, 0, 1), (2, 1, 0), (2, 1, 1), (3, 2, 0), (3, 2, 1)]


def document(nodes=None, scene=(2, 0)):
    square = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)
    raised = struct.pack("<12f", 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1)
    data = square + raised + struct.pack("<6H", 0, 1, 2, 0, 2, 3)

    def primitive(position):
        return {"attributes": {"POSITION": position}, "indices": 2}

    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(scene)}],
        "nodes": nodes or [{"name": "house", "mesh": 0, "translation": [10, 0, 0], "children": [1]},
                           {"name": "sign", "mesh": 1, "translation": [0, 0, 2], "scale": [-1, 1, 1]}, {"mesh": 1}],
        "meshes": [{"primitives": [primitive(0), primitive(1)]}, {"primitives": [primitive(0)]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 96, "byteLength": 12}],
        "buffers": [{"byteLength": len(data),
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]})


def read_scene_hits(file):
    """[(t, prim, u, v, geometry, instance)]"""
    descr, shape, data = read_npy(file)
    assert descr == [("t", "<f4"), ("prim", "<u4"), ("u", "<f4"), ("v", "<f4"), ("geometry", "<u4"),
                     ("instance", "<u4")], descr
    hits = list(struct.iter_unpack("<fIffII", data))
    assert shape == (len(hits),), shape
    return hits


class Gltf(ProgramTest):
    def setUp(self):
        self.scene = self.write("scene.gltf", document())
        self.rays = str(self.folder / "rays.npy")
        self.hits = str(self.folder / "hits.npy")
        write_npy(self.rays, "<f4", (len(RAYS), 8),
                  b"".join(struct.pack("<8f", *origin, 0, 0, 0, -1, 100) for origin, _ in RAYS))

    def trace(self, *options):
        return self.document("trace", self.scene, "--rays", self.rays, "--hits", self.hits, "--repeat", "1", *options)

    def test_hits_say_where(self):
        for options in ((), ("--layout", "compact"), ("--quality", "fast"), ("--path", "single"), ("--threads", "1")):
            with self.subTest(options=options):
                made = self.trace(*options)
                self.assertEqual((made["scene"]["geometries"], made["scene"]["instances"]), (3, 3))
                self.assertEqual(made["trace"][0]["hits"], 5)
                for hit, (_, wanted) in zip(read_scene_hits(self.hits), RAYS, strict=True):
                    t, prim, geometry, instance = wanted or (float("inf"), MISS, MISS, 0)
                    self.assertEqual((hit[0], hit[1], hit[4], hit[5]), (t, prim, geometry, instance))

    def test_flatten_counts_through(self):
        for options in (("--flatten",), ("--builder", "karras"), ("--kernel", "scalar"), ("--layout", "wide4")):
            with self.subTest(options=options):
                made = self.trace(*options)
                self.assertEqual((made["scene"]["geometries"], made["scene"]["instances"]), (1, 0))
                hits = read_hits(self.hits)
                self.assertEqual([hit[1] for hit in hits], FLAT_PRIMS)
                self.assertEqual([hit[0] for hit in hits][:5], [wanted[0] for _, wanted in RAYS[:5]])

    def test_strict_keeps_the_structure(self):
        made = self.trace("--strict")
        self.assertEqual((made["scene"]["geometries"], made["scene"]["instances"]), (3, 3))
        self.assertNotIn("flattened", made["scene"])
        self.assertEqual(read_scene_hits(self.hits)[0][4:6], RAYS[0][1][2:4])

    def test_quiet_says_what_was_flattened(self):
        result = self.run_program("trace", self.scene, "--rays", self.rays, "--builder", "karras", "--quiet", "--json", "flat.json")
        self.assertEqual((result.code, result.out), (0, ""))
        self.assertEqual(result.err, "raydix: " + self.scene + ": its meshes and nodes are taken as one mesh (--flatten)\n")
        self.assertIs(json.loads((self.folder / "flat.json").read_text())["scene"]["flattened"], True)
        self.assertEqual(self.succeed("trace", self.scene, "--rays", self.rays, "--flatten", "--quiet").out, "")
        self.assertIs(self.document("query", self.scene, "--closest", "--builder", "ploc")["scene"]["flattened"], True)

    def test_devices_take_one_mesh(self):
        self.assertIn("its 3 meshes and 3 nodes are taken as one mesh (--flatten)",
                      self.succeed("trace", self.scene, "--device", "sim", "--size", "8x8").out)
        for options in ((), ("--flatten",)):
            self.trace("--device", "sim", *options)
            self.assertEqual([hit[1] for hit in read_hits(self.hits)], FLAT_PRIMS)

    def test_what_takes_one_mesh_says_so(self):
        note = "scene.gltf: its 3 meshes and 3 nodes are taken as one mesh (--flatten)"
        for command in (("build", self.scene), ("trace", self.scene, "--kernel", "scalar", "--size", "8x8"),
                        ("query", self.scene, "--closest", "--builder", "ploc"), ("query", self.scene, "--knn", "1"),
                        ("check", self.scene)):
            with self.subTest(command=command):
                self.assertIn(note, self.succeed(*command).out)
                self.assertNotIn(note, self.succeed(*command, "--flatten").out)
        self.assertNotIn(note, self.succeed("trace", self.scene, "--size", "8x8").out)

    def columns(self, *names):
        """The .npy files of q: rows of whole numbers."""
        files = []
        for name in names:
            descr, shape, data = read_npy(self.folder / f"q.{name}.npy")
            self.assertEqual(descr, "<u4", name)
            values = struct.unpack(f"<{len(data) // 4}I", data)
            files.append(values if len(shape) == 1 else list(zip(*[iter(values)] * 2)))
        return files

    def test_queries_keep_the_structure(self):
        """Answers are those of --flatten, ids apart."""
        queries = str(self.folder / "queries.npy")
        points = [(0.7, 0.2, 0.5), (0.2, 0.7, -1), (10.5, 0.2, 1.4), (9.2, 0.1, 2.5), (5, 5, 5), (float("nan"), 0, 0)]
        write_npy(queries, "<f4", (len(points), 3), b"".join(struct.pack("<3f", *p) for p in points))
        self.succeed("build", self.scene, "--repeat", "1", "-o", "scene.rdx")

        def query(scene, *options):
            return self.document("query", scene, *options, "--out", "q", "--repeat", "0")

        flat = query(self.scene, "--closest", "--queries", queries, "--flatten")
        (prims,) = self.columns("indices")
        places = [(self.folder / f"q.{name}.npy").read_bytes() for name in ("distances", "points")]
        for scene in (self.scene, str(self.folder / "scene.rdx")):
            kept = query(scene, "--closest", "--queries", queries)
            self.assertEqual((kept["scene"]["geometries"], kept["scene"]["instances"]), (3, 3))
            for field in ("kind", "queries", "found", "invalid_queries"):
                self.assertEqual(kept["query"][0][field], flat["query"][0][field])
            names = list(zip(*self.columns("instances", "geometries", "indices")))
            self.assertEqual(names, [FLAT_NAMES[p] if p != MISS else (0, MISS, MISS) for p in prims])
            self.assertEqual([(self.folder / f"q.{name}.npy").read_bytes() for name in ("distances", "points")], places)
        self.assertIn("--queries", self.run_program("query", "scene.rdx", "--closest").err)
        self.document("query", self.scene, "--closest", "--repeat", "0")  # its own points

        flat = query(self.scene, "--signed-distance", "--queries", queries, "--flatten")
        distances = (self.folder / "q.distances.npy").read_bytes()
        kept = query(self.scene, "--signed-distance", "--queries", queries)
        self.assertEqual((self.folder / "q.distances.npy").read_bytes(), distances)
        self.assertEqual(kept["solid"], flat["solid"])

        # Two squares, and a third that goes through both.
        crossed = self.write("crossed.gltf", document(
            [{"mesh": 0}, {"mesh": 1, "translation": [0.25, 0.25, -0.25], "scale": [1, 2, 1],
                           "rotation": [0.7071067811865476, 0, 0, 0.7071067811865476]}], [0, 1]))
        names = [(1, 0, 0), (1, 0, 1), (1, 1, 0), (1, 1, 1), (2, 2, 0), (2, 2, 1)]
        for first, second, options in ((names, names, (crossed,)), (FLAT_NAMES, names, (self.scene, "--with", crossed))):
            query(*options, "--pairs", "--flatten")
            (pairs,) = self.columns("pairs")
            self.assertGreater(len(pairs), 1)
            found = query(*options, "--pairs")["query"][0]
            self.assertEqual((found["queries"], found["found"]), (len(first), len(pairs)))
            prims, geometries, instances = self.columns("pairs", "pairs-geometries", "pairs-instances")
            self.assertEqual([tuple(zip(*row)) for row in zip(instances, geometries, prims)],
                             [(first[i], second[j]) for i, j in pairs])
        self.fail_with_one_line("query", self.scene, "--pairs", "--max-result-bytes", "100", names=("scene.gltf", "bytes"))

    def test_info_counts_both(self):
        info = self.document("info", self.scene)["scene"]
        self.assertEqual([info[name] for name in ("geometries", "instances", "triangles", "vertices")], [3, 3, 8, 16])
        self.assertIn("3 meshes in 3 nodes", self.succeed("info", self.scene).out)

    def test_any_hits_are_bytes(self):
        for options in ((), ("--flatten",), ("--kernel", "scalar")):
            self.trace("--mode", "any", *options)
            descr, shape, data = read_npy(self.hits)
            self.assertEqual((descr, shape, data), ("|u1", (6,), bytes([1, 1, 1, 1, 1, 0])))

    def test_all_hits(self):
        self.trace("--mode", "all")
        _, _, offsets = read_npy(str(self.folder / "hits.offsets.npy"))
        self.assertEqual(struct.unpack("<7Q", offsets), (0, 1, 2, 4, 5, 6, 6))
        hits = read_scene_hits(self.hits)
        self.assertEqual([(hit[0], hit[4], hit[5]) for hit in hits[2:4]], [(4.0, 1, 2), (5.0, 0, 2)])

    def test_rays_of_cameras_and_pictures(self):
        """What a picture shows does not depend on whether its scene is one mesh."""
        values = []
        for flat in ((), ("--flatten",)):
            made = [self.document("trace", self.scene, "--rays", rays, "--size", "32x24", "--repeat", "1", *flat)
                    for rays in ("primary", "ao", "diffuse")]
            values.append([(one["trace"][0]["count"], one["trace"][0]["hits"]) for one in made])
            for view in ("shaded", "normal", "depth", "ao", "steps"):
                self.succeed("render", self.scene, "--view", view, "--size", "32x24", "-o",
                             str(self.folder / f"{view}{len(flat)}.png"), *flat)
        for (count, hits), (flat_count, flat_hits) in zip(*values, strict=True):
            self.assertGreater(count, 0)
            self.assertAlmostEqual(count, flat_count, delta=flat_count / 100)
            self.assertAlmostEqual(hits, flat_hits, delta=max(3, flat_hits / 50))
        for view in ("normal", "depth"):
            self.assertEqual(*((self.folder / f"{view}{k}.png").read_bytes() for k in (0, 1)))

    def test_one_mesh_at_rest_is_one_mesh(self):
        self.scene = self.write("one.gltf", json.dumps(
            {**json.loads(document([{"mesh": 0}], [0])),
             "meshes": [json.loads(document())["meshes"][1]]}))
        self.trace()
        self.assertEqual([hit[1] for hit in read_hits(self.hits)], [0, 1, MISS, MISS, MISS, MISS])

    def test_a_node_that_flattens(self):
        self.scene = self.write("flat.gltf", document([{"mesh": 0}, {"name": "paper", "mesh": 1, "scale": [1, 1, 0]}],
                                                      [0, 1]))
        self.fail_with_one_line("trace", self.scene, "--size", "8x8",
                                names=("flat.gltf", "node 1 (paper)", "singular", "--flatten"))
        self.succeed("trace", self.scene, "--size", "8x8", "--flatten")


if __name__ == "__main__":
    main()
