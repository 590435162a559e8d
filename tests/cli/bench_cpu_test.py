"""raydix bench cpu: figures of both sides, hits compared, refusals; what is said without Embree."""
import pathlib
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from program import PROGRAM, TRIANGLE, ProgramTest, json_of, main, ply  # noqa: E402

BENCH_CPU = pathlib.Path(PROGRAM).resolve().parent / "bench_cpu"
SCENE = "builtin:atrium?triangles=10000"
SMALL = ("--size", "48x32", "--samples", "2", "--rounds", "1", "--threads", "2")
KINDS = ["primary", "ao", "diffuse", "diffuse_shuffled"]


class WithoutEmbree(ProgramTest):
    def test_says_what_is_missing(self):
        alone = self.folder / "raydix"
        shutil.copy(PROGRAM, alone)
        done = subprocess.run([alone, "bench", "cpu", SCENE], capture_output=True, text=True)
        ProgramTest.runs += 1
        self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (1, "", 1), done)
        for word in ("raydix: bench cpu", "bench_cpu", "Embree", "libembree-dev"):
            self.assertIn(word, done.stderr)


@unittest.skipUnless(BENCH_CPU.exists(), "bench_cpu is not built: no Embree, or RAYDIX_BENCH is off")
class BenchCpu(ProgramTest):
    def check_spread(self, spread):
        self.assertGreater(spread["min"], 0)
        self.assertLessEqual(spread["min"], spread["median"])
        self.assertLessEqual(spread["median"], spread["max"])

    def test_all_figures(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--quality", "fast,balanced", "--embree",
                                 "medium,medium+compact", "--sah")
        self.assertEqual(document["command"], "bench cpu")
        self.assertRegex(document["embree"], r"^[34]\.\d+\.\d+$")
        self.assertEqual(document["options"]["rounds"], 1)
        self.assertGreater(len(document["options"]["instruction_sets"]), 0)
        (scene,) = document["scenes"]
        self.assertEqual(scene["threads"], 2)
        self.check_builds(scene)
        self.check_rays(scene)
        self.check_ratios(scene, document["summary"])

    def check_builds(self, scene):
        builds = {build["peer"]: build for build in scene["builds"]}
        self.assertEqual(list(builds), ["embree medium", "embree medium+compact", "raydix fast", "raydix balanced"])
        for build in builds.values():
            self.check_spread(build["fresh_ms"])
            self.check_spread(build["kept_ms"])
            self.assertAlmostEqual(build["bytes_per_triangle"], build["bytes"] / scene["triangles"])
            self.assertTrue(10 < build["bytes_per_triangle"] < 400, build)
            self.assertTrue(5 < build["sah"] < 500, build)
            if build["peer"].startswith("raydix"):
                self.assertLess(build["layout_ms"]["min"], build["kept_ms"]["max"])
            else:
                self.assertIsNone(build["layout_ms"])
        self.assertEqual(builds["embree medium"]["bytes_referenced"], 0)
        self.assertGreater(builds["embree medium+compact"]["bytes_referenced"], 0)
        self.assertLess(builds["embree medium+compact"]["bytes"], builds["embree medium"]["bytes"])

    def check_rays(self, scene):
        self.assertEqual([kind["rays"] for kind in scene["rays"]], KINDS)
        for kind in scene["rays"]:
            self.assertGreater(kind["count"], 0)
            self.assertEqual(len(kind["modes"]), 2 * 6 + 2 * 2)
            for mode in kind["modes"]:
                self.check_spread(mode["mrays_per_s"])
                self.assertEqual(mode["call"] == "single", mode["mode"].startswith(("1-wide", "single")))
                if mode["peer"].startswith("raydix"):
                    self.assertIsNone(mode["different_hits"])
                    continue
                # Edges and grazing rays: Embree's test is not watertight in these modes.
                self.assertLessEqual(sum(mode["different_hits"].values()), 1e-3 * kind["count"], mode)
        primary = scene["rays"][0]
        self.assertEqual(primary["count"] % (48 * 32), 0)  # whole pictures

    def check_ratios(self, scene, summary):
        builds = {build["peer"]: build for build in scene["builds"]}
        ratios = {(r["raydix"], r["embree"], r["figure"]): r["ratio"] for r in scene["ratios"]}
        self.assertEqual(len(ratios), 2 * (2 * (3 + 8) + 8))  # "best" is one of rates alone
        for ours in ("fast", "balanced"):
            for theirs in ("medium", "medium+compact"):
                expected = builds["raydix " + ours]["bytes"] / builds["embree " + theirs]["bytes"]
                self.assertAlmostEqual(ratios[ours, theirs, "bytes"], expected)
        for kind in scene["rays"]:
            rate = {(m["peer"], m["mode"]): m["mrays_per_s"]["median"] for m in kind["modes"]}
            best = max(rate[key] for key in rate if key[0].startswith("embree"))
            ours = rate["raydix balanced", "batch automatic"]
            self.assertAlmostEqual(ratios["balanced", "best", kind["rays"] + "_batch"], ours / best)
            best = max(rate[key] for key in rate if key[0] == "embree medium" and key[1].startswith("1-wide"))
            ours = rate["raydix fast", "single"]
            self.assertAlmostEqual(ratios["fast", "medium", kind["rays"] + "_single"], ours / best)
        self.assertEqual(len(summary), len(ratios))
        self.assertEqual(scene["speed_ups"], [])

    def test_threads_paths_and_several_scenes(self):
        other = "builtin:soup?triangles=500"
        result = self.succeed("bench", "cpu", SCENE, other, *SMALL, "--quality", "balanced", "--embree", "medium",
                              "--rays", "primary,ao", "--threads-study", "--all-paths", "--no-builds", "--json", "r.json")
        for word in ("speed-up from 1 to 2 threads", "over all scenes", "worst scene", "batch packets", "16-wide coherent"):
            self.assertIn(word, result.out)
        document = json_of((self.folder / "r.json").read_text(encoding="utf-8"))
        for scene in document["scenes"]:
            self.assertEqual(scene["builds"], [])
            self.assertEqual(len(scene["rays"][0]["modes"]), 2 * (6 + 6))
            self.assertEqual({s["peer"] for s in scene["speed_ups"]}, {"embree medium", "raydix balanced"})
            self.assertEqual({s["figure"] for s in scene["speed_ups"]},
                             {f"{kind}_{call}" for kind in KINDS[:2] for call in ("batch", "single")})
        for row in document["summary"]:
            values = {scene["name"]: r["ratio"] for scene in document["scenes"] for r in scene["ratios"]
                      if (r["embree"], r["figure"]) == (row["embree"], row["figure"])}
            self.assertEqual(row["worst"], min(values.values()))
            self.assertEqual(values[row["worst_scene"]], row["worst"])
            self.assertAlmostEqual(row["median"], sum(values.values()) / 2)

    def test_differences_are_seen(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--quality", "fast", "--embree", "medium", "--no-builds",
                                 "--rays", "primary", "--tolerance", "0")
        (kind,) = document["scenes"][0]["rays"]
        for mode in kind["modes"]:
            if mode["peer"] == "embree medium":  # its t is rounded elsewhere than ours
                self.assertTrue(0 < mode["different_hits"]["distance"] < kind["count"], mode)

    def test_instruction_sets(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--quality", "fast", "--embree", "medium", "--rays", "ao",
                                 "--no-builds", "--isa", "all")
        sets = document["options"]["instruction_sets"]
        modes = [mode["mode"] for mode in document["scenes"][0]["rays"][0]["modes"] if mode["peer"] == "raydix fast"]
        self.assertEqual(modes, [f"batch automatic {isa}" for isa in sets] + ["single"])

    def test_builds_alone(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--no-rays", "--quality", "fast", "--embree", "low")
        (scene,) = document["scenes"]
        self.assertEqual(scene["rays"], [])
        self.assertEqual({r["figure"] for r in scene["ratios"]}, {"fresh_ms", "kept_ms", "bytes"})
        self.assertEqual([build["sah"] for build in scene["builds"]], [None, None])

    def test_one_triangle(self):
        scene = self.write("one.ply", TRIANGLE)
        document = self.document("bench", "cpu", scene, *SMALL, "--quality", "fast", "--embree", "medium")
        for kind in document["scenes"][0]["rays"]:
            self.assertTrue(all(sum(mode["different_hits"].values()) == 0 for mode in kind["modes"]
                                if mode["peer"] == "embree medium"))

    def test_what_is_refused(self):
        self.fail_with_one_line("bench", "cpu", "missing.ply", names=["missing.ply"])
        points = self.write("points.ply", ply([(0, 0, 0), (1, 0, 0)]))
        self.fail_with_one_line("bench", "cpu", points, names=["points.ply", "no triangles"])
        for wrong in (["--quality", "ultra"], ["--embree", "ultra"], ["--embree", "medium+fast"], ["--rays", "rain"],
                      ["--isa", "mmx"], ["--rounds", "0"], ["--width", "5"], ["--bogus"], ["--no-rays", "--no-builds"]):
            self.fail_with_usage("bench", "cpu", SCENE, *wrong, names=[wrong[0]])
        self.fail_with_usage("bench", "cpu", names=["SCENE"])


if __name__ == "__main__":
    main()
