"""--layout cwbvh in build, and where it does not serve."""
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main  # noqa: E402

SOUP = "builtin:soup?triangles=2000"
FIELDS = {"nodes", "leaves", "references", "max_depth", "children_per_node", "sah", "widening", "node_bytes",
          "triangle_bytes", "bytes_per_triangle", "ms"}


class Cwbvh(ProgramTest):
    def test_build(self):
        binary = self.document("build", SOUP, "--repeat", "1")["build"]
        build = self.document("build", SOUP, "--repeat", "1", "--layout", "cwbvh")["build"]
        cwbvh = build["cwbvh"]
        self.assertEqual(set(cwbvh), FIELDS)
        self.assertEqual((build["layout"], binary["layout"]), ("cwbvh", "binary"))
        self.assertEqual(build["tree_hash"], binary["tree_hash"])
        self.assertEqual(build["layout_nodes"], cwbvh["nodes"])
        self.assertEqual(build["bytes"], 80 * cwbvh["nodes"] + 48 * cwbvh["references"])
        self.assertEqual(cwbvh["references"], 2000)
        self.assertAlmostEqual(cwbvh["bytes_per_triangle"], build["bytes"] / 2000)
        self.assertLess(cwbvh["max_depth"], build["max_depth"])
        self.assertLess(cwbvh["sah"], build["sah"])

    def test_table(self):
        self.assertRegex(self.succeed("build", SOUP, "--repeat", "1", "--layout", "cwbvh").out,
                         r"(?m)^cwbvh +[\d,]+ nodes of \d\.\d\d children, [\d,]+ leaves, depth \d+")

    def test_elsewhere(self):
        for arguments in (("trace", SOUP), ("check", SOUP), ("render", SOUP, "-o", "x.png"),
                          ("build", SOUP, "-o", "x.rdx"), ("build", SOUP, "--tree", "octree"),
                          ("build", SOUP, "--tree", "kdtree"), ("trace", SOUP, "--tree", "kdtree")):
            self.fail_with_usage(*arguments, "--layout", "cwbvh")


if __name__ == "__main__":
    main()
