"""raydix bench scene: every workload, answers compared, both groups; refusals; what is said without Embree."""
import pathlib
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from program import PROGRAM, ProgramTest, json_of, main, ply  # noqa: E402

BESIDE = (pathlib.Path(PROGRAM).resolve().parent / "bench_scene").exists()
QUICK = ("bench", "scene", "--quick", "--threads", "2")
TETRAHEDRON = ply([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
KINDS = [f"{rays} {call}" for rays in ("primary", "random") for call in ("closest", "any")]
QUESTIONS = {
    "instances": KINDS, "nested": KINDS, "plants": KINDS, "spheres": KINDS, "user": KINDS, "doubles": KINDS,
    "all_hits": ["primary all hits", "random all hits"],
    "filters": [f"{kind} accept {part}" for part in ("all", "half") for kind in KINDS],
    "closest": ["near", "far"],
    "moved": ["commit", "transforms and commit", "transforms of 1 %, commit"],
    "fixed": KINDS,
    "frames": ["frame"], "frame parts": ["commit", "primary", "ao"],
}
IN_MS = ("moved", "frames", "frame parts")
ALONE = ("plants", "spheres", "user", "fixed", "frames", "frame parts")  # of contents of their own, not of each scene


class WithoutEmbree(ProgramTest):
    def test_says_what_is_missing(self):
        alone = self.folder / "raydix"
        shutil.copy(PROGRAM, alone)
        done = subprocess.run([alone, "bench", "scene"], capture_output=True, text=True)
        ProgramTest.runs += 1
        self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (1, "", 1), done)
        for word in ("raydix: bench scene", "bench_scene", "Embree", "libembree-dev"):
            self.assertIn(word, done.stderr)


@unittest.skipUnless(BESIDE, "bench_scene is not built: no Embree, or RAYDIX_BENCH is off")
class BenchScene(ProgramTest):
    def test_all_workloads(self):
        """What CI runs: both groups, every answer compared, every figure there."""
        result = self.succeed(*QUICK, "--json", "r.json")
        for word in ("tuned, seed 1", "held out, seed 2", "ratios over all scenes"):
            self.assertIn(word, result.out)
        document = json_of((self.folder / "r.json").read_text(encoding="utf-8"))
        self.assertEqual(document["command"], "bench scene")
        self.assertRegex(document["embree"], r"^[34]\.\d+\.\d+$")
        self.assertTrue(document["machine"]["cpu"])
        groups = [(group["group"], group["seed"]) for group in document["groups"]]
        self.assertEqual(groups, [("tuned", 1), ("held out", 2)])
        for group in document["groups"]:
            self.check_group(group["questions"])
        tuned, held_out = ([q["hits"] for q in group["questions"]] for group in document["groups"])
        self.assertNotEqual(tuned, held_out)  # other places and rays
        self.check_summary(document)

    def check_group(self, questions):
        for workload, texts in QUESTIONS.items():
            asked = [q for q in questions if q["workload"] == workload]
            scenes = list(dict.fromkeys(q["scene"] for q in asked))
            self.assertEqual(len(scenes), 1 if workload in ALONE else 2, workload)
            self.assertEqual([q["question"] for q in asked], texts * len(scenes))
        hits = {part: sum(q["hits"] for q in questions if q["question"].endswith(f"accept {part}")) for part in ("all", "half")}
        self.assertLess(hits["half"], hits["all"])
        for question in questions:
            with self.subTest(workload=question["workload"], question=question["question"]):
                self.check_question(question)

    def check_question(self, question):
        ours = [mode for mode in question["modes"] if mode["side"] == "raydix"]
        self.assertNotEqual(ours, [])
        self.assertNotEqual(question["ratios"], [])
        if question["workload"] != "moved":
            self.assertGreater(question["count"], 0)
            self.assertGreater(question["hits"], 0.02 * question["count"])  # the rays meet the scene
        for mode in question["modes"]:
            spread = mode["ms" if question["workload"] in IN_MS else "mrays_per_s"]
            self.assertTrue(0 < spread["min"] <= spread["median"] <= spread["max"], mode)
            self.assertEqual(mode["answers"] is None, mode["side"] == "raydix", mode)
            if mode["answers"] is None:
                continue
            different = mode["answers"]["hit_or_miss"] + mode["answers"]["distance"]
            compared = 64 * 48 if question["workload"] == "moved" else question["count"]
            self.assertEqual(mode["answers"]["equal"] + different, compared)
            self.assertLessEqual(different, 0.005 * compared, mode)
            self.assertEqual(mode["answers"]["unexplained"], 0, mode)
            # Places and primitives are numbered alike on both sides; few hits tie.
            self.assertLessEqual(mode["answers"]["other_primitive"], 0.01 * compared, mode)
        for ratio in question["ratios"]:
            self.check_ratio(question, ratio)

    def check_ratio(self, question, ratio):
        unit = "ms" if question["workload"] in IN_MS else "mrays_per_s"

        def best(call, side):
            figures = [mode[unit]["median"] for mode in question["modes"] if mode["call"] in call and side(mode["side"])]
            return min(figures) if unit == "ms" else max(figures)

        robust = ratio["figure"] == "single robust"
        call = ("batch",) if ratio["figure"] == "batch" else ("single",)
        ours = best(call, lambda side: side == "raydix")
        peer = best(("batch", "single") if call == ("batch",) else call,
                    lambda side: side != "raydix" and side.endswith("+robust") == robust)
        expected = ours / peer if (question["ratio_of"] == "rates") == (unit == "mrays_per_s") else peer / ours
        self.assertAlmostEqual(ratio["ratio"] / expected, 1)
        self.assertLessEqual(ratio["min"], ratio["max"])

    def check_summary(self, document):
        for row in document["summary"]:
            values = [ratio["ratio"] for group in document["groups"] if group["group"] == row["group"]
                      for q in group["questions"] if q["workload"] == row["workload"]
                      for ratio in q["ratios"] if ratio["figure"] == row["figure"]]
            less_is_better = row["workload"] in ("moved", "doubles")
            self.assertEqual(row["worst"], max(values) if less_is_better else min(values), row)
        rows = {(row["group"], row["workload"]) for row in document["summary"]}
        self.assertEqual(rows, {(group, workload) for group in ("tuned", "held out")
                                for workload in QUESTIONS})

    def test_scenes_and_chosen_workloads(self):
        mesh = self.write("mesh.ply", TETRAHEDRON)
        cloud = self.write("cloud.ply", ply([(x, y, x * y % 3) for x in range(9) for y in range(7)]))
        document = self.document(*QUICK, mesh, cloud, "--seed", "1", "--only", "spheres,all_hits", "--rounds", "1")
        (group,) = document["groups"]
        self.assertEqual((group["group"], group["seed"]), ("tuned", 1))
        asked = {(q["workload"], q["scene"]): q for q in group["questions"]}
        self.assertEqual(set(asked), {("all_hits", "mesh.ply"), ("spheres", "made at random"), ("spheres", "cloud.ply")})
        self.assertEqual(asked["spheres", "cloud.ply"]["primitives"], 63)
        self.assertEqual(asked["all_hits", "mesh.ply"]["primitives"], 4)
        for question in asked.values():
            for mode in question["modes"]:
                if mode["answers"] is not None:
                    self.assertEqual(mode["answers"]["unexplained"], 0, mode)

    def test_high_stands_beside_both(self):
        document = self.document(*QUICK, "--only", "user", "--quality", "high", "--seed", "1")
        sides = {mode["side"] for q in document["groups"][0]["questions"] for mode in q["modes"]}
        self.assertEqual(sides, {"raydix", "embree medium", "embree medium+robust", "embree high", "embree high+robust"})

    def test_same_seed_same_answers(self):
        once, again = (self.document(*QUICK, "--only", "plants,moved", "--seed", "5", "--rounds", "1") for _ in range(2))

        def answers(document):
            return [(q["scene"], q["question"], q["hits"], [mode["answers"] for mode in q["modes"]])
                    for group in document["groups"] for q in group["questions"]]

        self.assertEqual(answers(once), answers(again))

    def test_differences_are_seen(self):
        # Without any tolerance the two sides' roundings differ for far more rays than edges explain.
        self.fail_with_one_line(*QUICK, "--only", "instances", "--tolerance", "0", names=["embree medium", "answers differ"])

    def test_what_is_refused(self):
        self.fail_with_one_line("bench", "scene", "missing.ply", names=["missing.ply"])
        empty = self.write("empty.ply", ply([]))
        self.fail_with_one_line("bench", "scene", empty, names=["empty.ply"])
        for wrong in (["--only", "rain"], ["--quality", "ultra"], ["--rounds", "0"], ["--clock", "sun"],
                      ["--instances", "0"], ["--size", "5"], ["--bogus"]):
            self.fail_with_usage("bench", "scene", *wrong, names=[wrong[0]])


if __name__ == "__main__":
    main()
