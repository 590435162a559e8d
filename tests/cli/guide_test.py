"""The shell commands in the guides do what they say: they end with exit code 0."""
import os
import pathlib
import subprocess
import sys

sys.dont_write_bytecode = True
from program import PROGRAM, ProgramTest, main  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Guides(ProgramTest):
    def test_every_command_runs(self):
        path = f"{pathlib.Path(PROGRAM).resolve().parent}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run([sys.executable, ROOT / "scripts/snippets.py", "sh", *sorted(ROOT.glob("docs/guide/*.md"))],
                              env={**os.environ, "PATH": path}, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("blocks of sh", done.stdout)
        ProgramTest.runs += done.stdout.count("blocks")


if __name__ == "__main__":
    main()
