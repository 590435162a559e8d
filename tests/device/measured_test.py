"""`raydix bench traversal --device opencl`: measured rates beside a simulated machine of the device's name, and one above its bound."""
import json
import os
import pathlib
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
from program import ProgramTest, json_of, main  # noqa: E402

BENCH = ("bench", "traversal", "builtin:atrium?triangles=10000", "--size", "32x24", "--camera", "0", "--rays", "primary", "--kernel",
         "while_while", "--builder", "split", "--sweep-sample", "0", "--device", "opencl", "--repeat", "2")


class Measured(ProgramTest):
    def setUp(self):
        super().setUp()
        devices = json_of(self.succeed("doctor", "--json", "-").out)["devices"]
        if not [d for d in devices if d["selector"].startswith("opencl") and d["usable"]]:
            if os.environ.get("RAYDIX_DEVICE_REQUIRED") == "opencl":
                self.fail("no OpenCL device")
            self.skipTest("no OpenCL device")

    def test_a_rate_above_its_bound_is_flagged(self):
        name = self.document(*BENCH, "--machine", "gtx480")["measured"][0]["device"]
        for clock, above in ((1000.0, False), (1e-5, True)):
            machine = self.write("own.json", json.dumps({"base": "gtx480", "name": name, "clock_ghz": clock}))
            arguments = (*BENCH, "--machine", machine)
            row, = self.document(*arguments)["measured"]
            self.assertEqual(row["machine"], name)
            self.assertEqual(row["mrays_per_s"]["median"] > row["mrays_per_s_bound"], above)
            self.assertAlmostEqual(row["percent_of_simulated"], 100 * row["mrays_per_s"]["median"] / row["mrays_per_s_limit"])
            self.assertEqual("above the bound: a cost or figure of the simulated machine" in self.succeed(*arguments).out, above)


if __name__ == "__main__":
    main()
