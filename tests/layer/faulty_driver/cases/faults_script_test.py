#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests bench/faults/faults.py with a script in place of vellum."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[4]
sys.path.insert(0, str(ROOT / "bench/faults"))
sys.dont_write_bytecode = True
import faults  # noqa: E402
BUILD = os.environ.get("VELLUM_TEST_BUILD")

PROGRAM = """#!{python}
import os, pathlib, sys, time
words = sys.argv
if "--list" in words:
    print("khr.resolution-query.0002 khr.resolution-query.0003 khr.resolution-query.0004".replace(" ", chr(10)))
    sys.exit()
fault = os.environ["VELLUM_TEST_FAULT"]
if "--replay" in words:
    sys.exit(fault == "index-stride")
output = pathlib.Path(words[words.index("--output") + 1])
layers = [sorted(pathlib.Path(folder).iterdir())[0].name for folder in os.environ["VK_ADD_LAYER_PATH"].split(":")]
pathlib.Path("{log}").open("a").write(" ".join(words[4:] + layers) + chr(10))
if fault in ("index-stride", "base-twice"):
    (output / "failures").mkdir(parents=True)
    (output / "failures" / "khr.resolution-query.0003.json").write_text("{{}}")
if not fault:
    time.sleep({slow})
if fault in ("index-stride", "hangs"):
    time.sleep(600)
sys.exit({{"dies": 1, "does-nothing": 2, "": {clean}}}.get(fault, 0))
"""


class Script(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_script(self, faults, *words, clean=0, slow=0):
        program = self.folder / "program"
        program.write_text(PROGRAM.format(python=sys.executable, log=self.folder / "log", clean=clean, slow=slow))
        program.chmod(0o755)
        chosen = [word for fault in faults for word in ("--fault", fault)]
        return subprocess.run([sys.executable, ROOT / "bench/faults/faults.py", "--build", BUILD, "--program", program,
                               *chosen, *words], capture_output=True, text=True, check=False)

    def calls(self):
        return (self.folder / "log").read_text().splitlines()

    def test_results(self):
        file = self.folder / "results.json"
        ended = self.run_script(["index-stride", "dies", "base-twice", "triangle-stride", "hangs"], "--seed", "7", "--seconds", "2",
                                "--output", str(file), "--", "--minutes", "1")
        self.assertEqual(ended.returncode, 1)
        rows = json.loads(file.read_text())["faults"]
        self.assertEqual([(row["fault"], row["result"], row["case"]) for row in rows],
                         [("index-stride", "found", "khr.resolution-query.0003"), ("dies", "found", None),
                          ("base-twice", "flake", None), ("triangle-stride", "missed", None),
                          ("hangs", "no end", None)])
        self.assertEqual([row["number"] for row in rows], [2, None, None, None, None])
        self.assertIn("| found | ", ended.stdout)
        self.assertIn(" | khr.resolution-query.0003 | 2 |\n", ended.stdout)
        self.assertIn("found 2 / planted 5 with seed 7, median", ended.stdout)
        self.assertIn("; median case 2 of 3, last 2\n", ended.stdout)
        self.assertEqual(len(self.calls()), 6)
        self.assertTrue(self.calls()[0].startswith("--seed 7 --minutes 1 "))

    def test_order_of_layers(self):
        self.run_script(["second-queue-loses-micromaps"])
        above, vellum = "VkLayer_vellum_test_faulty_driver.json", "VkLayer_vellum_opacity_micromap.json"
        self.assertEqual(self.calls(), [f"--seed 1 --quick {above} {vellum}",
                                        f"--seed 1 --quick {above} {vellum} VkLayer_vellum_test_mock_driver.json"])

    # A slow machine has more time: five times that of the run without a fault.
    def test_time_limit(self):
        faults.LEAST_LIMIT = 0
        self.assertEqual(faults.limit_of(None, 30), 150)
        self.assertEqual(faults.limit_of(7, 30), 7)
        faults.LEAST_LIMIT = 1000
        self.assertEqual(faults.limit_of(None, 30), 1000)
        ended = self.run_script(["dies"], slow=1)
        self.assertRegex(ended.stderr, r"^3 cases, [1-9]\d* s without a fault\n")

    def test_all_found(self):
        self.assertEqual(self.run_script(["dies"]).returncode, 0)

    def test_findings_without_a_fault(self):
        ended = self.run_script(["dies"], clean=1)
        self.assertIn("without a fault: found", ended.stderr)

    def test_a_run_that_fails(self):
        ended = self.run_script(["does-nothing"])
        self.assertIn("does-nothing: vellum check returned 2", ended.stderr)

    def test_unknown_fault(self):
        self.assertIn("there is no fault nonsense", self.run_script(["nonsense"]).stderr)

    def test_list(self):
        self.assertIn("indexStride is ignored", self.run_script([], "--list").stdout)


if __name__ == "__main__":
    unittest.main()
