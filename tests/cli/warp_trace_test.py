"""trace --device sim and cuda: which kernels go with which device, hits from the simulator, one line without a GPU."""
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, main  # noqa: E402

SOUP = "builtin:soup?triangles=300"
SMALL = [SOUP, "--size", "24x16", "--camera", "0"]
KERNELS = ["packet", "while_while", "if_if", "speculative_while_while", "persistent_packet", "persistent_while_while",
           "persistent_if_if", "persistent_speculative_while_while", "ray_replacement", "work_queue", "dynamic_fetch"]


class WarpTrace(ProgramTest):
    def test_combinations_that_do_not_go_together(self):
        for device in ("cuda", "sim"):
            self.fail_with_usage("trace", SOUP, "--device", device, "--kernel", "scalar", names=["--kernel", *KERNELS])
            self.fail_with_usage("trace", SOUP, "--device", device, "--mode", "all", names=["--mode"])
        for kernel in KERNELS:
            self.fail_with_usage("trace", SOUP, "--kernel", kernel, names=["--kernel", "cpu", "scalar", "the others", "while_while"])
        self.fail_with_usage("trace", SOUP, "--device", "sim", "--tree", "kdtree", names=["--tree"])
        for command in ("build", "check", "render"):
            more = ["-o", "x.png"] if command == "render" else []
            self.fail_with_usage(command, SOUP, "--device", "sim", *more, names=["--device", "sim"])
        self.fail_with_usage("trace", SOUP, "--device", "sim", "--machine", "abacus", names=["--machine", "abacus", "h200"])
        self.fail_with_one_line("trace", SOUP, "--device", "sim", "--machine", "absent.json", names=["absent.json"])

    def test_every_kernel_in_the_simulator(self):
        for rays in ("primary", "ao"):
            found = set()
            for kernel in KERNELS:
                trace = self.document("trace", *SMALL, "--rays", rays, "--samples", "2", "--device", "sim", "--kernel",
                                      kernel, "--machine", "h200")["trace"][0]
                self.assertEqual((trace["device"], trace["kernel"]), ("sim", kernel))
                self.assertIsNone(trace["mrays_per_s"])
                self.assertIsNone(trace["node_visits_per_ray"])
                simulated = trace["simulated"]
                self.assertEqual(simulated["machine"], "h200")
                self.assertGreater(simulated["mrays_per_s_bound"], 0)
                self.assertGreaterEqual(simulated["mrays_per_s_bound"], 0.999 * simulated["mrays_per_s_scheduled"])
                found.add((trace["count"], trace["hits"], trace["invalid_rays"]))
            self.assertEqual(len(found), 1, f"{rays}: kernels differ: {found}")
            count, hits, _ = found.pop()
            self.assertLessEqual(hits, count)
            self.assertGreater(hits if rays == "primary" else count, 0)

    def test_hits_are_those_of_the_cpu_away_from_edges(self):
        cpu = self.document("trace", *SMALL)["trace"][0]
        sim = self.document("trace", *SMALL, "--device", "sim")["trace"][0]
        self.assertEqual(sim["kernel"], "speculative_while_while")
        self.assertEqual(cpu["count"], sim["count"])
        self.assertLessEqual(abs(cpu["hits"] - sim["hits"]), 2)

    def test_the_table_says_that_it_is_simulated(self):
        text = self.succeed("trace", *SMALL, "--device", "sim", "--explain").out
        self.assertIn("hits come from the simulator", text)
        self.assertIn("*simulated* on gtx480", text)
        self.assertIn("pair64", text)

    def test_a_device_that_is_not_there(self):
        done = self.run_program("trace", *SMALL, "--device", "cuda", "--kernel", "while_while", "--quiet", "--repeat", "1")
        if done.code != 0:  # where a GPU is, the trace has nothing to complain about
            self.assertEqual(done.code, 1)
            self.assert_one_line(done)
            self.assertRegex(done.err, "CUDA")


if __name__ == "__main__":
    main()
