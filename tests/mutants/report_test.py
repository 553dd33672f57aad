#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests the table on made-up results."""
import pathlib
import tempfile
import unittest

import report
from results import Results

BUILDS = {"a.h:1:flag:0": "built", "a.h:2:flag:0": "built", "b/c.h:1:constant:0": "built", "a.h:3:flag:0": "stillborn",
          "a.h:4:flag:0": "same", "a.h:5:flag:0": "built", "a.h:6:flag:0": "built"}


class Report(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.results = Results(self.folder / "results.jsonl")
        for name, result in BUILDS.items():
            self.results.add(name, "build", result=result, seconds=2.0, before="x", after="y")
        for name in ("a.h:1:flag:0", "a.h:2:flag:0", "b/c.h:1:constant:0", "a.h:5:flag:0"):
            self.results.add(name, "tests", result="killed" if name == "a.h:1:flag:0" else "survived", seconds=1.0)
        self.results.add("a.h:2:flag:0", "check", result="killed", seconds=3.0)

    def test_table(self):
        lines = report.report(self.results, {"a.h:5:flag:0": "why"})
        for line in ("| chosen | 7 |", "| stillborn: do not compile | 1 |", "| equivalent: the same binary | 1 |",
                     "| equivalent: explained | 1 |", "| counted: a killer was run against them | 3 |", "| tests | 3 | 1 | 33.3 % | 1.0 |",
                     "| check | 1 | 1 | 100.0 % | 3.0 |", "| any of them | 3 | 2 | 66.7 % | |", "| flag | 2 | 2 |",
                     "| b | 1 | 0 |"):
            self.assertIn(line, lines)
        survivors = lines[lines.index("## Survivors"):lines.index("## Explained as equivalent")]
        self.assertEqual([line for line in survivors if ":" in line], ["b/c.h:1:constant:0"])
        self.assertIn("a.h:5:flag:0: why", lines)

    def test_matrix(self):
        self.results.add("a.h:1:flag:0", "suites", result="killed", all={"x": "exit 1", "y": "SIGSEGV"}, seconds=1.0)
        self.results.add("a.h:2:flag:0", "suites", result="killed", all={"x": "exit 1"}, seconds=1.0)
        lines = report.matrix(self.results)
        self.assertIn("| x | 2 | 1 | 1 2 |", lines)
        self.assertIn("| y | 1 | 0 | 1 |", lines)
        self.assertIn("| 2 | a.h:2:flag:0 | 1 |", lines)

    def test_equivalent_file(self):
        path = self.folder / "equivalent.txt"
        path.write_text("# comment\n\na.h:1:flag:0 for a reason\n")
        self.assertEqual(report.read_equivalent(path), {"a.h:1:flag:0": "for a reason"})


if __name__ == "__main__":
    unittest.main()
