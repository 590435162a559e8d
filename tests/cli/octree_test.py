"""--tree octree in build and check, and where it does not serve."""
import sys

sys.dont_write_bytecode = True
from program import TRIANGLE, ProgramTest, main, ply  # noqa: E402

SOUP = "builtin:soup?triangles=2000"
POINTS = "builtin:clustered?points=3000"
FIELDS = {"tree", "builder", "bits", "device", "threads", "nodes", "leaves", "references", "layout_nodes", "max_depth",
          "depth_bound", "sah", "sah_constants", "epo", "bytes", "bytes_referenced", "peak_bytes", "tree_hash", "ms",
          "ms_spread", "max_leaf", "max_level", "nodes_per_level"}
TIMES = {"bounds", "codes", "sort", "hierarchy", "fit", "layout", "total"}


class Octree(ProgramTest):
    def build(self, scene, *arguments):
        return self.document("build", scene, "--tree", "octree", "--repeat", "2", *arguments)["build"]

    def test_build(self):
        for scene, count in ((SOUP, 2000), (POINTS, 3000)):
            build = self.build(scene)
            self.assertLessEqual(FIELDS, set(build))
            self.assertEqual(set(build["ms"]), TIMES)
            self.assertEqual((build["tree"], build["references"], build["max_leaf"]), ("octree", count, 4))
            self.assertEqual((build["bits"], build["max_level"]), (63, 21))
            levels = build["nodes_per_level"]
            self.assertEqual((levels[0], sum(levels), len(levels)), (1, build["nodes"], build["max_depth"] + 1))
            self.assertLess(build["leaves"], build["nodes"])
            self.assertRegex(build["tree_hash"], r"\A[0-9a-f]{32}\Z")
            self.assertEqual(build["bytes"], 32 * build["nodes"] + 16 * count)
            self.assertGreaterEqual(build["peak_bytes"], build["bytes"])
            for threads in ("1", "2", "7"):
                self.assertEqual(self.build(scene, "--threads", threads)["tree_hash"], build["tree_hash"])

    def test_options(self):
        hashes = set()
        for arguments, fields in (((), {}), (("--bits", "30"), {"bits": 30, "max_level": 10}),
                                  (("--max-leaf", "1"), {"max_leaf": 1}),
                                  (("--max-level", "3"), {"max_level": 3, "max_depth": 3}),
                                  (("--max-level", "0"), {"max_level": 0, "nodes": 1, "largest_leaf": 3000})):
            build = self.build(POINTS, *arguments)
            for field, value in fields.items():
                self.assertEqual(build[field], value, arguments)
            hashes.add(build["tree_hash"])
        self.assertEqual(len(hashes), 5)

    def test_tables(self):
        out = self.succeed("build", POINTS, "--tree", "octree", "--repeat", "1").out
        for word in ("octree over 3,000 points", "levels       1 ", "depth", "memory", "hash", "sort", "total"):
            self.assertIn(word, out)

    def test_check(self):
        for scene in (SOUP, POINTS):
            check = self.document("check", scene, "--tree", "octree", "--max-level", "5")["check"]
            self.assertEqual((check["ok"], check["broken"]), (True, None))
            self.assertIn("every invariant holds", self.succeed("check", scene, "--tree", "octree").out)

    def test_odd_input(self):
        one = self.write("one.ply", ply([(1, 2, 3)]))
        self.assertEqual(self.build(one)["nodes"], 1)
        none = self.write("none.ply", ply([("nan", 0, 0), (0, "inf", 0)]))
        build = self.build(none)
        self.assertEqual((build["nodes"], build["left_out"], build["nodes_per_level"]), (0, 2, []))
        self.fail_with_one_line("build", none, "--tree", "octree", "--strict", names=["none.ply", "point 0"])
        self.fail_with_one_line("build", "absent.ply", "--tree", "octree", names=["absent.ply"])
        pair = self.write("pair.ply", ply([(0, 0, 0), (3e-7, 0, 0), (1, 1, 1)]))
        self.assertEqual(self.build(pair, "--max-leaf", "1")["nodes_per_level"], [1, 2] + [1] * 19 + [1])
        self.assertEqual(self.document("check", pair, "--tree", "octree")["check"]["ok"], True)

    def test_what_an_octree_does_not_do(self):
        self.succeed("build", SOUP, "-o", "tree.rdx", "--quiet")
        scene = self.write("triangle.ply", TRIANGLE)
        for refused in (["build", scene, "-o", "octree.rdx"], ["build", "tree.rdx"], ["check", "tree.rdx"],
                        ["check", "--same", scene, scene], ["build", scene, "--builder", "karras"],
                        ["build", scene, "--quality", "fast"], ["build", scene, "--fit", "levels"],
                        ["build", scene, "--epo"], ["build", scene, "--sah-node", "2"],
                        ["build", scene, "--max-level", "22"], ["build", scene, "--max-level", "11", "--bits", "30"],
                        ["check", scene, "--max-level", "-1"]):
            self.fail_with_usage(*refused, "--tree", "octree")
        for command in (["trace", scene], ["render", scene, "-o", "x.png"]):
            self.fail_with_usage(*command, "--tree", "octree", names=["--tree", "octree", "bvh"])
        self.fail_with_usage("render", "tree.rdx", "--tree", "octree", "--view", "tree", "-o", "x.png", names=["--tree"])
        self.assertFalse((self.folder / "octree.rdx").exists() or (self.folder / "x.png").exists())
        self.fail_with_usage("build", scene, "--max-level", "3", names=["--max-level", "octree"])
        self.fail_with_usage("trace", "tree.rdx", "--max-level", "3", names=["--max-level"])

    def test_pictures(self):
        for view in (["--view", "tree", "--levels", "1-3"], ["--view", "slice", "--axis", "x", "--at", "0.3"],
                     ["--view", "tree", "--max-level", "2"]):
            self.succeed("render", SOUP, "--tree", "octree", *view, "--size", "64x48", "-o", "octree.png")
            self.assertEqual((self.folder / "octree.png").read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        self.assertIn("levels 1 to 3", self.succeed("render", SOUP, "--tree", "octree", "--view", "tree", "--levels",
                                                    "1-3", "--size", "8x8", "-o", "octree.png").out)


if __name__ == "__main__":
    main()
