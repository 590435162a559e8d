"""docs/performance/gpu.md and docs/k12.md against the results of scripts/gpu in bench/results: every row of their tables of builds and rays."""
import json
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGES = ("bounds", "codes", "sort", "layout", "hierarchy", "fit", "total")
SCENES = ("conference", "figure")
SECONDARY = ("ao", "diffuse", "diffuse_shuffled")


def rows_of(page, first_cell):
    """Cells of the table rows whose first cell matches."""
    cells = ([cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|"))
    return [row for row in cells if re.fullmatch(first_cell, row[0])]


class GpuPage(unittest.TestCase):
    def setUp(self):
        self.page = (ROOT / "docs" / "performance" / "gpu.md").read_text(encoding="utf-8")
        document = json.loads((ROOT / "bench" / "results" / "NVIDIA-H100-80GB-HBM3.json").read_text(encoding="utf-8"))
        self.tests, self.lines = document["tests"], document["bench"]

    def only(self, bench, **wanted):
        found = [line for line in self.lines if line["bench"] == bench and all(line.get(k) == v for k, v in wanted.items())]
        self.assertEqual(len(found), 1, wanted)
        return found[0]

    def test_tests_passed(self):
        self.assertEqual({test["status"] for test in self.tests}, {"passed"})
        self.assertIn(f"all {len(self.tests)} tests", self.page)

    def test_builds(self):
        rows = [row for row in rows_of(self.page, "[0-9,]+") if len(row) == 12]
        self.assertGreaterEqual(len(rows), 28)
        for count, tree, bits, *times, rate, share in rows:
            tree = tree.strip("`")
            kind = {"tree": tree} if tree in ("octree", "kdtree") else {"tree": "bvh", "builder": tree}
            line = self.only("gpu_build", triangles=int(count.replace(",", "")), bits=int(bits), max_leaf=1, **kind)
            self.assertEqual(times, [f"{line['ms'][stage]['median']:.2f}" for stage in STAGES])
            self.assertEqual(rate, f"{line['gprims_per_s']:.2f}")
            self.assertEqual(share, f"{100 * line['of_copy_rate']:.1f} %" if "of_copy_rate" in line else "-")

    def test_rays(self):
        kernels = {line["kernel"] for line in self.lines if line["bench"] == "gpu_trace"}
        rows = [row for row in rows_of(self.page, "`[a-z_]+`") if len(row) == 7]
        self.assertEqual({row[0].strip("`") for row in rows}, kernels)
        for kernel, *rates in rows:
            expected = [line["mrays_per_s"]["median"] for scene in SCENES for rays in SECONDARY for line in self.lines
                        if line["bench"] == "gpu_trace" and scene in line["scene"] and line["rays"] == rays
                        and line["kernel"] == kernel.strip("`")]
            self.assertEqual(rates, [f"{rate:.0f}" for rate in expected])

    def test_simulated_bounds(self):
        bounds = json.loads((ROOT / "bench" / "results" / "bounds-h100.json").read_text(encoding="utf-8"))["rows"]
        rows = [row for row in rows_of(self.page, "`[a-z_]+`") if len(row) == 9]
        self.assertEqual({row[0].strip("`") for row in rows}, {bound["kernel"] for bound in bounds})
        for kernel, *cells in rows:
            expected = []
            for scene in SCENES:
                for rays in SECONDARY[:2]:
                    bound, = (line["mrays_per_s_bound"] for line in bounds
                              if scene in line["scene"] and line["rays"] == rays and line["kernel"] == kernel.strip("`"))
                    rate, = (line["mrays_per_s"]["median"] for line in self.lines if line["bench"] == "gpu_trace"
                             and scene in line["scene"] and line["rays"] == rays and line["kernel"] == kernel.strip("`"))
                    self.assertLess(rate, bound)
                    expected += [f"{bound:.0f}", f"{100 * rate / bound:.0f} %"]
            self.assertEqual(cells, expected)

    def test_page_of_karras_2012(self):
        page = (ROOT / "docs" / "k12.md").read_text(encoding="utf-8")
        page = page[page.index("## On a GPU of today"):page.index("## How good the model is")]
        times = {}
        for builder in ("karras", "garanzha", "lauterbach"):
            lines = [self.only("gpu_build", tree="bvh", builder=builder, bits=30, max_leaf=1, triangles=count)["ms"]
                     for count in (173552, 999708, 1765932, 9992928)]
            times[builder] = [ms["hierarchy"]["median"] + ms["fit"]["median"] for ms in lines]
            self.assertEqual(rows_of(page, f"`{builder}`")[0][1:], [f"{ms:.2f}" for ms in times[builder]])
        ratios = [f"{a / b:.1f}" for a, b in zip(times["garanzha"], times["karras"])]
        self.assertEqual(rows_of(page, "`garanzha` over `karras`")[0][1:], ratios)

    def test_compressed_trees(self):
        rows = [row for row in rows_of(self.page, "[0-9,]+") if len(row) == 5]
        self.assertEqual(len(rows), 4)
        for count, *rates in rows:
            line = self.only("gpu_cwbvh", triangles=int(count.replace(",", "")))
            self.assertEqual(rates, [f"{line[rays][kernel]['mrays_per_s']['median']:.0f}" for rays in ("primary", "diffuse")
                                     for kernel in ("cwbvh", "persistent_cwbvh")])

    def test_h200(self):
        document = json.loads((ROOT / "bench" / "results" / "NVIDIA-H200.json").read_text(encoding="utf-8"))
        self.assertIn(f"All {len(document['tests'])} tests", self.page)
        self.assertEqual({test["status"] for test in document["tests"]}, {"passed"})
        large = [line for line in document["bench"] if line["bench"] == "gpu_build" and line["max_leaf"] == 1
                 and line["triangles"] > 9_900_000]
        rows = rows_of(self.page, "10 M: `[a-z]+`")
        self.assertEqual(len(rows), 7)
        for name, *cells in rows:
            tree = name[7:-1]
            lines = {line["bits"]: line for line in large if line.get("builder", line["tree"]) == tree}
            self.assertEqual(cells, [f"{lines[30]['ms']['total']['median']:.2f}", f"{lines[63]['ms']['total']['median']:.2f}",
                                     f"{lines[63]['gprims_per_s']:.2f}"])
        rows = rows_of(self.page, r"2\^24: `[a-z_]+`")
        self.assertEqual(len(rows), 11)
        for name, *cells in rows:
            expected = []
            for rays in ("primary", "ao"):
                row, = (row for row in document["traversal"] if row["rays"] == rays and row["kernel"] == name[7:-1])
                expected += [f"{row['mrays_per_s']['median']:.0f}", f"{row['percent_of_simulated']:.1f} %"]
            self.assertEqual(cells, expected)


if __name__ == "__main__":
    unittest.main()
