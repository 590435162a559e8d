"""--tree kdtree in build, check and trace; pictures of trees."""
import sys

sys.dont_write_bytecode = True
from program import TRIANGLE, ProgramTest, main, ply, read_hits, read_png  # noqa: E402

SOUP = "builtin:soup?triangles=2000"
POINTS = "builtin:clustered?points=2000"
BUILD_FIELDS = {"tree", "builder", "bits", "device", "threads", "nodes", "leaves", "references", "layout_nodes", "max_depth",
                "depth_bound", "sah", "sah_constants", "epo", "bytes", "bytes_referenced", "peak_bytes", "tree_hash", "ms",
                "ms_spread", "max_leaf"}


class KdTree(ProgramTest):
    def test_build(self):
        for scene in (SOUP, POINTS):
            build = self.document("build", scene, "--tree", "kdtree", "--repeat", "2")["build"]
            self.assertLessEqual(BUILD_FIELDS, set(build))
            self.assertEqual((build["tree"], build["references"]), ("kdtree", 2000))
            self.assertEqual(build["max_leaf"], 8 if scene == POINTS else 4)
            self.assertIsNone(build["sah"])
            self.assertEqual(build["nodes"], 2 * build["leaves"] - 1)
            self.assertLessEqual(build["max_depth"], build["depth_bound"])
            for threads in ("1", "2", "7"):
                again = self.document("build", scene, "--tree", "kdtree", "--threads", threads, "--repeat", "1")["build"]
                self.assertEqual(again["tree_hash"], build["tree_hash"])
            other = self.document("build", scene, "--tree", "kdtree", "--max-leaf", "1", "--bits", "30")["build"]
            self.assertNotEqual(other["tree_hash"], build["tree_hash"])
            self.assertEqual((other["max_leaf"], other["bits"]), (1, 30))
            self.assertNotEqual(self.document("build", scene)["build"]["tree_hash"], build["tree_hash"])
        printed = self.succeed("build", SOUP, "--tree", "kdtree", "--repeat", "1").out
        for word in ("kdtree", "depth", "memory", "hash", "total"):
            self.assertIn(word, printed)

    def test_check(self):
        check = self.document("check", SOUP, "--tree", "kdtree")["check"]
        self.assertEqual((check["ok"], check["broken"], check["primitives"]), (True, None, 2000))
        self.assertIn("every invariant holds", self.succeed("check", POINTS, "--tree", "kdtree").out)

    def test_trace_gives_the_hits_of_the_bvh(self):
        for rays in ("primary", "diffuse"):
            samples = ("--samples", "2") if rays != "primary" else ()
            arguments = ("trace", SOUP, "--rays", rays, "--size", "64x48", *samples, "--repeat", "1")
            of_bvh = self.document(*arguments, "--hits", "bvh.npy")
            of_kdtree = self.document(*arguments, "--tree", "kdtree", "--hits", "kdtree.npy")
            self.assertEqual(of_kdtree["build"]["tree"], "kdtree")
            self.assertEqual(read_hits(self.folder / "bvh.npy"), read_hits(self.folder / "kdtree.npy"))
            ours, theirs = of_kdtree["trace"][0], of_bvh["trace"][0]
            self.assertGreater(ours["hits"], 0)
            for field in ("count", "hits", "invalid_rays", "mode"):
                self.assertEqual(ours[field], theirs[field])
            self.assertEqual([ours["kernel"], theirs["kernel"]], ["scalar", "engine"])
            self.assertGreater(ours["node_visits_per_ray"], 1)
            self.assertGreater(ours["triangle_tests_per_ray"], 0)
        ao = [self.document("trace", SOUP, "--rays", "ao", "--size", "64x48", "--samples", "2", "--repeat", "1", "--tree",
                            tree)["trace"][0] for tree in ("bvh", "kdtree")]
        self.assertEqual(ao[0]["hits"], ao[1]["hits"])
        self.assertEqual(ao[1]["mode"], "any")
        self.assertIn("k-d tree", self.succeed("trace", SOUP, "--tree", "kdtree", "--size", "8x8", "--explain").out)

    def test_refusals(self):
        self.fail_with_usage("build", SOUP, "--tree", "kdtree", "-o", "x.rdx", names=["--output", "kdtree"])
        self.fail_with_usage("build", SOUP, "--tree", "kdtree", "--builder", "ploc", names=["--builder"])
        self.fail_with_usage("build", SOUP, "--tree", "kdtree", "--quality", "fast", names=["--quality"])
        self.fail_with_usage("build", SOUP, "--tree", "kdtree", "--fit", "levels", names=["--fit"])
        self.fail_with_usage("build", SOUP, "--tree", "kdtree", "--epo", names=["--epo"])
        self.fail_with_usage("trace", SOUP, "--tree", "kdtree", "--mode", "all", names=["--mode"])
        self.fail_with_usage("check", "--same", SOUP, SOUP, "--tree", "kdtree", names=["--tree"])
        self.fail_with_usage("render", SOUP, "--tree", "kdtree", "-o", "x.png", names=["--tree"])
        self.succeed("build", SOUP, "-o", "soup.rdx", "--quiet")
        for command in (("build",), ("check",), ("trace",), ("render", "-o", "x.png", "--view", "tree")):
            self.fail_with_usage(*command, "soup.rdx", "--tree", "kdtree", names=["soup.rdx"])
        points = self.write("points.ply", ply([(0, 0, 0), (1, 0, 0)]))
        self.fail_with_one_line("trace", points, "--tree", "kdtree", names=["points.ply", "points"])
        nan = self.write("nan.ply", ply([(0, 0, 0), (1, 0, 0), ("nan", 1, 0)], [(0, 1, 2)]))
        for command in ("build", "check", "trace"):
            self.fail_with_one_line(command, nan, "--tree", "kdtree", "--strict", names=["nan.ply", "triangle 0"])

    def test_pictures_of_trees(self):
        self.succeed("build", SOUP, "-o", "drawn.rdx", "--quiet")
        for scene, tree in ((SOUP, "bvh"), (SOUP, "kdtree"), (POINTS, "bvh"), (POINTS, "kdtree"), ("drawn.rdx", "bvh")):
            for arguments in (("--view", "tree"), ("--view", "tree", "--levels", "2-5"), ("--view", "slice"),
                              ("--view", "slice", "--axis", "x", "--at", "0.25", "--levels", "4")):
                self.succeed("render", scene, "--tree", tree, *arguments, "--size", "80x60", "-o", "tree.png",
                             "--quiet")
                width, height, rows = read_png(self.folder / "tree.png")
                self.assertEqual((width, height), (80, 60))
                self.assertGreater(rows, 5)
        self.assertIn("levels 0 to", self.succeed("render", SOUP, "--view", "slice", "-o", "tree.png").out)
        self.assertIn("no boxes", self.succeed("render", SOUP, "--view", "slice", "--levels", "99", "-o", "tree.png").out)
        empty = self.write("one.ply", TRIANGLE)
        self.succeed("render", empty, "--view", "tree", "--tree", "kdtree", "--size", "8x8", "-o", "tree.png")

    def test_wrong_uses_of_picture_options(self):
        for bad in (["--levels", "5-2"], ["--levels", "x"], ["--levels", "1-"], ["--levels", "1-2-3"], ["--levels", "-1"],
                    ["--axis", "w"], ["--at", "2"]):
            self.fail_with_usage("render", SOUP, "--view", "slice", *bad, "-o", "x.png")
        self.fail_with_usage("render", SOUP, "--levels", "2", "-o", "x.png", names=["--levels"])
        self.fail_with_usage("render", SOUP, "--view", "tree", "--axis", "x", "-o", "x.png", names=["--axis"])


if __name__ == "__main__":
    main()
