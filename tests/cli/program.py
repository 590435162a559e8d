"""Runs the raydix program for the tests and reads the files that it writes, with the standard library alone."""
import ast
import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

PROGRAM = os.environ.get("RAYDIX_PROGRAM", "build/release/bin/raydix")
SHARED_SCENES = pathlib.Path(os.environ.get("RAYDIX_SHARED_SCENES", "../shared/scenes"))
SANITIZED = bool(os.environ.get("RAYDIX_SANITIZE"))
TIME_LIMIT_S = 600 if SANITIZED else 120
COMMANDS = ("info", "scenes", "build", "check", "trace", "render", "query")

MISS = 0xFFFFFFFF


class Result:
    def __init__(self, arguments, done):
        self.arguments, self.code = arguments, done.returncode
        self.out = done.stdout.decode("utf-8", "strict")
        self.err = done.stderr.decode("utf-8", "replace")

    def __str__(self):
        return f"raydix {self.arguments}\nexit code {self.code}\n{self.out}\n{self.err}"


def no_constant(name):
    raise ValueError(f"{name} is not JSON")


def json_of(text):
    return json.loads(text, parse_constant=no_constant)


class ProgramTest(unittest.TestCase):
    """A test with a folder of its own for the program's files."""

    runs = 0

    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory(prefix="raydix-cli-")
        cls.addClassCleanup(holder.cleanup)
        cls.folder = pathlib.Path(holder.name)

    def run_program(self, *arguments, **options):
        ProgramTest.runs += 1
        done = subprocess.run([PROGRAM, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=TIME_LIMIT_S, cwd=self.folder, **options)
        return Result(arguments, done)

    def succeed(self, *arguments):
        result = self.run_program(*arguments)
        self.assertEqual(result.code, 0, result)
        self.assertEqual(result.err, "", result)
        return result

    def document(self, *arguments):
        """Runs with --json -; standard output must be one document and nothing else."""
        return json_of(self.succeed(*arguments, "--json", "-").out)

    def fail_with_one_line(self, *arguments, names=()):
        """Exit code 1, nothing on standard output, one line on standard error that holds all of `names`."""
        result = self.run_program(*arguments)
        self.assert_one_line(result)
        for name in names:
            self.assertIn(name, result.err, result)
        return result

    def assert_one_line(self, result):
        self.assertEqual(result.code, 1, result)
        self.assertEqual(result.out, "", result)
        self.assertEqual(result.err.count("\n"), 1, result)
        self.assertTrue(result.err.startswith("raydix: ") and result.err.endswith("\n"), result)
        self.assertGreater(len(result.err), len("raydix: x: y"), result)

    def fail_with_usage(self, *arguments, names=()):
        """Exit code 2, nothing on standard output, one line on standard error that holds all of `names`."""
        result = self.run_program(*arguments)
        self.assertEqual(result.code, 2, result)
        self.assertEqual(result.out, "", result)
        self.assertRegex(result.err, r"\Araydix: .+; run with --help for more information\n\Z", result)
        self.assertEqual(result.err.count("\n"), 1, result)
        for name in names:
            self.assertIn(name, result.err, result)

    def write(self, name, content):
        file = self.folder / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return str(file)


def ply(vertices, faces=()):
    """A mesh as an ascii PLY file; without faces a point cloud."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}",
             "property float x", "property float y", "property float z"]
    if faces:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines.append("end_header")
    lines += [" ".join(str(x) for x in v) for v in vertices]
    lines += [" ".join(str(x) for x in (len(f), *f)) for f in faces]
    return "\n".join(lines) + "\n"


TRIANGLE = ply([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])


def read_npy(file):
    """Returns (descr, shape, bytes of the elements)."""
    content = pathlib.Path(file).read_bytes()
    assert content[:6] == b"\x93NUMPY", content[:6]
    wide = content[6] >= 2
    (length,) = struct.unpack_from("<I" if wide else "<H", content, 8)
    start = (12 if wide else 10) + length
    header = ast.literal_eval(content[start - length:start].decode("latin-1").strip())
    assert header["fortran_order"] is False
    return header["descr"], header["shape"], content[start:]


def write_npy(file, descr, shape, data):
    header = repr({"descr": descr, "fortran_order": False, "shape": shape}).encode()
    header += b" " * (-(10 + len(header) + 1) % 64) + b"\n"
    pathlib.Path(file).write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + data)


def read_hits(file):
    """[(t, prim, u, v)]"""
    descr, shape, data = read_npy(file)
    assert descr == [("t", "<f4"), ("prim", "<u4"), ("u", "<f4"), ("v", "<f4")], descr
    hits = list(struct.iter_unpack("<fIff", data))
    assert shape == (len(hits),), shape
    return hits


def read_rays(file):
    """[(ox, oy, oz, tmin, dx, dy, dz, tmax)]"""
    descr, shape, data = read_npy(file)
    assert descr == "<f4" and shape[1:] == (8,), (descr, shape)
    rays = list(struct.iter_unpack("<8f", data))
    assert shape[0] == len(rays), shape
    return rays


def read_png(file):
    """(width, height, values): an 8-bit RGB picture with right checksums; how many different bytes its rows hold."""
    content = pathlib.Path(file).read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    at, data, size = 8, b"", None
    while at < len(content):
        length, kind = struct.unpack_from(">I4s", content, at)
        body = content[at + 8:at + 8 + length]
        assert struct.unpack_from(">I", content, at + 8 + length)[0] == zlib.crc32(kind + body), kind
        if kind == b"IHDR":
            size = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            data += body
        at += 12 + length
    width, height, depth, colour = size[:4]
    assert (depth, colour) == (8, 2), (depth, colour)
    rows = zlib.decompress(data)
    assert len(rows) == height * (3 * width + 1)
    return width, height, len(set(rows))


def signal_name(code):
    return signal.Signals(-code).name if code < 0 else None


def main():
    """Runs the tests of the script: exits 77, which CTest reads as skipped, where every one was skipped."""
    result = unittest.main(exit=False, verbosity=1).result
    print(f"{result.testsRun} tests, {ProgramTest.runs} runs of the program", file=sys.stderr)
    for reason in sorted({reason for _, reason in result.skipped}):
        print(f"skipped: {reason}", file=sys.stderr)
    if result.wasSuccessful() and not ProgramTest.runs and result.skipped:
        sys.exit(77)
    sys.exit(0 if result.wasSuccessful() and ProgramTest.runs else 1)
