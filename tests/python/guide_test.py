"""The Python in the guides, the tour and the README runs, page by page."""
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "docs/tour.md", *sorted((ROOT / "docs/guide").glob("*.md"))]


@pytest.mark.parametrize("page", [p for p in PAGES if "```python\n" in p.read_text("utf-8")], ids=lambda p: p.stem)
def test_the_code_runs(page):
    done = subprocess.run([sys.executable, ROOT / "scripts/snippets.py", "python", page], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
