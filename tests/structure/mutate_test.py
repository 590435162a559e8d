"""scripts/mutate.py: every fault that it plants still applies, and changes something."""
import importlib.util
import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def faults():
    spec = importlib.util.spec_from_file_location("mutate", ROOT / "scripts" / "mutate.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutate"] = module  # where its dataclass looks itself up
    spec.loader.exec_module(module)
    return module.FAULTS


class Faults(unittest.TestCase):
    def test_old_text_stands_once(self):
        for number, fault in enumerate(faults(), 1):
            with self.subTest(number=number, file=fault.file, breaks=fault.breaks):
                file = ROOT / fault.file
                self.assertTrue(file.is_file())
                self.assertEqual(file.read_text(encoding="utf-8").count(fault.old), 1)
                self.assertNotEqual(fault.old, fault.new)

    def test_there_are_many(self):
        self.assertGreaterEqual(len(faults()), 60)


if __name__ == "__main__":
    unittest.main()
