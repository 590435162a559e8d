"""The README's C++ example is examples/first_hit.cpp, word for word; its pictures and links exist; the map of folders is whole."""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


class Readme(unittest.TestCase):
    def test_the_example_is_the_compiled_one(self):
        blocks = re.findall(r"```cpp\n(.*?)```", README, re.DOTALL)
        self.assertEqual(blocks, [(ROOT / "examples" / "first_hit.cpp").read_text(encoding="utf-8")])
        self.assertEqual(len(blocks[0].splitlines()), 12)

    def test_links_of_all_documents_lead_somewhere(self):
        links = 0
        for document in [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")]:
            prose = re.sub(r"```.*?```", "", document.read_text(encoding="utf-8"), flags=re.DOTALL)
            for link in re.findall(r"\]\(([^)#]+)[^)]*\)", prose):
                if "://" not in link:
                    links += 1
                    self.assertTrue((document.parent / link).exists(), f"{document.name}: {link}")
        self.assertGreater(links, 5)

    def test_pictures_are_small(self):
        pictures = list((ROOT / "docs" / "images").glob("*.png"))
        self.assertTrue(pictures)
        for picture in pictures:
            self.assertLess(picture.stat().st_size, 300_000, picture.name)

    def test_the_first_commands_are_the_two_that_matter(self):
        commands = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
        self.assertEqual([line.split()[0] for line in commands[0].splitlines()], ["scripts/demo", "scripts/test"])

    def test_it_is_one_page(self):
        self.assertLessEqual(len(README.splitlines()), 120)

    def test_the_map_names_every_folder_of_the_core(self):
        architecture = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
        for folder in sorted(p.name for p in (ROOT / "src").iterdir() if p.is_dir()):
            self.assertRegex(architecture, rf"`(src/)?{folder}`", f"src/{folder} is missing")


if __name__ == "__main__":
    unittest.main()
