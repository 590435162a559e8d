"""raydix query: nearest points, radius and box against every point, in the arithmetic of contract.md 8."""
import math
import random
import struct
import sys

sys.dont_write_bytecode = True
from program import MISS, TRIANGLE, ProgramTest, main, ply, read_npy, write_npy  # noqa: E402

SEED = 5
INF = math.inf


def f32(x):
    """The float32 nearest to x; sums, differences and products of two float32 are exact enough in double."""
    try:
        return struct.unpack("<f", struct.pack("<f", x))[0]
    except OverflowError:
        return math.copysign(INF, x)


def squared_distance(a, b):
    dx, dy, dz = (f32(p - q) for p, q in zip(a, b))
    return f32(f32(f32(dx * dx) + f32(dy * dy)) + f32(dz * dz))


def is_finite(point):
    return all(math.isfinite(x) for x in point)


def by_distance(points, query):
    """[(d2, index)], nearest first; nothing for a query that is not finite."""
    if not is_finite(query):
        return []
    return sorted((squared_distance(p, query), i) for i, p in enumerate(points) if is_finite(p))


def values(file, kind, columns=None):
    descr, shape, data = read_npy(file)
    assert descr == {"I": "<u4", "f": "<f4", "Q": "<u8"}[kind], descr
    if columns is not None:
        assert len(shape) == 2 and shape[1] == columns, shape
    else:
        assert len(shape) == 1, shape
    return [v[0] for v in struct.iter_unpack("<" + kind, data)]


class Query(ProgramTest):
    def setUp(self):
        chance = random.Random(SEED)
        nan, inf = math.nan, INF
        self.points = [tuple(f32(chance.random()) for _ in range(3)) for _ in range(300)]
        self.points += [(0.5, 0.5, 0.5)] * 40 + [(nan, 0, 0), (0, inf, 0)] + [(-0.0, 0.0, -0.0)]
        self.queries = [tuple(f32(chance.uniform(-0.2, 1.2)) for _ in range(3)) for _ in range(60)]
        self.queries += self.points[:10] + [(0.5, 0.5, 0.5), (nan, 0, 0), (0, 0, -inf), (1e20, 0, 0), (3e38, 3e38, 0)]
        self.cloud = self.write_rows("cloud.npy", self.points, 3)
        self.file = self.write_rows("queries.npy", self.queries, 3)

    def write_rows(self, name, rows, columns):
        flat = [x for row in rows for x in row]
        write_npy(self.folder / name, "<f4", (len(rows), columns), struct.pack(f"<{len(flat)}f", *flat))
        return name

    def rows_of(self, prefix):
        """[[(distance, index)]] of a CSR result."""
        offsets = values(self.folder / f"{prefix}.offsets.npy", "Q")
        found = list(zip(values(self.folder / f"{prefix}.distances.npy", "f"),
                         values(self.folder / f"{prefix}.indices.npy", "I")))
        self.assertEqual((offsets[0], offsets[-1]), (0, len(found)))
        return [found[a:b] for a, b in zip(offsets, offsets[1:])]

    def test_knn(self):
        for k in (1, 8, 40, 400):
            for tree in ("automatic", "bvh"):
                document = self.document("query", self.cloud, "--knn", str(k), "--queries", self.file, "--out", "knn",
                                         "--repeat", "1", "--tree", tree)
                indices = values(self.folder / "knn.indices.npy", "I", k)
                distances = values(self.folder / "knn.distances.npy", "f", k)
                self.assertEqual(len(indices), len(self.queries) * k)
                for q, query in enumerate(self.queries):
                    wanted = by_distance(self.points, query)[:k]
                    row = list(zip(distances[q * k:q * k + k], indices[q * k:q * k + k]))
                    self.assertEqual(row[:len(wanted)], [(f32(math.sqrt(d2)), i) for d2, i in wanted], (k, q))
                    self.assertEqual(row[len(wanted):], [(INF, MISS)] * (k - len(wanted)))
                entry = document["query"][0]
                self.assertEqual((entry["kind"], entry["k"], entry["queries"], entry["invalid_queries"]),
                                 ("knn", k, len(self.queries), 2))
                self.assertEqual(entry["found"], sum(i != MISS for i in indices))
                self.assertGreater(entry["mqueries_per_s"]["median"], 0)
                self.assertEqual((document["build"]["points"], document["build"]["left_out"]), (341, 2))

    def test_knn_within_a_distance(self):
        k, r2 = 8, f32(f32(0.25) * f32(0.25))
        document = self.document("query", self.cloud, "--knn", str(k), "--max-distance", "0.25", "--queries", self.file,
                                 "--out", "near", "--repeat", "0")
        indices = values(self.folder / "near.indices.npy", "I", k)
        short = 0
        for q, query in enumerate(self.queries):
            wanted = [i for d2, i in by_distance(self.points, query) if d2 <= r2][:k]
            self.assertEqual(list(indices[q * k:q * k + k]), wanted + [MISS] * (k - len(wanted)), q)
            short += len(wanted) < k
        self.assertGreater(short, 0)
        self.assertEqual(document["query"][0]["max_distance"], 0.25)
        self.assertIsNone(document["query"][0]["radius"])
        self.fail_with_usage("query", self.cloud, "--radius", "1", "--max-distance", "1", names=["--max-distance"])

    def test_sort_belongs_to_lists(self):
        for kind in (["--knn", "2"], ["--closest"], ["--pairs"]):
            self.fail_with_usage("query", self.cloud, *kind, "--sort", names=["--sort", "--radius and --box"])

    def test_radius(self):
        for radius in (0, 0.25, 1e30):
            for sort in (False, True):
                document = self.document("query", self.cloud, "--radius", str(radius), "--queries", self.file, "--out", "r",
                                         "--repeat", "1", *(["--sort"] if sort else []))
                r2 = f32(f32(radius) * f32(radius))
                for q, (row, query) in enumerate(zip(self.rows_of("r"), self.queries, strict=True)):
                    wanted = [(d2, i) for d2, i in by_distance(self.points, query) if d2 <= r2]
                    if not sort:
                        wanted.sort(key=lambda n: n[1])
                    self.assertEqual(row, [(f32(math.sqrt(d2)), i) for d2, i in wanted], (radius, q))
                entry = document["query"][0]
                self.assertEqual((entry["kind"], entry["invalid_queries"], entry["radius"]), ("radius", 2, f32(radius)))

    def test_box(self):
        boxes = [(0.1, 0.2, 0.3, 0.6, 0.7, 0.8), (0.5,) * 6, (0.9, 0, 0, 0.1, 1, 1), (-9, -9, -9, 9, 9, 9),
                 (math.nan, 0, 0, 1, 1, 1), (0, 0, 0, 1, 1, INF), (0,) * 6]
        boxes = [tuple(f32(x) for x in box) for box in boxes]
        document = self.document("query", self.cloud, "--box", "--queries", self.write_rows("boxes.npy", boxes, 6), "--out", "b")
        for row, box in zip(self.rows_of("b"), boxes, strict=True):
            inside = [i for i, p in enumerate(self.points) if is_finite(box) and is_finite(p)
                      and all(lo <= x <= hi for lo, x, hi in zip(box[:3], p, box[3:]))]
            self.assertEqual(row, [(0.0, i) for i in inside])
        self.assertEqual(document["query"][0]["invalid_queries"], 2)
        self.assertEqual(document["query"][0]["kind"], "box")

    def test_results_larger_than_their_limit(self):
        pairs = [self.write("mesh.ply", TRIANGLE), "--pairs", "--with", "mesh.ply"]
        boxes = [self.cloud, "--box", "--queries", self.write_rows("all.npy", [(-9,) * 3 + (9,) * 3] * 50, 6)]
        for arguments in ([self.cloud, "--radius", "9"], [self.cloud, "--knn", "300"], boxes, pairs):
            self.succeed("query", *arguments, "--repeat", "0", "--max-result-bytes", "10000000")
            self.fail_with_one_line("query", *arguments, "--repeat", "0", "--max-result-bytes", "7", "--out", "refused",
                                    names=["bytes", "max_result_bytes"])
        self.assertFalse(list(self.folder.glob("refused*")))
        self.fail_with_usage("query", "mesh.ply", "--closest", "--max-result-bytes", "7", names=["--max-result-bytes"])

    def test_the_points_themselves_are_the_queries(self):
        self.document("query", self.cloud, "--knn", "1", "--out", "own", "--repeat", "0")
        indices = values(self.folder / "own.indices.npy", "I", 1)
        self.assertEqual(indices[:300], list(range(300)))
        self.assertEqual(indices[300:340], [300] * 40)  # equal points: the lowest index
        self.assertEqual(indices[340:342], [MISS] * 2)

    def test_vertices_of_meshes_and_other_point_files(self):
        mesh = self.write("mesh.ply", TRIANGLE)
        self.write("far.ply", ply([(3, 0, 0), (0, 5, 0)]))
        document = self.document("query", mesh, "--knn", "2", "--queries", "far.ply", "--out", "mesh")
        self.assertEqual(values(self.folder / "mesh.indices.npy", "I", 2), [1, 0, 2, 0])
        self.assertEqual(values(self.folder / "mesh.distances.npy", "f", 2), [2.0, 3.0, 4.0, 5.0])
        self.assertEqual(document["build"]["points"], 3)

    def test_threads_change_no_byte(self):
        scene = "builtin:clustered?points=20000"
        for kind in (["--knn", "5"], ["--radius", "0.001"]):
            contents = set()
            for threads in ("1", "2", "7"):
                self.succeed("query", scene, *kind, "--out", "t", "--threads", threads, "--repeat", "0", "--quiet")
                contents.add(b"".join((self.folder / f"t.{part}.npy").read_bytes() for part in ("indices", "distances")))
            self.assertEqual(len(contents), 1)

    def test_tables(self):
        printed = self.succeed("query", self.cloud, "--knn", "3", "--repeat", "1").out
        for word in ("341", "2 invalid ones left out", "kdtree", "Mqueries/s", "knn"):
            self.assertIn(word, printed)
        self.assertEqual(self.succeed("query", self.cloud, "--knn", "3", "--quiet").out, "")

    def test_usage_errors(self):
        for bad in ([], ["--knn", "2", "--radius", "1"], ["--knn", "0"], ["--knn", "-1"], ["--knn", "two"], ["--radius", "-1"],
                    ["--radius", "nan"], ["--radius", "inf"], ["--box"], ["--knn", "1", "--tree", "octree"],
                    ["--knn", "1", "--repeat", "-1"], ["--knn", "1", "--nothing"]):
            self.fail_with_usage("query", self.cloud, *bad)
        self.fail_with_usage("query", "--knn", "1")

    def test_input_errors(self):
        self.fail_with_one_line("query", "absent.npy", "--knn", "1", names=["absent.npy"])
        self.fail_with_one_line("query", self.cloud, "--knn", "1", "--queries", "absent.npy", names=["absent.npy"])
        for options in ([], ["--builder", "karras"]):
            result = self.run_program("query", "builtin:figure?triangles=5000", "--closest", "--queries", "absent.npy", *options)
            self.assertTrue(result.err.startswith("raydix: absent.npy: "), result.err)
        self.fail_with_one_line("query", self.cloud, "--box", "--queries", self.file, names=["queries.npy", "(N, 6)"])
        self.fail_with_one_line("query", self.cloud, "--box", "--queries", self.write("t.ply", TRIANGLE), names=["t.ply", "(Q, 6)"])
        self.fail_with_one_line("query", self.cloud, "--knn", "1", "--strict", names=["cloud.npy", "point 340"])
        self.fail_with_one_line("query", self.cloud, "--knn", "4000000000", names=["cloud.npy", "10976000000000 bytes"])
        result = self.run_program("query", self.cloud, "--knn", "1", "--repeat", "0", "--out", "no/x")
        self.assertEqual((result.code, result.err.count("\n")), (1, 1), result)
        self.assertIn("no/x.indices.npy", result.err)
        many = self.write_rows("many.npy", [(1, 2, 3)] * 200000, 3)
        self.fail_with_one_line("query", many, "--radius", "0", "--quiet", names=["many.npy", "more than"])


if __name__ == "__main__":
    main()
