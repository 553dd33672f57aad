#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests scripts/run-cts with a program that stands for deqp-vk. usage: run_cts_test.py"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

RUN_CTS = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "run-cts"
# Cases do what their names say.
DEQP = f"#!{sys.executable}" + '''
import os, pathlib, signal, sys, time
options = dict(word.split("=", 1) for word in sys.argv[1:])
if options.get("--deqp-runmode") == "stdout-caselist":
    kind = "query" if "ray_query" in options["--deqp-case"] else "pipeline"
    print(f"Writing test cases\\nGROUP: {kind}\\nTEST: {kind}.Pass.1\\nTEST: {kind}.NotSupported.1")
    sys.exit()
for case in pathlib.Path(options["--deqp-caselist-file"]).read_text().split():
    print(f"Test case '{case}'..", flush=True)
    what = case.split(".")[1]
    if what == "Crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "Hang":
        time.sleep(1000)
    if what == "Flaky":
        mark = pathlib.Path(options["--deqp-log-filename"]).parent / (case + ".mark")
        what = "Pass" if mark.exists() else "Fail"
        mark.touch()
    print(f"  {what} (a (detail), with a comma)", flush=True)
print("DONE!")
'''


class RunCts(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.deqp = self.folder / "deqp-vk"
        self.deqp.write_text(DEQP, encoding="utf-8")
        self.deqp.chmod(0o755)

    def file(self, name, *lines):
        path = self.folder / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def run_cts(self, *options, cases=None):
        if cases:
            options += ("--cases", self.file("cases", *cases))
        self.out = self.folder / "out"
        return subprocess.run([sys.executable, RUN_CTS, "--deqp", self.deqp, "--no-layer", "--out", self.out, "--timeout", "2",
                               "--jobs", "2", *options],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120, check=False)

    def statuses(self, name="results.csv"):
        rows = [line.split(",") for line in (self.out / name).read_text(encoding="utf-8").splitlines()]
        if name == "results.csv":
            self.assertTrue(all(float(row[2]) >= 0 for row in rows))
        return {row[0]: row[1] for row in rows}

    def test_statuses_of_deqp_runner(self):
        result = self.run_cts(cases=["a.Pass.1", "a.Fail.1", "a.NotSupported.1", "a.QualityWarning.1", "a.Waiver.1",
                                     "a.InternalError.1", "a.Crash.1", "a.Hang.1", "a.Flaky.1", "a.Pass.2"])
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertEqual(self.statuses(), {
            "a.Pass.1": "Pass", "a.Pass.2": "Pass", "a.Fail.1": "Fail", "a.NotSupported.1": "Skip", "a.Waiver.1": "Warn",
            "a.QualityWarning.1": "Warn", "a.InternalError.1": "Fail", "a.Crash.1": "Crash", "a.Hang.1": "Timeout",
            "a.Flaky.1": "Flake"})
        self.assertEqual(self.statuses("failures.csv"), {"a.Fail.1": "Fail", "a.InternalError.1": "Fail",
                                                         "a.Crash.1": "Crash", "a.Hang.1": "Timeout"})
        self.assertIn('a.Pass.1,Pass,"a (detail), with a comma"', (self.out / "details.csv").read_text(encoding="utf-8"))

    def test_resume(self):
        cases = ["a.Pass.1", "a.Fail.1", "a.NotSupported.1", "a.Flaky.1"]
        self.run_cts(cases=cases[:3])
        result = self.run_cts("--resume", cases=cases)
        self.assertEqual(self.statuses(), {"a.Pass.1": "Pass", "a.Fail.1": "Fail", "a.NotSupported.1": "Skip", "a.Flaky.1": "Flake"})
        ran = "".join(path.read_text(encoding="utf-8") for path in self.out.glob("chunk*.txt")).split()
        self.assertEqual(sorted(ran), ["a.Fail.1", "a.Flaky.1"], result.stdout)

    def test_failures_are_the_next_baseline(self):
        cases = ["a.Pass.1", "a.Fail.1", "a.Crash.1"]
        self.assertEqual(self.run_cts(cases=cases).returncode, 1)
        baseline = self.file("baseline", (self.out / "failures.csv").read_text(encoding="utf-8"))
        self.assertEqual(self.run_cts("--baseline", baseline, cases=cases).returncode, 0)
        self.assertEqual(self.statuses(), {"a.Pass.1": "Pass", "a.Fail.1": "ExpectedFail", "a.Crash.1": "ExpectedFail"})

    def test_baseline_skips_and_flakes(self):
        baseline = self.file("baseline", "# known", "a.Pass.1,Crash", "a.Fail.1,Crash", "a.NotSupported.1,Fail", "a.Pass.2,Fail,1.5")
        result = self.run_cts("--baseline", baseline, "--skips", self.file("skips", "Hang"), "--flakes",
                              self.file("flakes", r"^a\.Fail\.2$"),
                              cases=["a.Pass.1", "a.Pass.2", "a.Fail.1", "a.Fail.2", "a.NotSupported.1", "a.Hang.1"])
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertEqual(self.statuses(), {
            "a.Pass.1": "UnexpectedImprovement(Pass)", "a.Pass.2": "UnexpectedImprovement(Pass)",
            "a.Fail.1": "UnexpectedImprovement(Fail)", "a.Fail.2": "KnownFlake",
            "a.NotSupported.1": "UnexpectedImprovement(Skip)", "a.Hang.1": "Skip"})

    def test_cases_of_opacity_micromaps(self):
        result = self.run_cts()
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertEqual(self.statuses(), {"query.Pass.1": "Pass", "query.NotSupported.1": "Skip", "pipeline.Pass.1": "Pass",
                                           "pipeline.NotSupported.1": "Skip"})

    def test_cases_of_a_pattern(self):
        self.assertEqual(self.run_cts("--pattern", "dEQP-VK.ray_query.*").returncode, 0)
        self.assertEqual(self.statuses(), {"query.Pass.1": "Pass", "query.NotSupported.1": "Skip"})

    def test_nothing_was_tested(self):
        result = self.run_cts(cases=["a.NotSupported.1", "a.NotSupported.2"])
        self.assertEqual(result.returncode, 125, result.stdout)
        self.assertIn("nothing was tested", result.stdout)
        self.assertEqual(self.run_cts("--skips", self.file("skips", "Pass"), cases=["a.Pass.1"]).returncode, 125)

    def test_wrong_files(self):
        for option, line in (("--baseline", "a.Pass.1,Broken"), ("--baseline", "a.Pass.1"), ("--skips", "("), ("--flakes", "(")):
            result = self.run_cts(option, self.file("wrong", line), cases=["a.Pass.1"])
            self.assertNotEqual(result.returncode, 0)
            self.assertIn("wrong:1: must be", result.stdout)
        self.assertEqual(self.run_cts("--skips", self.folder / "missing", cases=["a.Pass.1"]).returncode, 2)


if __name__ == "__main__":
    unittest.main()
