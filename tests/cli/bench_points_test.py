"""raydix bench points: the program beside raydix, its document and its usage errors."""
import pathlib
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from program import PROGRAM, ProgramTest, main  # noqa: E402

BESIDE = (pathlib.Path(PROGRAM).parent / "bench_points").exists()
SMALL = ("bench", "points", "builtin:clustered?points=3000", "--rounds", "2", "--threads", "2")


class BenchPoints(ProgramTest):
    def test_without_the_program(self):
        alone = self.folder / "raydix"
        shutil.copy(PROGRAM, alone)
        done = subprocess.run([alone, "bench", "points"], capture_output=True, text=True)
        ProgramTest.runs += 1
        self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (1, "", 1), done)
        for word in ("raydix: bench points", "bench_points", "libnanoflann-dev"):
            self.assertIn(word, done.stderr)

    @unittest.skipUnless(BESIDE, "bench_points is not built: RAYDIX_BENCH is off or nanoflann is missing")
    def test_document(self):
        for clock in ("wall", "cpu"):
            document = self.document(*SMALL, "--leaf", "10,32", "--clock", clock)
            self.assertEqual(document["command"], "bench points")
            self.assertRegex(document["nanoflann"], r"^\d+\.\d+\.\d+$")
            (scene,) = document["scenes"]
            self.assertEqual((scene["points"], scene["queries"]), (3000, 3000))
            self.assertGreater(scene["found_by_radius"], 5)
            self.assertLess(scene["found_by_radius"], 20)
            self.assertEqual([c["question"] for c in scene["contests"]],
                             ["build, one thread", "knn random", "radius random", "knn single random", "knn ordered",
                              "radius ordered", "knn single ordered"])
            for contest in scene["contests"]:
                ours, *peers = (spread["median"] for spread in contest["ns"].values())
                self.assertEqual(len(peers), 2)
                self.assertAlmostEqual(contest["ratio"], ours / min(peers))

    @unittest.skipUnless(BESIDE, "bench_points is not built")
    def test_tables_and_errors(self):
        one_leaf = (*SMALL, "--leaf", "10")  # of several leaf sizes, the table names only the fastest of each row
        printed = self.succeed(*one_leaf).out
        for words in ("build, one thread", "knn random", "radius ordered", "knn single ordered", "ratio"):
            self.assertIn(words, printed)
        self.assertEqual(printed.count("(leaf 10)"), 7)
        self.assertEqual(self.succeed(*SMALL, "--quiet").out, "")
        for bad in (["--leaf", "0"], ["--clock", "sun"], ["--radius", "-1"], ["--nothing"]):
            self.fail_with_usage(*SMALL, *bad)
        self.fail_with_one_line("bench", "points", "absent.ply", names=["absent.ply"])


if __name__ == "__main__":
    main()
