#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests cpu_times.py, with a script in place of ctest."""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().with_name("cpu_times.py")
PHASE = SCRIPT.parents[2] / "scripts/phase"
BUSY = "import time\nwhile time.process_time() < 0.3: pass\n"
CTEST = f"""#!{sys.executable}
import os, sys
if "die" in sys.argv:
    os.kill(os.getpid(), 9)
print("1/2 Test #1: one ...   Passed    0.10 sec")
with open(os.environ["VELLUM_TEST_CPU_TIMES"], "a") as times:
    times.write("0.50 one\\n")
    for i in range(20):
        times.write(f"0.01 small{{i}}\\n")
print("\\n50% tests passed, 1 tests failed out of 2\\n\\nTotal Test time (real) =   0.21 sec", *sys.argv[1:])
sys.exit(8)
"""


class CpuTimes(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.times = self.folder / "times"

    def run_script(self, *words, **variables):
        environment = os.environ | {"PATH": f"{self.folder}:{os.environ['PATH']}"} | variables
        return subprocess.run([sys.executable, SCRIPT, *words], env=environment, capture_output=True, text=True, check=False)

    def run_test(self, *command):
        return self.run_script("test", "a.test", *command, VELLUM_TEST_CPU_TIMES=str(self.times)).returncode

    def run_ctest(self, *words):
        program = self.folder / "ctest"
        program.write_text(CTEST)
        program.chmod(0o755)
        self.times.write_text("7 building\n1.00 one\n")
        return self.run_script("ctest", *words, VELLUM_TEST_CPU_TIMES=str(self.times))

    def test_a_test_with_its_processes(self):
        program = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {BUSY!r}])\n{BUSY}"
        self.assertEqual(self.run_test(sys.executable, "-c", program), 0)
        seconds, name = self.times.read_text().split()
        self.assertEqual(name, "a.test")
        self.assertGreaterEqual(float(seconds), 0.6)
        self.assertLess(float(seconds), 10)

    def test_ends_as_the_test_does(self):
        for code in (1, 77):
            self.assertEqual(self.run_test("sh", "-c", f"exit {code}"), code)
        for number in (signal.SIGKILL, signal.SIGSEGV, signal.SIGTERM):
            self.assertEqual(self.run_test("sh", "-c", f"kill -{int(number)} $$"), -number)
        self.assertEqual(len(self.times.read_text().splitlines()), 5)

    def test_nothing_is_recorded_without_the_variable(self):
        variables = {name: value for name, value in os.environ.items() if name != "VELLUM_TEST_CPU_TIMES"}
        ended = subprocess.run([sys.executable, SCRIPT, "test", "a.test", "sh", "-c", "exit 3"], env=variables, check=False)
        self.assertEqual(ended.returncode, 3)

    def test_the_closing_lines_of_ctest_come_last(self):
        ended = self.run_ctest("--preset", "release")
        self.assertEqual(ended.returncode, 8)
        lines = ended.stdout.splitlines()
        self.assertTrue(lines[0].startswith("1/2 Test #1"))
        self.assertEqual(lines[-3:], ["50% tests passed, 1 tests failed out of 2", "",
                                      "Total Test time (real) =   0.21 sec --preset release"])
        table = [line.split(maxsplit=1) for line in lines[lines.index("CPU seconds:") + 1:-4]]
        self.assertEqual(table[:2], [["7.0", "building"], ["1.5", "one"]])
        self.assertEqual(table[-2:], [["0.1", "7 others"], ["8.7", "in all"]])
        self.assertEqual(len(table), 17)

    def test_without_closing_lines(self):
        ended = self.run_ctest("die")
        self.assertEqual(ended.returncode, 128 + signal.SIGKILL)
        self.assertIn("     8.0  in all\n", ended.stdout)

    def test_phases(self):
        script = f"set -e\n. {PHASE}\nphase quiet sleep 0\nphase busy {sys.executable} -c 'import time\nwhile time.process_time() < 1.2: pass'\n"
        ended = subprocess.run(["bash", "-c", script], env=os.environ | {"VELLUM_TEST_CPU_TIMES": str(self.times)},
                               capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        self.assertRegex(ended.stderr, r"^== quiet\n   \d+ s, 0 s of CPU\n== busy\n   \d+ s, [12] s of CPU\n$")
        self.assertRegex(self.times.read_text(), r"^0 quiet\n[12] busy\n$")


if __name__ == "__main__":
    unittest.main()
