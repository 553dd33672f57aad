#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests run_page.py."""
import pathlib
import tempfile
import textwrap
import unittest

import run_page


class Pages(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.page = pathlib.Path(self.folder.name) / "page.md"

    def check(self, block, update=False, indent="", after=""):
        text = textwrap.indent(f"Text.\n\n```console\n{block}```\n\n```\n$ false\n```\n{after}", indent)
        self.page.write_text(text)
        return run_page.check(self.page, self.folder.name, update)

    def test_equal_output(self):
        self.assertEqual(self.check("$ echo one && echo two\none\ntwo\n$ true\n"), ([], 2))

    def test_other_output(self):
        self.assertEqual(self.check("$ echo one\ntwo\n")[0], ["page.md: $ echo one\nexpected:\ntwo\nprinted:\none\n"])

    def test_missing_and_additional_lines(self):
        self.assertEqual(len(self.check("$ echo one\n")[0]), 1)
        self.assertEqual(len(self.check("$ true\none\n")[0]), 1)

    def test_stderr_and_failure(self):
        self.assertEqual(self.check("$ echo one >&2\none\n")[0], [])
        self.assertEqual(self.check("$ exit 3\n")[0], ["page.md: $ exit 3\nexit code 3\n"])

    def test_ellipsis(self):
        self.assertEqual(self.check("$ echo took 12 ms at 3; seq 5\ntook ... ms at 3\n1\n...\n5\n")[0], [])
        self.assertEqual(len(self.check("$ echo took 12 ms at 4\ntook ... ms at 3\n")[0]), 1)

    def test_numbers_of_candidates(self):
        self.assertEqual(self.check("$ echo 'candidates  0.7 per pixel, at most 30'\ncandidates 1.0 per pixel, at most 39\n")[0], [])
        self.assertEqual(len(self.check("$ echo candidates 0.6\ncandidates 1.0\n")[0]), 1)
        self.assertEqual(len(self.check("$ echo candidates 1.6\ncandidates 1.0\n")[0]), 1)
        self.assertEqual(len(self.check("$ echo hits 0.9\nhits 1.0\n")[0]), 1)

    def test_commands_share_a_folder(self):
        self.assertEqual(self.check("$ echo one >file\n$ cat file\none\n")[0], [])

    def test_exports_hold(self):
        self.assertEqual(self.check("$ export one=1\n$ export two=$one$one\n$ other=3\n$ echo $one $two $other\n1 11\n")[0], [])

    def test_indented_blocks(self):
        self.assertEqual(self.check("$ printf 'one\\n  two\\n'\none\n  two\n", indent="   "), ([], 1))
        self.check("$ echo one; echo 2\n...e\n1\n", update=True, indent="   ")
        self.assertIn("\n   ```console\n   $ echo one; echo 2\n   ...e\n   2\n   ```", self.page.read_text())

    def test_pictures(self):
        picture = "   <!-- commands write made.svg -->\n   ![Squares](page.svg)\n"
        (self.page.parent / "page.svg").write_text("old\n")
        block = "$ echo new >made.svg\n"
        self.assertEqual(self.check("$ echo old >made.svg\n", after=picture)[0], [])
        self.assertEqual(self.check(block, after=picture)[0], ["page.md: page.svg is not what commands write to made.svg"])
        self.assertEqual(self.check(block, after=picture.replace("made", "none"))[0],
                         ["page.md: page.svg is not what commands write to none.svg"])
        self.check(block, after=picture, update=True)
        self.assertEqual((self.page.parent / "page.svg").read_text(), "new\n")

    def test_update(self):
        findings, _ = self.check("$ echo took 12 ms; echo 7\ntook ... ms\n6\n", update=True)
        self.assertEqual(findings, [])
        self.assertIn("```console\n$ echo took 12 ms; echo 7\ntook ... ms\n7\n```", self.page.read_text())


if __name__ == "__main__":
    unittest.main()
