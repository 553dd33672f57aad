#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""On a device that hangs, dies, is lost or does nothing, `vellum check` and `vellum bench` run to their end and keep every
result."""
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[4]
BUILD = pathlib.Path(os.environ["VELLUM_TEST_BUILD"]).resolve()
sys.path.insert(0, str(ROOT / "bench/faults"))
import faults  # noqa: E402

# Drivers die by signals, also under the sanitizers.
os.environ["ASAN_OPTIONS"] = "verify_asan_link_order=0:handle_segv=0:detect_leaks=0"

CASES = [f"khr.plain.000{number}" for number in range(5)]
STATUS = {"hangs": "Timeout", "dies": "Crash", "loses-device": "Crash", "does-nothing": "Fail"}


class CheckEnds(unittest.TestCase):
    def check(self, fault, submissions, jobs):
        """The results of the cases on a device that has the fault after so many submissions, by name."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "cases").write_text("\n".join(CASES))
            planted = next(known for known in faults.known_faults(BUILD) if known.name == fault)
            variables = faults.environment(BUILD, folder, planted) | {"VELLUM_TEST_FAULT_AFTER": str(submissions)}
            words = ["--caselist", str(folder / "cases"), "--timeout", "5" if fault == "hangs" else "60",
                     "--output", str(folder / "out"), "-j", str(jobs)]
            ended = subprocess.run([str(BUILD / "bin/vellum"), "check", *words], env=variables, capture_output=True,
                                   text=True, check=False)
            self.assertIn(ended.returncode, (0, 1), ended.stderr)
            rows = (folder / "out/results.csv").read_text().splitlines()
            results = dict(row.split(",")[:2] for row in rows)
            self.assertEqual(sorted(results), CASES)
            self.assertEqual(len(rows), len(CASES))
            return ended.returncode, results

    def side_by_side(self, run, faults):
        """What run() returns for each fault. Most of the time is spent waiting for what hangs."""
        with concurrent.futures.ThreadPoolExecutor(len(faults)) as pool:
            return zip(faults, pool.map(run, faults))

    def test_from_the_beginning(self):
        for fault, (code, results) in self.side_by_side(lambda fault: self.check(fault, 0, len(CASES)), STATUS):
            with self.subTest(fault):
                self.assertEqual(code, 1)
                self.assertEqual(set(results.values()), {STATUS[fault]})

    def test_in_the_middle(self):
        # A crash or hang that depends on what ran in its process before is a failure, a wrong result is a flake.
        for fault, status in STATUS.items():
            with self.subTest(fault):
                code, results = self.check(fault, 10, 1)
                fails = status != "Fail"
                self.assertEqual(code, 1 if fails else 0)
                self.assertIn(status if fails else "Flake", results.values())
                self.assertLessEqual(set(results.values()), {"Pass", "Flake", *([status] if fails else [])})

    def bench(self, fault):
        """The parts of a report on a device that has the fault after 30 submissions."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            planted = next(known for known in faults.known_faults(BUILD) if known.name == fault)
            variables = faults.environment(BUILD, folder, planted) | {"VELLUM_TEST_FAULT_AFTER": "30"}
            words = ["--seconds", "1", "--timeout", "15" if fault == "hangs" else "60", "-o", str(folder / "report.html")]
            ended = subprocess.run([str(BUILD / "bin/vellum"), "bench", *words], env=variables, capture_output=True, text=True,
                                   check=False)
            self.assertEqual(ended.returncode, 1, ended.stderr)
            self.assertTrue((folder / "report.html").is_file())
            return json.loads((folder / "report.json").read_text())["parts"]

    def test_bench(self):
        found = {"hangs": "hung", "dies": "crashed", "loses-device": "the device was lost"}
        for fault, parts in self.side_by_side(self.bench, found):
            with self.subTest(fault):
                words = found[fault]
                self.assertTrue(parts[0]["rows"], parts[0])
                self.assertTrue(any(part["failure"] for part in parts), parts)
                for part in parts:
                    # The driver goes on with work of the lost device, whose objects are freed, and may crash.
                    expected = (words, "crashed") if fault == "loses-device" else (words,)
                    self.assertTrue(not part["failure"] or any(each in part["failure"] for each in expected), part)


if __name__ == "__main__":
    unittest.main()
