#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_cases.py with a build of one program. usage: check_cases_test.py PROGRAM"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_cases.py")
PROGRAM = sys.argv.pop(1)


class CheckCases(unittest.TestCase):
    def check(self, *filters, compiled=("a_test.cpp",), batch=""):
        with tempfile.TemporaryDirectory() as folder:
            build = pathlib.Path(folder)
            tests = [f"add_test(t{at} [==[{PROGRAM}]==] [==[--gtest_filter={one}]==])\n" for at, one in enumerate(filters)]
            (build / "CTestTestfile.cmake").write_text("".join(tests), encoding="utf-8")
            (build / "programs").write_text(PROGRAM + "\n", encoding="utf-8")
            (build / "tests").mkdir()
            (build / "tests" / "a_test.cpp").touch()
            (build / "tests" / "Unity").mkdir()
            (build / "tests" / "Unity" / "unity_a_cxx.cxx").write_text(f'#include "{build}/tests/{batch}"\n', encoding="utf-8")
            (build / "compile_commands.json").write_text(
                json.dumps([{"file": str(build / "tests" / file)} for file in compiled]), encoding="utf-8")
            result = subprocess.run([sys.executable, CHECK, f"--build={build}", f"--tests={build / 'tests'}",
                                     f"--programs={build / 'programs'}"],
                                    stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60, check=False)
        return result.returncode, result.stdout.split("\n")

    def test_all(self):
        self.assertEqual(self.check("*")[0], 0)

    def test_together(self):
        self.assertEqual(self.check("Good.*:Bad.*", "-Good.*:Bad.*")[0], 0)

    def test_left_out(self):
        status, lines = self.check("-Good.*:Bad.Leaves", "Good.Passes")
        self.assertEqual(status, 1)
        program = pathlib.Path(PROGRAM).name
        self.assertIn(f"never run: {program}: Good.PrintsWithoutNewLine", lines)
        self.assertIn(f"never run: {program}: Bad.Leaves", lines)
        self.assertEqual(sum(line.startswith("never run") for line in lines), 2)

    def test_no_test_of_the_program(self):
        status, lines = self.check()
        self.assertEqual(status, 1)
        self.assertGreater(sum(line.startswith("never run") for line in lines), 10)

    def test_file_that_is_not_compiled(self):
        status, lines = self.check("*", compiled=("b_test.cpp",))
        self.assertEqual(status, 1)
        self.assertIn("never compiled: a_test.cpp", lines)

    def test_file_of_a_batch(self):
        self.assertEqual(self.check("*", compiled=("Unity/unity_a_cxx.cxx",), batch="a_test.cpp")[0], 0)
        status, lines = self.check("*", compiled=("Unity/unity_a_cxx.cxx",), batch="b_test.cpp")
        self.assertEqual(status, 1)
        self.assertIn("never compiled: a_test.cpp", lines)


if __name__ == "__main__":
    unittest.main()
