"""The repository stays light: no file that git keeps is larger than 1 MB."""
import pathlib
import shutil
import subprocess
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Light(unittest.TestCase):
    def test_no_file_is_above_1_mb(self):
        if shutil.which("git") is None or not (ROOT / ".git").exists():
            self.skipTest("no git here")
        names = subprocess.run(["git", "-c", f"safe.directory={ROOT}", "ls-files", "-z"], cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout
        files = [ROOT / name for name in names.decode().split("\0") if name]
        self.assertGreater(len(files), 100)
        self.assertEqual([file.name for file in files if file.is_file() and file.stat().st_size > 1_000_000], [])


if __name__ == "__main__":
    unittest.main()
