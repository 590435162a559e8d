"""raydix doctor: what the machine offers, and what cannot be used and why."""
import os
import sys

sys.dont_write_bytecode = True
from program import ProgramTest, json_of, main  # noqa: E402


class Doctor(ProgramTest):
    def test_table_and_document_say_the_same(self):
        table = self.succeed("doctor").out
        document = json_of(self.succeed("doctor", "--json", "-").out)
        self.assertEqual(document["command"], "doctor")
        whats = [finding["what"] for finding in document["findings"]]
        self.assertEqual(whats[:4], ["processor", "instruction set", "threads", "huge pages"])
        self.assertLessEqual({"MPI", "Embree", "nanoflann"}, set(whats))
        for finding in document["findings"]:
            self.assertTrue(finding["found"] and finding["meaning"], finding)
            self.assertIn(f"{finding['what']:<16} {finding['found']}\n", table)
        found = {finding["what"]: finding["found"] for finding in document["findings"]}
        self.assertEqual(found["processor"], document["machine"]["cpu"])
        self.assertEqual(found["threads"], str(document["machine"]["cores"]))

    def test_devices_are_usable_or_say_why_not(self):
        devices = json_of(self.succeed("doctor", "--json", "-").out)["devices"]
        self.assertLessEqual({"cuda", "opencl", "hip"}, {device["selector"].split(":")[0] for device in devices})
        for device in devices:
            self.assertEqual(device["usable"], device["missing"] == "")
            if not device["usable"]:
                self.fail_with_one_line("build", "builtin:soup?triangles=10", "--device", device["selector"])

    def test_a_system_without_drivers(self):
        (self.folder / "none").mkdir()
        environment = {**os.environ, "OCL_ICD_VENDORS": str(self.folder / "none")}
        devices = json_of(self.run_program("doctor", "--json", "-", env=environment).out)["devices"]
        self.assertFalse([d for d in devices if d["selector"].startswith("opencl") and d["usable"]])


if __name__ == "__main__":
    main()
