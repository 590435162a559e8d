"""scripts/check_includes.py finds each kind of fault in a small tree that holds it."""
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import check_includes  # noqa: E402

CLEAN = {
    "include/raydix/types.h": "#include <array>\n",
    "include/raydix/bvh.h": "#include <raydix/types.h>\n",
    "src/base/math.h": "#include <raydix/types.h>\n",
    "src/exec/parallel.cpp": '#include <tbb/parallel_for.h>\n#include "base/math.h"\n',
    "src/tree/fit.h": '#include <raydix/bvh.h>\n#include "base/math.h"\n',
    "src/build/build.cpp": '#include "tree/fit.h"\n',
    "cli/main.cpp": "#include <raydix/bvh.h>\n",
}
FAULTS = {
    "a lower folder includes a higher one": ("src/base/math.h", '#include "tree/fit.h"\n', "src/base/math.h:1: src/base may not"),
    "base includes a public header of a later step": ("src/base/math.h", "\n#include <raydix/bvh.h>\n", "src/base/math.h:2: src/base may not"),
    "a folder that is not in the table": ("src/other/a.h", '#include "base/math.h"\n', "src/other/a.h:1: folder src/other"),
    "TBB outside of exec/parallel.cpp": ("src/tree/fit.h", "#include <tbb/task_arena.h>\n", "src/tree/fit.h:1: src/tree/fit.h may not"),
    "CUDA in a public header": ("include/raydix/types.h", "#include <cuda_runtime.h>\n", "include/raydix/types.h:1:"),
    "the program includes the core": ("cli/main.cpp", '#include "tree/fit.h"\n', "cli/main.cpp:1: cli may include"),
    "a path relative to the file": ("src/tree/fit.h", '#include "../base/math.h"\n', "src/tree/fit.h:1:"),
    "a header that is gone": ("src/tree/fit.h", "#include <raydix/gone.h>\n", "src/tree/fit.h:1: <raydix/gone.h> does not exist"),
    "a circle": ("include/raydix/types.h", "#include <raydix/bvh.h>\n", "the includes go in a circle"),
    "a long file": ("src/tree/fit.h", "\n" * 701, "src/tree/fit.h:701: 701 lines"),
}


class CheckIncludes(unittest.TestCase):
    def faults_of(self, files):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name, text in files.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text, encoding="utf-8")
            return check_includes.check(root)[0]

    def test_a_clean_tree_has_no_faults(self):
        self.assertEqual(self.faults_of(CLEAN), [])

    def test_each_fault_is_found_where_it_is(self):
        for what, (file, text, expected) in FAULTS.items():
            with self.subTest(what):
                faults = self.faults_of({**CLEAN, file: text})
                self.assertTrue(any(expected in fault for fault in faults), faults)

    def test_a_circle_in_the_table(self):
        graph = {"a": {(1, "b")}, "b": {(2, "c")}, "c": {(3, "a")}}
        self.assertEqual(check_includes.cycles_of(graph), ["c:3: the includes go in a circle: a -> b -> c -> a"])


if __name__ == "__main__":
    unittest.main()
