"""scripts/mutate.py: every fault that it plants still applies, and changes something."""
import fnmatch
import importlib
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def mutate():
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(ROOT / "scripts"))
    return importlib.import_module("mutate")


class Faults(unittest.TestCase):
    def test_old_text_stands_once(self):
        for number, fault in enumerate(mutate().FAULTS, 1):
            with self.subTest(number=number, file=fault.file, breaks=fault.breaks):
                file = ROOT / fault.file
                self.assertTrue(file.is_file())
                self.assertEqual(file.read_text(encoding="utf-8").count(fault.old), 1)
                self.assertNotEqual(fault.old, fault.new)

    def test_there_are_many(self):
        self.assertGreaterEqual(len(mutate().FAULTS), 60)

    def test_long_tests_are_there(self):
        """A name that no test has would leave that test among those that look first."""
        for folder, names in mutate().LONG.items():
            sources = [f.read_text(encoding="utf-8") for f in (ROOT / "tests" / folder).glob("*_test.cpp")]
            tests = [".".join(m) for text in sources for m in re.findall(r"^TEST(?:_[FP])?\((\w+), *(\w+)\)", text, re.M)]
            for name in names:
                self.assertTrue(fnmatch.filter(tests, name), f"{folder}: {name}")


if __name__ == "__main__":
    unittest.main()
