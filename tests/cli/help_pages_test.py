"""Completion in shells and manual pages know every command and option that --help knows."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from program import PROGRAM, ProgramTest, main  # noqa: E402

COMMANDS = ("info", "scenes", "build", "check", "trace", "render", "query", "simulate", "bench", "report")
SUITES = ("traversal", "cpu", "scene", "points", "hierarchy")


def options_in(help_text):
    return set(re.findall(r"(?m)^  (?:-\w,)?(--[a-z][a-z-]*)", help_text))


class HelpPages(ProgramTest):
    def complete(self, *words):
        """What bash offers for the last of `words`."""
        quoted = " ".join(f"'{word}'" for word in words)
        script = (f"source <('{PROGRAM}' completion bash)\nCOMP_WORDS=({quoted})\nCOMP_CWORD={len(words) - 1}\n"
                  "_raydix\nprintf '%s\\n' \"${COMPREPLY[@]}\"\n")
        done = subprocess.run(["bash", "-uc", script], capture_output=True, text=True, check=True, cwd=self.folder)
        self.assertEqual(done.stderr, "")
        return set(done.stdout.split())

    def test_bash_completes_commands(self):
        self.assertEqual(self.complete("raydix", "tr"), {"trace"})
        self.assertLessEqual(set(COMMANDS), self.complete("raydix", ""))
        self.assertEqual(self.complete("raydix", "bench", ""), self.complete("raydix", "bench", "") | set(SUITES))
        self.assertEqual(self.complete("raydix", "completion", ""), {"--help", "-h", "bash", "zsh", "fish"})

    def test_bash_completes_every_option(self):
        for command in COMMANDS:
            known = options_in(self.succeed(command, "--help").out)
            self.assertIn("--help", known)
            self.assertLessEqual(known, self.complete("raydix", command, "--"), command)
        self.assertLessEqual(options_in(self.succeed("bench", "traversal", "--help").out),
                             self.complete("raydix", "bench", "traversal", "--"))

    def test_bash_completes_values(self):
        self.assertEqual(self.complete("raydix", "trace", "x.ply", "--mode", ""), {"closest", "any", "all"})
        self.assertEqual(self.complete("raydix", "trace", "--mode", "=", "cl"), {"closest"})
        self.assertEqual(self.complete("raydix", "build", "--quality", "b"), {"balanced"})
        self.assertEqual(self.complete("raydix", "trace", "--json", ""), set())  # files, which bash adds itself
        self.assertEqual(self.complete("raydix", "trace", ""), set())

    def test_zsh_and_fish_can_read_theirs(self):
        for shell in ("zsh", "fish"):
            text = self.succeed("completion", shell).out
            for command in (*COMMANDS, *SUITES):
                self.assertRegex(text, rf"\b{command}\b")
            for option in options_in(self.succeed("trace", "--help").out):
                self.assertIn(option if shell == "zsh" else f"-l {option[2:]}", text)
            if shutil.which(shell):
                subprocess.run([shell, "-n"], input=text, text=True, check=True)

    @unittest.skipUnless(shutil.which("fish"), "fish is not installed")
    def test_fish_completes(self):
        def complete(line):
            script = f"'{PROGRAM}' completion fish | source; complete -C '{line}'"
            done = subprocess.run(["fish", "--no-config", "-c", script], capture_output=True, text=True, check=True,
                                  cwd=self.folder, env={**os.environ, "HOME": str(self.folder)})
            return {text.split("\t")[0] for text in done.stdout.splitlines()}

        self.assertEqual(complete("raydix tr"), {"trace"})
        self.assertEqual(complete("raydix trace --mode "), {"closest", "any", "all"})
        self.assertIn("traversal", complete("raydix bench tra"))
        self.assertLessEqual({"bash", "zsh", "fish"}, complete("raydix completion "))
        self.assertIn("--layout", complete("raydix trace --lay"))

    def test_other_shells_are_refused(self):
        self.fail_with_usage("completion", "tcsh", names=["tcsh"])
        self.fail_with_usage("man", "trade", names=["'trade'"])
        self.fail_with_usage("man", "bench", "trade", names=["'trade'", "bench"])

    def test_manual_pages(self):
        for words in ([], *([c] for c in COMMANDS), ["bench", "traversal"]):
            page = self.succeed("man", *words).out
            plain = page.replace("\\-", "-")
            for option in options_in(self.succeed(*words, "--help").out):
                self.assertIn(option, plain, words)
            self.assertIn(".SH EXIT STATUS", page)
            if shutil.which("groff"):
                done = subprocess.run(["groff", "-man", "-Tutf8", "-ww"], input=page, capture_output=True, text=True,
                                      check=True)
                self.assertEqual(done.stderr, "", words)
                self.assertIn(" ".join(["raydix", *words]), re.sub(r".\x08|\x1b\[[0-9;]*m", "", done.stdout))

    def test_manual_pages_of_programs_beside(self):
        for words, program in ((["bench", "cpu"], "bench_cpu"), (["bench", "points"], "bench_points"), (["mpi"], "raydix_mpi")):
            page = self.succeed("man", *words).out.replace("\\-", "-")
            if not (pathlib.Path(PROGRAM).parent / program).exists():
                self.assertNotIn(".SH OPTIONS", page)
                continue
            known = options_in(self.succeed(*words, "--help").out)
            known |= {"--knn"} if words == ["mpi"] else {"--rounds"}
            for option in known:
                self.assertIn(option, page, words)

    def test_help_offers_no_tree_that_is_refused(self):
        for words in (["simulate"], ["bench", "traversal"]):
            text = self.succeed(*words, "--help").out
            self.assertNotIn("octree", text, words)
            self.assertNotIn("wide8", text, words)
            self.assertNotIn("|sim", text, words)
        self.assertRegex(text, r"Builder \(default.*sbvh for gtx480")
        self.assertEqual(self.complete("raydix", "simulate", "x.ply", "--tree", ""), {"bvh"})

    def test_help_of_render_offers_no_layout_that_is_refused(self):
        text = self.succeed("render", "--help").out
        self.assertIn("octree", text)
        for refused in ("wide8", "cwbvh", "cuda", "|sim"):
            self.assertNotIn(refused, text)

    def test_help_of_check_offers_what_it_takes(self):
        text, page = self.succeed("check", "--help").out, self.succeed("man", "check").out
        for refused in ("wide8", "wide4", "cwbvh", "compact", "|sim"):
            self.assertNotIn(refused, text)
            self.assertNotIn(refused, page)
        for offered in ("octree", "kdtree", "opencl"):
            self.assertIn(offered, text)
        self.assertEqual(self.complete("raydix", "check", "x.ply", "--layout", ""), {"binary"})
        self.assertNotIn("sim", self.complete("raydix", "check", "x.ply", "--device", ""))
        self.assertNotIn("|sim", self.succeed("build", "--help").out)
        self.assertNotIn("sim", self.complete("raydix", "build", "x.ply", "--device", ""))
        for layout in ("wide8", "wide4", "compact", "cwbvh"):
            self.fail_with_usage("check", "builtin:soup?triangles=5", "--layout", layout, names=["--layout"])

    def test_all_pages_into_a_folder(self):
        (self.folder / "pages").mkdir()
        self.succeed("man", "--folder", "pages")
        pages = {page.name for page in (self.folder / "pages").iterdir()}
        self.assertLessEqual({"raydix.1", "raydix-trace.1", "raydix-bench-traversal.1"}, pages)
        self.assertEqual((self.folder / "pages/raydix-trace.1").read_text(), self.succeed("man", "trace").out)
        self.fail_with_one_line("man", "--folder", "nowhere", names=["nowhere"])


if __name__ == "__main__":
    main()
