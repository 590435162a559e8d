"""raydix bench hierarchy: tables, JSON, refusals."""
import pathlib
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from program import SANITIZED, TRIANGLE, ProgramTest, json_of, main  # noqa: E402

SMALL = ("--sizes", "100,500", "--cost-sizes", "500,2000", "--thread-counts", "1,2", "--repeat", "1")
SUBJECTS = {"codes", "sort", "karras", "apetrei", "garanzha", "lauterbach", "octree", "kdtree"}
CASES = 19


class Bench(ProgramTest):
    def test_hierarchy(self):
        document = json_of(self.succeed("bench", "hierarchy", "builtin:soup?triangles=2000", *SMALL, "--bits", "30,63",
                                        "--factors", "1,64", "--json", "-").out)
        self.assertEqual(document["factors"], [1, 64])
        runs = document["runs"]
        self.assertEqual(len(runs), 3 * 2 * CASES * 2)  # scenes, bits, cases, threads
        self.assertEqual({run["builder"] for run in runs}, SUBJECTS)
        for run in runs:
            self.assertGreater(run["measured_ms"], 0)
            self.assertGreater(run["predicted_ms"] or 1, 0)
            self.assertEqual(run["predicted_ms"] is None, run["form"] == "tuned" and run["threads"] == 2)
            for machine in ("here", "gtx480", "h200"):
                if run["form"] != "tuned" and run["threads"] == 1:
                    once, larger = run["simulated_ms"][machine]
                    self.assertGreaterEqual(once, larger)
            if "items_per_level" in run and run["fit"] == "levels":
                self.assertEqual(sum(run["items_per_level"]), run["inner_nodes"])
        builds = document["builds"]
        self.assertEqual({build["builder"] for build in builds}, {"karras", "apetrei", "garanzha", "lauterbach"})
        for build in builds:
            self.assertGreater(build["ms"]["total"]["median"], 0)
        trees = {(run["scene"], run["bits"]): set() for run in runs}
        for run in runs:
            if run["digest"]:
                trees[run["scene"], run["bits"]].add((run["digest"], run["inner_nodes"], run["max_depth"]))
        self.assertTrue(all(len(kinds) == 1 for kinds in trees.values()))
        claims = document["hierarchy_claims"]
        self.assertEqual({claim["claim"][0] for claim in claims}, {"1", "2", "3", "4"})  # 5: of one size of scene
        for claim in claims:
            self.assertIn(claim["verdict"], {"holds", "does not hold", "open"})
            if claim["claim"].startswith("1."):
                self.assertEqual((claim["value"], claim["verdict"]), (1, "holds"))
        self.assertIn("no GPU was used", document["gpu"])

    def test_tables(self):
        out = self.succeed("bench", "hierarchy", "builtin:soup?triangles=300", *SMALL).out
        for word in ("karras, published, boxes in one pass", "lauterbach, boxes by levels", "gtx480 (simulated)", "us a launch",
                     "error", "nodes a level: 1 2", "whole builds", "claims of Karras 2012", "holds", "no GPU was used"):
            self.assertIn(word, out)

    def test_claims_and_heads_say_what_they_stand_on(self):
        """Errors of claims are those of the rows, whatever threads these ran with; columns name the size of the machine."""
        arguments = ("bench", "hierarchy", "builtin:soup?triangles=3000", "--sizes", "3000", "--cost-sizes", "500,2000",
                     "--thread-counts", "2", "--repeat", "1", "--factors", "4,16")
        out = self.succeed(*arguments, "--json", "two.json").out
        document = json_of((self.folder / "two.json").read_text(encoding="utf-8"))
        error = {(run["builder"], run["form"], run["fit"]): run["error"] for run in document["runs"] if run["series"] == "scene"}
        known = [claim for claim in document["hierarchy_claims"] if claim["claim"].startswith("2.") and claim["machine"] == "here"]
        self.assertEqual(len(known), 2)
        for claim in known:
            self.assertEqual(claim["error"], max(abs(error["karras", "published", "atomic"]),
                                                 abs(error["garanzha", "published", "levels"])))
        builds = {claim["figure"] for claim in document["hierarchy_claims"] if claim["claim"].startswith("1.")}
        self.assertEqual(builds, {"different trees of 13 builds"})  # those of the series of sizes have the same name
        self.assertIn("gtx480 x4       x16", out)
        self.succeed("report", "two.json", "-o", "two.html", "--quiet")
        self.assertIn("gtx480 \u00d7 4<", (self.folder / "two.html").read_text(encoding="utf-8"))

    def test_what_has_no_figure_is_a_dash(self):
        empty = self.write("empty.obj", b"")
        triangle = self.write("triangle.ply", TRIANGLE)
        for scene, more in ((triangle, ()), (empty, ()), ("builtin:soup?triangles=20", ("--sizes", "1", "--max-leaf", "255"))):
            arguments = ("bench", "hierarchy", scene, *SMALL, *more)
            result = self.succeed(*arguments, "--json", "figures.json")
            self.assertNotRegex(result.out, r"\b(nan|inf)", result)
            tuned = [line for line in result.out.splitlines() if line.startswith("sort, tuned")]
            self.assertRegex(tuned[1], r" 2 +[0-9.]+ +- +- -", result)  # threads, measured, predicted, error, most of it
            document = json_of((self.folder / "figures.json").read_text(encoding="utf-8"))
            for run in document["runs"]:
                if run.get("predicted_ms", 0) is None:
                    self.assertIsNone(run["error"])
                    self.assertIsNone(run["most_of_the_error"])
            for claim in document["hierarchy_claims"]:
                if claim["value"] is None or claim["error"] is None:
                    self.assertEqual((claim["error"], claim["verdict"]), (None, "open"), claim)

    def test_threads_bound_the_thread_counts(self):
        arguments = ("bench", "hierarchy", "builtin:soup?triangles=300", "--sizes", "100", "--cost-sizes", "500", "--repeat", "1")
        for more in ((), ("--thread-counts", "1")):
            document = self.document(*arguments, "--threads", "1", *more)
            self.assertEqual({row["threads"] for row in document["runs"] + document["builds"]}, {1})
        self.fail_with_usage(*arguments, "--threads", "1", "--thread-counts", "1,2", names=["--thread-counts", "--threads", "2"])

    @unittest.skipIf(SANITIZED, "test_hierarchy writes the same document")
    def test_plots(self):
        self.succeed("bench", "hierarchy", "builtin:soup?triangles=2000", *SMALL, "--json", "result.json", "--quiet")
        script = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot_hierarchy"
        plot = subprocess.run([script, self.folder / "result.json", "-o", self.folder / "plots"], capture_output=True,
                              text=True)
        if "matplotlib is missing" in plot.stderr:
            self.skipTest(plot.stderr.strip())
        self.assertEqual(plot.returncode, 0, plot.stderr)
        for name in ("time", "scaling", "error", "levels"):
            self.assertIn("<svg", (self.folder / "plots" / f"{name}.svg").read_text(encoding="utf-8"))
        bad = self.write("bad.json", b"{}")
        refused = subprocess.run([script, self.folder / bad], capture_output=True, text=True)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("not a result of bench hierarchy", refused.stderr)

    def test_traversal_on_a_device(self):
        scene = "builtin:soup?triangles=200"
        if json_of(self.succeed("info", scene, "--json", "-").out)["machine"]["gpu"] is None:
            self.fail_with_one_line("bench", "traversal", scene, "--device", "cuda")
        self.fail_with_usage("bench", "traversal", scene, "--device", "sim")

    def test_what_is_refused(self):
        self.fail_with_usage("bench")
        self.fail_with_usage("bench", "hierarchy", "--builders", "ploc")
        self.fail_with_usage("bench", "hierarchy", "--factors", "0")
        self.fail_with_usage("bench", "hierarchy", "--bits", "31")


if __name__ == "__main__":
    main()
