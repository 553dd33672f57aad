#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests how killers end, with Python programs in place of tests, and the file of results."""
import dataclasses
import pathlib
import sys
import tempfile
import unittest

import killers
from results import Results


def step(code, **values):
    return killers.Step("step", (sys.executable, "-c", code, "{layer}"), **values)


class Killers(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def kill(self, *steps):
        return killers.kill(steps, self.folder, self.folder / "log")

    def test_survivor(self):
        self.assertEqual(self.kill(step("pass"), step("pass"))["result"], "survived")

    def test_the_first_failure_ends_it(self):
        after = step("import sys, pathlib; pathlib.Path(sys.argv[1], 'ran').write_text('')")
        result = self.kill(step("pass"), step("print('found'); raise SystemExit(1)"), after)
        self.assertEqual((result["result"], result["by"], result["how"]), ("killed", "step", "exit 1"))
        self.assertFalse((self.folder / "ran").exists())
        self.assertIn("found", (self.folder / "log").read_text())

    def test_crash(self):
        self.assertEqual(self.kill(step("import os; os.abort()"))["how"], "SIGABRT")

    def test_hang(self):
        self.assertEqual(self.kill(step("import time; time.sleep(60)", seconds=0.2))["how"], "hang")
        self.assertEqual(self.kill(step("while True: pass", cpu_seconds=1))["how"], "hang")

    def test_layer(self):
        code = "import os, sys; sys.exit(os.environ['VELLUM_TEST_LAYER'] != sys.argv[1] or os.environ['NAME'] != 'a=b')"
        self.assertEqual(self.kill(step(code, environment=(("NAME", "a=b"),)))["result"], "survived")

    def test_check(self):
        program = self.folder / "program"
        program.write_text('#!/bin/sh\ntest "$1 $2 $6" = "check --layer-path --quick" && test "$3" = "$7"\n')
        program.chmod(0o755)
        (only,) = killers.check_steps(program, ["--quick", "{layer}"], 60)
        self.assertEqual(self.kill(only)["result"], "survived")

    def test_all_killers(self):
        steps = [dataclasses.replace(step(f"raise SystemExit({code})"), name=name) for name, code in (("a", 1), ("b", 0), ("c", 2))]
        result = killers.kill_by_all(steps, self.folder, self.folder / "log")
        self.assertEqual((result["result"], result["all"]), ("killed", {"a": "exit 1", "c": "exit 2"}))
        self.assertEqual(killers.kill_by_all(steps[1:2], self.folder, self.folder / "log")["result"], "survived")

    def test_a_step_for_each_suite(self):
        program = self.folder / "program"
        program.write_text("#!/bin/sh\ntest \"$*\" = '--gtest_list_tests --gtest_filter=*' || exit 1\n"
                           "printf 'A.\\n  One\\n  DISABLED_Two\\nAll/B.\\n  Three/0  # x\\n  Three/1  # y\\n'\n")
        program.chmod(0o755)
        whole = killers.Step("all", ("{layer}/program", "--gtest_filter=*", "--gtest_brief=1"), (("X", "1"),))
        one, other = killers.suites_of(whole, self.folder)
        self.assertEqual((one.name, one.words), ("program A X=1", ("{layer}/program", "--gtest_filter=A.One", "--gtest_brief=1")))
        self.assertEqual((other.name, other.words[1]), ("program All/B X=1", "--gtest_filter=All/B.Three/0:All/B.Three/1"))

    def test_list_of_tests(self):
        path = self.folder / "tests.txt"
        path.write_text("# comment\n\nprogram A.*:-B.* X=1 Y=2\n")
        (only,) = killers.read_steps(path, pathlib.Path("bin"))
        self.assertEqual(only.words[:2], ("bin/program", "--gtest_filter=A.*:-B.*"))
        self.assertEqual(dict(only.environment), {"X": "1", "Y": "2"})

    def test_results(self):
        path = self.folder / "results.jsonl"
        Results(path).add("a", "build", result="built")
        Results(path).add("a", "tests", result="killed")
        again = Results(path)
        again.add("b", "build", result="same")
        again = Results(path)
        self.assertEqual(again.stages(), ["build", "tests"])
        self.assertEqual(again.find("a", "tests")["result"], "killed")
        self.assertEqual(list(again.of_stage("build")), ["a", "b"])


if __name__ == "__main__":
    unittest.main()
