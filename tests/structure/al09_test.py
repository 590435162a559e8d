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
OUTSIDE = {("gtx285", "persistent_speculative_while_while", "diffuse"): "below",
           ("gtx680", "dynamic_fetch", "ao"): "below"}


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
        for key, (part, _, _, place) in rows.items():
            if place == "open":
                self.assertTrue(0.65 < part < 1.15, key)

    def test_every_claim_that_does_not_hold_has_its_paragraph(self):
        page = PAGE.read_text(encoding="utf-8")
        paragraphs = re.findall(r"^- \*\*(.+?)\.?\*\* ", page, re.MULTILINE)
        for claim in results.claims.values():
            if claim["verdict"] != "holds":
                self.assertIn(claim["claim"], " | ".join(paragraphs))

    def test_kernels_are_compared_on_the_same_launches(self):
        def row(kernel, part, bound):
            return {"scene": "s.ply", "machine": "m", "kernel": kernel, "rays": "ao", "part_taken": part, "count": 1000 * part, "sampling_error": 0.1 - part / 10,
                    "mrays_per_s_bound": bound, "mrays_per_s_scheduled": bound - 1, "memory_limits": None}
        # `slow` was also traced on a larger part of the launches, which are easier there.
        made_up = plots.Results([{"simulate": [row("fast", 0.25, 100), row("slow", 0.25, 90)], "claims": [], "published": []},
                                 {"simulate": [row("slow", 0.5, 150)], "claims": [], "published": []}])
        self.assertEqual(made_up.on_same_launches("s", "m", "ao"), {"fast": ("scheduled", 99), "slow": ("scheduled", 89)})
        self.assertEqual(made_up.bound(("s", "m", "slow", "ao")), (150, 0.05))

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
