#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests which mutants are chosen, on made-up ones and on the sources of this tree."""
import collections
import pathlib
import unittest

import selection
from operators import Mutant

ROOT = pathlib.Path(__file__).resolve().parents[2]
LARGE, SMALL = 400, 4


def made_up():
    return [Mutant(name, line, operator, 0, 0, 0, "") for name, lines in (("large", LARGE), ("small", SMALL))
            for line in range(lines) for operator in ("constant", "flag")]


class Selection(unittest.TestCase):
    def test_repeats(self):
        self.assertEqual(selection.choose(made_up(), 3, 20), selection.choose(list(reversed(made_up())), 3, 20))
        self.assertNotEqual(selection.choose(made_up(), 3, 20), selection.choose(made_up(), 4, 20))

    def test_longer_choices_begin_with_shorter_ones(self):
        self.assertEqual(selection.choose(made_up(), 3, 40)[:20], selection.choose(made_up(), 3, 20))

    def test_small_files_have_more_than_their_share(self):
        count = collections.Counter((mutant.file, mutant.operator) for mutant in selection.choose(made_up(), 3, 40))
        self.assertEqual(len(count), 4)
        self.assertGreater(count["small", "flag"] * LARGE, count["large", "flag"] * SMALL)
        self.assertGreater(count["large", "flag"], count["small", "flag"])

    def test_everything(self):
        self.assertEqual(len(selection.choose(made_up(), 3, 10000)), 2 * (LARGE + SMALL))

    def test_sources(self):
        for target in selection.PATTERNS:
            with self.subTest(target):
                self.check_sources(target)

    def check_sources(self, target):
        mutants = selection.all_mutants(ROOT, target)
        self.assertEqual(len({mutant.id for mutant in mutants}), len(mutants))
        files = {mutant.file for mutant in mutants}
        for pattern in selection.PATTERNS[target]:
            self.assertTrue(any((ROOT / name) in ROOT.glob(pattern) for name in files), pattern)
        for mutant in mutants[::97]:
            source = (ROOT / mutant.file).read_text(encoding="utf-8")
            self.assertNotEqual(mutant.apply(source), source, mutant.id)
            self.assertEqual(mutant.apply(source).count("\n"), source.count("\n"), mutant.id)


if __name__ == "__main__":
    unittest.main()
