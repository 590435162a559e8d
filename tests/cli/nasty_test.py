"""Every broken or strange file of the shared scenes through the program: done, or exit code 1 and one line."""
import resource
import sys

sys.dont_write_bytecode = True
from program import SANITIZED, SHARED_SCENES, ProgramTest, json_of, main, signal_name  # noqa: E402

MEMORY_LIMIT = 6 << 30
COMMANDS = (["info", "--json", "-"], ["build", "--json", "-", "--repeat", "1"], ["check", "--quiet"],
            ["trace", "--json", "-", "--repeat", "1", "--size", "24x16", "--camera", "0"])


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))


class Nasty(ProgramTest):
    def test_every_file(self):
        files = sorted(f for f in (SHARED_SCENES / "nasty").glob("*") if f.is_file())
        if not files:
            self.skipTest(f"{SHARED_SCENES / 'nasty'} holds no files on this machine")
        done = refused = 0
        for file in files:
            outcomes = {}
            for command, *options in COMMANDS:
                with self.subTest(file=file.name, command=command):
                    # a sanitizer reserves more address space than any limit allows
                    result = self.run_program(command, str(file.resolve()), *options,
                                              preexec_fn=None if SANITIZED else limit_memory)
                    self.assertIsNone(signal_name(result.code), result)
                    outcomes[command] = result.code
                    if result.code == 0:
                        done += 1
                        self.assertEqual(result.err, "", result)
                        if "--json" in options:
                            self.check_counts(command, json_of(result.out))
                    else:
                        refused += 1
                        self.assert_one_line(result)
                        self.assertIn(file.name, result.err)
            # what can be read can be made a tree of, unless an index is wrong; what cannot be read fails everywhere
            if outcomes.get("info") == 1:
                self.assertEqual(set(outcomes.values()), {1}, (file.name, outcomes))
            self.assertEqual(outcomes.get("build"), outcomes.get("check"), (file.name, outcomes))
        print(f"{len(files)} files: {done} runs done, {refused} refused with one line", file=sys.stderr)
        self.assertGreater(done, 0)
        self.assertGreater(refused, 0)

    def check_counts(self, command, document):
        scene = document["scene"]
        self.assertTrue(scene["triangles"] == 0 or scene["points"] == 0, scene)
        if command == "build":
            build = document["build"]
            self.assertEqual(build["references"] + build["left_out"], scene["triangles"] or scene["points"])
        if command == "trace":
            self.assertLessEqual(document["trace"][0]["hits"], document["trace"][0]["count"])


if __name__ == "__main__":
    main()
