"""scripts/build_timings.py: the last time of each file that is still there, the slowest first."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "build_timings.py"
LOG = """# ninja log v5
0\t9000\t1\tCMakeFiles/raydix.dir/src/build/wide.cpp.o\tab
100\t2600\t1\tCMakeFiles/raydix.dir/src/build/wide.cpp.o\tab
0\t4000\t1\tcli/CMakeFiles/raydix_commands.dir/trace.cpp.o\tac
0\t70000\t1\tCMakeFiles/raydix.dir/src/build/gone.cpp.o\tad
4000\t4500\t1\tbin/raydix\tae
"""


def run(folder, *arguments):
    return subprocess.run([sys.executable, SCRIPT, folder, *arguments], capture_output=True, text=True, check=False)


class BuildTimings(unittest.TestCase):
    def test_the_slowest_first(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / ".ninja_log").write_text(LOG, encoding="utf-8")
            for output in ("CMakeFiles/raydix.dir/src/build/wide.cpp.o", "cli/CMakeFiles/raydix_commands.dir/trace.cpp.o",
                           "bin/raydix"):
                (folder / output).parent.mkdir(parents=True, exist_ok=True)
                (folder / output).touch()
            lines = run(folder, "2").stdout.splitlines()
        self.assertEqual(lines[:3], ["3 steps, 7 s together; the slowest:",
                                     "     4.0 s  raydix_commands: cli/trace.cpp",
                                     "     2.5 s  raydix: src/build/wide.cpp"])
        self.assertEqual(lines[3:5], ["by folder:", "     4.0 s  raydix_commands: cli"])

    def test_a_folder_without_a_log(self):
        with tempfile.TemporaryDirectory() as name:
            result = run(name)
        self.assertEqual(result.returncode, 1)
        self.assertIn("nothing was built", result.stderr)


if __name__ == "__main__":
    unittest.main()
