"""raydix bench cpu: workloads, figures of both sides, hits compared, runs that go on; what is said without Embree."""
import json
import pathlib
import shutil
import statistics
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from program import PROGRAM, TRIANGLE, ProgramTest, json_of, main, ply  # noqa: E402

BENCH_CPU = pathlib.Path(PROGRAM).resolve().parent / "bench_cpu"
SCENE = "builtin:atrium?triangles=10000"
PICTURES = ("--size", "48x32", "--samples", "2", "--rounds", "1", "--threads", "2")
SMALL = (*PICTURES, "--camera", "0")
FEW = (*SMALL, "--workloads", "primary,ao", "--quality", "balanced", "--embree", "medium")
KINDS = ["primary", "ao", "diffuse", "diffuse_shuffled", "ao_1", "ao_4", "diffuse_1", "diffuse_4",
         "bounce_1", "bounce_2", "bounce_3", "bounce_4", "bounce_5", "shadow_lamp", "shadow_area", "lidar", "random", "outside"]
CALLS = [f"{kind}@{rays}" for kind in ("primary", "diffuse_1", "random") for rays in (64, 1024, 16384)] + ["random@262144"]
PIXELS = 48 * 32


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

    def rates(self, workload):
        return {(m["peer"], m["mode"]): m["mrays_per_s"]["median"] for m in workload["modes"]}

    def ratios(self, scene):
        return {(r["raydix"], r["workload"], r["figure"]): r for r in scene["ratios"] if r["workload"]}

    def test_usage_errors_come_before_the_work(self):
        absent = "absent.ply"  # the work would fail with it
        for options in (("--size", "0x0"), ("--camera", "foo"), ("--no-rays", "--size", "foo")):
            self.fail_with_usage("bench", "cpu", absent, *options, names=options[-2:])

    def test_all_workloads(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--no-builds", "--quality", "balanced", "--embree",
                                 "medium,medium+robust")
        (scene,) = document["scenes"]
        self.assertEqual([w["workload"] for w in scene["workloads"]], KINDS + CALLS)
        self.assertEqual(document["options"]["workloads"], KINDS + CALLS)
        workloads = {w["workload"]: w for w in scene["workloads"]}
        for workload in workloads.values():
            self.check_workload(workload)
        # All that the camera of a closed hall sends hits, so that none of a picture's rays are left out.
        counts = {"primary": PIXELS, "ao_1": PIXELS, "ao_4": 4 * PIXELS, "diffuse_1": PIXELS, "diffuse_4": 4 * PIXELS,
                  "bounce_1": PIXELS, "bounce_5": PIXELS, "shadow_lamp": PIXELS, "shadow_area": PIXELS,
                  "lidar": 64 * 2048, "random": PIXELS, "outside": PIXELS}
        for name, count in counts.items():
            self.assertEqual((workloads[name]["count"], workloads[name]["calls"]), (count, 1), name)
        for name in ("shadow_lamp", "shadow_area", "ao_1", "ao_4"):
            self.assertTrue(0 < workloads[name]["hits"] < workloads[name]["count"], name)
        self.assertTrue(0 < workloads["outside"]["hits"] < 0.1 * PIXELS)
        calls = {"primary@64": (PIXELS, 24), "primary@1024": (1024, 1), "primary@16384": (PIXELS, 1),
                 "random@64": (65536, 1024), "random@1024": (65536, 64), "random@16384": (65536, 4), "random@262144": (262144, 1)}
        for name, expected in calls.items():
            self.assertEqual((workloads[name]["count"], workloads[name]["calls"]), expected, name)
        self.check_ratios_of_rates(scene)
        self.check_groups(scene, document["summary"])

    def check_workload(self, workload):
        self.assertGreater(workload["count"], 0)
        modes = [(m["peer"], m["call"]) for m in workload["modes"]]
        self.assertEqual(modes.count(("embree medium", "single")), 2)
        self.assertEqual(modes.count(("embree medium", "batch")), 4)
        self.assertEqual(modes.count(("embree medium+robust", "single")), 2)
        self.assertEqual(modes.count(("raydix balanced", "single")), 1)
        self.assertEqual(modes.count(("raydix balanced", "batch")), 1)
        self.assertEqual(len(modes), 10)
        for mode in workload["modes"]:
            self.check_spread(mode["mrays_per_s"])
            self.assertEqual(mode["call"] == "single", mode["mode"].startswith(("1-wide", "single")))
            self.assertEqual(mode["default"], mode["mode"] == "batch automatic")
            if mode["peer"].startswith("raydix"):
                self.assertIsNone(mode["different_hits"])
                continue
            # Edges and grazing rays: Embree's test is not watertight in these modes.
            self.assertLessEqual(sum(mode["different_hits"].values()), 1e-3 * workload["count"], mode)

    def check_ratios_of_rates(self, scene):
        ratios = self.ratios(scene)
        self.assertEqual(len(ratios), 3 * len(scene["workloads"]))
        for workload in scene["workloads"]:
            rate, name = self.rates(workload), workload["workload"]
            best = max(rate[key] for key in rate if key[0] == "embree medium")
            single = max(rate[key] for key in rate if key[0] == "embree medium" and key[1].startswith("1-wide"))
            robust = max(rate[key] for key in rate if key[0] == "embree medium+robust")
            ours = rate["raydix balanced", "batch automatic"], rate["raydix balanced", "single"]
            self.assertAlmostEqual(ratios["balanced", name, "batch"]["ratio"], ours[0] / best)
            self.assertAlmostEqual(ratios["balanced", name, "single"]["ratio"], ours[1] / single)
            self.assertAlmostEqual(ratios["balanced", name, "single_robust"]["ratio"], ours[1] / robust)
            peer, mode = ratios["balanced", name, "batch"]["best"].split(", ")
            self.assertEqual(rate["embree " + peer, mode], best)

    def check_groups(self, scene, summary):
        ratios = self.ratios(scene)
        size = {w["workload"]: w["count"] / w["calls"] for w in scene["workloads"]}
        members = {
            ("batches of 16 K rays and more", "batch"): [w for w in size if size[w] >= 16384],
            ("batches of 64 to 4 K rays", "batch"): [w for w in size if 64 <= size[w] <= 4096],
            ("single calls", "single"): KINDS, ("single calls", "single_robust"): KINDS}
        rows = {(r["workload"], r["figure"]): r for r in summary}
        self.assertEqual(len(rows), 3 * len(size) + 4)
        for (group, figure), names in members.items():
            values = {name: ratios["balanced", name, figure]["ratio"] for name in names}
            row = rows[group, figure]
            self.assertEqual(row["worst"], min(values.values()))
            self.assertEqual(values[row["worst_workload"]], row["worst"])
            self.assertAlmostEqual(row["median"], statistics.median(values.values()))

    def test_builds_and_qualities(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--workloads", "primary,shadow_lamp", "--quality",
                                 "fast,balanced,high", "--embree", "medium,high,medium+compact", "--sah")
        self.assertEqual(document["command"], "bench cpu")
        self.assertRegex(document["embree"], r"^[34]\.\d+\.\d+$")
        self.assertEqual(document["options"]["rounds"], 1)
        self.assertTrue(document["complete"])
        self.assertGreater(len(document["options"]["instruction_sets"]), 0)
        (scene,) = document["scenes"]
        self.assertEqual((scene["threads"], scene["group"]), (2, "tuned"))
        self.assertEqual(scene["speed_ups"], [])
        self.check_builds(scene)
        ratios = self.ratios(scene)
        self.assertEqual({(r["raydix"], r["embree"]) for r in ratios.values()},
                         {("fast", "medium, high, medium+compact"), ("balanced", "medium, medium+compact"),
                          ("high", "medium, high, medium+compact")})
        for workload in scene["workloads"]:
            rate = self.rates(workload)
            best = max(rate[key] for key in rate if key[0].startswith("embree"))
            self.assertAlmostEqual(ratios["high", workload["workload"], "batch"]["ratio"],
                                   rate["raydix high", "batch automatic"] / best)

    def check_builds(self, scene):
        builds = {build["peer"]: build for build in scene["builds"]}
        self.assertEqual(list(builds), ["embree medium", "embree high", "embree medium+compact", "raydix fast",
                                        "raydix balanced", "raydix high"])
        for build in builds.values():
            self.check_spread(build["fresh_ms"])
            self.check_spread(build["kept_ms"])
            self.assertAlmostEqual(build["bytes_per_triangle"], build["bytes"] / scene["triangles"])
            self.assertTrue(10 < build["bytes_per_triangle"] < 400, build)
            if build["peer"] != "embree high":
                self.assertTrue(5 < build["sah"] < 500, build)
            if build["peer"].startswith("raydix"):
                self.assertLess(build["copy_ms"]["min"], build["kept_ms"]["max"])
            else:
                self.assertIsNone(build["copy_ms"])
        self.assertEqual(builds["embree medium"]["bytes_referenced"], 0)
        self.assertGreater(builds["embree medium+compact"]["bytes_referenced"], 0)
        self.assertLess(builds["embree medium+compact"]["bytes"], builds["embree medium"]["bytes"])
        ratios = {(r["raydix"], r["embree"], r["figure"]): r["ratio"] for r in scene["ratios"] if not r["workload"]}
        self.assertEqual(len(ratios), 3 * 3 * 3)
        for ours in ("fast", "balanced", "high"):
            for theirs in ("medium", "medium+compact"):
                expected = builds["raydix " + ours]["bytes"] / builds["embree " + theirs]["bytes"]
                self.assertAlmostEqual(ratios[ours, theirs, "bytes"], expected)

    def test_threads_paths_and_held_out_scenes(self):
        others = ("builtin:soup?triangles=500", "builtin:soup?triangles=700", "builtin:soup?triangles=900")
        result = self.succeed("bench", "cpu", SCENE, others[0], "--held-out", others[1], "--held-out", others[2], *FEW,
                              "--embree", "medium+robust", "--threads-study", "--all-paths", "--no-builds", "--json", "r.json")
        for word in ("speed-up from 1 to 2 threads", "tuned: 2 scenes", "held out: 2 scenes", "worst scene",
                     "batch packets", "16-wide coherent"):
            self.assertIn(word, result.out)
        document = json_of((self.folder / "r.json").read_text(encoding="utf-8"))
        self.assertEqual([s["name"] for s in document["scenes"]], [SCENE, *others])
        self.assertEqual([s["group"] for s in document["scenes"]], ["tuned", "tuned", "held_out", "held_out"])
        for scene in document["scenes"]:
            self.assertEqual(scene["builds"], [])
            self.assertEqual(len(scene["workloads"][0]["modes"]), 2 * (6 + 6 + 6))
            self.assertEqual({s["peer"] for s in scene["speed_ups"]},
                             {"embree medium", "embree medium+robust", "raydix balanced"})
            self.assertEqual({(s["workload"], s["figure"]) for s in scene["speed_ups"]},
                             {(w, call) for w in ("primary", "ao") for call in ("batch", "single")})
        self.check_summary(document)

    def check_summary(self, document):
        rows = [r for r in document["summary"] if r["workload"] in ("primary", "ao")]
        self.assertEqual(len(rows), 2 * 2 * 3)  # groups of scenes, workloads, figures
        for row in rows:
            values = {s["name"]: r["ratio"] for s in document["scenes"] if s["group"] == row["group"]
                      for r in s["ratios"] if (r["workload"], r["figure"]) == (row["workload"], row["figure"])}
            self.assertEqual((len(values), row["scenes"]), (2, 2))
            self.assertEqual(row["worst"], min(values.values()))
            self.assertEqual(values[row["worst_scene"]], row["worst"])
            self.assertAlmostEqual(row["median"], sum(values.values()) / 2)

    def test_goes_on_where_it_stopped(self):
        file = self.folder / "resumed.json"
        command = ("bench", "cpu", SCENE, "builtin:soup?triangles=500", *FEW, "--resume", "--json", str(file))
        whole = self.succeed(*command).out
        complete = json_of(file.read_text(encoding="utf-8"))
        self.assertTrue(complete["complete"])
        # Nothing is measured twice: a document that is complete comes out as it went in.
        self.assertEqual(self.succeed(*command).out, whole)
        self.assertEqual(json_of(file.read_text(encoding="utf-8")), complete)
        # As it was before the last two workloads.
        stopped = json_of(file.read_text(encoding="utf-8"))
        stopped["complete"] = False
        stopped["scenes"][0]["workloads"].pop()
        stopped["scenes"].pop()
        file.write_text(json.dumps(stopped), encoding="utf-8")
        self.succeed(*command)
        resumed = json_of(file.read_text(encoding="utf-8"))
        self.assertTrue(resumed["complete"])
        self.assertEqual(resumed["scenes"][0]["builds"], complete["scenes"][0]["builds"])
        self.assertEqual(resumed["scenes"][0]["workloads"][0], complete["scenes"][0]["workloads"][0])
        for scene in resumed["scenes"]:
            self.assertEqual([w["workload"] for w in scene["workloads"]], ["primary", "ao"])
        self.assertEqual(len(resumed["summary"]), len(complete["summary"]))
        self.fail_with_one_line(*command, "--seed", "7", names=["resumed.json", "options", "--resume"])
        file.write_text("{", encoding="utf-8")
        self.fail_with_one_line(*command, names=["resumed.json", "--resume"])

    def test_calls_of_some_rays(self):
        document = self.document("bench", "cpu", SCENE, *PICTURES, "--no-builds", "--quality", "fast", "--embree", "medium",
                                 "--workloads", "bounce_2@100,random@100000,primary@4", "--clock", "cpu")
        counts = {w["workload"]: (w["count"], w["calls"]) for w in document["scenes"][0]["workloads"]}
        # Of each of five pictures as many whole calls as there are.
        self.assertEqual(counts, {"bounce_2@100": (7500, 75), "random@100000": (100000, 1), "primary@4": (5 * PIXELS, 5 * PIXELS // 4)})

    def test_differences_are_seen(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--quality", "fast", "--embree", "medium", "--no-builds",
                                 "--workloads", "primary", "--tolerance", "0")
        (workload,) = document["scenes"][0]["workloads"]
        for mode in workload["modes"]:
            if mode["peer"] == "embree medium":  # its t is rounded elsewhere than ours
                self.assertTrue(0 < mode["different_hits"]["distance"] < workload["count"], mode)

    def test_instruction_sets(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--quality", "fast", "--embree", "medium", "--workloads", "ao",
                                 "--no-builds", "--isa", "all")
        sets = document["options"]["instruction_sets"]
        modes = [mode["mode"] for mode in document["scenes"][0]["workloads"][0]["modes"] if mode["peer"] == "raydix fast"]
        self.assertEqual(modes, [f"batch automatic {isa}" for isa in sets] + ["single"])

    def test_builds_alone(self):
        document = self.document("bench", "cpu", SCENE, *SMALL, "--no-rays", "--quality", "fast", "--embree", "low")
        (scene,) = document["scenes"]
        self.assertEqual(scene["workloads"], [])
        self.assertEqual({r["figure"] for r in scene["ratios"]}, {"fresh_ms", "kept_ms", "bytes"})
        self.assertEqual([build["sah"] for build in scene["builds"]], [None, None])

    def test_one_triangle(self):
        scene = self.write("one.ply", TRIANGLE)
        document = self.document("bench", "cpu", scene, *SMALL, "--quality", "fast", "--embree", "medium", "--workloads",
                                 "primary,diffuse,bounce_1,bounce_2,shadow_lamp,primary@64,bounce_2@64")
        workloads = {w["workload"]: w for w in document["scenes"][0]["workloads"]}
        for workload in workloads.values():
            self.assertTrue(all(sum(mode["different_hits"].values()) == 0 for mode in workload["modes"]
                                if mode["peer"] == "embree medium"))
        # Nothing is there to be hit a second time.
        for name in ("bounce_2", "bounce_2@64"):
            self.assertEqual(workloads[name]["count"], 0)
            self.assertIsNone(workloads[name]["modes"][0]["mrays_per_s"])

    def test_what_is_refused(self):
        self.fail_with_one_line("bench", "cpu", "missing.ply", names=["missing.ply"])
        points = self.write("points.ply", ply([(0, 0, 0), (1, 0, 0)]))
        self.fail_with_one_line("bench", "cpu", points, names=["points.ply", "no triangles"])
        for wrong in (["--quality", "ultra"], ["--embree", "ultra"], ["--embree", "medium+fast"], ["--workloads", "rain"],
                      ["--workloads", "ao@"], ["--workloads", "ao@0"], ["--workloads", "ao,"], ["--workloads", "primary@1k"],
                      ["--isa", "mmx"], ["--rounds", "0"], ["--clock", "sun"], ["--bogus"], ["--resume"],
                      ["--resume", "--json", "-"], ["--no-rays", "--no-builds"]):
            self.fail_with_usage("bench", "cpu", SCENE, *wrong, names=[wrong[0]])
        self.fail_with_usage("bench", "cpu", names=["SCENE"])


if __name__ == "__main__":
    main()
