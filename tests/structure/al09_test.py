"""docs/al09.md: its tables are those of bench/results, every claim that does not hold has its paragraph, and published rates lie where the model says."""
import importlib.machinery
import importlib.util
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "al09.md"

# Published over the tightest limit, Sibenik: what is certainly not within 0.75 and 1.0. docs/al09.md says why.
OUTSIDE = {("gtx285", "persistent_speculative_while_while", "diffuse"): "below"}


def load_script():
    sys.dont_write_bytecode = True
    loader = importlib.machinery.SourceFileLoader("plot_al09", str(ROOT / "scripts" / "plot-al09"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


plots = load_script()
results = plots.Results(plots.documents())


class Al09(unittest.TestCase):
    def test_tables_are_those_of_the_results(self):
        for file, tables in ((PAGE, plots.parts(results)), (plots.SCENES_PAGE, plots.scene_parts(results)), (plots.COSTS_PAGE, plots.cost_parts(results))):
            page = file.read_text(encoding="utf-8")
            self.assertEqual(page, plots.page_text(page, tables), "run scripts/plot-al09")

    def test_published_rates_of_sibenik_lie_below_the_tightest_limit(self):
        rows = {key[1:]: results.place(key) for key in results.published if key[0] == "sibenik"}
        self.assertEqual(len(rows), 15)
        outside = {key: place for key, (_, _, _, place) in rows.items() if place in ("above", "below")}
        self.assertEqual(outside, OUTSIDE)
        self.assertEqual(sum(place == "within" for _, _, _, place in rows.values()), 10)
        for key, (part, low, high, place) in rows.items():
            self.assertTrue(low <= part <= high, key)
            if place == "open":
                self.assertTrue(0.65 < part < 1.15, key)

    def test_packets_beside_while_while_are_within_a_quarter_of_the_published_ratios(self):
        for scene in ("sibenik", "conference"):
            for kind in plots.KINDS:
                keys = [(scene, "gtx285", kernel, kind) for kernel in ("persistent_while_while", "persistent_packet")]
                ours, published = (rates[0] / rates[1] for rates in ([results.bound(key)[0] for key in keys],
                                                                     [results.published[key] for key in keys]))
                self.assertTrue(0.75 < ours / published < 1.25, (scene, kind, ours / published))

    def test_every_claim_that_does_not_hold_has_its_paragraph(self):
        page = PAGE.read_text(encoding="utf-8")
        paragraphs = [title for titles in re.findall(r"^- \*\*(.+?)\.?\*\* ", page, re.MULTILINE) for title in titles.split("; ")]
        for claim in results.claims.values():
            if claim["verdict"] != "holds":
                self.assertIn(claim["claim"], paragraphs)

    def test_kernels_are_compared_on_the_same_launches(self):
        def row(kernel, part, bound):
            return {"scene": "s.ply", "machine": "m", "kernel": kernel, "rays": "ao", "part_taken": part, "count": 1000 * part, "sampling_error": 0.1 - part / 10,
                    "mrays_per_s_bound": bound, "mrays_per_s_scheduled": bound - 1, "memory_limits": None}
        fast, slow = row("fast", 0.25, 100), row("slow", 0.25, 90)
        # `slow` was also traced on a larger part of the launches, which are easier there.
        made_up = plots.Results([{"simulate": [fast, slow], "claims": [], "published": []},
                                 {"simulate": [row("slow", 0.5, 150)], "claims": [], "published": []}])
        self.assertEqual(made_up.on_same_launches("s", "m", "ao"), {"fast": ("scheduled", 99, fast), "slow": ("scheduled", 89, slow)})
        self.assertEqual(made_up.bound(("s", "m", "slow", "ao")), (150, 0.05))
        # Of two parts that both have, the one with memory limits; else the larger.
        parts = [[row("fast", part, 100), row("slow", part, 90)] for part in (0.25, 0.5)]
        for documents in (parts, parts[::-1]):
            made_up = plots.Results([{"simulate": rows, "claims": [], "published": []} for rows in documents])
            self.assertEqual(made_up.on_same_launches("s", "m", "ao")["fast"][2]["part_taken"], 0.5)
        for part in parts[0]:
            part["memory_limits"] = {"l1": 50}
        for documents in (parts, parts[::-1]):
            made_up = plots.Results([{"simulate": rows, "claims": [], "published": []} for rows in documents])
            self.assertEqual(made_up.on_same_launches("s", "m", "ao")["fast"][:2], ("l1", 50))
        # Where both traced all, l1 is half of their bounds there, with the error of its sample.
        whole = {"simulate": [row("fast", 1, 120) | {"sampling_error": 0}, row("slow", 1, 100) | {"sampling_error": 0}], "claims": [], "published": []}
        found = plots.Results([{"simulate": parts[0], "claims": [], "published": []}, whole]).on_same_launches("s", "m", "ao")
        self.assertEqual(found["fast"][:2], ("l1", 60))
        self.assertAlmostEqual(found["fast"][2]["sampling_error"], 0.075)

    def test_what_is_not_told_from_the_first_kernel(self):
        costs = [{"kernel": kernel, "operation": "turn", "most": most} for kernel, most in (("first", 11), ("persistent_first", 12), ("twin", 11))]

        def row(kernel, error):
            traced = {"machine": "m", "kernel": kernel, "sampling_error": error, "operations": [{"name": "turn", "issues_per_ray": 2, "cost": 10}]}
            return plots.with_most(traced, {"machines": [{"name": "m", "costs": costs}]})
        # Costs leave the first kernel 10 % slower, but where they are in common; samples leave 2 * hypot(0.03, 0.04) = 10 %.
        for kernel, errors, limit, behind in (("other", (0, 0), 90, True), ("other", (0, 0), 91, False), ("twin", (0, 0), 99, True), ("persistent_first", (0, 0), 99, True),
                                              ("persistent_first", (0.03, 0.04), 91, False), ("persistent_first", (0.03, 0.04), 89, True), ("other", (None, 0), 1, False)):
            self.assertEqual(plots.is_behind(row(kernel, errors[0]), limit, row("first", errors[1]), 100), behind)

    def test_derived_ranges_are_those_of_the_claims(self):
        """What the program says of claims by issue on all primary rays, which have no error but that of costs."""
        found = 0
        for (scene, _, about), claim in results.claims.items():
            match = re.fullmatch(r"(\S+) against (\S+), primary rays, issue bound", about)
            if match is None:
                continue
            first, second = (min(results.rows[scene, "gtx285", kernel, "primary"], key=plots.error_of) for kernel in match.groups())
            low, high = plots.cost_range(second, first)
            self.assertAlmostEqual(claim["low"], low * claim["ratio"], 6)
            self.assertAlmostEqual(claim["high"], high * claim["ratio"], 6)
            found += 1
        self.assertGreaterEqual(found, 14)

    def test_verdicts_follow_the_rule(self):
        self.assertGreater(len(results.claims), 40)
        for claim in results.claims.values():
            low, high = claim["paper_low"], claim["paper_high"] or float("inf")
            if claim["low"] is None:
                self.assertTrue(claim["verdict"].startswith("needs"))
            elif low <= claim["low"] and claim["high"] <= high:
                self.assertEqual(claim["verdict"], "holds")
            else:
                apart = claim["high"] < low or high < claim["low"]
                self.assertEqual(claim["verdict"], "does not hold" if apart else "open")


if __name__ == "__main__":
    unittest.main()
