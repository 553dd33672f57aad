#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_quotes.py."""
import pathlib
import tempfile
import unittest

import check_quotes

SOURCE = "int f()\n{\n    // [inside]\n    a();\n        b();\n    // [inside end]\n}\n"


class Quotes(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = pathlib.Path(self.folder.name)
        (self.root / "f.cpp").write_text(SOURCE)

    def check(self, region, code, update=False):
        page = self.root / "page.md"
        page.write_text(f"Text.\n\n<!-- f.cpp: {region} -->\n```cpp\n{code}```\n\nMore.\n")
        findings, count = check_quotes.check(page, self.root, update)
        self.assertEqual(count, 1)
        return findings, page.read_text()

    def test_equal(self):
        self.assertEqual(self.check("inside", "a();\n    b();\n")[0], [])

    def test_stale(self):
        self.assertEqual(self.check("inside", "a();\n")[0],
                         ["page.md: the code of f.cpp: inside differs from the source"])

    def test_no_such_region(self):
        self.assertEqual(self.check("outside", "a();\n")[0], ["page.md: f.cpp has no region outside"])

    def test_update(self):
        findings, text = self.check("inside", "", update=True)
        self.assertEqual(findings, [])
        self.assertIn("```cpp\na();\n    b();\n```\n\nMore.", text)


if __name__ == "__main__":
    unittest.main()
