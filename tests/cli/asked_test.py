"""What documents say of the options that their run was given."""
import json
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main, ply  # noqa: E402

SOUP = "builtin:soup?triangles=3000"
SMALL = ("--size", "16x12", "--camera", "0", "--repeat", "2")


class Asked(ProgramTest):
    def test_rays_of_trace(self):
        self.write("soup.ply", ply([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
        self.write("cameras.json", json.dumps({"width": 20, "height": 10, "ao_radius": 0.25, "cameras": [
            {"name": "front", "position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "vfov": 60}]}))
        usual = self.document("trace", "soup.ply", "--repeat", "2", "--seed", "7")
        row = usual["trace"][0]
        self.assertEqual(usual["seed"], 7)
        self.assertEqual([row[f] for f in ("camera", "cameras", "size", "samples", "repeat", "path")],
                         ["all", None, "20x10", None, 2, "automatic"])
        ao = self.document("trace", SOUP, *SMALL, "--rays", "ao", "--samples", "3", "--ao-radius", "0.5", "--path", "single",
                           "--cameras", "cameras.json", "--save-rays", "rays.npy")["trace"][0]
        self.assertEqual([ao[f] for f in ("camera", "cameras", "size", "samples", "ao_radius", "path")],
                         ["0", "cameras.json", "16x12", 3, 0.5, "single"])
        given = self.document("trace", SOUP, "--rays", "rays.npy", "--kernel", "scalar")["trace"][0]
        self.assertEqual([given[f] for f in ("rays", "camera", "cameras", "size", "samples", "path")],
                         ["rays.npy", None, None, None, None, None])
        shuffled = self.document("trace", SOUP, *SMALL, "--rays", "diffuse_shuffled", "--samples", "2")["trace"][0]
        self.assertEqual((shuffled["rays"], shuffled["samples"]), ("diffuse_shuffled", 2))

    def test_rays_of_simulate(self):
        document = self.document("simulate", SOUP, "--size", "16x12", "--rays", "primary,ao", "--samples", "2", "--ao-radius", "0.5",
                                 "--launch-rays", "2048", "--kernel", "packet", "--seed", "3", "--camera", "0")
        self.assertEqual([document[f] for f in ("seed", "cameras", "memory")], [3, None, False])
        fields = ("camera", "size", "samples", "ao_radius", "launch_rays")
        self.assertEqual([[row[f] for f in fields] for row in document["simulate"]],
                         [["0", "16x12", None, None, None], ["0", "16x12", 2, 0.5, 2048]])
        bench = self.document("bench", "traversal", SOUP, "--machine", "gtx480", "--size", "16x12", "--rays", "ao", "--samples", "2",
                              "--kernel", "packet", "--sweep-sample", "0", "--memory")
        self.assertEqual([bench[f] for f in ("seed", "cameras", "memory", "error", "sweep_sample")], [1, None, True, None, 0])
        self.assertEqual([bench["simulate"][0][f] for f in ("camera", "size", "samples")], ["all", "16x12", 2])

    def test_builds(self):
        build = self.document("build", SOUP, "--builder", "karras", "--repeat", "3", "--fit", "levels", "--epo", "0.5")["build"]
        self.assertEqual([build[f] for f in ("repeat", "fit", "epo_sample")], [3, "levels", 0.5])
        usual = self.document("build", SOUP)["build"]
        self.assertEqual([usual[f] for f in ("repeat", "fit", "epo_sample")], [5, None, None])
        for tree in ("octree", "kdtree"):
            self.assertEqual(self.document("build", SOUP, "--tree", tree, "--repeat", "2")["build"]["repeat"], 2)
        self.assertEqual(self.document("build", SOUP, "--layout", "wide8", "-o", "s.rdx", "--repeat", "2")["build"]["repeat"], 2)

    def test_queries(self):
        self.write("queries.ply", ply([(0, 0, 0), (1, 2, 3)]))
        row = self.document("query", SOUP, "--radius", "0.1", "--sort", "--queries", "queries.ply", "--repeat", "2")["query"][0]
        self.assertEqual([row[f] for f in ("kind", "queries_file", "with", "narrow", "sort", "repeat")],
                         ["radius", "queries.ply", None, False, True, 2])
        row = self.document("query", SOUP, "--pairs", "--with", "builtin:soup?triangles=50", "--narrow")["query"][0]
        self.assertEqual((row["queries_file"], row["with"], row["narrow"]), (None, "builtin:soup?triangles=50", True))

    def test_pictures(self):
        size = ("--size", "8x8", "-o", "p.png")
        plain = self.document("render", SOUP, *size)
        self.assertEqual(plain["seed"], 1)
        fields = ("cameras", "tree", "quality", "builder", "levels", "axis", "at")
        self.assertEqual([plain["render"][f] for f in fields], [None, "bvh", "balanced", None, None, None, None])
        slice_of = self.document("render", SOUP, *size, "--view", "slice", "--builder", "karras", "--levels", "2-3", "--axis", "x",
                                 "--at", "0.25")["render"]
        self.assertEqual([slice_of[f] for f in fields], [None, "bvh", None, "karras", "2-3", "x", 0.25])
        octree = self.document("render", SOUP, *size, "--view", "tree", "--tree", "octree")["render"]
        self.assertEqual([octree[f] for f in fields], [None, "octree", None, None, None, None, None])


if __name__ == "__main__":
    main()
