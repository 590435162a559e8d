"""Wide layouts in build and trace: figures, equal hits, what does not go together."""
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main  # noqa: E402

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
