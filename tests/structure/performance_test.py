"""docs/performance.md: its tables are those of figures.json and bench/results, their figures stand in the pages of docs/performance, its links lead somewhere."""
import importlib.machinery
import importlib.util
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "performance.md"
DETAILS = sorted((ROOT / "docs" / "performance").glob("*.md"))


def load_script():
    sys.dont_write_bytecode = True
    loader = importlib.machinery.SourceFileLoader("plot_performance", str(ROOT / "scripts" / "plot-performance"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


plots = load_script()


def anchors(text):
    """As GitHub makes them: lower case, no punctuation, hyphens for spaces."""
    prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    heads = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


class Tables(unittest.TestCase):
    def test_page_is_what_the_figures_give(self):
        page = PAGE.read_text(encoding="utf-8")
        self.assertEqual(page, plots.page_text(page, plots.load()), "run scripts/plot-performance")

    def test_pages_of_topics_have_the_tables_of_the_documents(self):
        tables = dict(plots.topic_tables(plots.load()))
        self.assertEqual({path.name for path in tables}, {"batches.md", "single-calls.md", "scenes.md"})
        for path, table in tables.items():
            page = path.read_text(encoding="utf-8")
            self.assertEqual(page, plots.between_marks(page, "workloads", table), "run scripts/plot-performance")
            self.assertGreater(table.count("\n| "), 25, path.name)
            number = re.search(r"\| \d\.\d\d / ", table).group(0)
            self.assertNotEqual(page, plots.between_marks(page, "workloads", table.replace(number, "| 9.99 / ", 1)))

    def test_a_mark_that_is_lost_is_found(self):
        page = "<!-- a: made -->\n| old |\n<!-- end -->\n"
        self.assertEqual(plots.between_marks(page, "a", "| new |"), page.replace("old", "new"))
        for broken in (page.replace("<!-- end -->", ""), page.replace("a: made", "b: made"), page + page,
                       page.replace("<!-- end -->", "<!-- c: made -->\n<!-- end -->")):
            with self.assertRaises(SystemExit):
                plots.between_marks(broken, "a", "| new |")

    def test_a_changed_number_is_found(self):
        page = PAGE.read_text(encoding="utf-8")
        number = re.search(r"\| (\d\.\d\d) / \d\.\d\d \|", page.split("<!-- tables")[1]).group(1)
        changed = page.replace(f"| {number} / ", f"| {number[:-1]}{(int(number[-1]) + 1) % 10} / ", 1)
        self.assertNotEqual(changed.split("<!-- tables")[1], plots.page_text(changed, plots.load()).split("<!-- tables")[1])

    def test_figures_stand_in_the_pages_of_their_topics(self):
        pages = [file.read_text(encoding="utf-8") for file in DETAILS]
        numbers = 0
        for table in plots.load()["tables"]:
            for row in table["rows"]:
                for column in table["columns"]:
                    value = row.get(column.get("ratio"))
                    if value is None:
                        continue
                    figures = [f"{number:.2f}" for number in plots.ends(value)]
                    numbers += len(figures)
                    found = any(all(re.search(rf"(?<![\d.]){figure}(?!\d)", page) for figure in figures) for page in pages)
                    self.assertTrue(found, f"{row['what']}: no page of docs/performance has {' and '.join(figures)}")
        self.assertGreater(numbers, 100)

    def test_each_measured_row_names_its_run_and_each_run_is_used(self):
        figures = plots.load()
        used = set()
        for table in figures["tables"]:
            for row in table["rows"]:
                measured = any(row.get(c.get("ratio")) is not None for c in table["columns"]) or "items" in row
                self.assertTrue("run" in row or not measured, row["what"])
                used.add(row.get("run"))
        self.assertEqual(used - {None}, set(figures["runs"]))
        for name, run in figures["runs"].items():
            self.assertIn(run["machine"], {"EPYC", "Genoa", "Milan", "Xeon", "simulated"}, name)
            self.assertRegex(run["date"], r"^\d{4}-\d\d-\d\d$")
            self.assertTrue(run["command"] and run["how"], name)


class Verdicts(unittest.TestCase):
    def verdict(self, of, target, **ratios):
        return plots.verdict({"of": of, "target": target, **ratios}, {"target": ["tuned", "held_out"]})

    def test_rates_and_times(self):
        self.assertEqual(self.verdict("rates", [1.3, 1.05], tuned=[1.31, 1.05], held_out=[1.3, 1.2]), "1.3 / 1.05: met")
        self.assertEqual(self.verdict("rates", [1.3, 1.05], tuned=[1.29, 1.04]), "1.3 / 1.05: missed")
        self.assertEqual(self.verdict("rates", [1.3, 1.05], tuned=[1.35, 0.81]), "1.3 / 1.05: median met, worst missed")
        self.assertEqual(self.verdict("rates", [1.3, 1.05], tuned=[1.35, 1.1], held_out=[0.8, 0.7]), "1.3 / 1.05: missed in part")
        self.assertEqual(self.verdict("times", [0.6, 0.8], tuned=[0.55, 0.75]), "0.6 / 0.8: met")
        self.assertEqual(self.verdict("times", [0.6, 0.8], tuned=[0.55, 1.2]), "0.6 / 0.8: median met, worst missed")

    def test_ranges_single_numbers_and_none(self):
        self.assertEqual(self.verdict("rates", [1.2, 1.0], tuned={"range": [0.97, 1.24]}), "1.2 / 1.0: missed in part")
        self.assertEqual(self.verdict("times", [0.5], tuned={"range": [0.51, 0.53]}), "0.5: missed")
        self.assertEqual(self.verdict("times", [0.5], tuned=0.5), "0.5: met")
        self.assertEqual(self.verdict("rates", [1.5], tuned=None), "1.5: not measured")
        self.assertEqual(self.verdict("rates", None, tuned=1.0), "-")


class Pages(unittest.TestCase):
    def test_pictures_are_there_and_small(self):
        for table in plots.load()["tables"]:
            picture = ROOT / "docs" / "images" / f"performance-{table['name']}.png"
            self.assertLess(picture.stat().st_size, 60_000, picture.name)

    def test_pages_are_short(self):
        self.assertLess(len(PAGE.read_text(encoding="utf-8").splitlines()), 180)
        for file in DETAILS:
            self.assertLess(len(file.read_text(encoding="utf-8").splitlines()), 260, file.name)

    def test_anchors_of_links_to_measurements_exist(self):
        links = 0
        for document in [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")]:
            prose = re.sub(r"```.*?```", "", document.read_text(encoding="utf-8"), flags=re.DOTALL)
            for target, anchor in re.findall(r"\]\(([^)#\s]*)#([^)\s]+)\)", prose):
                file = (document.parent / target).resolve() if target else document
                if file.suffix == ".md" and "performance" in str(file.relative_to(ROOT)) + str(document.relative_to(ROOT)):
                    links += 1
                    self.assertIn(anchor, anchors(file.read_text(encoding="utf-8")), f"{document.name}: {target}#{anchor}")
        self.assertGreater(links, 20)

    def test_simulated_figures_are_called_so(self):
        for table in plots.load()["tables"]:
            if any(row.get("run") == "hierarchy" for row in table["rows"]):
                self.assertIn("simulated", table["title"])
                self.assertIn("Simulated", table["about"])


if __name__ == "__main__":
    unittest.main()
