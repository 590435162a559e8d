"""Help texts, exit codes, one-line errors, --quiet, --json, progress."""
import json
import os
import pty
import stat
import struct
import subprocess
import sys
import time

sys.dont_write_bytecode = True
from program import COMMANDS, PROGRAM, SANITIZED, TIME_LIMIT_S, TRIANGLE, ProgramTest, json_of, main, ply, write_npy  # noqa: E402

COMMON = ["--json", "--threads", "--quiet", "--seed"]
TREE = ["--tree", "--builder", "--quality", "--bits", "--max-leaf", "--max-level", "--fit", "--layout", "--device", "--strict", "--cameras"]
FIGURES = ["--epo", "--sah-node", "--sah-primitive"]
OPTIONS = {
    "info": ["SCENE"],
    "scenes": [],
    "build": ["SCENE", "--repeat", "--output", *TREE, *FIGURES],
    "check": ["SCENE", "--same", *TREE],
    "trace": ["SCENE", "--rays", "--mode", "--kernel", "--camera", "--hits", "--save-rays", "--repeat", "--size",
              "--samples", "--ao-radius", "--explain", *TREE, *FIGURES],
    "render": ["SCENE", "--output", "--view", "--size", "--camera", "--eye", "--target", "--up", "--fov",
               "--samples", *TREE],
    "query": ["SCENE", "--knn", "--radius", "--box", "--queries", "--out", "--sort", "--tree", "--strict", "--repeat"],
}
SMALL = "builtin:soup?triangles=50"
MEDIUM = "builtin:soup?triangles=2000"


class Usage(ProgramTest):
    def test_help_is_complete(self):
        top = self.succeed("--help").out
        for command in COMMANDS:
            self.assertRegex(top, rf"(?m)^  {command} +\w")
            text = self.succeed(command, "--help").out
            for option in OPTIONS[command] + COMMON:
                self.assertIn(option, text, command)
            for line in text.splitlines():
                self.assertFalse(line.strip().startswith("--") and len(line.split()) == 1, f"no words about {line}")

    def test_figures_belong_to_commands_that_print_them(self):
        for command in (("check", SMALL), ("render", SMALL, "-o", "x.png")):
            for option in FIGURES:
                self.assertNotIn(option, self.succeed(command[0], "--help").out)
                self.fail_with_usage(*command, option, "1", names=[option])

    def test_version(self):
        self.assertRegex(self.succeed("--version").out, r"\Araydix \d+\.\d+\.\d+\n\Z")

    def test_usage_errors_are_2(self):
        self.fail_with_usage()
        self.fail_with_usage("trade", names=["'trade'"])
        self.fail_with_usage("bench", "trade", names=["'trade'", "traversal", "hierarchy"])
        self.fail_with_usage("--nothing")
        for command in ("info", "build", "trace", "render"):
            self.fail_with_usage(command, names=["SCENE" if command != "render" else "required"])
        self.fail_with_usage("check", names=["SCENE"])
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--view", "slice", "--at", "nan")
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--eye", "0", "0", "0", "--fov", "nan")
        self.fail_with_usage("build", SMALL, "--epo", "nan")
        self.fail_with_usage("check", "--same", SMALL)
        self.fail_with_usage("check", SMALL, "--same", SMALL, SMALL)
        self.fail_with_usage("render", SMALL, names=["--output"])
        for bad in (["--bits", "31"], ["--bits"], ["--max-leaf", "0"], ["--max-leaf", "256"], ["--builder", "other"], ["--fit", "tight"],
                    ["--tree", "other"], ["--quality", "best"], ["--device", "abacus"], ["--layout", "x"],
                    ["--repeat", "0"], ["--threads", "-1"], ["--threads", "1025"], ["--threads", "100000"],
                    ["--threads", "two"], ["--seed", "-1"], ["--epo", "0"],
                    ["--epo", "1.5"], ["--epo", "much"], ["--sah-node", "-1"], ["--sah-node", "nan"],
                    ["--sah-primitive", "inf"], ["--nothing"], ["--json"], ["extra"],
                    ["--quality", "fast", "--builder", "karras"]):
            self.fail_with_usage("build", SMALL, *bad)
        for bad in (["--rays", "secondary"], ["--mode", "some"], ["--kernel", "x"], ["--camera", "first"],
                    ["--size", "640"], ["--size", "0x480"], ["--size", "640x480x3"], ["--samples", "0"],
                    ["--ao-radius", "0"], ["--ao-radius", "nan"], ["--ao-radius", "x"]):
            self.fail_with_usage("trace", SMALL, *bad)
        for bad in (["--view", "inside"], ["--eye", "1", "2"], ["--fov", "0"], ["--fov", "180"], ["--camera", "-1"],
                    ["--size", "big"], ["--samples", "-1"]):
            self.fail_with_usage("render", SMALL, "-o", "x.png", *bad)

    def test_usage_errors_name_what_was_typed_in_one_line(self):
        self.fail_with_usage("build", SMALL, "--threads", "100000", names=["--threads", "100000"])
        self.fail_with_usage("two\nlines", names=["'two\\x0Alines'"])
        self.fail_with_usage("build", SMALL, "--builder", "two\nlines", names=["--builder", "two\\x0Alines"])

    def test_options_before_the_scene(self):
        size = ("--size", "8x8")
        for arguments in (["--eye", "1,2,3", SMALL], ["--eye", "1", "2", "3", SMALL], [SMALL, "--eye", "0", "-.5", "3"],
                          ["--eye", "-.5,-.25,3", "--up", "0", "1", "-.5", SMALL]):
            self.succeed("render", *size, *arguments, "-o", "eye.png")
        made = [self.succeed("render", SMALL, *size, "-o", name, "--quiet", f"--eye={eye}") and (self.folder / name).read_bytes()
                for name, eye in (("a.png", "-0.5,1,3"), ("b.png", "-.5,1,3"))]
        self.assertEqual(*made)
        self.assertIsNotNone(self.document("build", "--epo", SMALL)["build"]["epo"])
        self.assertIsNotNone(self.document("build", "--epo", "0.5", SMALL)["build"]["epo"])
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--eye", "1", "2", names=["--eye", "3 required"])

    def test_views_that_are_none(self):
        absent = ("render", "absent.ply", "-o", "x.png")  # the command line alone is at fault
        for option in ("--eye", "--target", "--up"):
            for bad in ("nan", "inf", "1e39", "x"):
                self.fail_with_usage(*absent, option, "1", "2", bad, names=[option])
            self.fail_with_usage(*absent, option, "1,2,nan", names=[option, "'nan' is not a finite"])
        self.fail_with_usage(*absent, "--up", "0,0,-0", names=["--up", "no direction"])
        self.fail_with_usage(*absent, "--eye", "1,2,3", "--target", "1,2,3.0", names=["--eye", "--target"])
        self.fail_with_usage(*absent, "--eye", "1,2,3", "--target", "1,2,4", "--up", "0,0,-2", names=["--up", "parallel to the view"])
        self.fail_with_one_line(*absent, "--eye", "1,2,3", "--target", "1,2,4", "--up", "0,1,0", names=["absent.ply"])
        self.succeed("render", SMALL, "-o", "x.png", "--size", "8x8", "--eye", "+1", "2e0", "-3", "--up", "0,1,0")

    def test_names_of_files_that_are_empty(self):
        """As a shell gives a variable that has no value."""
        for arguments, option in ((("info", "tri.ply"), "--json"), (("trace", "tri.ply"), "--cameras"), (("query", "tri.ply", "--pairs"), "--with"),
                                  (("query", "tri.ply", "--knn", "1"), "--queries"), (("bench", "traversal", "tri.ply"), "--state")):
            with self.subTest(option=option):
                self.fail_with_usage(*arguments, option, "", names=[option, "the name of the file is empty"])

    def test_faults_are_named_as_they_were_typed(self):
        self.fail_with_usage("--nope", names=["'--nope' is not an option of raydix"])
        self.fail_with_usage("bench", "--nope=3", names=["'--nope' is not an option of bench"])
        self.fail_with_usage("trace", SMALL, "--siz", "8x8", names=["not expected: --siz 8x8"])
        for option, names in (("--kernel", "packet,while_while,packet"), ("--rays", "primary,ao,primary")):
            self.fail_with_usage("simulate", SMALL, option, names, names=[option, names.split(",")[0], "twice"])
        self.fail_with_usage("man", "--folder", "", names=["--folder", "empty"])
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--view", "tree", "--levels", "", names=["--levels"])
        result = self.write("empty.json", "{}")
        self.fail_with_usage("report", result, "-o", "t.png", names=["--output", "t.png", ".html"])
        for tree in ("octree", "kdtree"):
            self.assertIn(" bytes a triangle)", self.succeed("build", SMALL, "--tree", tree, "--repeat", "1").out)

    def test_sizes_and_cameras_are_looked_at_before_the_work(self):
        for command in (("trace", "absent.ply"), ("simulate", "absent.ply"), ("render", "absent.ply", "-o", "x.png"),
                        ("report", "absent.json", "-o", "x.html"), ("bench", "traversal", "absent.ply")):
            self.fail_with_usage(*command, "--size", "foo", names=["--size", "'foo'"])
            if command[0] != "report":
                self.fail_with_usage(*command, "--camera", "foo", names=["--camera", "'foo'"])

    def test_numbers_that_float32_does_not_hold(self):
        for command in (("trace", SMALL), ("render", SMALL, "-o", "x.png"), ("simulate", SMALL)):
            for bad in ("1e-300", "1e300"):
                self.fail_with_usage(*command, "--ao-radius", bad, names=["--ao-radius", f"'{bad}'", "float32"])
        self.fail_with_usage("query", SMALL, "--radius", "1e39", names=["--radius", "float32"])
        self.succeed("query", SMALL, "--radius", "1e-300", "--repeat", "0")  # it may be 0

    def test_whole_numbers(self):
        for command, option, most in (("build", "--seed", 2**64 - 1), ("trace", "--max-result-bytes", 2**64 - 1),
                                      ("build", "--repeat", 10000), ("build", "--threads", 1024), ("build", "--max-leaf", 255)):
            for bad in ("18446744073709551616", "99999999999999999999", "-1", "1G", "0x10", "1e3", "", "3.5"):
                self.fail_with_usage(command, SMALL, f"{option}={bad}" if bad else option, *([""] if not bad else []),
                                     names=[option, f"'{bad}' is not a whole number from ", f" to {most};"])
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--camera", "-1", names=["'-1' is not a whole number from 0"])
        repeats = self.document("build", SMALL, "--repeat", "010", "--seed", "18446744073709551615")
        self.assertIn("build", repeats)
        self.assertIn("of 10 ", self.succeed("build", SMALL, "--repeat", "010").out)  # no octal number
        self.fail_with_one_line("info", "builtin:soup?triangles=10&triangles=20", names=["'triangles' is given twice"])

    def test_numbers_up_to_a_limit(self):
        for command, option, least, most in ((("build", SMALL), "--epo", "above 0 and up to", 1), (("render", SMALL, "-o", "x.png"), "--fov", "above 0 and up to", 179),
                                             (("render", SMALL, "-o", "x.png"), "--at", "from 0 to", 1), (("bench", "traversal", SMALL), "--sample", "above 0 and up to", 1),
                                             (("bench", "traversal", SMALL), "--error", "above 0 and up to", 1), (("bench", "traversal", SMALL), "--sweep-sample", "from 0 to", 1)):
            for bad in (str(most + 1), "-1", "nan", "inf", "1x", *(["0", "1e-300"] if "above" in least else [])):
                self.fail_with_usage(*command, f"{option}={bad}", names=[f"{option}: '{bad}' is not a number {least} {most};"])
        self.fail_with_usage("bench", "hierarchy", SMALL, "--repeat", "0", names=["--repeat: '0' is not a whole number from 1 to 1000;"])

    def test_options_that_would_be_ignored(self):
        for arguments, names in ((("trace", SMALL, "--kernel", "engine", "--layout", "binary"), ("--layout", "--kernel engine")),
                                 (("trace", SMALL, "--machine", "h100"), ("--machine", "--device sim")),
                                 (("simulate", SMALL, "--any", "--rays", "primary"), ("--any", "--rays FILE.npy"))):
            self.fail_with_usage(*arguments, names=names)
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--layout", "wide8", names=["wide8", "build and trace"])

    def test_outputs_are_tried_before_the_work(self):
        absent = "absent.ply"  # the work would fail with it
        self.fail_with_usage("render", absent, "-o", "x.jpg", names=["--output", "x.jpg", "known: .png .exr"])
        self.fail_with_usage("render", absent, "-o", "picture", names=["--output", "picture", "known: .png .exr"])
        for command, names in ((("render", absent, "-o", "no/x.png"), ("no/x.png: cannot write",)),
                               (("render", absent, "-o", "x.png", "--json", "no/x.json"), ("no/x.json: cannot write",)),
                               (("trace", absent, "--hits", "no/h.npy"), ("no/h.npy: cannot write",)),
                               (("trace", absent, "--save-rays", "/"), ("/: cannot write",)),
                               (("info", absent, "--json", "no/i.json"), ("no/i.json: cannot write",)),
                               (("bench", "traversal", absent, "--json", "no/b.json"), ("no/b.json: cannot write",)),
                               (("bench", "hierarchy", absent, "--json", "no/b.json"), ("no/b.json: cannot write",)),
                               (("build", absent, "-o", "no/t.rdx"), ("no/t.rdx: cannot write",)),
                               (("query", absent, "--closest", "--out", "no/q"), ("no/q.indices.npy: cannot write",))):
            self.fail_with_one_line(*command, names=names)
        for command in (("query", SMALL, "--closest", "--out"), ("build", SMALL, "-o"), ("trace", SMALL, "--hits")):
            self.fail_with_usage(*command, "", names=["empty"])
        self.assertFalse([name for name in os.listdir(self.folder) if name.startswith(".")])

    def test_standard_error_that_cannot_be_written(self):
        for arguments, code in (("info /nonexistent", 1), ("--foo", 2), ("build " + SMALL + " -o t.rdx --bits 1", 2)):
            for where in ("2>&-", "2>/dev/full"):
                done = subprocess.run(["sh", "-c", f"'{PROGRAM}' {arguments.replace('?', chr(92) + '?')} {where}"], timeout=TIME_LIMIT_S,
                                      cwd=self.folder, stdout=subprocess.PIPE)
                self.assertEqual((done.returncode, done.stdout), (code, b""), (arguments, where))

    def test_outputs_go_through_links_and_into_devices(self):
        for command, option in ((["build", SMALL, "--quiet"], "-o"), (["build", SMALL, "--quiet"], "--json"),
                                (["trace", SMALL, "--size", "4x4", "--quiet"], "--hits"),
                                (["trace", SMALL, "--size", "4x4", "--quiet"], "--save-rays"),
                                (["render", SMALL, "--size", "4x4", "--quiet"], "-o")):
            with self.subTest(command=command[0], option=option):
                suffix = ".png" if command[0] == "render" else ".out"
                target, link = self.folder / f"target{suffix}", self.folder / f"link{suffix}"
                target.unlink(missing_ok=True)
                link.unlink(missing_ok=True)
                link.symlink_to(target.name)
                self.succeed(*command, option, str(link))
                self.assertTrue(link.is_symlink())
                self.assertTrue(target.is_file() and not target.is_symlink())
                pipe = self.folder / f"pipe{suffix}"
                pipe.unlink(missing_ok=True)
                os.mkfifo(pipe)
                reader = subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE)
                self.succeed(*command, option, str(pipe))
                sent = reader.communicate(timeout=TIME_LIMIT_S)[0]
                self.assertTrue(stat.S_ISFIFO(os.lstat(pipe).st_mode), "still a pipe")
                self.assertGreater(len(sent), 8)

    def test_dev_stdout(self):
        done = self.run_program("build", SMALL, "--quiet", "--json", "/dev/stdout")
        self.assertEqual((done.code, done.err), (0, ""), done)
        self.assertEqual(json.loads(done.out)["command"], "build")

    def test_a_full_disk_leaves_the_old_file(self):
        folder = self.folder / "full"
        folder.mkdir()
        old = self.write("full/old.rdx", "old")
        code = ("import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)); "
                "os.execv(sys.argv[1], sys.argv[1:])")
        for arguments in (["build", MEDIUM, "--quiet", "-o", old], ["trace", MEDIUM, "--size", "64x64", "--quiet", "--hits", old],
                          ["trace", MEDIUM, "--size", "64x64", "--quiet", "--save-rays", old]):
            done = subprocess.run([sys.executable, "-c", code, PROGRAM, *arguments], capture_output=True, timeout=TIME_LIMIT_S)
            self.assertEqual((done.returncode, done.stderr.count(b"\n")), (1, 1), done)
            self.assertIn(b"old.rdx: cannot write", done.stderr)
            self.assertEqual((folder / "old.rdx").read_bytes(), b"old")
            self.assertEqual(os.listdir(folder), ["old.rdx"])

    def test_input_errors_are_1_and_one_line(self):
        file = self.write("triangle.ply", TRIANGLE)
        self.write("empty.ply", b"")
        self.write("cut.ply", TRIANGLE[:-8])
        self.write("text.rdx", b"not a tree\n")
        self.write("empty.rdx", b"")
        self.write("what.txt", b"hello\n")
        self.write("bad_cameras.json", b'{"cameras": [{"position": [0, 0]}]}')
        os.mkdir(self.folder / "folder.ply")
        for scene in ("absent.ply", "folder.ply", "empty.ply", "cut.ply", "what.txt", "text.rdx", "empty.rdx",
                      "absent.rdx", "-", "no/such/folder/x.obj"):
            for command in ("info", "build", "check", "trace"):
                self.fail_with_one_line(command, scene, names=[scene])
            self.fail_with_one_line("render", scene, "-o", "x.png", names=[scene])
        for scene, names in (("builtin:", ["builtin"]), ("builtin:nothing", ["nothing", "figure"]),
                             ("builtin:soup?colour=red", ["colour", "triangles"]),
                             ("builtin:soup?triangles", ["triangles"]), ("builtin:soup?triangles=", ["triangles"]),
                             ("builtin:soup?triangles=many", ["many"]), ("builtin:soup?triangles=-5", ["-5"]),
                             ("builtin:soup?triangles=1e300", ["1e300"])):
            self.fail_with_one_line("info", scene, names=names)
        self.fail_with_one_line("build", file, "--cameras", "bad_cameras.json", names=["bad_cameras.json"])
        self.fail_with_one_line("trace", file, "--camera", "7", names=["triangle.ply", "camera 7"])
        self.fail_with_one_line("render", file, "--camera", "7", "-o", "x.png", names=["triangle.ply", "camera 7"])
        self.fail_with_usage("render", file, "-o", "x.bmp", "--size", "4x4", names=["--output", "x.bmp"])
        self.fail_with_one_line("trace", file, "--rays", "absent.npy", names=["absent.npy"])
        self.fail_with_one_line("trace", file, "--rays", self.write("bad.npy", b"\x93NUMPY"), names=["bad.npy"])

    def test_a_device_that_is_not_there(self):
        soup = "builtin:soup?triangles=100"
        for tree in ((), ("--builder", "hploc"), ("--tree", "kdtree"), ("--tree", "octree")):
            for command in (("build", soup, "--repeat", "1"), ("check", soup)):
                done = self.run_program(*command, "--device", "cuda", "--quiet", *tree)
                if done.code != 0:  # where a GPU is, the build has nothing to complain about
                    self.assertEqual(done.code, 1)
                    self.assert_one_line(done)
                    self.assertRegex(done.err, "CUDA")
        self.fail_with_usage("trace", SMALL, "--device", "cuda", "--kernel", "scalar", names=["--kernel"])
        self.fail_with_usage("render", SMALL, "-o", "x.png", "--device", "cuda", names=["--device"])

    def test_an_unreadable_file(self):
        file = self.write("locked.ply", TRIANGLE)
        os.chmod(file, 0)
        if os.access(file, os.R_OK):
            self.skipTest("this user may read every file")
        self.fail_with_one_line("info", file, names=["locked.ply"])

    def test_unwritable_outputs(self):
        for arguments in (["build", SMALL, "-o", "no/x.rdx"], ["build", SMALL, "--quiet", "--json", "no/x.json"],
                          ["trace", SMALL, "--size", "4x4", "--hits", "no/h.npy"],
                          ["trace", SMALL, "--size", "4x4", "--save-rays", "no/r.npy"],
                          ["render", SMALL, "--size", "4x4", "-o", "no/x.png"],
                          ["render", SMALL, "--size", "4x4", "-o", "no/x.exr"]):
            result = self.run_program(*arguments)
            self.assertEqual((result.code, result.err.count("\n")), (1, 1), result)
            self.assertIn("no/", result.err)

    def test_a_full_standard_output(self):
        if not os.path.exists("/dev/full"):
            self.skipTest("there is no /dev/full")
        for arguments in (["scenes"], ["info", SMALL], ["build", SMALL, "--json", "-"], ["--version"], ["--help"], ["man", "trace"]):
            with open("/dev/full", "w") as full:
                done = subprocess.run([PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, timeout=TIME_LIMIT_S)
            self.assertEqual((done.returncode, done.stderr.count(b"\n")), (1, 1), done)
            self.assertIn(b"raydix: standard output: cannot be written", done.stderr)

    def test_geometry_errors_name_the_file(self):
        nan = self.write("nan.ply", ply([(0, 0, 0), (1, 0, 0), ("nan", 1, 0), (0, 1, 0)], [(0, 1, 3), (0, 1, 2)]))
        for command in ("build", "check", "trace"):
            self.fail_with_one_line(command, nan, "--strict", names=["nan.ply", "triangle 1"])
        self.assertEqual(self.document("build", nan)["build"]["left_out"], 1)
        far = self.write("far.ply", ply([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 3)]))
        self.fail_with_one_line("build", far, names=["far.ply", "3"])
        points = self.write("points.ply", ply([(0, 0, 0), (1, 0, 0)]))
        self.fail_with_one_line("trace", points, names=["points.ply", "points"])
        self.fail_with_one_line("build", points, "--layout", "compact", "--quiet", names=["points.ply", "rays need triangles"])
        for options in ((), ("--builder", "ploc")):
            self.fail_with_one_line("render", points, "-o", "x.png", *options, names=["points.ply", "points", "--view tree", "--view slice"])
        for view in ("tree", "slice"):
            self.succeed("render", points, "-o", "x.png", "--size", "8x8", "--view", view)

    def test_odd_file_names(self):
        for name in (b"caf\xe9.ply", "gr\u00fcn \u6728.ply".encode(), b"two\nlines.ply", b"-dash.ply", b"\x1b[31m.ply"):
            path = os.path.join(os.fsencode(self.folder), name)
            with open(path, "wb") as file:
                file.write(TRIANGLE.encode())
            self.assertEqual(json_of(self.succeed("info", path, "--json", "-").out)["scene"]["triangles"], 1)
            self.succeed("info", path, "--quiet")
            with open(path, "wb") as file:
                file.write(TRIANGLE[:40].encode())
            self.fail_with_one_line("build", path)

    def test_a_file_is_written_once_and_never_over_what_is_read(self):
        file = self.write("one.ply", TRIANGLE)
        for name, to in (("link.ply", "one.ply"), ("to_h.npy", "h.npy"), ("to_link.npy", "to_h.npy")):
            os.symlink(to, os.path.join(self.folder, name))
        self.succeed("info", file, "--json", "one.json")
        before = {name: open(os.path.join(self.folder, name), "rb").read() for name in ("one.ply", "one.json")}
        rays = ["trace", file, "--size", "4x4", "--samples", "1"]
        for arguments, names in ((["report", "one.json", "-o", "./one.json"], ["--output", "one.json", "RESULT"]),
                                 (["info", file, "--json", "link.ply"], ["--json", "link.ply"]),
                                 ([*rays, "--hits", "h.npy", "--save-rays", os.path.join(self.folder, "h.npy")], ["h.npy"]),
                                 ([*rays, "--hits", "h.npy", "--json", "h.npy"], ["--hits", "--json"]),
                                 ([*rays, "--hits", "to_link.npy", "--json", "h.npy"], ["--hits", "--json"]),
                                 (["build", file, "-o", "a.rdx", "--json", "a.rdx"], ["--json", "--output"])):
            with self.subTest(arguments[0], names=names):
                self.fail_with_usage(*arguments, names=names)
        self.assertEqual(before, {name: open(os.path.join(self.folder, name), "rb").read() for name in before})
        self.assertEqual([name for name in ("h.npy", "a.rdx") if os.path.exists(os.path.join(self.folder, name))], [])
        self.succeed("build", file, "-o", "again.rdx")
        self.succeed("build", "again.rdx", "-o", "again.rdx")  # a tree may be built anew in its place
        self.succeed("check", "again.rdx")
        self.succeed(*rays, "--hits", "/dev/null", "--json", "/dev/null", "--quiet")

    def test_files_that_a_name_stands_for_are_not_replaced(self):
        (self.folder / "implied").mkdir()
        camera = {"name": "c", "position": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0], "vfov": 40}
        mesh = self.write("implied/mesh.ply", TRIANGLE)
        gltf = self.write("implied/s.gltf", json.dumps({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "a%20b.bin"}]}))
        buffer = self.write("implied/a b.bin", struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0))
        cameras = self.write("implied/cameras.json", json.dumps([camera]))
        queries = str(self.folder / "implied/w.distances.npy")
        write_npy(queries, "<f4", (1, 3), struct.pack("<3f", 0, 0, 0))
        before = {file.name: file.read_bytes() for file in (self.folder / "implied").iterdir()}
        trace = ["--size", "4x4", "--repeat", "1"]
        out = str(self.folder / "implied/w")
        for arguments, names in ((["trace", mesh, *trace, "--json", cameras], ["cameras.json", "SCENE"]),
                                 (["trace", gltf, *trace, "--hits", buffer], ["--hits", "a b.bin", "SCENE"]),
                                 (["query", mesh, "--pairs", "--with", gltf, "--json", buffer], ["--json", "--with"]),
                                 (["build", gltf, "-o", buffer], ["--output", "SCENE"]),
                                 (["build", mesh, "-o", mesh], ["--output", "SCENE"]),
                                 (["query", mesh, "--knn", "1", "--queries", queries, "--out", out], ["--out", "--queries"]),
                                 (["query", mesh, "--knn", "1", "--out", out, "--json", out + ".indices.npy"], ["--json", "--out"]),
                                 (["trace", mesh, *trace, "--mode", "all", "--hits", out + ".npy", "--save-rays", out + ".offsets.npy"],
                                  ["--hits", "--save-rays"]),
                                 (["check", "--same", mesh, gltf, "--json", mesh], ["--json", "--same"])):
            with self.subTest(arguments[0], names=names):
                self.fail_with_usage(*arguments, names=names)
        self.assertEqual(before, {file.name: file.read_bytes() for file in (self.folder / "implied").iterdir()})
        self.succeed("trace", mesh, *trace, "--hits", out + ".npy", "--save-rays", out + ".offsets.npy")  # no --mode all
        self.succeed("trace", gltf, *trace, "--json", out + ".json")

    def test_quiet_prints_nothing(self):
        file = self.write("quiet.ply", TRIANGLE)
        for arguments in (["info", file], ["scenes"], ["build", file, "-o", "quiet.rdx"], ["check", "quiet.rdx"],
                          ["check", "--same", "quiet.rdx", file], ["trace", file, "--size", "8x8", "--explain"],
                          ["render", file, "--size", "8x8", "-o", "quiet.png"]):
            self.assertEqual(self.succeed(*arguments, "--quiet").out, "")
            self.assertNotEqual(self.succeed(*arguments).out, "")

    def test_json_to_a_file(self):
        printed = self.succeed("build", SMALL, "--json", "out.json").out
        document = json_of((self.folder / "out.json").read_text())
        self.assertIn(document["build"]["tree_hash"], printed)
        self.assertEqual(self.succeed("build", SMALL, "--quiet", "--json", "out.json").out, "")

    def test_epo_with_and_without_a_value(self):
        self.assertIsNone(self.document("build", MEDIUM)["build"]["epo"])
        bare = self.document("build", MEDIUM, "--epo")["build"]["epo"]
        self.assertGreater(bare, 0)
        self.assertEqual(self.document("build", MEDIUM, "--epo", "1")["build"]["epo"], bare)
        self.assertEqual(self.document("build", "--epo", "--bits", "63", MEDIUM)["build"]["epo"], bare)
        self.assertGreater(self.document("build", MEDIUM, "--epo", "0.5")["build"]["epo"], 0)

    def test_progress_only_on_a_terminal(self):
        command = ["render", "builtin:figure?triangles=20000", "--view", "ao", "--size", "1600x1200", "-o", "p.png"]
        samples = 4 if SANITIZED else 64
        for _ in range(8):
            started = time.monotonic()
            self.succeed(*command, "--samples", str(samples))  # to a pipe: nothing on standard error
            if time.monotonic() - started > 2.5:
                break
            samples *= 2
        shown = self.on_terminal(*command, "--samples", str(samples))
        both = self.on_terminal(*command, "--samples", str(samples), with_tables=True)
        self.assertRegex(both, rb" %\r\x1b\[Kp\.png \(1600 x 1200", "the bar is not wiped before the result")
        self.assertRegex(shown, rb"\rrendering \[#*\.*\] +\d+ %")
        self.assertTrue(shown.rstrip().endswith(b"\r\x1b[K"), "the bar is not wiped at the end")
        self.assertEqual(self.on_terminal(*command, "--samples", str(samples), "--quiet"), b"")

    def on_terminal(self, *arguments, with_tables=False):
        ours, theirs = pty.openpty()
        process = subprocess.Popen([PROGRAM, *arguments], stdout=theirs if with_tables else subprocess.DEVNULL, stderr=theirs, cwd=self.folder)
        os.close(theirs)
        shown = b""
        try:
            while chunk := os.read(ours, 4096):
                shown += chunk
        except OSError:  # the other end is closed
            pass
        os.close(ours)
        self.assertEqual(process.wait(TIME_LIMIT_S), 0)
        return shown


if __name__ == "__main__":
    main()
