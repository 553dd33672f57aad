#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests bench/compare_reports.py."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "bench/compare_reports.py"


def report(*ratios):
    rows = [{"row": "frame", "level": level, "heavy": False, "ratio": ratio} for level, ratio in enumerate(ratios)]
    return {"parts": [{"name": "frames", "rows": rows + [{"row": "device"}]}]}


class CompareReports(unittest.TestCase):
    def compare(self, first, second):
        with tempfile.TemporaryDirectory() as name:
            paths = [pathlib.Path(name) / "first.json", pathlib.Path(name) / "second.json"]
            for path, content in zip(paths, (first, second)):
                path.write_text(json.dumps(content))
            ended = subprocess.run([sys.executable, SCRIPT, *paths], capture_output=True, text=True, check=False)
        return ended.returncode, ended.stdout, ended.stderr

    def verdicts(self, first, second):
        code, printed, _ = self.compare(report(first), report(second))
        return code, printed.splitlines()[2].split("|")[-2].strip()

    def test_narrow_and_close_agree(self):
        self.assertEqual(self.verdicts([0.99, 1, 1.01], [1.01, 1.02, 1.03]), (0, "agree"))
        # Quartiles that do not touch are no difference that matters.
        self.assertEqual(self.verdicts([0.999, 1, 1.001], [1.019, 1.02, 1.021]), (0, "agree"))

    def test_narrow_and_apart_differ(self):
        self.assertEqual(self.verdicts([0.99, 1, 1.01], [1.08, 1.1, 1.12]), (1, "differ"))
        self.assertEqual(self.verdicts([0.99, 1, 1.01], [0.88, 0.9, 0.92]), (1, "differ"))

    def test_wide_overlap_is_no_agreement(self):
        self.assertEqual(self.verdicts([0.6, 1, 1.4], [0.7, 1, 1.3]), (2, "undecided"))
        self.assertEqual(self.verdicts([0.6, 1, 1.4], [1.05, 1.1, 1.15]), (2, "undecided"))
        self.assertEqual(self.verdicts([0.8, 1, 1.2], [1.8, 2, 2.2]), (1, "differ"))

    def test_a_clock_that_stands_still(self):
        self.assertEqual(self.verdicts([None, None, None], [0.9, 1, 1.1]), (2, "undecided"))

    def test_one_difference_counts(self):
        code, printed, _ = self.compare(report([0.99, 1, 1.01], [0.5, 1, 1.5], [1, 1, 1]),
                                        report([0.99, 1, 1.01], [0.5, 1, 1.5], [2, 2, 2]))
        self.assertEqual(code, 1)
        self.assertIn("1 of 3 agree, 1 differ, 1 undecided.", printed)

    def test_other_measurements(self):
        code, _, errors = self.compare(report([1, 1, 1]), report([1, 1, 1], [1, 1, 1]))
        self.assertEqual((code, errors), (1, "the reports did not measure the same\n"))


if __name__ == "__main__":
    unittest.main()
