"""raydix report: pages from real documents; what is refused. tests/report/page_test.py opens them in a browser."""
import json
import os
import pathlib
import re
import shutil
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
FIGURE = "builtin:figure?triangles=5000"


class Report(ProgramTest):
    def make(self, name, *arguments):
        self.succeed(*arguments, "--quiet", "--json", name)
        return name

    def page(self, *arguments):
        self.succeed("report", *arguments, "-o", "page.html", "--quiet")
        return (self.folder / "page.html").read_text(encoding="utf-8")

    def test_rows_within_rows_are_tables(self):
        rows = [{"cloud": cloud, "queries": [{"kind": "knn", "rate": rate, "peers": [{"peer": f"peer of {cloud}", "rate": rate / 2}]}]}
                for cloud, rate in (("even", 12.25), ("dense", 46.75))]
        self.write("points.json", json.dumps({"command": "bench points", "clouds": rows}))
        self.succeed("report", "points.json", "-o", "page.html", "--quiet")
        page = (self.folder / "page.html").read_text().replace("<wbr>", "")
        for text in ("clouds, even: queries", "12.25", "46.75", "queries, knn: peers", "peer of dense"):
            self.assertIn(text, page)

    def test_documents_of_every_command(self):
        results = [self.make("build.json", "build", FIGURE), self.make("trace.json", "trace", FIGURE, "--size", "16x12"),
                   self.make("check.json", "check", FIGURE), self.make("info.json", "info", FIGURE),
                   self.make("scenes.json", "scenes"),
                   self.make("study.json", "bench", "hierarchy", "builtin:soup?triangles=2000", "--sizes", "200,2000",
                             "--cost-sizes", "500,2000", "--repeat", "1", "--thread-counts", "1")]
        html = self.page(*results)
        for section in ("summary", "builds", "traces", "construction", "scenes", "other", "sources"):
            self.assertIn(f'<section id="{section}">', html)
        total = json.loads((self.folder / "build.json").read_text(encoding="utf-8"))["build"]["ms"]["total"]
        self.assertIn(f'data-v="{total:.17g}"', html)  # the number of the document, all digits
        self.assertIn("every invariant holds", html)
        for name in results:
            self.assertIn(name, html)
        self.assertEqual(html, self.page(*results))

    def test_the_page_of_sibenik_is_what_its_documents_give(self):
        names = ("traversal-sibenik-gtx285.json", "traversal-sibenik-widths.json")
        results = [shutil.copy(ROOT / "bench/results" / name, self.folder / name) for name in names]
        self.succeed("report", *(pathlib.Path(result).name for result in results), "-o", "page.html", "--quiet")
        self.assertTrue((self.folder / "page.html").read_bytes() == (ROOT / "docs/reports/al09-sibenik.html").read_bytes(),
                        "docs/reports/al09-sibenik.html is older than the program or its documents: docs/al09.md says how it is made")

    def test_trees_that_are_compared(self):
        """Neither says that a tree is broken."""
        other = "builtin:soup?triangles=50"
        differs = self.run_program("check", "--same", FIGURE, other, "--quiet", "--json", "differs.json")
        self.assertEqual(differs.code, 1)
        same = json.loads((self.folder / self.make("same.json", "check", "--same", FIGURE, FIGURE)).read_text(encoding="utf-8"))["check"]
        check = json.loads((self.folder / "differs.json").read_text(encoding="utf-8"))["check"]
        self.assertEqual((same["ok"], same["same"], same["difference"], same["compared"]), (True, True, None, [FIGURE, FIGURE]))
        self.assertEqual((check["ok"], check["same"], check["compared"]), (False, False, [FIGURE, other]))
        self.assertIn("primitives given: ", check["difference"])
        self.assertNotIn("broken", check)
        html = re.sub("<wbr>", "", self.page("differs.json", "same.json"))
        self.assertIn(f"The trees of {FIGURE} and {other} differ: primitives given: ", html)
        self.assertIn(f"The trees of {FIGURE} and {FIGURE} are the same.", html.replace("Compared: the", "The"))
        self.assertNotIn("broken", html)

    def test_two_runs_are_compared(self):
        first = self.make("a.json", "build", FIGURE, "--builder", "karras", "--max-leaf", "4")
        second = self.make("b.json", "build", FIGURE, "--builder", "karras", "--max-leaf", "8")
        a, b = (json.loads((self.folder / n).read_text(encoding="utf-8"))["build"] for n in (first, second))
        html = self.page(first, second)
        row = re.search(r"<tr><th[^>]*>[^<]*bvh</th><td[^>]*>size</td>.*?</tr>", html, re.DOTALL).group(0)
        values = [float(v) for v in re.findall(r'data-v="([^"]*)"', row)]
        self.assertEqual(values[:2], [a["bytes"], b["bytes"]])
        self.assertAlmostEqual(values[2], b["bytes"] / a["bytes"])
        self.assertIn("better" if b["bytes"] < a["bytes"] else "worse", row)
        self.assertIn("max_leaf", html)  # a setting that differs
        self.assertNotIn('<section id="comparison">', self.page(first))

    def test_summary_and_table_have_the_same_trees(self):
        documents = [self.make("plain.json", "build", FIGURE, "--builder", "ploc"),
                     self.make("better.json", "build", FIGURE, "--builder", "ploc", "--reinsertion-rounds", "2"),
                     self.make("sbvh.json", "trace", FIGURE, "--builder", "sbvh", "--size", "16x12"),
                     self.make("split.json", "trace", FIGURE, "--builder", "split", "--size", "16x12")]
        builds = {name: json.loads((self.folder / name).read_text(encoding="utf-8"))["build"] for name in documents}
        html = self.page(*documents)
        low, high = (choose(builds.values(), key=lambda build: build["sah"]) for choose in (min, max))
        self.assertIn(f"is that of <strong>{low['builder']}</strong>; the highest", html)
        self.assertIn(f"is that of {high['builder']}.", html)
        self.assertIn("ploc, 2 rounds of reinsertion", html)
        for build in builds.values():
            self.assertIn(f'data-v="{build["sah"]:.17g}"', html)

    def test_nothing_to_say_is_no_summary(self):
        self.write("empty.obj", b"")
        for arguments in (("scenes",), ("simulate", "empty.obj", "--rays", "primary", "--size", "8x8")):
            self.assertNotIn("Summary", self.page(self.make("quiet.json", *arguments)))
        self.assertIn('<a href="#summary">Summary</a>', self.page(self.make("build.json", "build", FIGURE)))

    def test_pictures(self):
        self.succeed("render", FIGURE, "--size", "32x24", "--samples", "1", "-o", "p.png", "--json", "render.json", "--quiet")
        self.assertEqual(self.page("render.json").count("data:image/png;base64,"), 1)  # named in the document
        self.assertEqual(self.page("render.json", "--picture", "p.png", "--picture", "p.png").count("data:image/png"), 3)
        self.assertEqual(self.page("--picture", "p.png", "render.json").count("data:image/png"), 2)
        html = self.page(self.make("info.json", "info", FIGURE), "--render", "--size", "24x16")
        self.assertEqual(html.count('width="24" height="16"'), 2)
        self.assertIn("shaded", html)
        self.assertIn("steps", html)

    def test_a_scene_that_is_not_there_is_said_and_left_out(self):
        name = self.write("gone.json", json.dumps({"command": "info", "scene": {"name": "gone.ply"}}))
        result = self.run_program("report", name, "--render", "-o", "page.html")
        self.assertEqual(result.code, 0, result)
        self.assertIn("no picture: gone.ply", result.err)
        self.assertEqual(result.err.count("\n"), 1, result)

    def test_what_is_refused(self):
        good = self.make("good.json", "scenes")
        bad = self.write("bad.json", '{"a": ')
        listed = self.write("list.json", "[]")
        binary = self.write("binary.json", bytes(range(256)))
        (self.folder / "folder").mkdir(exist_ok=True)
        out = ("-o", "refused.html")
        for arguments, names in (((bad, *out), ("bad.json", "JSON")), ((listed, *out), ("list.json", "not an object")),
                                 ((binary, *out), ("binary.json",)), (("absent.json", *out), ("absent.json", "No such file")),
                                 (("folder", *out), ("folder", "is a folder")),
                                 ((good, bad, *out), ("bad.json",)),
                                 ((good, "-o", "absent/page.html"), ("absent/page.html", "cannot write")),
                                 ((good, "-o", "folder"), ("folder", "cannot write")),
                                 ((good, "--picture", "good.json", *out), ("good.json",)),
                                 ((good, "--picture", "absent.png", *out), ("absent.png",))):
            self.fail_with_one_line("report", *arguments, names=names)
        self.assertFalse((self.folder / "refused.html").exists())
        self.assertEqual([n for n in os.listdir(self.folder) if n.endswith(".part")], [])
        self.fail_with_usage("report", good)
        self.fail_with_usage("report", "-o", "page.html")
        self.fail_with_usage("report", good, *out, "--render", "--size", "huge")

    def test_a_failure_keeps_the_old_page(self):
        good = self.make("good.json", "scenes")
        before = self.page(good)
        self.fail_with_one_line("report", good, self.write("bad.json", "{"), "-o", "page.html")
        self.assertEqual((self.folder / "page.html").read_text(encoding="utf-8"), before)


if __name__ == "__main__":
    main()
