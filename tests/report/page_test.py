"""raydix report in a headless Chromium: light, dark, phone, paper, sorting, nothing loaded, nothing executed.

Screenshots of every section go to the folder RAYDIX_SCREENSHOTS. The documents beside this file hold made-up numbers.
"""
import base64
import hashlib
import json
import os
import pathlib
import re
import struct
import sys
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "cli"))
from browser import MISSING, Browser  # noqa: E402
from program import ProgramTest, main  # noqa: E402

MADE_UP = [str(HERE / "documents" / name) for name in ("simulate.json", "traversal.json")]
ATTACK = "</title></script><script>document.title='executed'</script><img src=x onerror=\"document.title='executed'\">"


def size_of(png):
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", png[16:24])


class PageTest(ProgramTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.page = cls.make_page(cls())

    def make_page(self):
        """Every kind of document, one of them with an attack in each of its texts."""
        figure = "builtin:figure?triangles=5000"
        results = []
        for name, arguments in {
                "karras": ("build", figure, "--builder", "karras"), "ploc": ("build", figure, "--builder", "ploc"),
                "octree": ("build", figure, "--tree", "octree"), "info": ("info", figure), "check": ("check", figure),
                "trace": ("trace", figure, "--size", "32x24", "--repeat", "2"), "scenes": ("scenes",),
                "trace2": ("trace", figure, "--size", "32x24", "--repeat", "2", "--builder", "ploc"),
                "render": ("render", figure, "--size", "64x48", "--samples", "1", "-o", "figure.png"),
                "study": ("bench", "hierarchy", "builtin:soup?triangles=3000", "--sizes", "300,3000", "--repeat", "1",
                          "--cost-sizes", "500,2000", "--thread-counts", "1")}.items():
            self.succeed(*arguments, "--quiet", "--json", f"{name}.json")
            results.append(f"{name}.json")
        attack = json.loads((self.folder / "karras.json").read_text(encoding="utf-8"))
        attack["scene"]["name"] = attack["build"]["builder"] = attack["machine"]["cpu"] = ATTACK
        attack[ATTACK] = [{ATTACK: ATTACK}]
        self.write("attack.json", json.dumps(attack))
        self.succeed("report", *results, "attack.json", *MADE_UP, "--title", ATTACK, "-o", "page.html")
        return self.folder / "page.html"


class Text(PageTest):
    def test_only_its_own_script_may_run(self):
        html = self.page.read_text(encoding="utf-8")
        scripts = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
        self.assertEqual(len(scripts), 1)
        digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
        self.assertIn(f"script-src 'sha256-{digest}'", html, "put this hash into src/report/page.cpp")
        self.assertNotIn("<img src=x", html)
        for address in re.findall(r"(?:src|href)=\"([^\"]*)\"", html):
            self.assertRegex(address, r"^(#|data:)")
        self.assertNotIn("@import", html)
        self.assertNotIn("url(", html)


@unittest.skipIf(MISSING, MISSING)
class InBrowser(PageTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.browser = Browser()
        cls.addClassCleanup(cls.browser.close)
        cls.pictures = pathlib.Path(os.environ.get("RAYDIX_SCREENSHOTS", cls.folder))
        cls.pictures.mkdir(parents=True, exist_ok=True)

    def show(self, **options):
        self.browser.show(self.page, **options)
        self.assertEqual(self.browser.run("return document.readyState"), "complete")

    def sections(self):
        return self.browser.run("return [...document.querySelectorAll('section')].map(s => s.id)")

    def assert_clean(self):
        self.assertEqual(self.browser.logs("browser"), [])
        others, all_of_them = self.browser.requests(self.page)
        self.assertEqual(others, [])
        self.assertGreater(all_of_them, 0)  # the page's own: requests are seen at all

    def test_light_and_dark(self):
        backgrounds = set()
        for scheme in ("light", "dark"):
            self.show(scheme=scheme)
            ids = self.sections()
            self.assertEqual(ids, ["summary", "comparison", "builds", "traces", "traversal", "simulated", "construction",
                                   "pictures", "scenes", "other", "sources"])
            for section in ids:
                png = self.browser.screenshot(f"#{section}")
                (self.pictures / f"{scheme}-{section}.png").write_bytes(png)
                width, height = size_of(png)
                self.assertGreater(width, 900)
                self.assertGreater(height, 80, section)
            backgrounds.add(self.browser.run("return getComputedStyle(document.body).backgroundColor"))
            self.assertGreaterEqual(self.contrast(), 4.5)
            self.assert_clean()
        self.assertEqual(len(backgrounds), 2, backgrounds)

    def contrast(self):
        """The least ratio of text to background over the kinds of text that the page has (WCAG 2)."""
        return self.browser.run("""
            const light = (rgb) => rgb.map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
                .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
            const numbers = (colour) => colour.match(/[0-9.]+/g).map(Number);
            const ground = (element) => {
                for (let e = element; e; e = e.parentElement) {
                    const rgba = numbers(getComputedStyle(e).backgroundColor);
                    if (getComputedStyle(e).backgroundColor.startsWith('rgb') && (rgba.length < 4 || rgba[3] === 1))
                        return rgba.slice(0, 3);
                }
                return [255, 255, 255];
            };
            let least = 99;
            for (const e of document.querySelectorAll('p, .badge, .note, .subtitle, a, .legend span, svg text, .better, .worse, .unit')) {
                const style = getComputedStyle(e);
                const ink = numbers(e instanceof SVGElement ? style.fill : style.color).slice(0, 3);
                const [a, b] = [light(ink), light(ground(e))];
                least = Math.min(least, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05));
            }
            return least;""")

    def test_phone(self):
        for scheme in ("light", "dark"):
            self.show(width=390, height=844, scheme=scheme)
            self.browser.run("for (const d of document.querySelectorAll('details')) d.open = true")
            self.assertLessEqual(self.browser.run("return document.documentElement.scrollWidth"), 390)
            wide = self.browser.run("""
                return [...document.querySelectorAll('main *')].filter((e) => !e.closest('div.table') && !e.closest('svg') &&
                    e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.outerHTML.slice(0, 200));""")
            self.assertEqual(wide, [])
            small = self.browser.run("""
                return Math.min(...[...document.querySelectorAll('figure svg text')].map((t) => t.getBoundingClientRect().height));""")
            self.assertGreater(small, 9)  # pixels, of a line of text
            for section in self.sections():
                (self.pictures / f"phone-{scheme}-{section}.png").write_bytes(self.browser.screenshot(f"#{section}"))
            self.assert_clean()

    def column(self, index):
        return self.browser.run("""
            const table = document.querySelector('#simulated div.table table');
            return [...table.tBodies[0].rows].map((row) => row.cells[arguments[0]].dataset.v ?? row.cells[arguments[0]].textContent);
        """, index)

    def click(self, index):
        return self.browser.run("""
            const head = document.querySelector('#simulated div.table table').tHead.rows[0].cells[arguments[0]];
            head.querySelector('button').click();
            return head.getAttribute('aria-sort');""", index)

    def test_sorting(self):
        self.show()
        titles = self.browser.run("return [...document.querySelector('#simulated div.table table').tHead.rows[0].cells]"
                                  ".map((head) => head.querySelector('.name').textContent)")
        for title, number in (("bound", True), ("scheduled", True), ("kernel", False)):
            index = titles.index(title)
            before = self.column(index)
            key = float if number else str
            known, missing = [v for v in before if v != "\u2013"], [v for v in before if v == "\u2013"]
            self.assertEqual(self.click(index), "ascending")
            self.assertEqual(self.column(index), sorted(known, key=key) + missing)
            self.assertEqual(self.click(index), "descending")
            self.assertEqual(self.column(index), sorted(known, key=key, reverse=True) + missing)
            self.assertEqual(len(missing), 3 if title == "scheduled" else 0)  # nulls of the document stay last
        self.assert_clean()

    def test_without_script_all_is_there(self):
        self.browser.devtools("Emulation.setScriptExecutionDisabled", value=True)
        try:
            self.show()
            html = self.page.read_text(encoding="utf-8")
            self.assertEqual(self.browser.run("return document.querySelectorAll('tbody tr').length"), html.count("<tr>") -
                             html.count("<thead>"))
            self.assertEqual(self.browser.run("return document.querySelectorAll('th button').length"), 0)
        finally:
            self.browser.devtools("Emulation.setScriptExecutionDisabled", value=False)

    def test_attacks_are_text(self):
        self.show()
        self.assertEqual(self.browser.run("return document.title"), ATTACK)
        self.assertEqual(self.browser.run("return document.querySelector('h1').textContent"), ATTACK)
        self.assertEqual(self.browser.run("return document.scripts.length"), 1)
        self.assertEqual(self.browser.run("return document.querySelectorAll('img:not([src^=data])').length"), 0)
        texts = self.browser.run("return document.querySelector('#builds').textContent")
        self.assertIn(ATTACK, texts)
        self.assert_clean()

    def test_drawings_are_inside_their_frames(self):
        self.show()
        outside = self.browser.run("""
            for (const d of document.querySelectorAll('details')) d.open = true;
            const faults = [];
            for (const svg of document.querySelectorAll('figure > svg')) {
                const frame = svg.getBoundingClientRect();
                for (const mark of svg.querySelectorAll('text, rect, path, circle')) {
                    const box = mark.getBoundingClientRect();
                    if (box.left < frame.left - 12 || box.right > frame.right + 12 || box.top < frame.top - 6 ||
                        box.bottom > frame.bottom + 6)
                        faults.push(svg.getAttribute('aria-label') + ': ' + mark.outerHTML.slice(0, 160));
                }
            }
            return faults;""")
        self.assertEqual(outside, [])
        counts = self.browser.run("return [document.querySelectorAll('figure > svg').length,"
                                  " document.querySelectorAll('svg g > title').length]")
        self.assertGreater(counts[0], 20)
        self.assertGreater(counts[1], 200)  # tooltips

    def test_every_simulated_figure_says_so(self):
        self.show()
        unsaid = self.browser.run("""
            return [...document.querySelectorAll('#simulated figure, #simulated div.table')].filter((part) =>
                !part.querySelector('figcaption .badge.simulated, caption .badge.simulated')).map((p) => p.textContent.slice(0, 80));
        """)
        self.assertEqual(unsaid, [])
        tips = self.browser.run("return [...document.querySelectorAll('#simulated figure svg g > title')]"
                                ".map((t) => t.textContent).filter((t) => !t.includes('(simulated)'))")
        self.assertEqual(tips, [])

    def test_paper(self):
        self.show(scheme="dark")
        pdf = self.browser.pdf()
        (self.pictures / "page.pdf").write_bytes(pdf)
        self.assertEqual(pdf[:5], b"%PDF-")
        self.assertGreater(len(re.findall(rb"/Type\s*/Page\b", pdf)), 3)
        self.browser.devtools("Emulation.setEmulatedMedia", media="print")
        self.assertEqual(self.browser.run("return getComputedStyle(document.body).backgroundColor"), "rgb(255, 255, 255)")
        self.assertEqual(self.browser.run("return getComputedStyle(document.querySelector('nav')).display"), "none")
        self.browser.devtools("Emulation.setEmulatedMedia", media="")


if __name__ == "__main__":
    main()
