"""raydix simulate and bench traversal: figures, machine files, samples, refusals."""
import itertools
import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import time
import unittest

sys.dont_write_bytecode = True
from program import PROGRAM, SANITIZED, TRIANGLE, ProgramTest, main, ply, write_npy  # noqa: E402

SCENE = "builtin:grove?triangles=10000" if SANITIZED else "builtin:grove?triangles=20000"
SMALL = ("--size", "32x24", "--samples", "2") if SANITIZED else ("--size", "64x48", "--samples", "4")
MEDIUM = ("--size", "40x30", "--launch-rays", "1024") if SANITIZED else ("--size", "128x96", "--launch-rays", "4096")
KERNELS = {"packet", "while_while", "if_if", "speculative_while_while", "persistent_packet", "persistent_while_while",
           "persistent_if_if", "persistent_speculative_while_while", "ray_replacement", "work_queue", "dynamic_fetch"}
KINDS = {"primary", "ao", "diffuse", "diffuse_shuffled"}


class Simulate(ProgramTest):
    def test_wide_nodes_by_name(self):
        rows = self.document("simulate", SCENE, *SMALL, "--kernel", "while_while,cwbvh")["simulate"]
        self.assertEqual({(r["kernel"], r["rays"]) for r in rows}, {(k, r) for k in ("while_while", "cwbvh") for r in KINDS})
        visits = {(r["kernel"], r["rays"]): next(o["issues_per_ray"] * o["simd_efficiency"] for o in r["operations"] if o["name"] == "visit_node")
                  for r in rows}
        for row in rows:
            self.assertEqual(row["different_hits"], 0, row["kernel"])
        for rays in KINDS:
            self.assertLess(visits["cwbvh", rays], visits["while_while", rays])

    def test_every_kernel_and_kind(self):
        document = self.document("simulate", SCENE, *SMALL)
        rows = document["simulate"]
        self.assertEqual({(r["kernel"], r["rays"]) for r in rows}, {(k, r) for k in KERNELS for r in KINDS})
        for row in rows:
            self.assertIs(row["simulated"], True)
            self.assertEqual(row["different_hits"], 0, row["kernel"])
            self.assertGreater(row["count"], 0)
            self.assertEqual(row["mode"], "any" if row["rays"] == "ao" else "closest")
            self.assertGreater(row["mrays_per_s_bound"], 0)
            self.assertGreater(row["mrays_per_s_scheduled"], 0)
            self.assertLessEqual(row["mrays_per_s_scheduled"], row["mrays_per_s_bound"] * 1.000001)
            self.assertIsNone(row["mrays_per_s_memory"])
            self.assertEqual(row["sampling_error"], 0)
            self.assertTrue(0 < row["simd_efficiency"] <= 1)
            self.assertAlmostEqual(row["instructions_per_ray"] / (row["issues_per_ray"] * 32), row["simd_efficiency"])
            self.assertTrue(0 <= row["idle_share"] <= 1)
            self.assertAlmostEqual(sum(op["share"] for op in row["operations"]), 1)
            self.assertEqual(len(row["histogram"]["edges"]), len(row["histogram"]["counts"]) + 1)
        by_kind = {kind: {r["hits"] for r in rows if r["rays"] == kind} for kind in KINDS}
        self.assertTrue(all(len(hits) == 1 for hits in by_kind.values()), by_kind)
        self.assertEqual(document["machines"][0]["name"], "gtx480")

    def test_same_figures_for_every_thread_count(self):
        one, two = (self.document("simulate", SCENE, *SMALL, "--rays", "diffuse", "--memory", "--threads", str(n))
                    for n in (1, 3))
        for row in one["simulate"] + two["simulate"]:
            self.assertIsNotNone(row["mrays_per_s_memory"])
            self.assertLessEqual(row["mrays_per_s_memory"], row["mrays_per_s_bound"] * 1.000001)
            limits = {k: v for k, v in row["memory_limits"].items() if not k.endswith("_per_ray")}
            self.assertEqual(set(limits), {"replays", "texture", "l1", "l2", "dram", "latency"})  # of gtx480
            self.assertAlmostEqual(row["mrays_per_s_memory"], min(row["mrays_per_s_bound"], *limits.values()))
            named = limits.get(row["memory_limit"], row["mrays_per_s_bound"])
            self.assertAlmostEqual(row["mrays_per_s_memory"], named)
        self.assertEqual(one["simulate"], two["simulate"])

    @unittest.skipIf(SANITIZED, "many rays for a statistic; other tests run the same code")
    def test_a_sample_is_near_the_whole(self):
        arguments = ("simulate", SCENE, "--size", "256x192", "--samples", "8", "--rays", "diffuse", "--kernel",
                     "while_while,packet", "--launch-rays", "4096")
        whole, part = self.document(*arguments), self.document(*arguments, "--sample", "0.25")
        for a, b in zip(whole["simulate"], part["simulate"]):
            self.assertLess(b["count"], 0.5 * a["count"])
            self.assertGreater(b["sampling_error"], 0)
            error = abs(b["mrays_per_s_bound"] / a["mrays_per_s_bound"] - 1)
            self.assertLess(error, 6 * b["sampling_error"] + 0.02)

    def test_a_sample_of_few_rays_is_all_of_them_once(self):
        arguments = ("simulate", SCENE, *SMALL, "--kernel", "while_while")
        whole, part = self.document(*arguments), self.document(*arguments, "--sample", "0.1")
        for a, b in zip(whole["simulate"], part["simulate"]):
            if b["part_taken"] == 1:  # runs of the least length would overlap
                self.assertEqual({**a, "sample": 0.1}, b)
            self.assertLessEqual(b["count"], a["count"])
            self.assertAlmostEqual(b["count"] / a["count"], b["part_taken"])
        self.assertEqual(part["simulate"][0]["part_taken"], 1)

    def test_rays_from_a_file(self):
        self.succeed("trace", SCENE, "--size", "32x24", "--camera", "0", "--repeat", "1", "--save-rays", "rays.npy")
        document = self.document("simulate", SCENE, "--rays", "rays.npy", "--width", "8")
        self.assertEqual({row["count"] for row in document["simulate"]}, {32 * 24})
        self.assertEqual({row["width"] for row in document["simulate"]}, {8})

    def test_invalid_rays_are_counted(self):
        rows = [(0, 0, 5, 0, 0, 0, -1, 9), (float("nan"), 0, 5, 0, 0, 0, -1, 9), (0, 0, 5, 0, 0, 0, 0, 9)]
        write_npy(self.folder / "invalid.npy", "<f4", (3, 8), b"".join(struct.pack("<8f", *row) for row in rows))
        arguments = ("simulate", SCENE, "--rays", "invalid.npy", "--kernel", "while_while,packet")
        self.assertEqual([row["invalid_rays"] for row in self.document(*arguments)["simulate"]], [2, 2])
        self.assertIn("\n2 rays are invalid and count as misses\n", self.succeed(*arguments).out)

    def test_machine_files(self):
        document = self.document("simulate", SCENE, *SMALL, "--rays", "primary", "--kernel", "while_while")
        before = document["simulate"][0]["mrays_per_s_bound"]
        file = self.write("twice.json", json.dumps({"base": "gtx480", "name": "twice", "multiprocessors": 30}))
        twice = self.document("simulate", SCENE, *SMALL, "--rays", "primary", "--kernel", "while_while", "--machine", file)
        self.assertEqual(twice["machines"][0]["name"], "twice")
        self.assertAlmostEqual(twice["simulate"][0]["mrays_per_s_bound"], 2 * before)
        # Fields that came later may be left out, even without a base.
        bare = {key: value for key, value in document["machines"][0].items()
                if key not in ("read_clocks", "stack_read_clocks", "block_release")}
        same = self.document("simulate", SCENE, *SMALL, "--rays", "primary", "--kernel", "while_while", "--machine",
                             self.write("bare.json", json.dumps(bare)))
        self.assertEqual(same["simulate"][0]["mrays_per_s_bound"], before)
        self.assertEqual((same["machines"][0]["read_clocks"], same["machines"][0]["block_release"]), (0, "own"))
        # A machine that a document holds is a machine file.
        again = self.write("again.json", json.dumps(document["machines"][0]))
        same = self.document("simulate", SCENE, *SMALL, "--rays", "primary", "--kernel", "while_while", "--machine", again)
        self.assertEqual(same["simulate"][0]["mrays_per_s_bound"], before)

    def test_machines_that_were_never_built(self):
        """Those of docs/simulator.md do what it says of them, on another scene."""
        folder = pathlib.Path(__file__).resolve().parents[2] / "examples" / "machines"

        def figures(machine, kernels, field, *more):
            rows = self.document("simulate", SCENE, *SMALL, "--machine", machine, "--kernel", kernels, "--rays", "diffuse",
                                 *more)["simulate"]
            return {row["kernel"]: row[field] for row in rows}

        kernels = "while_while,work_queue"
        base = figures("gtx480", kernels, "mrays_per_s_bound")
        free = figures(folder / "gtx480-free-exchange.json", kernels, "mrays_per_s_bound")
        self.assertEqual(free["while_while"], base["while_while"])
        self.assertGreater(free["work_queue"], 1.3 * base["work_queue"])
        kernels = "while_while,persistent_while_while"
        base = figures("gtx285", kernels, "mrays_per_s_scheduled")
        own = figures(folder / "gtx285-blocks-out-of-order.json", kernels, "mrays_per_s_scheduled")
        self.assertEqual(own["persistent_while_while"], base["persistent_while_while"])
        self.assertGreaterEqual(own["while_while"], base["while_while"])
        base = figures("gtx680", "while_while", "mrays_per_s_memory", "--memory")
        more = figures(folder / "gtx680-more-in-flight.json", "while_while", "mrays_per_s_memory", "--memory")
        self.assertGreaterEqual(more["while_while"], base["while_while"])
        kernels = "while_while,speculative_while_while,dynamic_fetch"
        base = figures("h100", kernels, "mrays_per_s_bound")
        step = figures(folder / "h100-lanes-in-step.json", kernels, "mrays_per_s_bound")
        self.assertEqual(step["while_while"], base["while_while"])
        for kernel in ("speculative_while_while", "dynamic_fetch"):
            self.assertGreater(step[kernel], 1.03 * base[kernel])

    def test_costs_of_single_kernels_are_kept_in_machine_files(self):
        arguments = ("simulate", SCENE, "--size", "32x24", "--rays", "primary")
        first = self.document(*arguments, "--machine", "h200")
        again = self.document(*arguments, "--machine", self.write("h200.json", json.dumps(first["machines"][0])))
        self.assertEqual(first["simulate"], again["simulate"])
        # A cost without a kernel holds for all kernels.
        dear = self.document(*arguments, "--machine",
                             self.write("dear.json", '{"base": "h200", "costs": {"visit_node": 5000}}'))
        for before, after in zip(first["simulate"], dear["simulate"]):
            self.assertLess(after["mrays_per_s_bound"], 0.5 * before["mrays_per_s_bound"], after["kernel"])
        one = self.document(*arguments, "--machine", self.write("one.json", json.dumps(
            {"base": "h200", "name": "h200",
             "costs": [{"operation": "visit_node", "instructions": 5000, "kernel": "if_if"}]})))
        for before, after in zip(first["simulate"], one["simulate"]):
            changed = before["mrays_per_s_bound"] != after["mrays_per_s_bound"]
            self.assertEqual(changed, before["kernel"] == "if_if", before["kernel"])

    def test_bad_machine_files(self):
        for text, words in (("{", ["JSON"]), ("[]", ["machine", "object"]),
                            ('{"base": "gtx1"}', ["gtx1", "gtx480"]),
                            ('{"base": "gtx480", "clock": 2}', ["clock", "not a field"]),
                            ('{"base": "gtx480", "clock_ghz": -1}', ["clock_ghz"]),
                            ('{"base": "gtx480", "clock_ghz": "fast"}', ["clock_ghz"]),
                            ('{"base": "gtx480", "clock_ghz": 1e-308}', ["clock_ghz", "1e-6"]),
                            ('{"base": "gtx480", "name": ""}', ["name", "empty"]),
                            ('{"base": "gtx480", "name": "a\\u001b[31mb"}', ["name", "control characters"]),
                            ('{"base": "gtx480", "origin": "a\\nb"}', ["origin", "control characters"]),
                            ('{"base": "gtx480", "costs": {"a\\u001b[31m": 1}}', ["costs"]),
                            ('{"base": "gtx480", "a\\u001b[31m": 1}', ["not a field"]),
                            ('{"base": "gtx480", "read_clocks": -1}', ["read_clocks"]),
                            ('{"base": "gtx480", "replays": 1}', ["replays", "true or false"]),
                            ('{"base": "gtx480", "l2_clocks": "long"}', ["l2_clocks"]),
                            ('{"base": "gtx480", "texture_bytes": -5}', ["texture_bytes"]),
                            ('{"base": "gtx480", "block_release": "never"}', ["block_release", "in_order"]),
                            ('{"base": "gtx480", "multiprocessors": 0}', ["multiprocessors"]),
                            ('{"base": "gtx480", "multiprocessors": 1.5}', ["multiprocessors"]),
                            ('{"base": "gtx480", "multiprocessors": 4000000000}', ["in flight"]),
                            ('{"base": "gtx480", "costs": {"fly": 1}}', ["fly"]),
                            ('{"base": "gtx480", "costs": {"push": -1}}', ["push"]),
                            ('{"base": "gtx480", "costs": [{"operation": "push"}]}', ["instructions"]),
                            ('{"base": "gtx480", "costs": 3}', ["costs"]),
                            ('{"base": "gtx480", "costs": [{"operation": "push", "instructions": 3, "kernel": "x"}]}',
                             ["there is no kernel x"]),
                            ('{"base": "gtx480", "costs": [{"operation": "push", "instructions": 3, "cost": 1}]}',
                             ["cost is not a field"]),
                            ('{"base": "gtx480", "costs": [{"operation": "push", "instructions": 3}, '
                             '{"operation": "push", "instructions": 4}]}', ["push has two costs"]),
                            ('{"name": "bare"}', ["multiprocessors", "missing"])):
            file = self.write("bad.json", text)
            self.fail_with_one_line("simulate", SCENE, "--machine", file, names=["bad.json", *words])
        for text, words in (('{"base": "gtx480", "costs": [{"operation": "push", "instructions": 9, "most": 3}]}',
                             ["'push'", "most", "3", "instructions", "9"]),
                            ('{"base": "gtx480", "block_lanes": 4096}', ["block_lanes is 4096", "resident_lanes", "1024"]),
                            ('{"base": "gtx480", "resident_lanes": 16, "block_lanes": 16}', ["resident_lanes is 16", "32"]),
                            ('{"base": "gtx480", "resident_lanes": 200}', ["resident_lanes is 200", "32"])):
            file = self.write("cannot.json", text)
            self.fail_with_one_line("simulate", SCENE, "--machine", file, names=["cannot.json", *words])
            self.fail_with_one_line("bench", "traversal", SCENE, "--machine", f"gtx285,{file}", names=["cannot.json", *words])
        # A cache that gives nothing is no texture cache.
        file = self.write("texture.json", '{"base": "gtx480", "texture_fetches_per_clock": 0}')
        self.fail_with_one_line("simulate", SCENE, "--memory", "--machine", file,
                                names=["texture.json", "texture_fetches_per_clock is 0;", "1e-6"])
        # 15 first-level caches of 4 GB would be 32 GB of records.
        file = self.write("caches.json", '{"base": "gtx480", "l1_bytes": 4000000000}')
        self.fail_with_one_line("simulate", SCENE, "--memory", "--machine", file, names=["caches.json", "l1_bytes", "2^30"])
        self.fail_with_one_line("simulate", SCENE, "--machine", "none.json", names=["none.json"])
        for command in (("simulate",), ("bench", "traversal")):
            self.fail_with_usage(*command, SCENE, "--machine", "gtx1", names=["--machine", "gtx1", "gtx285_enum_popc", ".json"])

    def test_usage(self):
        self.fail_with_usage("simulate")
        self.fail_with_usage("simulate", SCENE, "--kernel", "while", names=["while", "if_if"])
        self.fail_with_usage("simulate", SCENE, "--rays", "primary,rain", names=["rain"])
        self.fail_with_usage("simulate", SCENE, "--width", "12")
        self.fail_with_usage("simulate", SCENE, "--sample", "0")
        self.fail_with_usage("simulate", SCENE, "--sample", "1.5")
        self.fail_with_usage("bench", "traversal", SCENE, "--kernel", "x")
        self.fail_with_usage("simulate", SCENE, "--any", "--rays", "primary", names=["--any", "--rays FILE.npy", "primary"])
        help_text = " ".join(self.succeed("simulate", "--help").out.split())
        self.assertIn("Builder (default: split, without --quality)", help_text)
        self.assertNotIn("default: balanced", help_text)

    def test_files_at_fault_are_named_once(self):
        scene = self.write("one.ply", TRIANGLE)
        result = self.fail_with_one_line("simulate", scene, "--camera", "7", "--quiet", names=["camera 7"])
        self.assertEqual(result.err.count("one.ply"), 1, result)
        os.mkdir(self.folder / "folder")
        for state in ("folder", "none/state.json"):
            result = self.fail_with_one_line("bench", "traversal", scene, "--state", state, names=[state + ": cannot write: "])
            self.assertNotIn("one.ply", result.err)
        result = self.fail_with_one_line("bench", "traversal", "none.ply", names=["none.ply"])
        self.assertEqual(result.err.count("none.ply"), 1, result)
        result = self.run_program("bench", "traversal", scene, "--rays", "rays.npy", "--quiet")
        self.assertEqual(result.code, 2)
        self.assertIn("bench traversal makes its own rays", result.err)

    def test_nothing_is_printed_before_an_error(self):
        scene = self.write("one.ply", TRIANGLE)
        for arguments in (("simulate", scene), ("bench", "traversal", scene, "--machine", "gtx285")):
            self.fail_with_one_line(*arguments, "--camera", "7", names=["camera 7"])
            self.fail_with_usage(*arguments, "--camera", "x", names=["'x'"])
        self.fail_with_one_line("simulate", scene, "--rays", "none.npy", names=["none.npy"])

    def test_points_are_refused(self):
        self.fail_with_one_line("simulate", "builtin:uniform?points=100", names=["triangles"])


class Traversal(ProgramTest):
    def tables_and_document(self, *arguments):
        """What one run prints, and what it writes."""
        out = self.succeed(*arguments, "--json", "traversal.json").out
        return out, json.loads((self.folder / "traversal.json").read_text(encoding="utf-8"))

    def test_tables(self):
        size = ("--size", "16x12", "--samples", "2") if SANITIZED else SMALL
        arguments = ("bench", "traversal", SCENE, *size, "--machine", "gtx285,gtx480")
        out, document = self.tables_and_document(*arguments)
        rows = document["simulate"]
        self.assertEqual({r["machine"] for r in rows}, {"gtx285", "gtx480", "gtx285_enum_popc"})
        self.assertEqual(len(rows), 4 * (2 * 11 + 2))
        self.assertEqual(document["published"], [])
        self.assertEqual(document["measured"], [])
        claims = document["claims"]
        self.assertGreaterEqual(len(claims), 15)
        bound = {(r["kernel"], r["rays"], r["machine"]): r["mrays_per_s_bound"] for r in rows}
        queue = [c for c in claims if "work_queue on gtx285_enum_popc" in c["found"] and "ao rays" in c["found"]]
        self.assertEqual(len(queue), 1)
        self.assertAlmostEqual(queue[0]["ratio"], bound["work_queue", "ao", "gtx285_enum_popc"] /
                               bound["persistent_while_while", "ao", "gtx285"])
        sweep = document["width_sweep"]
        self.assertEqual(len(sweep), 4 * 11 * 8)
        for row in sweep:
            if row["width"] == 1 and row["kernel"] in ("while_while", "if_if"):
                self.assertAlmostEqual(row["simd_efficiency"], 1)
        for word in ("simulated Mrays/s", "claims", "no GPU was used"):
            self.assertIn(word, out)

    def test_what_has_no_figure_is_null_and_a_dash(self):
        empty = self.write("empty.obj", b"")
        arguments = ("bench", "traversal", empty, *SMALL, "--machine", "gtx285")
        out = self.succeed(*arguments, "--json", "empty.json").out
        self.assertIn("SAH -,", out)
        self.assertNotIn(" 0.0%", out.split("SIMD efficiency by width", 1)[1].split("claims of", 1)[0])
        document = json.loads((self.folder / "empty.json").read_text(encoding="utf-8"))
        self.assertEqual(len(document["width_sweep"]), 4 * 11 * 8)
        for row in document["width_sweep"]:
            self.assertEqual((row["simd_efficiency"], row["mrays_per_s_bound"]), (None, None))
        self.assertEqual({claim["verdict"] for claim in document["claims"]}, {"needs rays"})
        self.succeed("report", "empty.json", "-o", "empty.html", "--quiet")
        html = (self.folder / "empty.html").read_text(encoding="utf-8")
        self.assertIn(f"No claim of the paper has a verdict here: {len(document['claims'])} need rays.", html)

    def test_the_sweep_has_the_widths_that_a_machine_holds(self):
        small = self.write("small.json", '{"base": "gtx480", "name": "small", "resident_lanes": 32, "block_lanes": 32}')
        document = self.document("bench", "traversal", SCENE, "--size", "16x16", "--samples", "1", "--machine", small, "--rays",
                                 "primary", "--kernel", "if_if")
        self.assertEqual([row["width"] for row in document["width_sweep"]], [1, 2, 4, 8, 16, 32])

    def test_claims_are_intervals_against_intervals(self):
        one = self.write("one.json", '{"base": "gtx285", "name": "gtx285", "multiprocessors": 1}')  # which small launches fill
        arguments = ("bench", "traversal", SCENE, "--size", "64x48", "--samples", "4", "--machine", one, "--sweep-sample", "0")
        claims = self.document(*arguments)["claims"]
        for claim in claims:
            self.assertTrue(0 < claim["low"] <= claim["ratio"] <= claim["high"], claim)
            low, high = claim["paper_low"], claim["paper_high"] or float("inf")
            inside = low <= claim["low"] and claim["high"] <= high
            outside = claim["high"] < low or high < claim["low"]
            self.assertEqual(claim["holds"], True if inside else False if outside else None, claim)
            self.assertEqual(claim["verdict"], "holds" if inside else "does not hold" if outside else "open")
        # The same claims for a small part of the launches: none is gone.
        part = self.document(*arguments, "--launch-rays", "8192", "--sample", "0.2")["claims"]
        self.assertEqual([c["claim"] for c in part], [c["claim"] for c in claims])
        scheduled = [c for c in part if ", scheduled" in c["found"]]
        self.assertGreaterEqual(len(scheduled), 7)

    def test_the_error_of_a_claim_is_that_of_its_costs(self):
        """Costs without a range leave none; a range of a node's cost is carried through."""
        arguments = ("bench", "traversal", SCENE, "--size", "64x48", "--samples", "4", "--sweep-sample", "0", "--rays", "diffuse",
                     "--kernel", "persistent_packet,persistent_while_while,packet")
        machine = self.document(*arguments, "--machine", "gtx285")["machines"][0]
        machine["multiprocessors"] = 1  # which small launches fill
        for cost in machine["costs"]:
            cost.pop("most", None)
            if cost["operation"] == "visit_node":
                cost["most"] = 2 * cost["instructions"]
        document = self.document(*arguments, "--machine", self.write("gtx285.json", json.dumps(machine)))
        rows = {row["kernel"]: row for row in document["simulate"]}

        def share(kernel):
            return next(op["share"] for op in rows[kernel]["operations"] if op["name"] == "visit_node")

        beats, gain = document["claims"][0], document["claims"][1]
        self.assertIn("twofold on diffuse", beats["claim"])
        self.assertAlmostEqual(beats["low"], beats["ratio"] / (1 + share("persistent_while_while")), 5)
        self.assertAlmostEqual(beats["high"], beats["ratio"] * (1 + share("persistent_packet")), 5)
        # One kernel in two forms has one cost for a node, whatever it is.
        plain, persistent = 1 + share("packet"), 1 + share("persistent_packet")
        ends = sorted([gain["ratio"], gain["ratio"] * plain / persistent])
        self.assertAlmostEqual(gain["low"], ends[0], 5)
        self.assertAlmostEqual(gain["high"], ends[1], 5)

    def test_kernels_are_ranked_with_the_error_of_their_difference(self):
        small = [self.write(f"{base}.json", json.dumps({"base": base, "name": base, "multiprocessors": 1})) for base in ("gtx285", "gtx480")]
        size = "40x30" if SANITIZED else "64x48"
        arguments = ("bench", "traversal", SCENE, "--size", size, "--samples", "4", "--machine", ",".join(small), "--rays", "primary,ao",
                     "--memory", "--sweep-sample", "0")  # machines that these launches fill
        out, document = self.tables_and_document(*arguments)
        rows = {(r["rays"], r["kernel"], r["machine"]): r for r in document["simulate"]}
        most = {(m["name"], c.get("kernel"), c["operation"]): c.get("most", 0) for m in document["machines"] for c in m["costs"]}

        def tightest(row):
            limits = [row["mrays_per_s_bound"], row["mrays_per_s_scheduled"], row["mrays_per_s_memory"]]
            return min(limit for limit in limits if limit)

        def costs_of(row):
            """Of each operation issues, instructions as charged, and the most that they may be."""
            return {o["name"]: (o["issues_per_ray"], o["cost"], max(o["cost"], most.get((row["machine"], row["kernel"], o["name"]), 0)))
                    for o in row["operations"]}

        def cost_range(a, b):
            """Instructions of b over those of a, relative to what is charged: every end of every cost that both have in common."""
            a, b = costs_of(a), costs_of(b)
            common = [o for o in a.keys() & b.keys() if a[o][1:] == b[o][1:]]
            moving = [o for o in common if a[o][2] > a[o][1]]

            def instructions(row, own_end, at_most):
                return sum(n * (cost[o in at_most] if o in common else cost[own_end]) for o, (n, *cost) in row.items())

            ratios = [[instructions(b, ends, at_most) / instructions(a, 1 - ends, at_most) for ends in (0, 1)] for count in range(len(moving) + 1)
                      for at_most in map(set, itertools.combinations(moving, count))]
            charged = instructions(b, 0, ()) / instructions(a, 0, ())
            return min(r[0] for r in ratios) / charged, max(r[1] for r in ratios) / charged

        self.assertCountEqual([(r["machine"], r["rays"], len(r["kernels"])) for r in document["ranking"]],
                              [(machine, rays, number) for rays in ("primary", "ao")
                               for machine, number in (("gtx285", 11), ("gtx285_enum_popc", 2), ("gtx480", 11))])
        level = 0
        for ranked in document["ranking"]:
            own = [rows[ranked["rays"], k["kernel"], ranked["machine"]] for k in ranked["kernels"]]
            rates = [tightest(row) for row in own]
            self.assertEqual(rates, sorted(rates, reverse=True))
            self.assertEqual([k["behind"] for k in ranked["kernels"]][0], None)
            first = ranked["kernels"][0]["kernel"]
            for kernel, row, rate in list(zip(ranked["kernels"], own, rates))[1:]:
                self.assertAlmostEqual(kernel["mrays_per_s"], rate)
                self.assertAlmostEqual(kernel["first_over_it"], rates[0] / rate)
                if ranked["machine"] == "gtx285_enum_popc":  # of full size
                    self.assertEqual((kernel["behind"], kernel["low"], kernel["needs"]), (None, None, "needs launches that fill the machine"))
                    continue
                self.assertEqual((kernel["behind"], kernel["needs"]), (kernel["low"] > 1, ""))
                level += not kernel["behind"]
                if kernel["kernel"].removeprefix("persistent_") == first.removeprefix("persistent_"):
                    continue  # one kernel in two forms
                ends = cost_range(own[0], row)
                self.assertAlmostEqual(kernel["low"], rates[0] / rate * ends[0], 5)
                self.assertAlmostEqual(kernel["high"], rates[0] / rate * ends[1], 5)
        self.assertGreater(level, 0)
        self.assertIn("not told from: ", out)
        # Of a part of the launches the error of the sample comes to that.
        size = ("--size", "96x72", "--launch-rays", "2048") if SANITIZED else ("--size", "256x192", "--launch-rays", "8192")
        part = self.document("bench", "traversal", SCENE, *size, "--samples", "4", "--sample", "0.3", "--machine", small[1], "--rays", "ao", "--sweep-sample", "0")
        rows = {(r["rays"], r["kernel"], r["machine"]): r for r in part["simulate"]}
        ranked = next(r for r in part["ranking"] if (r["machine"], r["rays"]) == ("gtx480", "ao"))
        first, last = ranked["kernels"][0], ranked["kernels"][-1]
        self.assertGreater(rows["ao", first["kernel"], "gtx480"]["sampling_error"], 0)
        ends = cost_range(*(rows["ao", kernel["kernel"], "gtx480"] for kernel in (first, last)))
        self.assertLess(last["low"], last["first_over_it"] * ends[0])

    def test_small_launches_do_not_judge_schedules(self):
        claims = self.document("bench", "traversal", SCENE, *SMALL, "--machine", "gtx285", "--sweep-sample", "0", "--kernel",
                               "packet,persistent_packet,while_while,persistent_while_while")["claims"]
        scheduled = [c for c in claims if ", scheduled" in c["found"]]
        self.assertGreaterEqual(len(scheduled), 6)
        for claim in claims:
            needs = claim["verdict"] == "needs launches that fill the machine"
            self.assertEqual(needs, claim in scheduled)
            self.assertEqual((claim["low"], claim["holds"]) == (None, None), needs)
            self.assertGreater(claim["ratio"], 0)

    def test_a_small_sample_needs_whole_launches(self):
        claims = self.document("bench", "traversal", SCENE, "--size", "256x192", "--samples", "4", "--sample", "0.1", "--rays",
                               "primary", "--machine", "gtx285", "--sweep-sample", "0", "--kernel",
                               "packet,persistent_packet,while_while,persistent_while_while,if_if")["claims"]
        needing = [c for c in claims if c["verdict"] == "needs whole launches"]
        self.assertEqual(len(needing), 3)
        for claim in needing:
            self.assertIsNone(claim["holds"])
            self.assertIn(", scheduled", claim["found"])
        self.assertGreater(len(claims), len(needing))

    def test_a_study_goes_on_where_it_ended(self):
        arguments = ("bench", "traversal", SCENE, *MEDIUM, "--samples", "8", "--machine",
                     "gtx285,gtx480", "--kernel", "while_while,persistent_packet,dynamic_fetch", "--rays", "primary,diffuse",
                     "--sweep-sample", "0", "--quiet")
        whole = self.document(*arguments)
        first = self.document(*arguments, "--state", "state.json", "--error", "1")
        self.assertLess(first["simulate"][-1]["part_taken"], 1)
        self.assertGreater(first["simulate"][-1]["sampling_error"], 0)
        again = self.document(*arguments, "--state", "state.json", "--error", "1")  # nothing is left to do
        self.assertEqual(first["simulate"], again["simulate"])
        kept = json.loads((self.folder / "state.json").read_text(encoding="utf-8"))
        part = next(part for name, part in kept["parts"].items() if "diffuse" in name)  # ended before the sample began
        del part["rows"], part["launches"]
        for launches in part["all"].values():
            del launches[3:]
        self.write("early.json", json.dumps(kept))
        self.assertEqual(first["simulate"], self.document(*arguments, "--state", "early.json", "--error", "1")["simulate"])
        rest = self.document(*arguments, "--state", "state.json")
        self.assertEqual(whole["simulate"], rest["simulate"])
        self.assertEqual(whole["claims"], rest["claims"])
        kept = json.loads((self.folder / "state.json").read_text(encoding="utf-8"))
        del next(iter(kept["parts"].values()))["rows"][0]["operations"]
        self.write("broken.json", json.dumps(kept))
        self.fail_with_one_line(*arguments, "--state", "broken.json", names=["broken.json", "cannot be gone on with"])
        self.fail_with_one_line(*arguments, "--ao-radius", "3", "--state", "state.json", names=["state.json", "other options"])
        self.write("other.json", "{}")
        self.fail_with_one_line(*arguments, "--state", "other.json", names=["other.json", "is no state of bench traversal"])

    def test_scenes_and_machines_of_one_name_are_refused(self):
        for folder, size in (("a", 1), ("b", 2)):
            os.makedirs(self.folder / folder, exist_ok=True)
            self.write(f"{folder}/one.ply", ply([(0, 0, 0), (size, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
            self.succeed("build", f"{folder}/one.ply", "-o", f"{folder}.rdx", "--quiet")
        small = ("--size", "16x16", "--samples", "1", "--quiet")
        for a, b in (("a/one.ply", "b/one.ply"), ("a.rdx", "b.rdx"), ("a.rdx", "b/one.ply"), (SCENE, SCENE)):
            for bench in ("traversal", "hierarchy"):
                self.fail_with_one_line("bench", bench, a, b, "--quiet", names=[f"{b}: ", f"from {a}: both are named "])
        for number in (1, 2):
            self.write(f"m{number}.json", json.dumps({"base": "gtx480", "multiprocessors": number}))
        for a, b, name in (("m1.json", "m2.json", "custom"), ("gtx480", "gtx480", "gtx480")):
            self.fail_with_one_line("bench", "traversal", "a/one.ply", *small, "--machine", f"{a},{b}", names=[f"{b}: ", f"'{name}'"])

    def test_a_name_that_is_not_utf8_has_a_state(self):
        scene = os.fsdecode(b"b\xff.ply")
        (self.folder / scene).write_text(TRIANGLE)
        arguments = ("bench", "traversal", scene, *SMALL, "--machine", "gtx285", "--kernel", "while_while", "--rays", "primary",
                     "--sweep-sample", "0", "--quiet", "--state", "bytes.json")
        self.assertEqual(self.document(*arguments)["simulate"], self.document(*arguments)["simulate"])
        self.assertEqual(len(json.loads((self.folder / "bytes.json").read_text(encoding="utf-8"))["parts"]), 1)

    def test_an_interrupted_study_leaves_its_state_alone(self):
        arguments = ("bench", "traversal", SCENE, "--size", "64x48", "--samples", "8", "--launch-rays", "1024", "--machine",
                     "gtx285", "--kernel", "while_while", "--rays", "primary,diffuse", "--sweep-sample", "0", "--quiet")
        whole = self.document(*arguments)
        for k in range(20):
            state = self.folder / "ended.json"
            state.unlink(missing_ok=True)
            process = subprocess.Popen([PROGRAM, *arguments, "--state", "ended.json"], cwd=self.folder)
            while process.poll() is None and not state.exists():
                time.sleep(0.001)  # until the first launch
            time.sleep(0.0007 * k)
            process.send_signal((signal.SIGINT, signal.SIGTERM)[k % 2])
            self.assertIn(process.wait(), (0, -signal.SIGINT, -signal.SIGTERM))
            self.assertEqual([file.name for file in self.folder.glob("*.part")], [])
        self.assertEqual(whole["simulate"], self.document(*arguments, "--state", "ended.json")["simulate"])

    def test_a_state_of_something_else_is_refused(self):
        cameras = {"width": 32, "height": 24, "ao_radius": 0.5, "cameras": [
            {"position": [0.2, 0.3, 3], "target": [0.5, 0.5, 0], "up": [0, 1, 0], "vfov": 30}]}
        arguments = ("bench", "traversal", "one.ply", "--cameras", "cameras.json", "--samples", "1", "--machine", "gtx285",
                     "--kernel", "while_while", "--rays", "primary,ao", "--sweep-sample", "0", "--quiet", "--state", "kept.json")
        corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        self.write("one.ply", ply(corners, [(0, 1, 2)]))
        self.write("cameras.json", json.dumps(cameras))
        self.document(*arguments)
        for change in ({"width": 64, "height": 48}, {"ao_radius": 5}):
            self.write("cameras.json", json.dumps({**cameras, **change}))
            self.fail_with_one_line(*arguments, names=["kept.json", "other options"])
        self.write("cameras.json", json.dumps(cameras))
        self.write("one.ply", ply([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 1, 2)]))  # in the same box
        self.fail_with_one_line(*arguments, names=["kept.json", "another scene"])
        self.write("one.ply", ply(corners, [(0, 1, 2)]))
        self.document(*arguments)

    def test_a_damaged_state_is_refused(self):
        arguments = ("bench", "traversal", self.write("one.ply", TRIANGLE), *SMALL, "--machine", "gtx285", "--kernel",
                     "while_while", "--rays", "primary", "--sweep-sample", "0", "--quiet", "--state")
        self.document(*arguments, "sound.json")
        sound = json.loads((self.folder / "sound.json").read_text(encoding="utf-8"))
        (name, part), = sound["parts"].items()

        def refused(document, *names):
            self.write("damaged.json", json.dumps(document))
            result = self.fail_with_one_line(*arguments, "damaged.json", names=["damaged.json: ", *names])
            self.assertNotIn("json.exception", result.err)

        refused({**sound, "holds": 3}, "is no state")
        refused({**sound, "version": 1}, "another version")
        for value in (3, None, [1], "x", {}):
            refused({**sound, "parts": {name: value}})
        for launches in (-1, 0.5, part["launches"] - 1, part["launches"] + 1):
            refused({**sound, "parts": {name: {**part, "launches": launches}}}, "cannot be gone on with")
        for row in ({"instructions": -5}, {"rays": 1.5}, {"warp_times": [[-1, 1]]}):
            refused({**sound, "parts": {name: {**part, "rows": [{**part["rows"][0], **row}]}}}, "cannot be gone on with")
        refused({**sound, "parts": {name: {**part, "rows": 2 * part["rows"]}}}, "cannot be gone on with: 2 rows, not 1")

    def test_a_sample_is_corrected_by_all_launches(self):
        arguments = ("bench", "traversal", SCENE, "--size", "64x48" if SANITIZED else "128x96", "--samples", "8", "--launch-rays",
                     "1024", "--machine", "gtx285,gtx480", "--kernel", "while_while,persistent_packet", "--rays", "diffuse", "--sweep-sample", "0",
                     "--builder", "split", "--quiet")
        whole = self.document(*arguments)["simulate"]
        part = self.document(*arguments, "--error", "0.9")["simulate"]
        self.fail_with_usage(*arguments, "--error", "0.9", "--sample", "0.5", names=["--error", "--sample"])
        for w, p in zip(whole, part, strict=True):
            self.assertEqual(w["correction"], 1)
            self.assertLess(p["part_taken"], 0.5)
            error = p["mrays_per_s_bound"] / w["mrays_per_s_bound"] - 1
            self.assertLess(abs(error), 6 * p["sampling_error"] + 1e-9)
            self.assertGreater(abs(p["correction"] - 1), 1e-3)
            # Of these, or of those that are much like them, the instructions of all launches are known.
            self.assertLess(abs(error), 1e-6 if (p["kernel"], p["machine"]) == ("while_while", "gtx285") else 1e-2)

    def test_published_figures_of_the_papers_scenes(self):
        mesh = pathlib.Path(self.write("conference_copy.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                                       "property float y\nproperty float z\nelement face 1\n"
                                       "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"))
        document = self.document("bench", "traversal", str(mesh), *SMALL, "--sweep-sample", "0", "--rays", "primary")
        self.assertEqual(len(document["published"]), 15)
        for row in document["published"]:
            if row["rays"] == "primary":
                self.assertIs(row["above_bound"], row["mrays_per_s"] > row["mrays_per_s_bound"])
            else:
                self.assertIsNone(row["above_bound"])
        self.assertEqual({row["builder"] for row in document["simulate"] if row["machine"].startswith("gtx285")}, {"split"})
        self.assertEqual({row["builder"] for row in document["simulate"] if row["machine"] in ("gtx480", "gtx680")}, {"sbvh"})
        chosen = self.document("bench", "traversal", str(mesh), *SMALL, "--sweep-sample", "0", "--rays", "primary",
                               "--builder", "karras", "--machine", "gtx480", "--kernel", "while_while")
        self.assertEqual({row["builder"] for row in chosen["simulate"]}, {"karras"})
        self.assertTrue(all(row["other_edition"] for row in document["published"]))


if __name__ == "__main__":
    main()
