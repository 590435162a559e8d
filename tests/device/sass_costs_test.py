"""sass_costs_test.py SCRIPT: what scripts/sass_costs counts in a disassembly small enough to count by pencil."""
import importlib.machinery
import importlib.util
import pathlib
import sys
import unittest

SOURCE = """\
RAYDIX_HD void start_batch() {
    warp.step(Op::start_ray, [&](Lane& l) { start_ray(l); });
}
RAYDIX_HD void turn() {
    warp.loop(Op::node_loop, at_inner_node, [&] {
        visit_once(warp); take(warp);
    take(warp);
}
RAYDIX_HD void visit_once() {
    warp.step(Op::visit_node, [&](Lane& l) { visit_node(l); });
    warp.when([](const Lane& l) { return must_push(l); },
}
RAYDIX_HD void take() {
    warp.any_of(
        warp.step(
            Op::pop, [](Lane& l) { pop(l); });
}
"""


class SassCosts(unittest.TestCase):
    def setUp(self):
        self.texts = {"per_ray.h": SCRIPT.Text(SOURCE.splitlines())}
        fixture = pathlib.Path(__file__).with_name("sass_fixture.txt").read_text(encoding="utf-8")
        table, self.opcodes, notes = SCRIPT.count_all(fixture, self.texts)
        self.row, self.notes = table["while_while"], notes["while_while"]

    def test_operations_of_lines(self):
        text = self.texts["per_ray.h"]
        self.assertEqual(text.operation_of(2), ("start_ray", 2))
        self.assertEqual(text.operation_of(11), ("visit_node", 10))  # the last named above it
        self.assertEqual(text.operation_of(15), ("pop", 15))         # named on the next line
        self.assertEqual(text.operation_of(16), ("pop", 15))         # of the same call
        self.assertIsNone(text.operation_of(9))                      # nothing is named yet

    def test_counts(self):
        # Three of the step, and the condition behind it, whose line names no operation.
        self.assertEqual(self.row["visit_node"], 4)
        # Two and four instructions at two inlined places; a call over two lines is one place.
        self.assertEqual(self.row["pop"], 3)
        # The vote's branch and the branch back.
        self.assertEqual(self.row["node_loop"], 2)
        # Load, reciprocal, branch; two of the loop's entry, the exit behind it, and one line of the prologue.
        self.assertEqual(self.row["start_ray"], 7)
        self.assertEqual(set(self.row), {"visit_node", "pop", "node_loop", "start_ray"})

    def test_a_chain_that_the_text_cannot_have_is_cut(self):
        # turn() calls take() in line 7; its line 5 is neither there nor in a lambda that is given to take().
        chain = (("per_ray.h", 5), ("thread_warp.h", 1), ("per_ray.h", 15), ("per_ray.h", 7), ("batches.h", 1))
        self.assertEqual(SCRIPT.believable(chain, self.texts), (("per_ray.h", 5), ("batches.h", 1)))
        # A lambda in the call itself comes back to its own function.
        chain = (("per_ray.h", 6), ("thread_warp.h", 1), ("per_ray.h", 10), ("per_ray.h", 6), ("batches.h", 1))
        self.assertEqual(SCRIPT.believable(chain, self.texts), chain)
        for chain in ((("per_ray.h", 5), ("per_ray.h", 5)), (("per_ray.h", 10), ("thread_warp.h", 1), ("per_ray.h", 6)), ()):
            self.assertEqual(SCRIPT.believable(chain, self.texts), chain)

    def test_what_is_left_out(self):
        # The call of the slow path with its argument; three behind BRA.DIV.
        self.assertEqual(self.notes["slow"], 5)
        self.assertEqual(self.notes["not attributed"], 1)
        self.assertEqual(self.notes["moved out of their loop"], 3)

    def test_every_operation_of_op_h_is_known(self):
        self.assertEqual(len(SCRIPT.operations()), 21)
        self.assertEqual(SCRIPT.operations()[0], "main_loop")


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    loader = importlib.machinery.SourceFileLoader("sass_costs", sys.argv.pop(1))
    SCRIPT = importlib.util.module_from_spec(importlib.util.spec_from_loader("sass_costs", loader))
    loader.exec_module(SCRIPT)
    unittest.main()
