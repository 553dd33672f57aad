#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests run_cases.py with a program whose cases pass, fail, crash, hang and skip. usage: run_cases_test.py PROGRAM"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import cpu_times  # noqa: E402

RUNNER = pathlib.Path(__file__).resolve().with_name("run_cases.py")
PROGRAM = sys.argv.pop(1)


def run(chosen, *options, environment=None):
    return subprocess.run([sys.executable, str(RUNNER), "--timeout=10", "--prefix=p.", *options, PROGRAM,
                           f"--gtest_filter={chosen}"],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120, check=False,
                          env={**os.environ, cpu_times.VARIABLE: os.devnull, **(environment or {})})


def failures(result):
    return [line.split()[1] for line in result.stdout.splitlines() if line.startswith("FAILED:")]


class RunCases(unittest.TestCase):
    def test_passing(self):
        result = run("Good.*")
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertIn("2 passed, 0 failed, 0 skipped", result.stdout)

    def test_each_failure_is_named_and_the_rest_runs(self):
        result = run("Good.*:Bad.*")
        self.assertEqual(result.returncode, 1)
        self.assertEqual(failures(result), ["p.Bad.Fails", "p.Bad.Crashes", "p.Bad.Hangs", "p.Bad.Leaves"])
        self.assertIn("5 passed, 4 failed, 1 skipped", result.stdout)
        self.assertIn("what the failing case says", result.stdout)
        self.assertIn("last words", result.stdout)
        self.assertIn("FAILED: p.Bad.Crashes (crashed: SIGSEGV)", result.stdout)
        self.assertIn("FAILED: p.Bad.Hangs (not done after 10 s, killed)", result.stdout)
        self.assertIn("FAILED: p.Bad.Leaves (the program ended with status 0)", result.stdout)
        self.assertIn("why it skips", result.stdout)
        self.assertIn(f"one of them alone: {PROGRAM} --gtest_filter=Bad.Fails", result.stdout)

    def test_failure_at_the_end_of_the_program(self):
        result = run("Late.*")
        self.assertEqual(result.returncode, 1)
        self.assertEqual(failures(result), ["p.Late.FailsAtTheEndOfTheProgram"])
        self.assertIn("1 passed, 1 failed, 0 skipped", result.stdout)

    def test_failure_at_the_end_of_a_program_with_one_case(self):
        result = run("Late.FailsAtTheEndOfTheProgram")
        self.assertEqual(result.returncode, 1)
        self.assertEqual(failures(result), ["p.Late.FailsAtTheEndOfTheProgram"])

    def test_emulator(self):
        result = run("Good.*:Bad.Fails", "--emulator=env", "--emulator=-i")
        self.assertEqual(failures(result), ["p.Bad.Fails"])
        self.assertIn("2 passed, 1 failed, 0 skipped", result.stdout)
        self.assertIn(f"one of them alone: env -i {PROGRAM} --gtest_filter=Bad.Fails", result.stdout)
        tests = run("Good.*", "--emulator=env", "--emulator=-i", "--ctest").stdout
        self.assertIn(f"[==[--emulator=env]==] [==[--emulator=-i]==] [==[{PROGRAM}]==]", tests)

    def test_parameters(self):
        result = run("Some/*")
        self.assertEqual(result.returncode, 1)
        self.assertEqual(failures(result), ["p.Some/WithParameter.IsTwo/0"])
        self.assertIn("1 passed, 1 failed, 0 skipped", result.stdout)

    def test_all_skipped(self):
        result = run("Skipped.*")
        self.assertEqual(result.returncode, 77, result.stdout)
        self.assertIn("0 passed, 0 failed, 1 skipped", result.stdout)

    def test_no_such_case(self):
        self.assertNotIn(run("NoSuch.*").returncode, (0, 77))

    def test_by_ctest(self):
        listing = run("Good.*:Bad.Fails:Some/*", "--ctest", "--environment=A=b").stdout
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "CTestTestfile.cmake").write_text(listing, encoding="utf-8")
            result = subprocess.run(["ctest", "--output-on-failure"], cwd=folder, stdout=subprocess.PIPE,
                                    stderr=subprocess.STDOUT, text=True, timeout=120, check=False)
        self.assertIn("2 tests failed out of 3", result.stdout)
        for name in ("p.Bad.Fails", "p.Some/WithParameter.IsTwo/0"):
            self.assertIn(f"FAILED: {name}", result.stdout)

    def test_cases_by_label(self):
        listing = run("*", "--ctest", "--with=fine", "--with=odd", "--without=broken").stdout
        filters = [line.split("--gtest_filter=")[1].split("]==]")[0] for line in listing.splitlines()
                   if line.startswith("add_test")]
        self.assertEqual(filters, ["Good.*", "Bad.PassesAfterTheFailure:Bad.PassesAfterTheCrash"])

    def test_slow_by_label(self):
        listing = run("Good.*:Late.*", "--ctest", "--labelled").stdout
        quick = [line.split("]==]")[0].split("[==[")[1] for line in listing.splitlines() if "[==[quick]==]" in line]
        self.assertEqual(quick, ["p.Good"])

    def test_label_that_no_case_has(self):
        result = run("*", "--ctest", "--with=nosuch")
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("no case has the label nosuch", result.stdout)

    def test_label_of_no_case(self):
        result = run("*", "--ctest", "--labelled", environment={"VELLUM_SAMPLE_LABELS": "NoSuch.* fine"})
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("no case is called NoSuch.*", result.stdout)

    def test_labels(self):
        listing = run("Good.*:Bad.*:Some/*", "--ctest", "--slow=Some/*").stdout
        quick = [line.split("]==]")[0].split("[==[")[1] for line in listing.splitlines() if "[==[quick]==]" in line]
        self.assertEqual(quick, ["p.Good", "p.Bad"])
        listing = run("Good.*:Bad.*", "--ctest", "--threads=Go*").stdout
        labels = [line.split("[==[LABELS]==] ")[1].split("[==[")[1].split("]==]")[0]
                  for line in listing.splitlines() if "LABELS" in line]
        self.assertEqual(labels, ["quick;threads", "quick"])


if __name__ == "__main__":
    unittest.main()
