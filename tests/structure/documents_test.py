"""Pages that speak of the code: snippets are those that are compiled, names and files exist, sections that headers cite exist."""
import pathlib
import re
import textwrap
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def text_of(file):
    return (ROOT / file).read_text(encoding="utf-8")


def sources(folders, ends):
    return [f for folder in folders for f in sorted((ROOT / folder).rglob("*")) if f.suffix in ends]


class Questions(unittest.TestCase):
    def test_code_is_that_of_the_example(self):
        example = text_of("examples/questions.cpp")
        parts = re.findall(r"^ *// \[[a-z-]+\]\n(.*?)^ *// \[end\]\n", example, re.DOTALL | re.MULTILINE)
        blocks = re.findall(r"```cpp\n(.*?)```", text_of("docs/questions.md"), re.DOTALL)
        self.assertEqual(len(blocks), 11)  # the tools and ten questions
        self.assertEqual(blocks, [textwrap.dedent(part) for part in parts])

    def test_headers_exist(self):
        lines = re.findall(r"^Headers: (.*)$", text_of("docs/questions.md"), re.MULTILINE)
        self.assertEqual(len(lines), 10)
        for name in re.findall(r"`([^`]+)`", " ".join(lines)):
            self.assertTrue((ROOT / "include" / "raydix" / name).exists(), name)


class Site(unittest.TestCase):
    def test_every_public_header_has_a_place_in_the_reference(self):
        named = re.findall(r"^```\{doxygenfile\} (.*)$", "\n".join(text_of(p) for p in sorted((ROOT / "docs/cpp").glob("*.md"))),
                           re.MULTILINE)
        headers = {h.name for h in (ROOT / "include/raydix").glob("*.h")} - {"raydix.h", "expert.h", "version.h"}
        self.assertEqual(sorted(named), sorted(headers))

    def test_every_page_is_reached_from_the_start(self):
        seen, todo = set(), ["index"]
        while todo:
            page = todo.pop()
            if page in seen:
                continue
            seen.add(page)
            text = text_of(f"docs/{page}.md")
            for tree in re.findall(r"```\{toctree\}\n(.*?)```", text, re.DOTALL):
                for entry in (line for line in tree.splitlines() if line and not line.startswith(":")):
                    folder = (ROOT / "docs" / page).parent
                    found = [folder / f"{entry}.md"] if "*" not in entry else sorted(folder.glob(f"{entry}.md"))
                    todo += [str(f.relative_to(ROOT / "docs").with_suffix("")) for f in found]
        pages = {str(p.relative_to(ROOT / "docs").with_suffix("")) for p in (ROOT / "docs").rglob("*.md")}
        self.assertEqual(pages, seen)


class Contract(unittest.TestCase):
    def test_cited_sections_exist(self):
        sections = set(re.findall(r"^## (\d+)\.", text_of("docs/contract.md"), re.MULTILINE))
        cited = 0
        for file in sources(["include", "src", "cli", "tests"], {".h", ".cpp", ".cu", ".cuh"}):
            text = re.sub(r"\n\s*// ?/? ?", " ", file.read_text(encoding="utf-8"))
            for page, number in re.findall(r"(\S*)contract\.md,?(?: section)? (\d+)", text):
                cited += 1
                self.assertIn(number, sections, file)
                if "include" in file.relative_to(ROOT).parts:
                    self.assertTrue(page.endswith("docs/"), f"{file}: cites no page of the repository")
        self.assertGreater(cited, 10)


class Glossary(unittest.TestCase):
    def test_files_exist_and_use_the_word(self):
        rows = re.findall(r"^\| \*\*(.+?)\*\* \| .* \| (.+?) \|$", text_of("docs/glossary.md"), re.MULTILINE)
        self.assertGreater(len(rows), 60)
        self.assertEqual(rows, sorted(rows, key=lambda row: row[0].lower()))
        for words, places in rows:
            files = re.findall(r"`([^`]+)`", places)
            self.assertTrue(files, words)
            text = ""
            for file in files:
                self.assertTrue((ROOT / file).is_file(), f"{words}: {file}")
                text += file + text_of(file)
            for word in words.split(", "):
                stem = re.sub(r"\W|_", "", word.lower())
                self.assertIn(stem[:-1], re.sub(r"\W|_", "", text.lower()), f"{word} is not in {files}")


class Architecture(unittest.TestCase):
    def test_files_and_functions_exist(self):
        page = text_of("docs/architecture.md")
        page = re.sub(r"```.*?```", "", page, flags=re.DOTALL)
        code = "\n".join(f.read_text(encoding="utf-8") for f in
                         sources(["include", "src", "python", "scripts", "tests", "cli"],
                                 {".h", ".cpp", ".cu", ".cuh", ".py", ".txt"}))
        files = {str(f.relative_to(ROOT)) for folder in ["include", "src", "python", "scripts", "tests", "docs", "cli"]
                 for f in (ROOT / folder).rglob("*")}
        for name in re.findall(r"`([^`\n]+)`", page):
            if re.fullmatch(r"[\w/]+\.(h|cpp|cu|cuh|py)|\w+(/\w+)+", name):
                self.assertTrue(any(f == name or f.endswith("/" + name) for f in files), name)
            elif re.fullmatch(r"\w+(::\w+)*", name):
                self.assertRegex(code, rf"\b{name.split('::')[-1]}\b", name)


if __name__ == "__main__":
    unittest.main()
