"""raydix mpi and the example of docs/distributed.md under mpirun: answers, bad input, a rank that is killed."""
import json
import os
import pathlib
import re
import signal
import struct
import subprocess
import tempfile
import textwrap
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
MPIRUN = os.environ["RAYDIX_MPIRUN"].split()
PROGRAM, EXAMPLE = os.environ["RAYDIX_PROGRAM"], os.environ["RAYDIX_EXAMPLE"]
TIME_LIMIT_S = 60


def command(ranks, *arguments):
    return [*MPIRUN, "-n", str(ranks), PROGRAM, "mpi", *arguments]


class Mpi(unittest.TestCase):
    def run_on(self, ranks, *arguments):
        return subprocess.run(command(ranks, *arguments), capture_output=True, text=True, timeout=TIME_LIMIT_S,
                              cwd=self.folder)

    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory(prefix="raydix-mpi-")
        cls.addClassCleanup(holder.cleanup)
        cls.folder = pathlib.Path(holder.name)

    def document_of(self, ranks, *arguments):
        done = self.run_on(ranks, *arguments, "--json", "-")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return json.loads(done.stdout)

    def failure_of(self, ranks, *arguments):
        """The lines of raydix; the launcher adds its own."""
        done = self.run_on(ranks, *arguments)
        self.assertNotEqual(done.returncode, 0, done.stdout)
        return [line for line in done.stderr.splitlines() if line.startswith("raydix: ")]

    def scene(self):
        """A closed, bent cube whose faces are grids."""
        file = self.folder / "solid.obj"
        if not file.exists():
            n, lines, corners = 12, [], {}

            def corner(p):
                if p not in corners:
                    corners[p] = len(corners) + 1
                    x, y, z = (c / n for c in p)
                    lines.append(f"v {x + 0.1 * y * z:.6f} {y - 0.2 * x * x:.6f} {z + 0.05 * x * y:.6f}")
                return corners[p]

            faces = []
            for axis in range(3):
                for side in (0, n):
                    for i in range(n):
                        for j in range(n):
                            quad = []
                            for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                                p = [a, b]
                                p.insert(axis, side)
                                quad.append(corner(tuple(p)))
                            if (side == 0) == (axis != 1):
                                quad.reverse()
                            faces += [f"f {quad[0]} {quad[1]} {quad[2]}", f"f {quad[0]} {quad[2]} {quad[3]}"]
            file.write_text("\n".join(lines + faces) + "\n")
        return str(file)


class Answers(Mpi):
    def test_verified_on_several_ranks(self):
        for ranks, partition, arguments in ((3, "curve", ("trace", "--size", "48x32")),
                                            (2, "as_given", ("trace", "--size", "24x16", "--mode", "all")),
                                            (4, "curve", ("trace", "--size", "24x16", "--mode", "any")),
                                            (3, "curve", ("query", "--knn", "5")),
                                            (2, "as_given", ("query", "--radius", "0.05")),
                                            (2, "curve", ("query", "--closest")),
                                            (2, "curve", ("query", "--contains"))):
            with self.subTest(ranks=ranks, arguments=arguments):
                document = self.document_of(ranks, arguments[0], self.scene(), *arguments[1:], "--partition",
                                            partition, "--verify")
                self.assertTrue(document["verified"])
                self.assertEqual(document["ranks"], ranks)
                self.assertGreater(document["report"]["rounds"], 0)
                self.assertGreater(document["report"]["messages"]["sum"], 0)

    def test_documents_name_the_scene_as_those_of_one_process(self):
        alone = json.loads(subprocess.run([PROGRAM, "info", self.scene(), "--json", "-"], capture_output=True).stdout)["scene"]
        far = self.folder / "far.obj"
        far.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2e12 0 0\nf 1 2 3\nf 1 2 4\n")
        size = ("--size", "8x8")
        for arguments in (("info",), ("trace", *size), ("query", "--closest"), ("render", *size, "-o", str(self.folder / "s.png")),
                          ("render", *size, "-o", str(self.folder / "s.png"), "--distributed")):
            with self.subTest(arguments):
                document = self.document_of(2, arguments[0], self.scene(), *arguments[1:])
                for field in ("name", "triangles", "points", "vertices", "left_out"):
                    self.assertEqual(document["scene"][field], alone[field], field)
                self.assertGreater(document["load_ms"], 0)
                self.assertEqual(self.document_of(2, arguments[0], str(far), *arguments[1:])["scene"]["left_out"], 1)
                self.assertIn("1 triangle left out", self.run_on(2, arguments[0], str(far), *arguments[1:]).stdout)
        document = self.document_of(2, "info", self.scene(), self.scene())
        self.assertEqual((document["scene"]["name"], document["scene"]["triangles"]), ("solid.obj, solid.obj", 2 * alone["triangles"]))

    def test_what_is_invalid_is_counted_over_all_ranks(self):
        queries, rays = self.folder / "invalid_queries.npy", self.folder / "invalid_rays.npy"
        nan, down = float("nan"), (0, 0, 0, -1, 9)  # tmin, direction, tmax
        for file, rows in ((queries, [(0, 0, 0), (nan, 0, 0), (1, nan, 0), (1, 1, 1), (nan, nan, nan)]),
                           (rays, [(0.5, 0.5, 5, *down), (nan, 0, 5, *down), (0.5, 0.4, 5, *down)])):
            head = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({len(rows)}, {len(rows[0])}), }}".ljust(117) + "\n"
            file.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode()
                             + b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows))
        for kind in (("--knn", "2"), ("--radius", "0.1"), ("--closest",), ("--contains",)):
            arguments = ("query", self.scene(), "--queries", str(queries), *kind)
            document = self.document_of(2, *arguments)
            self.assertEqual((document["queries"], document["invalid_queries"]), (5, 3), kind)
            self.assertIn(" found, 3 invalid\n", self.run_on(2, *arguments).stdout)
        arguments = ("trace", self.scene(), "--rays", str(rays))
        self.assertEqual(self.document_of(2, *arguments)["invalid_rays"], 1)
        self.assertIn("\n1 rays are invalid and count as misses\n", self.run_on(2, *arguments).stdout)

    def test_says_who_reads_and_who_holds_what(self):
        done = self.run_on(3, "info", self.scene())
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("rank 0 reads all of", done.stdout)
        self.assertRegex(done.stdout, r"holding +1728 triangles, at most \d+ on a rank of 3")

    def test_the_tree_over_all_ranks_is_that_of_one_process(self):
        alone = subprocess.run([PROGRAM, "build", self.scene(), "--builder", "karras"], capture_output=True, text=True)
        hash_alone = re.search(r"^hash +(\w{32})$", alone.stdout, re.MULTILINE).group(1)
        done = self.run_on(3, "info", self.scene(), "--verify")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(hash_alone, done.stdout)
        self.assertIn("the nodes of the LBVH have the bits of one process", done.stdout)
        self.assertEqual(self.document_of(2, "info", self.scene(), "--tree-hash")["tree_hash"], hash_alone)

    def test_each_rank_reads_its_part_of_files_that_let_it(self):
        mesh, points = self.folder / "solid.ply", self.folder / "points.npy"
        lines = pathlib.Path(self.scene()).read_text().splitlines()
        vertices = [[float(word) for word in line.split()[1:]] for line in lines if line.startswith("v ")]
        faces = [[int(word) - 1 for word in line.split()[1:]] for line in lines if line.startswith("f ")]
        head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
                f"property float y\nproperty float z\nelement face {len(faces)}\n"
                "property list uchar int vertex_indices\nend_header\n")
        mesh.write_bytes(head.encode() + b"".join(struct.pack("<3f", *v) for v in vertices)
                         + b"".join(struct.pack("<B3i", 3, *f) for f in faces))
        head = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({len(vertices)}, 3), }}".ljust(117) + "\n"
        points.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode()
                           + b"".join(struct.pack("<3f", *v) for v in vertices))
        for file, arguments in ((mesh, ("info",)), (mesh, ("trace", "--size", "24x16", "--verify")),
                                (mesh, ("query", "--closest", "--verify")), (mesh, ("query", "--knn", "3", "--verify")),
                                (points, ("query", "--knn", "3", "--verify")),
                                (points, ("query", "--radius", "0.1", "--queries", str(points)))):
            with self.subTest(file=file.name, arguments=arguments):
                done = self.run_on(3, arguments[0], str(file), *arguments[1:])
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                self.assertIn("each rank reads its part of", done.stdout)
                self.assertEqual("have the bits of one process" in done.stdout, "--verify" in arguments)
        done = self.run_on(3, "trace", str(mesh), self.scene(), str(mesh), "--size", "24x16", "--verify")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("rank 0 reads all of", done.stdout)
        done = self.run_on(3, "info", str(mesh), str(mesh), "--verify")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn(f"holding      {2 * len(faces)} triangles", done.stdout)

    def test_pictures_have_the_bytes_of_raydix_render(self):
        alone, many = self.folder / "alone.png", self.folder / "many.png"
        for ranks, view, more in ((3, "shaded", ()), (2, "steps", ()), (3, "diffuse", ("--distributed",)),
                                  (2, "depth", ("--distributed", "--partition", "as_given"))):
            with self.subTest(ranks=ranks, view=view, more=more):
                picture = ("--view", view, "--size", "40x30", "--samples", "4")
                done = subprocess.run([PROGRAM, "render", self.scene(), "-o", str(alone), *picture],
                                      capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stderr)
                many.unlink(missing_ok=True)
                document = self.document_of(ranks, "render", self.scene(), "-o", str(many), *picture, *more,
                                            "--verify")
                self.assertTrue(document["verified"])
                self.assertEqual(document["render"]["scene"], "distributed" if more else "replicated")
                self.assertEqual(many.read_bytes(), alone.read_bytes())

    def test_pictures_of_rdx_files_and_of_several_files(self):
        tree, scene, alone, many = (self.folder / name for name in ("tree.rdx", "scene.rdx", "a.png", "b.png"))
        size = ("--size", "40x30")
        for file, layout in ((tree, "binary"), (scene, "wide8")):
            subprocess.run([PROGRAM, "build", self.scene(), "--layout", layout, "-o", str(file)], check=True,
                           capture_output=True)
        for files in ([tree], [scene], [self.scene(), self.scene()]):
            with self.subTest(files=files):
                subprocess.run([PROGRAM, "render", str(files[0]), "-o", str(alone), *size], check=True,
                               capture_output=True)
                done = self.run_on(2, "render", *map(str, files), "-o", str(many), *size, "--verify")
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                self.assertEqual(many.read_bytes(), alone.read_bytes())
        self.assertIn("--view: steps of the tree",
                      self.failure_of(2, "render", str(tree), "-o", str(many), "--view", "steps")[0])

    def test_bench_of_two_ranks_predicts_nothing(self):
        done = self.run_on(2, "bench", "weak", "--per-rank", "500", "--queries", "50", "--repeat", "1")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("fit", done.stdout)
        self.assertIn("two-round: ", done.stdout)

    def test_bench_counts_and_predicts(self):
        document = self.document_of(8, "bench", "weak", "--per-rank", "2000", "--queries", "200", "--repeat", "1")
        self.assertEqual([row["ranks"] for row in document["counted"]], [1, 2, 4, 8])
        self.assertEqual(document["predicted"]["ranks"], 8)
        alone, most = document["counted"][0], document["counted"][-1]
        self.assertEqual(alone["messages"], 0)
        self.assertGreater(most["bytes"], 0)
        self.assertLess(most["bytes"], most["broadcast_bytes"])
        self.assertGreaterEqual(most["two_round_ranks_touched"], most["ranks_touched"] + 1)

    def test_the_example_of_the_page(self):
        done = subprocess.run([*MPIRUN, "-n", "4", EXAMPLE], capture_output=True, text=True, timeout=TIME_LIMIT_S)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(done.stdout.splitlines()),
                         [f"rank {r}: point {min(r + 1, 3) * 1000 + 500}" for r in range(4)])
        source = (ROOT / "examples" / "mpi_points.cpp").read_text(encoding="utf-8")
        shown = re.search(r"^ *// \[points\]\n(.*?)^ *// \[end\]\n", source, re.DOTALL | re.MULTILINE).group(1)
        page = (ROOT / "docs" / "distributed.md").read_text(encoding="utf-8")
        self.assertIn("```cpp\n" + textwrap.dedent(shown) + "```", page)


class Failures(Mpi):
    def test_one_line_and_no_hang(self):
        for arguments, text in ((("info", "no_such_file.ply"), "no_such_file.ply"),
                                (("query", self.scene(), "--knn", "1", "--exchange-bytes", "3"), "exchange_bytes is 3"),
                                (("query", self.scene()), "Exactly 1 option"),
                                (("nothing",), "'nothing' is not a command"),
                                (("render", "no_such_file.ply", "-o", "x.png"), "no_such_file.ply"),
                                (("render", self.scene(), "-o", "none/x.png", "--size", "8x8"), "none/x.png"),
                                (("render", self.scene(), "-o", "x.png", "--distributed", "--view", "steps"), "steps"),
                                (("render", self.scene(), "-o", "x.png", "--camera", "9"), "camera 9"),
                                (("trace", self.scene(), "--camera", "9"), "there is no camera 9")):
            with self.subTest(arguments=arguments):
                lines = self.failure_of(3, *arguments)
                self.assertEqual(len(lines), 1, lines)
                self.assertIn(text, lines[0])

    def test_points_have_no_triangles(self):
        file, other = self.folder / "cloud.xyz", self.folder / "cloud.npy"
        file.write_text("0 0 0\n1 0 0\n0 1 0\n")
        head = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }".ljust(117) + "\n"
        other.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode()
                          + struct.pack("<6f", *range(6)))
        mesh = self.folder / "one.ply"  # of which, with the .npy file, each rank reads its part
        mesh.write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                         b"property float y\nproperty float z\nelement face 1\n"
                         b"property list uchar int vertex_indices\nend_header\n"
                         + struct.pack("<9fB3i", 0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2))
        for cloud in (str(file), str(other)):
            for arguments, who in ((("trace", cloud), "rays"), (("query", cloud, "--closest"), "closest points"),
                                   (("query", cloud, "--contains"), "solids"),
                                   (("render", cloud, "-o", "x.png", "--distributed"), "pictures")):
                with self.subTest(arguments=arguments):
                    self.assertEqual(self.failure_of(2, *arguments),
                                     [f"raydix: {cloud}: {who} need triangles; there are vertices alone"])
            with self.subTest(mixed_with=cloud):
                lines = self.failure_of(2, "info", str(mesh), cloud)
                self.assertEqual(len(lines), 1, lines)
                self.assertIn(f"{cloud}: it holds points, and the other files triangles", lines[0])

    def test_usage_and_outputs_before_the_work(self):
        none = str(self.folder / "none" / "x")
        for code, text, arguments in ((2, "--size", ("trace", self.scene(), "--size", "0x5")),
                                      (2, "--camera", ("trace", self.scene(), "--camera", "-1")),
                                      (2, "--radius", ("query", self.scene(), "--radius", "nan")),
                                      (2, "--radius", ("query", self.scene(), "--radius", "-1")),
                                      (2, "--out", ("query", self.scene(), "--knn", "1", "--out", "")),
                                      (2, "--exchange-bytes", ("info", self.scene(), "--exchange-bytes", "0")),
                                      (2, "--size", ("render", self.scene(), "-o", "x.png", "--size", "0x5")),
                                      (2, "--per-rank", ("bench", "weak", "--per-rank", str(2 ** 64 - 1))),
                                      (1, none, ("trace", "no_file.obj", "--out", none)),
                                      (1, none, ("query", "no_file.obj", "--knn", "1", "--out", none)),
                                      (1, none, ("info", "no_file.obj", "--json", none)),
                                      (1, none, ("render", "no_file.obj", "-o", none + ".png"))):
            with self.subTest(arguments=arguments):
                done = self.run_on(2, *arguments)
                self.assertEqual(done.returncode, code, done.stderr)
                self.assertRegex(done.stderr, "(?m)^raydix: " + re.escape(text))

    def test_ranks_with_other_arguments(self):
        first, second = command(1, "info", self.scene()), command(1, "trace", self.scene())[len(MPIRUN):]
        done = subprocess.run([*first, ":", *second], capture_output=True, text=True, timeout=TIME_LIMIT_S)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn(f"raydix: rank 1: started with 'trace {self.scene()}', and rank 0 with 'info {self.scene()}'",
                      done.stderr)

    def test_a_killed_rank_ends_all(self):
        run = subprocess.Popen(command(4, "bench", "weak", "--per-rank", "300000", "--repeat", "1000"),
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=self.folder)
        ranks = self.children_of(run.pid, 4)
        time.sleep(1)
        os.kill(ranks[2], signal.SIGKILL)
        text, _ = run.communicate(timeout=TIME_LIMIT_S)
        self.assertNotEqual(run.returncode, 0)
        self.assertIn("signal 9", text)
        end = time.time() + TIME_LIMIT_S
        while any(pathlib.Path(f"/proc/{rank}").exists() for rank in ranks):
            self.assertLess(time.time(), end)
            time.sleep(0.05)

    def children_of(self, pid, wanted):
        end = time.time() + TIME_LIMIT_S
        while time.time() < end:
            found = []
            for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
                found += [int(child) for child in (task / "children").read_text().split()]
            if len(found) == wanted:
                return found
            time.sleep(0.05)
        self.fail("the ranks do not start")


if __name__ == "__main__":
    unittest.main()
