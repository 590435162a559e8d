"""scripts/mutate.py: every fault that it plants still applies, and changes something."""
import fnmatch
import importlib.util
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def mutate():
    spec = importlib.util.spec_from_file_location("mutate", ROOT / "scripts" / "mutate.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutate"] = module  # where its dataclass looks itself up
    spec.loader.exec_module(module)
    return module


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
