"""What documents say of the options that their run was given, and how a report compares two runs."""
import json
import re
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main, ply  # noqa: E402

SOUP = "builtin:soup?triangles=3000"
SMALL = ("--size", "16x12", "--camera", "0", "--repeat", "2")


def changed(command, option, value):
    """The command with another value of an option, which it may have."""
    words = list(command)
    if option not in words:
        return (*words, option, value)
    words[words.index(option) + 1] = value
    return tuple(words)


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
        self.assertEqual([given[f] for f in ("rays", "camera", "cameras", "size", "samples", "ao_radius", "path", "isa")],
                         ["rays.npy", *[None] * 7])
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

    def compared(self, first, second):
        for name, arguments in (("a.json", first), ("b.json", second)):
            self.succeed(*arguments, "--quiet", "--json", name)
        self.succeed("report", "a.json", "b.json", "-o", "page.html")
        html = re.sub("<wbr>", "", (self.folder / "page.html").read_text(encoding="utf-8"))
        return re.search(r'<section id="comparison">.*?</section>', html, re.DOTALL).group(0)

    def test_a_report_tells_which_options_differ(self):
        build, ao = ("build", SOUP), ("trace", SOUP, *SMALL, "--rays", "ao", "--samples", "2")
        for command, options, name in (
                (build, ["--sah-node", "5"], "sah_node"), (build, ["--sah-primitive", "5"], "sah_primitive"),
                (build, ["--repeat", "4"], "repeat"), (build, ["--threads", "1"], "threads"), (build, ["--seed", "2"], "seed"),
                ((*build, "--builder", "karras"), ["--fit", "levels"], "fit"), (build, ["--layout", "wide8"], "layout"),
                ((*build, "--epo", "1"), ["--epo", "0.5"], "epo_sample"),
                (ao, ["--isa", "sse4"], "instruction set of the engine"), (ao, ["--path", "single"], "path"),
                (ao, ["--ao-radius", "0.5"], "ao_radius"), (ao, ["--seed", "2"], "seed")):
            if "sse4" in options and "sse4" not in self.document("trace", SOUP, *SMALL)["trace"][0]["isa"]:
                options = ["--isa", "sse4"] if self.run_program(*ao, "--isa", "sse4").code == 0 else ["--path", "single"]
                name = name if options[0] == "--isa" else "path"
            part = self.compared(command, changed(command, *options))
            if name == "threads" and "settings are the same" in part:
                continue  # a machine of one core
            self.assertNotIn("settings are the same", part, options)
            self.assertIn(f">{name}</th>", part, options)
        for command, options in ((ao, ["--ao-radius", "0.5"]), (ao, ["--samples", "3"]), (ao, ["--size", "8x8"]), (ao, ["--seed", "2"])):
            part = self.compared(command, changed(command, *options))
            self.assertIn("not judged, other work", part)
            self.assertNotRegex(part, "\u25b2 better|\u25bc worse")
        costs = self.compared(build, (*build, "--sah-node", "5"))
        sah = re.search(r"<td[^>]*>SAH</td>.*?</tr>", costs, re.DOTALL).group(0)
        self.assertIn("not judged, other work: sah_node", sah)


if __name__ == "__main__":
    main()
