"""Scenes in .rdx files: build -o, the same hits and pictures, what takes such files and what refuses them."""
import math
import os
import struct
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from gltf_test import document as gltf, read_scene_hits  # noqa: E402
from program import MISS, ProgramTest, main, write_npy  # noqa: E402

SOUP = "builtin:soup?triangles=3000"
RAYS = ("--rays", "diffuse", "--camera", "0", "--repeat", "1", "--size", "40x30", "--samples", "2")


class SceneFile(ProgramTest):
    def setUp(self):
        self.scene = self.write("nodes.gltf", gltf())

    def hits_of(self, scene, *options):
        made = self.document("trace", scene, *RAYS, "--hits", "hits.npy", *options)
        return made, (self.folder / "hits.npy").read_bytes()

    def test_the_same_hits_and_pictures(self):
        for scene, options in ((self.scene, ()), (self.scene, ("--layout", "compact")), (self.scene, ("--quality", "fast")),
                               (SOUP, ("--layout", "wide8")), (SOUP, ("--layout", "compact", "--quality", "high")),
                               (self.scene, ("--flatten", "--layout", "wide8"))):
            with self.subTest(scene=scene, options=options):
                built = self.document("build", scene, *options, "--repeat", "1", "-o", "saved.rdx")
                self.assertLessEqual(built["build"]["ms_spread"]["min"]["total"], built["build"]["ms"]["total"])
                flat = [option for option in options if option == "--flatten"]
                made, wanted = self.hits_of(scene, *flat)
                loaded, hits = self.hits_of("saved.rdx")
                self.assertEqual(hits, wanted)
                for field in ("count", "hits", "invalid_rays"):
                    self.assertEqual(loaded["trace"][0][field], made["trace"][0][field])
                for field in ("name", "triangles", "vertices", "cameras"):
                    self.assertEqual(loaded["scene"][field], built["scene"][field])
                self.assertEqual((loaded["build"]["layout"], loaded["build"]["quality"]),
                                 (built["build"]["layout"], built["build"]["quality"]))
                for view in ("shaded", "depth", "steps"):
                    self.succeed("render", scene, "--view", view, "--size", "32x24", "-o", "a.png", *options)\
                        if "--layout" not in options else None
                    self.succeed("render", "saved.rdx", "--view", view, "--size", "32x24", "-o", "b.png")
                    if "--layout" not in options:
                        self.assertEqual((self.folder / "a.png").read_bytes(), (self.folder / "b.png").read_bytes())

    def test_counts(self):
        self.succeed("build", self.scene, "--repeat", "1", "-o", "saved.rdx")
        scene = self.document("info", "saved.rdx")["scene"]
        self.assertEqual((scene["geometries"], scene["instances"], scene["triangles"], scene["vertices"]), (3, 3, 8, 16))
        self.assertEqual((scene["layout"], scene["quality"]), ("wide8", "balanced"))
        self.assertEqual(scene["bytes"], (self.folder / "saved.rdx").stat().st_size)
        self.assertIn("3 meshes", self.succeed("info", "saved.rdx").out)
        self.assertIn("every invariant holds", self.succeed("check", "saved.rdx").out)
        self.assertEqual(self.document("check", "saved.rdx")["check"]["primitives"], 6)

    @unittest.skipUnless("RAYDIX_MIXED_SCENE" in os.environ, "RAYDIX_MIXED_SCENE is not set")
    def test_hits_of_a_mesh_and_of_shapes_are_told_apart(self):
        subprocess.run([os.environ["RAYDIX_MIXED_SCENE"], self.folder / "mixed.rdx"], check=True)
        down = (0, 0, 0, -1, math.inf)  # tmin, direction, tmax
        rays = [struct.pack("<8f", x, y, 9, *down) for x, y in ((0, 0), (5, 0), (9, 9))]
        write_npy(self.folder / "mixed.npy", "<f4", (3, 8), b"".join(rays))
        self.succeed("trace", "mixed.rdx", "--rays", "mixed.npy", "--hits", "mixed_hits.npy", "--repeat", "1")
        hits = read_scene_hits(self.folder / "mixed_hits.npy")
        self.assertEqual([(hit[1], hit[4]) for hit in hits], [(0, 0), (0, 1), (MISS, MISS)])

    def test_one_tree_where_it_is_asked_for(self):
        for options in (("--builder", "karras"), ("--flatten",), ("--max-leaf", "2")):
            self.succeed("build", self.scene, *options, "--repeat", "1", "-o", "tree.rdx")
            self.assertIn("depth", str(self.document("info", "tree.rdx")["build"]))
            self.succeed("trace", "tree.rdx", "--kernel", "scalar", "--size", "8x8", "--repeat", "1")

    def test_what_is_refused(self):
        self.succeed("build", self.scene, "--repeat", "1", "-o", "saved.rdx")
        for command in (("build", "saved.rdx"), ("query", "saved.rdx", "--knn", "2"), ("simulate", "saved.rdx", "--size", "8x8")):
            self.fail_with_one_line(*command, names=("saved.rdx", "it holds a scene", "info, check, trace, render and query --closest"))
        for same in (("saved.rdx", SOUP), (SOUP, "saved.rdx")):
            self.fail_with_one_line("check", "--same", *same, names=("saved.rdx", "--same compares trees"))
        self.fail_with_usage("render", "saved.rdx", "--view", "tree", "-o", "x.png", names=("saved.rdx", "--view: tree"))
        for options in (("--flatten",), ("--builder", "ploc"), ("--strict",)):
            self.fail_with_usage("query", "saved.rdx", "--closest", *options, names=("saved.rdx", options[0]))
        self.fail_with_usage("query", SOUP, "--pairs", "--with", "saved.rdx", "--flatten", names=("saved.rdx", "--flatten"))
        for options in (("--kernel", "scalar"), ("--layout", "compact"), ("--builder", "karras"), ("--quality", "high"),
                        ("--flatten",), ("--tree", "kdtree"), ("--device", "sim")):
            self.fail_with_usage("trace", "saved.rdx", "--size", "8x8", *options)
        for options in (("--layout", "wide4"), ("--layout", "cwbvh"), ("--layout", "wide8", "--builder", "ploc"),
                        ("--layout", "compact", "--max-leaf", "2"), ("--layout", "wide8", "--device", "cuda")):
            self.fail_with_usage("build", self.scene, "-o", "x.rdx", *options, names=("--output",))
        self.assertFalse((self.folder / "x.rdx").exists() or (self.folder / "x.png").exists())

    def test_names_in_any_case(self):
        self.succeed("build", SOUP, "--repeat", "1", "-o", "TREE.RDX")
        self.assertEqual(self.document("info", "TREE.RDX")["build"]["tree"], "bvh")
        self.succeed("trace", "TREE.RDX", "--size", "8x8", "--repeat", "1")
        self.fail_with_usage("trace", "TREE.RDX", "--builder", "karras", names=("--builder", "TREE.RDX"))
        self.succeed("build", "TREE.RDX", "--builder", "karras", "--repeat", "1")  # its triangles anew
        self.fail_with_one_line("info", self.write("x.txt", ""), names=("x.txt", ".glb", ".rdx"))

    def test_other_names(self):
        """What build -o wrote is known by how it begins."""
        for scene, name in ((SOUP, "tree.txt"), (self.scene, "scene.ply"), (self.scene, "no_ending")):
            with self.subTest(name=name):
                self.succeed("build", scene, "--repeat", "1", "-o", name)
                self.succeed("build", scene, "--repeat", "1", "-o", "same.rdx")
                for command in (("info",), ("trace", "--size", "8x8", "--repeat", "1")):
                    found, wanted = (self.document(command[0], file, *command[1:])["scene"] for file in (name, "same.rdx"))
                    self.assertEqual(found, wanted)
                self.succeed("check", name)
                self.succeed("build", name, "--repeat", "1", "-o", name) if name == "tree.txt" else None
        self.fail_with_usage("trace", "tree.txt", "--builder", "karras", names=("--builder", "tree.txt"))

    def test_altered_files(self):
        self.succeed("build", self.scene, "--repeat", "1", "-o", "saved.rdx")
        good = (self.folder / "saved.rdx").read_bytes()
        for content in (good[:700], good[:-1], good + b"x", good[:5000] + b"x" + good[5001:]):
            self.write("bad.rdx", content)
            for command in (("check", "bad.rdx"), ("trace", "bad.rdx", "--size", "8x8"), ("info", "bad.rdx")):
                self.fail_with_one_line(*command, names=("bad.rdx",))


if __name__ == "__main__":
    main()
