"""query --closest, --signed-distance, --pairs: files that a script can repeat, refusals."""
import math
import struct
import sys

sys.dont_write_bytecode = True
from program import MISS, TRIANGLE, ProgramTest, main, ply, read_npy, write_npy  # noqa: E402

FIGURE = "builtin:figure?triangles=5000"
BOX = ply([(x, y, z) for z in (0, 2) for y in (0, 2) for x in (0, 2)],
          [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
           (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)])


def f32(x):
    return struct.unpack("<f", struct.pack("<f", x))[0]


class QueryMesh(ProgramTest):
    def queries(self, points):
        file = str(self.folder / "queries.npy")
        write_npy(file, "<f4", (len(points), 3), b"".join(struct.pack("<3f", *p) for p in points))
        return file

    def column(self, name, descr, shape):
        found, found_shape, data = read_npy(self.folder / name)
        self.assertEqual((found, found_shape), (descr, shape))
        return [v[0] for v in struct.iter_unpack({"<f4": "<f", "<u4": "<I"}[descr], data)]

    def test_closest(self):
        scene = self.write("box.ply", BOX)
        points = [(1, 1, 5), (-1, -1, -1), (1, 0.5, 0.25), (math.nan, 0, 0)]
        document = self.document("query", scene, "--closest", "--queries", self.queries(points), "--out", "c", "--repeat", "1")
        query = document["query"][0]
        self.assertEqual((query["kind"], query["queries"], query["found"], query["invalid_queries"]), ("closest", 4, 3, 1))
        prims = self.column("c.indices.npy", "<u4", (4,))
        distances = self.column("c.distances.npy", "<f4", (4,))
        places = self.column("c.points.npy", "<f4", (4, 3))
        self.column("c.uv.npy", "<f4", (4, 2))
        self.assertEqual(places[:6], [1, 1, 2, 0, 0, 0])
        self.assertEqual(prims[3], MISS)
        self.assertEqual(distances[3], math.inf)
        self.assertEqual(prims[1], 0)  # a corner of six triangles: the lowest
        for i in range(3):
            off = [f32(places[3 * i + k] - f32(points[i][k])) for k in range(3)]
            d2 = f32(f32(f32(off[0] * off[0]) + f32(off[1] * off[1])) + f32(off[2] * off[2]))
            self.assertEqual(distances[i], f32(math.sqrt(d2)))

    def test_closest_is_the_same_for_every_builder(self):
        first = None
        for builder in ("apetrei", "binned", "sbvh"):
            self.succeed("query", FIGURE, "--closest", "--queries", "builtin:uniform?points=2000", "--builder", builder,
                         "--out", builder, "--threads", "2", "--repeat", "0")
            files = [read_npy(self.folder / f"{builder}.{name}.npy") for name in ("indices", "distances", "points", "uv")]
            first = first or files
            self.assertEqual(files, first)

    def test_the_text_says_whether_the_mesh_is_closed(self):
        queries = self.queries([(0, 0, 1)])
        for name, mesh, line in (("closed.ply", BOX, "solid        oriented, inside by crossings\n"),
                                 ("open.ply", TRIANGLE, "solid        open (3 open edges), inside by winding number\n")):
            for options in ((), ("--builder", "ploc")):
                text = self.succeed("query", self.write(name, mesh), "--signed-distance", "--queries", queries, "--repeat", "0", *options).out
                self.assertIn(line, text)

    def test_signed_distance(self):
        scene = self.write("box.ply", BOX)
        points = [(1, 1, 1), (1, 1, 3), (2, 2, 2), (3, 2, 2), (0.5, 1, 1), (math.inf, 0, 0)]
        document = self.document("query", scene, "--signed-distance", "--queries", self.queries(points), "--out", "s", "--repeat", "0")
        self.assertEqual(self.column("s.distances.npy", "<f4", (6,)), [-1, 1, 0, 1, -0.5, math.inf])
        self.assertEqual(document["solid"], {"closure": "oriented", "rule": "crossings", "open_edges": 0})
        self.assertEqual(document["query"][0]["invalid_queries"], 1)
        triangle = self.write("triangle.ply", TRIANGLE)
        document = self.document("query", triangle, "--signed-distance", "--queries", self.queries([(0, 0, 1)]), "--repeat", "0")
        self.assertEqual(document["solid"], {"closure": "open", "rule": "winding", "open_edges": 3})

    def test_pairs(self):
        # Two crossing triangles, one beside them whose box overlaps, one far away.
        scene = self.write("pairs.ply", ply(
            [(0, 0, 0), (4, 0, 0), (0, 4, 0), (1, 1, -1), (1, 1, 1), (2, 1, 1),
             (3.5, 3.5, 0), (3.6, 3.5, 0), (3.5, 3.6, 0), (9, 9, 9), (10, 9, 9), (9, 10, 9)],
            [(0, 1, 2), (3, 4, 5), (6, 7, 8), (9, 10, 11)]))
        for flags, expected in (((), [0, 1, 0, 2]), (("--narrow",), [0, 1])):
            document = self.document("query", scene, "--pairs", *flags, "--out", "p", "--repeat", "1")
            self.assertEqual(self.column("p.pairs.npy", "<u4", (len(expected) // 2, 2)), expected)
            self.assertEqual((document["query"][0]["kind"], document["query"][0]["found"]), ("pairs", len(expected) // 2))
        other = self.write("one.ply", ply([(1, 1, -1), (1, 1, 1), (2, 1, 1)], [(0, 1, 2)]))
        self.succeed("query", scene, "--pairs", "--narrow", "--with", other, "--out", "w", "--repeat", "0")
        self.assertEqual(self.column("w.pairs.npy", "<u4", (2, 2)), [0, 0, 1, 0])
        none = self.document("query", other, "--pairs", "--out", "n", "--repeat", "0")
        self.assertEqual(none["query"][0]["found"], 0)
        self.column("n.pairs.npy", "<u4", (0, 2))
        self.assertIn("pairs", self.succeed("query", FIGURE, "--pairs", "--repeat", "0").out)

    def test_a_tree_from_a_file(self):
        scene = self.write("box.ply", BOX)
        self.succeed("build", scene, "-o", "box.rdx", "--repeat", "1")
        queries = self.queries([(1, 1, 1)])
        self.succeed("query", "box.rdx", "--signed-distance", "--queries", queries, "--out", "r", "--repeat", "0")
        self.assertEqual(self.column("r.distances.npy", "<f4", (1,)), [-1])

    def test_refusals(self):
        self.fail_with_usage("query", FIGURE, names=["exactly one"])
        self.fail_with_usage("query", FIGURE, "--closest", "--pairs", names=["exactly one"])
        self.fail_with_usage("query", FIGURE, "--closest", "--narrow", names=["--narrow", "--pairs"])
        self.fail_with_usage("query", FIGURE, "--closest", "--with", FIGURE, names=["--with", "--pairs"])
        self.fail_with_usage("query", FIGURE, "--pairs", "--builder", "nonsense")
        self.fail_with_usage("query", FIGURE, "--closest", "--tree", "kdtree", names=["--tree"])
        self.fail_with_usage("query", FIGURE, "--knn", "1", "--builder", "ploc", names=["--builder"])
        self.fail_with_usage("query", FIGURE, "--pairs", "--queries", FIGURE, names=["--queries"])
        self.fail_with_one_line("query", "builtin:uniform?points=10", "--closest", names=["triangles", "points"])
        self.fail_with_one_line("query", FIGURE, "--closest", "--queries", "nowhere.npy", names=["nowhere.npy"])
        self.fail_with_one_line("query", "builtin:uniform?points=10", "--pairs", "--narrow", names=["narrow"])


if __name__ == "__main__":
    main()
