"""Options of the program: each stands in a page, and the page of the program names no others."""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
OPTION = r"--[a-z][a-z0-9-]*"


def options_of(folder):
    """Names in add_option, add_flag and the like: "--name" or "-n,--name", and nothing else in the string."""
    files = sorted(f for f in (ROOT / folder).rglob("*") if f.suffix in {".cpp", ".h"})
    return {name for f in files for name in re.findall(rf'"(?:-\w,)?({OPTION})"', f.read_text(encoding="utf-8"))}


def options_in(text):
    return set(re.findall(rf"(?<![\w-])({OPTION})(?![\w-])", text))


class Options(unittest.TestCase):
    def test_each_stands_in_a_page(self):
        pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
        named = set().union(*(options_in(page.read_text(encoding="utf-8")) for page in pages))
        options = options_of("cli")
        self.assertGreater(len(options), 80)
        self.assertEqual(sorted(options - named), [])

    def test_the_page_of_the_program_names_no_others(self):
        named = options_in((ROOT / "docs/guide/program.md").read_text(encoding="utf-8"))
        self.assertEqual(sorted(named - options_of("cli") - {"--help"}), [])


if __name__ == "__main__":
    unittest.main()
