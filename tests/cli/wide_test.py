"""Wide layouts in build and trace: figures, equal hits, what does not go together."""
import sys

sys.dont_write_bytecode = True
from program import SANITIZED, ProgramTest, main  # noqa: E402

SCENE = "builtin:figure?triangles=20000"
LAYOUTS = ("wide8", "wide4", "compact")
RAYS = ("--rays", "diffuse", "--camera", "0", "--repeat", "1", "--size", "160x120", "--samples", "2")


class Wide(ProgramTest):
    def test_build(self):
        bytes_of = {}
        for layout in LAYOUTS:
            build = self.document("build", SCENE, "--quality", "balanced", "--repeat", "2", "--layout", layout)["build"]
            wide = build["wide"]
            self.assertEqual((build["layout"], wide["layout"]), (layout, layout))
            self.assertEqual((build["layout_nodes"], build["bytes"]), (wide["nodes"], wide["node_bytes"] + wide["triangle_bytes"]))
            self.assertEqual(wide["references"], build["references"])
            for times in (wide["build_ms"], wide["kept_ms"]):
                self.assertTrue(0 < times["min"] <= times["median"] <= times["max"], times)
            self.assertLess(wide["children_per_node"], 4 if layout == "wide4" else 8)
            bytes_of[layout] = wide["triangle_bytes"]
            self.assertIn(layout, self.succeed("build", SCENE, "--repeat", "1", "--layout", layout).out)
        self.assertLess(bytes_of["compact"], 0.6 * bytes_of["wide8"])

    def assert_layout_is_in(self, build):
        """Times and peak are those of the layout that is named; `binary` has those of the tree alone."""
        binary, ms = build["binary"], build["ms"]
        self.assertGreater(ms["total"], 0)
        for stage in ms:
            self.assertLessEqual(build["ms_spread"]["min"][stage], ms[stage])
            self.assertLessEqual(ms[stage], build["ms_spread"]["max"][stage])
        self.assertLess(binary["bytes"], build["peak_bytes"])
        self.assertLess(build["bytes"], build["peak_bytes"])
        self.assertEqual(set(binary["ms"]), set(ms))

    def test_times_have_the_layout_in_them(self):
        for builder in ("ploc", "karras") if SANITIZED else ("ploc", "apetrei", "sweep", "karras"):
            for layout in LAYOUTS:
                build = self.document("build", SCENE, "--builder", builder, "--repeat", "1", "--layout", layout)["build"]
                self.assert_layout_is_in(build)
                wide, ms = build["wide"], build["ms"]
                self.assertEqual((ms["total"], build["kept_ms"]), (wide["build_ms"]["median"], wide["kept_ms"]))
                stages = [value for stage, value in ms.items() if stage != "total"]
                self.assertAlmostEqual(sum(stages), ms["total"], places=6)
                self.assertGreaterEqual(min(stages), 0)
                self.assertGreater(ms["layout"], 0)
        cwbvh = self.document("build", SCENE, "--repeat", "1", "--layout", "cwbvh")["build"]
        self.assert_layout_is_in(cwbvh)
        self.assertAlmostEqual(cwbvh["ms"]["layout"], cwbvh["binary"]["ms"]["layout"] + cwbvh["cwbvh"]["ms"], places=6)
        self.assertAlmostEqual(cwbvh["ms"]["total"], cwbvh["binary"]["ms"]["total"] + cwbvh["cwbvh"]["ms"], places=6)
        self.assertNotIn("binary", self.document("build", SCENE, "--repeat", "1")["build"])

    def test_a_trace_times_the_layout_too(self):
        build = self.document("trace", SCENE, *RAYS)["build"]
        self.assertEqual(build["layout"], "wide8")
        self.assert_layout_is_in(build)
        self.assertAlmostEqual(build["ms"]["total"], build["binary"]["ms"]["total"] + build["wide"]["ms"], places=6)
        self.assertAlmostEqual(build["ms"]["layout"], build["binary"]["ms"]["layout"] + build["wide"]["ms"], places=6)
        self.assertEqual(build["wide"]["build_ms"]["median"], build["ms"]["total"])
        self.succeed("build", SCENE, "--repeat", "1", "-o", "tree.rdx")
        loaded = self.document("trace", "tree.rdx", *RAYS)["build"]
        self.assertIsNone(loaded["ms"])
        self.assertIsNone(loaded["peak_bytes"])
        scalar = self.document("trace", SCENE, *RAYS, "--kernel", "scalar")["build"]
        self.assertEqual((scalar["layout"], scalar.get("binary")), ("binary", None))

    def test_equal_hits(self):
        self.succeed("trace", SCENE, *RAYS, "--hits", "scalar.npy")
        wanted = (self.folder / "scalar.npy").read_bytes()
        for layout in LAYOUTS:
            result = self.succeed("trace", SCENE, *RAYS, "--layout", layout, "--explain", "--hits", "wide.npy")
            self.assertIn(f"{layout} layout", result.out)
            self.assertEqual((self.folder / "wide.npy").read_bytes(), wanted, layout)

    def test_what_is_refused(self):
        for layout in LAYOUTS:
            self.fail_with_usage("trace", SCENE, "--layout", layout, "--kernel", "scalar", names=["--layout", layout])
            self.fail_with_usage("render", SCENE, "-o", "p.png", "--layout", layout, names=["--layout"])
        self.fail_with_usage("build", SCENE, "--layout", "wide4", "-o", "t.rdx", names=["--output"])


if __name__ == "__main__":
    main()
