"""Scene -> tree -> .rdx -> check, trace, render: JSON fields, hashes, rays, hits and pictures of the program."""
import math
import os
import struct
import sys

sys.dont_write_bytecode = True
from program import (MISS, SANITIZED, TRIANGLE, ProgramTest, main, ply, read_hits, read_npy, read_png, read_rays,  # noqa: E402
                     write_npy)

NUMBER, COUNT, TEXT = (int, float), int, str


def optional(kind):
    return (*(kind if isinstance(kind, tuple) else (kind,)), type(None))


MACHINE = {"cpu": TEXT, "cores": COUNT, "isa": TEXT, "gpu": optional(TEXT)}
SCENE = {"name": TEXT, "triangles": COUNT, "points": COUNT, "vertices": COUNT}
STAGES = {stage: NUMBER for stage in ("bounds", "codes", "sort", "hierarchy", "fit", "layout", "total")}
BUILD = {
    "tree": TEXT, "builder": TEXT, "bits": COUNT, "device": TEXT, "threads": COUNT, "nodes": COUNT, "leaves": COUNT,
    "references": COUNT, "layout_nodes": COUNT, "max_depth": COUNT, "depth_bound": optional(COUNT),
    "sah": optional(NUMBER), "sah_constants": {"node": NUMBER, "primitive": NUMBER}, "epo": optional(NUMBER),
    "bytes": COUNT, "bytes_referenced": COUNT, "peak_bytes": optional(COUNT), "tree_hash": TEXT,
}
BUILT = {**BUILD, "ms": STAGES, "ms_spread": {"min": STAGES, "max": STAGES},
         "kept_ms": {"median": NUMBER, "min": NUMBER, "max": NUMBER}}
LOADED = {**BUILD, "ms": type(None)}
TRACE = {
    "rays": TEXT, "kernel": TEXT, "device": TEXT, "count": COUNT, "hits": COUNT,
    "mrays_per_s": {"median": NUMBER, "min": NUMBER, "max": NUMBER},
    "node_visits_per_ray": NUMBER, "triangle_tests_per_ray": NUMBER,
}
DOCUMENT = {"version": TEXT, "machine": MACHINE}

# Two squares facing each other: z = 0 (triangles 0, 1) and z = 1 (triangles 2, 3).
SQUARES = ply([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
              [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
SOUP = "builtin:soup?triangles=2000"


class Pipeline(ProgramTest):
    def assert_shape(self, value, shape, where="document"):
        """Every field of `shape` is there with its type; others may stand beside them."""
        if isinstance(shape, dict):
            self.assertIsInstance(value, dict, where)
            for name, inner in shape.items():
                self.assertIn(name, value, where)
                self.assert_shape(value[name], inner, f"{where}.{name}")
        else:
            self.assertIsInstance(value, shape, where)
            self.assertNotIsInstance(value, bool, where)

    def test_fields_of_every_document(self):
        self.assert_shape(self.document("info", SOUP), {**DOCUMENT, "scene": SCENE, "load_ms": NUMBER})
        scenes = self.document("scenes")
        self.assert_shape(scenes, DOCUMENT)
        self.assertEqual({"atrium", "grove", "figure", "soup", "uniform", "clustered", "lidar"},
                         {s["name"] for s in scenes["scenes"]})
        usual = self.document("build", SOUP, "--bits", "30")["build"]
        self.assertEqual((usual["builder"], usual["depth_bound"]), ("ploc", None))  # of quality balanced
        built = self.document("build", SOUP, "--builder", "karras", "--repeat", "3", "-o", "fields.rdx", "--epo", "0.1", "--threads", "2")
        self.assert_shape(built, {**DOCUMENT, "scene": SCENE, "load_ms": NUMBER, "build": BUILT})
        build = built["build"]
        for stage, ms in build["ms"].items():
            self.assertLessEqual(build["ms_spread"]["min"][stage], ms)
            self.assertLessEqual(ms, build["ms_spread"]["max"][stage])
        self.assertEqual((build["tree"], build["builder"], build["bits"], build["device"], build["threads"]),
                         ("bvh", "karras", 63, "cpu", min(2, len(os.sched_getaffinity(0)))))
        self.assertEqual(build["nodes"], 2 * build["leaves"] - 1)
        self.assertEqual(build["references"], 2000)
        self.assertEqual(build["depth_bound"], 63 + 11)
        self.assertLessEqual(build["max_depth"], build["depth_bound"])
        self.assertRegex(build["tree_hash"], r"\A[0-9a-f]{32}\Z")
        self.assertGreater(build["peak_bytes"], build["bytes"])
        for command in (["info"], ["trace", "--size", "8x8"]):
            loaded = self.document(command[0], "fields.rdx", *command[1:])
            self.assert_shape(loaded, {**DOCUMENT, "scene": SCENE, "load_ms": NUMBER, "build": LOADED})
            self.assertIsNone(loaded["build"]["peak_bytes"])
            self.assertEqual(loaded["build"]["tree_hash"], build["tree_hash"])
        traced = self.document("trace", SOUP, "--size", "16x16")
        self.assert_shape(traced, {**DOCUMENT, "scene": SCENE, "load_ms": NUMBER, "build": BUILD})
        self.assert_shape(traced["trace"][0], TRACE)
        rate = traced["trace"][0]["mrays_per_s"]
        self.assertTrue(0 < rate["min"] <= rate["median"] <= rate["max"], rate)
        checked = self.document("check", SOUP)
        self.assert_shape(checked, {**DOCUMENT, "check": {"nodes": COUNT, "primitives": COUNT, "broken": type(None)}})
        self.assertIs(checked["check"]["ok"], True)
        self.assert_shape(self.document("render", SOUP, "--size", "8x8", "-o", "fields.png"),
                          {**DOCUMENT, "scene": SCENE, "load_ms": NUMBER, "render": {"file": TEXT, "view": TEXT}})

    def test_null_rules(self):
        self.write("points.ply", ply([(0, 0, 0), (1, 2, 3), (4, 5, 6)]))
        self.write("flat.ply", ply([(1, 1, 1)] * 3, [(0, 1, 2)]))
        points = self.document("build", "points.ply")
        self.assertEqual((points["scene"]["triangles"], points["scene"]["points"]), (0, 3))
        one_place = self.document("build", "flat.ply")["build"]
        self.assertEqual((one_place["sah"], one_place["epo"], one_place["nodes"]), (None, None, 1))
        nothing = self.document("build", "builtin:soup?triangles=0")["build"]
        self.assertEqual((nothing["nodes"], nothing["leaves"], nothing["sah"], nothing["depth_bound"]),
                         (0, 0, None, None))
        # no ray at all: there is no rate
        write_npy(self.folder / "none.npy", "<f4", (0, 8), b"")
        trace = self.document("trace", SOUP, "--rays", "none.npy")["trace"][0]
        self.assertEqual((trace["count"], trace["hits"], trace["mrays_per_s"], trace["node_visits_per_ray"]),
                         (0, 0, None, None))
        self.succeed("trace", SOUP, "--rays", "none.npy")

    def test_tiny_scenes(self):
        self.write("one.ply", TRIANGLE)
        one = self.document("build", "one.ply")["build"]
        self.assertEqual((one["nodes"], one["leaves"], one["max_depth"], one["sah"]), (1, 1, 0, 1.0))
        self.write("no_faces.off", "OFF\n0 0 0\n")
        for scene in ("one.ply", "builtin:soup?triangles=0", "no_faces.off"):
            for command in (["info"], ["build", "-o", "tiny.rdx"], ["check"], ["trace", "--size", "8x8"],
                            ["trace", "--rays", "ao", "--size", "8x8"], ["render", "-o", "tiny.png", "--size", "8x8"]):
                self.succeed(command[0], scene, *command[1:])
            self.succeed("check", "tiny.rdx")
            self.succeed("check", "--same", "tiny.rdx", scene)

    def test_same_hash_for_every_thread_count(self):
        count = 2000 if SANITIZED else 20000
        for scene in (f"builtin:soup?triangles={count}", f"builtin:clustered?points={count}"):
            for bits in ("30", "63"):
                hashes = {self.document("build", scene, "--bits", bits, "--repeat", "1", "--threads", threads)["build"]
                          ["tree_hash"] for threads in ("1", "2", "7", "7")}
                self.assertEqual(len(hashes), 1, (scene, bits, hashes))
        a = self.document("build", f"builtin:soup?triangles={count}", "--max-leaf", "1")["build"]
        b = self.document("build", f"builtin:soup?triangles={count}", "--seed", "2")["build"]
        c = self.document("build", f"builtin:soup?triangles={count}")["build"]
        self.assertEqual(len({x["tree_hash"] for x in (a, b, c)}), 3)
        self.assertEqual(a["leaves"], count)

    def test_same_tree_from_every_lbvh_builder_and_fit(self):
        scenes = ("builtin:soup?triangles=20000", "builtin:clustered?points=20000", "builtin:soup?triangles=3")
        for scene in scenes[1:2] if SANITIZED else scenes:  # 58 runs of the program each
            for bits, max_leaf in (("30", "1"), ("63", "4")):
                hashes = set()
                for builder in ("karras", "lauterbach", "garanzha", "apetrei"):
                    for fit in ([], ["--fit", "levels"], ["--fit", "atomic"]):
                        arguments = [scene, "--builder", builder, *fit, "--bits", bits, "--max-leaf", max_leaf]
                        build = self.document("build", *arguments, "--repeat", "1", "-o", "built.rdx")["build"]
                        self.assertEqual(build["builder"], builder)
                        hashes.add((build["tree_hash"], build["max_depth"], build["nodes"], build["depth_bound"]))
                        self.assertIn("every invariant holds", self.succeed("check", *arguments).out)
                    self.assertIn("every invariant holds", self.succeed("check", "built.rdx").out)
                    self.assertEqual(self.document("info", "built.rdx")["build"]["builder"], builder)
                self.assertEqual(len(hashes), 1, (scene, bits, hashes))

    def test_rdx_keeps_everything(self):
        built = self.document("build", SOUP, "-o", "soup.rdx")
        self.assertEqual(self.document("info", "soup.rdx")["scene"], self.document("info", SOUP)["scene"])
        self.assertEqual(self.document("build", "soup.rdx")["build"]["tree_hash"], built["build"]["tree_hash"])
        self.assertIn("every invariant holds", self.succeed("check", "soup.rdx").out)
        self.assertIn("the same", self.succeed("check", "--same", "soup.rdx", SOUP).out)
        self.fail_with_one_line("check", "--same", "soup.rdx", "builtin:soup?triangles=2001", names=["soup.rdx"])
        for scene in ("soup.rdx", SOUP):
            self.succeed("trace", scene, "--size", "32x24", "--hits", f"{scene == SOUP}.npy", "--repeat", "1")
            self.succeed("render", scene, "--size", "32x24", "--view", "primitive", "-o", f"{scene == SOUP}.png")
        for kind in ("npy", "png"):
            self.assertEqual((self.folder / f"True.{kind}").read_bytes(), (self.folder / f"False.{kind}").read_bytes())

    def test_altered_rdx_files(self):
        self.succeed("build", "builtin:soup?triangles=20", "-o", "good.rdx", "--repeat", "1")
        good = (self.folder / "good.rdx").read_bytes()
        step = max(1, len(good) // 60)
        changed = [good[:n] for n in range(0, len(good), step)]
        changed += [good[:n] + bytes([good[n] ^ 0x10]) + good[n + 1:] for n in range(0, len(good), step)]
        changed.append(good + b"\0")
        for content in changed:
            self.write("bad.rdx", content)
            self.fail_with_one_line("check", "bad.rdx", names=["bad.rdx"])

    def test_saved_rays_give_the_same_hits(self):
        for kind in ("primary", "ao", "diffuse", "diffuse_shuffled"):
            arguments = ["--repeat", "1", "--mode", "closest"]
            samples = [] if kind == "primary" else ["--samples", "2"]
            first = self.document("trace", SOUP, "--rays", kind, "--size", "32x24", "--camera", "0", *samples, *arguments,
                                  "--hits", "a.npy", "--save-rays", "rays.npy")["trace"][0]
            second = self.document("trace", SOUP, "--rays", "rays.npy", *arguments, "--hits", "b.npy",
                                   "--threads", "1")["trace"][0]
            rays, hits = read_rays(self.folder / "rays.npy"), read_hits(self.folder / "a.npy")
            self.assertEqual(len(rays), len(hits), kind)
            self.assertEqual((first["count"], first["hits"]), (len(rays), sum(h[1] != MISS for h in hits)), kind)
            self.assertGreater(first["hits"], 0, kind)
            self.assertEqual((self.folder / "a.npy").read_bytes(), (self.folder / "b.npy").read_bytes(), kind)
            for field in ("count", "hits", "node_visits_per_ray", "triangle_tests_per_ray"):
                self.assertEqual(first[field], second[field], (kind, field))
            for ray, (t, prim, u, v) in zip(rays, hits):
                if prim == MISS:
                    self.assertEqual((t, u, v), (math.inf, 0, 0))
                else:
                    self.assertTrue(ray[3] <= t <= ray[7] and prim < 2000 and u >= 0 and v >= 0 and u + v <= 1.0001)
            if kind == "ao":
                self.assertTrue(all(math.isfinite(ray[7]) for ray in rays))

    def test_modes(self):
        self.write("squares.ply", SQUARES)
        rays = [(0.75, 0.25, 3, 0, 0, 0, -1, math.inf),  # both squares: triangles 2 and 0
                (0.75, 0.25, 3, 2.5, 0, 0, -1, math.inf),  # only the far one
                (0.25, 0.75, 0.5, 0, 0, 0, 2, 10),  # triangle 3, t in units of a direction of length 2
                (5, 5, 3, 0, 0, 0, -1, math.inf),  # beside both
                (0.25, 0.75, 3, 0, 0, 0, -1, 1.5),  # ends before either
                (0.25, 0.75, 3, 0, 0, 0, 0, 1)]  # invalid
        write_npy(self.folder / "rays.npy", "<f4", (len(rays), 8), b"".join(struct.pack("<8f", *r) for r in rays))
        counts = {}
        for mode in ("closest", "any", "all"):
            hits = [] if mode == "any" else ["--hits", f"{mode}.npy"]
            trace = self.document("trace", "squares.ply", "--rays", "rays.npy", "--mode", mode, *hits)["trace"][0]
            self.assertEqual((trace["mode"], trace["count"], trace["invalid_rays"]), (mode, 6, 1))
            counts[mode] = trace["hits"]
        self.assertEqual(counts, {"closest": 3, "any": 3, "all": 4})
        miss = (math.inf, MISS)
        self.assertEqual([h[:2] for h in read_hits(self.folder / "closest.npy")],
                         [(2.0, 2), (3.0, 0), (0.25, 3), miss, miss, miss])
        self.assertEqual([h[:2] for h in read_hits(self.folder / "all.npy")], [(2.0, 2), (3.0, 0), (3.0, 0), (0.25, 3)])
        descr, shape, data = read_npy(self.folder / "all.offsets.npy")
        self.assertEqual((descr, shape), ("<u8", (7,)))
        self.assertEqual(struct.unpack("<7Q", data), (0, 2, 3, 4, 4, 4, 4))

    def test_all_hits_of_all_cameras_have_one_limit(self):
        self.write("squares.ply", SQUARES)
        one = '{"position": [0.5, 0.5, %g], "target": [0.5, 0.5, 0], "up": [0, 1, 0], "vfov": 40}'
        self.write("cameras.json", '{"width": 200, "height": 100, "cameras": [%s, %s]}' % (one % 4, one % -4))

        def trace(camera, *more):
            return ["trace", "squares.ply", "--mode", "all", "--camera", camera, "--repeat", "1", *more]

        def saved(name):
            offsets = read_npy(self.folder / f"{name}.offsets.npy")[2]
            return read_hits(self.folder / f"{name}.npy"), [n for n, in struct.iter_unpack("<Q", offsets)]

        for camera in ("0", "1", "all"):
            self.succeed(*trace(camera, "--hits", f"{camera}.npy"))
        (first, first_ends), (second, second_ends), (both, ends) = saved("0"), saved("1"), saved("all")
        self.assertGreater(min(len(first), len(second)), 1000)
        self.assertEqual(both, first + second)
        self.assertEqual(ends, first_ends + [len(first) + n for n in second_ends[1:]])
        # Enough for each camera, and for the answers of both, but not for all that joining them takes.
        limit = 16 * len(both) + 8 * len(ends) + 250_000
        for camera in ("0", "1"):
            self.succeed(*trace(camera, "--hits", "one.npy", "--max-result-bytes", str(limit)))
        self.fail_with_one_line(*trace("all", "--hits", "refused.npy", "--max-result-bytes", str(limit)),
                                names=["squares.ply", "all hits", "bytes", str(limit)])
        self.succeed(*trace("all", "--hits", "enough.npy", "--max-result-bytes", str(4 * limit)))
        self.assertEqual(saved("enough"), (both, ends))
        self.fail_with_one_line(*trace("0", "--max-result-bytes", "1000"), names=["trace_all", "more than 1000 bytes"])
        self.assertFalse((self.folder / "refused.npy").exists())
        for bad in (["--max-result-bytes", "1000"], ["--mode", "all", "--max-result-bytes", "-1"],
                    ["--mode", "all", "--max-result-bytes", "many"]):
            self.fail_with_usage("trace", "squares.ply", *bad, names=["--max-result-bytes"])

    def test_bad_ray_files(self):
        ray = struct.pack("<8f", 0, 0, 1, 0, 0, 0, -1, 9)
        for name, descr, shape, data in (("cut", "<f4", (2, 8), ray), ("wide", "<f4", (1, 9), ray + b"1234"),
                                         ("vast", "<f4", (1 << 60, 8), ray), ("negative", "<f4", (-1, 8), ray),
                                         ("words", "<U4", (1, 8), ray * 4)):
            write_npy(self.folder / f"{name}.npy", descr, shape, data)
            self.fail_with_one_line("trace", SOUP, "--rays", f"{name}.npy", names=[f"{name}.npy"])

    def test_cameras_of_another_program(self):
        os.mkdir(self.folder / "foreign")
        scene, broken = "foreign/squares.ply", "foreign/cameras.json"
        self.write(scene, SQUARES)
        self.write(broken, '[{"id": 0, "img_name": "0001"}]')
        self.write("own.json", '[{"position": [0.5, 0.5, 4], "target": [0.5, 0.5, 0]}]')
        write_npy(self.folder / "one.npy", "<f4", (1, 8), struct.pack("<8f", 0.5, 0.5, 3, 0, 0, 0, -1, 9))
        self.assertIn(f"{broken}: camera 1: position is missing", self.succeed("info", scene).out)
        for command in (["build", scene, "-o", "foreign.rdx"], ["query", scene, "--closest"], ["check", scene],
                        ["trace", scene, "--rays", "one.npy"], ["trace", scene, "--cameras", "own.json", "--size", "8x8"],
                        ["render", scene, "--eye", "0", "0", "4", "--size", "8x8", "-o", "x.png"],
                        ["render", scene, "--cameras", "own.json", "--size", "8x8", "-o", "x.png"],
                        ["render", scene, "--view", "slice", "--size", "8x8", "-o", "x.png"], ["info", "foreign.rdx"]):
            self.succeed(*command)
        for command in (["trace", scene], ["trace", scene, "--rays", "ao"], ["render", scene, "-o", "x.png"],
                        ["simulate", scene], ["render", scene, "--eye", "0", "0", "4", "--camera", "1", "-o", "x.png"]):
            self.fail_with_one_line(*command, "--quiet", names=[broken, "position is missing"])

    def test_cameras(self):
        one = '{"position": [0.5, 0.5, %g], "target": [0.5, 0.5, 0], "up": [0, 1, 0], "vfov": 40}'
        os.mkdir(self.folder / "scene")
        self.write("scene/squares.ply", SQUARES)
        self.write("scene/cameras.json", '{"width": 20, "height": 10, "cameras": [%s, %s]}' % (one % 4, one % -4))
        self.write("other.json", "[%s]" % (one % 100))
        scene = "scene/squares.ply"
        self.assertEqual(self.document("trace", scene)["trace"][0]["count"], 2 * 20 * 10)
        self.assertEqual(self.document("trace", scene, "--camera", "1")["trace"][0]["count"], 20 * 10)
        near = self.document("trace", scene, "--camera", "0", "--size", "30x30")["trace"][0]
        far = self.document("trace", scene, "--cameras", "other.json", "--size", "30x30")["trace"][0]
        self.assertEqual((near["count"], far["count"]), (900, 900))
        self.assertGreater(near["hits"], 10 * max(1, far["hits"]))
        self.succeed("render", scene, "-o", "own.png")
        self.assertEqual(read_png(self.folder / "own.png")[:2], (20, 10))
        self.fail_with_one_line("render", scene, "--cameras", "other.json", "--camera", "1", "-o", "x.png")
        for arguments in (["--eye", "0.5", "0.5", "4"], ["--eye=0.5,0.5,4"]):
            self.succeed("render", scene, "-o", "eye.png", "--camera", "1", "--size", "20x10", *arguments)
            self.assertEqual((self.folder / "eye.png").read_bytes(), (self.folder / "own.png").read_bytes())
        self.fail_with_one_line("render", scene, "-o", "x.png", "--camera", "1", "--eye", "0.5", "0.5", "0",
                                names=["--eye", "position equals target"])

    def test_pictures_of_every_view(self):
        scene = "builtin:figure?triangles=5000"
        self.succeed("build", scene, "--quality", "balanced", "-o", "figure.rdx", "--repeat", "1")
        seen = set()
        for view in ("shaded", "ao", "diffuse", "normal", "depth", "primitive", "steps"):
            samples = ("--samples", "16") if view in ("shaded", "ao", "diffuse") else ()
            self.succeed("render", "figure.rdx", "--view", view, "--size", "40x30", *samples, "-o", "a.png")
            width, height, values = read_png(self.folder / "a.png")
            self.assertEqual((width, height), (40, 30), view)
            self.assertGreater(values, 4, f"{view}: the picture is empty")
            seen.add((self.folder / "a.png").read_bytes())
            self.succeed("render", scene, "--view", view, "--size", "40x30", *samples, "-o", "b.png",
                         "--threads", "1")
            if view != "steps":  # of a .rdx file those are through its own binary tree
                self.assertEqual((self.folder / "a.png").read_bytes(), (self.folder / "b.png").read_bytes(), view)
        self.assertEqual(len(seen), 7)
        self.succeed("render", "figure.rdx", "--size", "40x30", "--samples", "4", "-o", "a.exr")
        self.assertEqual((self.folder / "a.exr").read_bytes()[:4], b"\x76\x2f\x31\x01")

    def test_npy_files_are_aligned_version_1(self):
        self.succeed("trace", SOUP, "--size", "4x4", "--camera", "0", "--hits", "h.npy", "--save-rays", "r.npy")
        self.assertEqual(read_npy(self.folder / "r.npy")[:2], ("<f4", (16, 8)))
        for name in ("h.npy", "r.npy"):
            content = (self.folder / name).read_bytes()
            self.assertEqual(content[6:8], b"\x01\x00")
            self.assertEqual((10 + struct.unpack_from("<H", content, 8)[0]) % 64, 0)


class RenderDocument(ProgramTest):
    def test_it_has_the_camera_and_samples_that_were_used(self):
        scene, size = "builtin:soup?triangles=50", ("--size", "8x8", "-o", "p.png")
        plain = self.document("render", scene, *size)["render"]
        self.assertEqual((plain["camera"], plain["fov"], plain["samples"], plain["ao_radius"]), ("corner", 32, 16, None))
        moved = self.document("render", scene, *size, "--eye", "1", "2", "3", "--target", "0", "0.5", "0", "--up", "0", "0", "1",
                              "--fov", "30", "--samples", "5", "--view", "ao", "--ao-radius", "0.25")["render"]
        self.assertEqual((moved["camera"], moved["eye"], moved["target"], moved["up"], moved["fov"]),
                         (None, [1, 2, 3], [0, 0.5, 0], [0, 0, 1], 30))
        self.assertEqual((moved["samples"], moved["ao_radius"]), (8, 0.25))
        self.assertEqual(self.document("render", scene, *size, "--view", "depth")["render"]["samples"], 0)
        self.assertGreater(self.document("render", scene, *size, "--view", "ao")["render"]["ao_radius"], 0)
        self.assertIsNone(self.document("render", scene, *size, "--view", "slice")["render"]["eye"])


if __name__ == "__main__":
    main()
