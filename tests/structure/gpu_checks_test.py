"""scripts/gpu_checks.py on made_up_gpu_result.json: a document of this test alone, whose figures nobody measured. As it
stands it meets every check; each change below must be found."""
import copy
import importlib.util
import json
import pathlib
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("gpu_checks", ROOT / "scripts" / "gpu_checks.py")
gpu_checks = importlib.util.module_from_spec(spec)
spec.loader.exec_module(gpu_checks)


class GpuChecks(unittest.TestCase):
    def setUp(self):
        self.document = json.loads((HERE / "made_up_gpu_result.json").read_text(encoding="utf-8"))
        self.assertIn("made up", self.document["gpu"])

    def missed(self, document):
        return [text for holds, text in gpu_checks.checks(document) if not holds]

    def changed(self, change):
        document = copy.deepcopy(self.document)
        change(document)
        return self.missed(document)

    def build(self, document, builder):
        return next(line for line in document["bench"] if line.get("builder") == builder)

    def row(self, document, rays, kernel="speculative_while_while"):
        return next(row for row in document["traversal"] if row["rays"] == rays and row["kernel"] == kernel)

    def test_all_is_met(self):
        self.assertEqual(self.missed(self.document), [])
        self.assertGreaterEqual(len(gpu_checks.checks(self.document)), 8)

    def test_copy_bandwidth(self):
        found = self.changed(lambda d: self.build(d, "karras").update(of_copy_rate=0.349))
        self.assertEqual(len(found), 1)
        self.assertIn("share of copy bandwidth", found[0])

    def test_whole_builds(self):
        for builder, least in (("karras", 3.99), ("hploc", 1.99)):
            found = self.changed(lambda d, b=builder, g=least: self.build(d, b).update(gprims_per_s=g))
            self.assertEqual(len(found), 1)
            self.assertIn(f"whole {builder} build", found[0])

    def test_small_scenes_and_short_codes_do_not_count(self):
        for change in ({"triangles": 1_770_000}, {"bits": 30}):
            found = self.changed(lambda d, c=change: self.build(d, "karras").update(c))
            self.assertEqual(len(found), 2)
            self.assertTrue(all("not measured" in text for text in found))

    def test_share_of_the_lower_bound(self):
        for rays in ("primary", "ao"):
            found = self.changed(lambda d, r=rays: self.row(d, r).update(percent_of_simulated=84.9))
            self.assertEqual(len(found), 1)
            self.assertIn(f"{rays} rays", found[0])

    def test_small_launches_do_not_count(self):
        found = self.changed(lambda d: self.row(d, "ao").update(largest_launch=1 << 20))
        self.assertEqual(len(found), 1)
        self.assertIn("ao rays", found[0])

    def test_no_rate_above_its_bound(self):
        for kernel in ("speculative_while_while", "persistent_packet"):
            def above(document, kernel=kernel):
                row = self.row(document, "primary", kernel)
                row["mrays_per_s"]["max"] = row["mrays_per_s_bound"] + 0.1
            found = self.changed(above)
            self.assertEqual(len(found), 1)
            self.assertIn(kernel, found[0])

    def test_nothing_measured_is_no_success(self):
        self.assertEqual(len(self.missed({"bench": [], "traversal": []})), 6)

        def without_bounds(document):
            for row in document["traversal"]:
                row["percent_of_simulated"] = None
        self.assertEqual(len(self.changed(without_bounds)), 3)


if __name__ == "__main__":
    unittest.main()
