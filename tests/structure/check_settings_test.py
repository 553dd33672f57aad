#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_settings.py on copies of the project's files."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_settings.py")
ROOT = CHECK.parents[2]
sys.path.insert(0, str(CHECK.parent))
import check_settings  # noqa: E402


def run(file, old, new):
    with tempfile.TemporaryDirectory() as folder:
        for name in (check_settings.CODE, check_settings.MANIFEST, check_settings.PAGE):
            copy = pathlib.Path(folder, name)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy)
        changed = pathlib.Path(folder, file)
        text = changed.read_text(encoding="utf-8")
        if old not in text:
            raise AssertionError(f"{old!r} is not in {file}")
        changed.write_text(text.replace(old, new), encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), folder], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckSettings(unittest.TestCase):
    def test_same(self):
        self.assertEqual(run(check_settings.PAGE, "## Notes", "## Notes")[0], 0)

    def test_row_that_the_page_lacks(self):
        code, out = run(check_settings.CODE, "    X(strict,", '    X(newer, newer, bool, false, "Newer", "A newer one.") \\\n    X(strict,')
        self.assertEqual(code, 1)
        self.assertIn(f"{check_settings.PAGE}: the table is stale", out)
        self.assertNotIn(check_settings.MANIFEST, out)

    def test_row_without_a_description(self):
        code, out = run(check_settings.CODE, '"Reject input that breaks a rule even if it does no harm, instead of only warning. For tests of applications."', '""')
        self.assertEqual(code, 1)
        self.assertIn("strict has no description", out)

    def test_row_that_is_not_understood(self):
        code, out = run(check_settings.CODE, "X(strict, strict, bool, false,", "X(strict, strict, bool, 1 + 1,")
        self.assertEqual(code, 1)
        count = len(check_settings.settings.read())
        self.assertIn(f"{count} settings, of which settings.py understands {count - 1}", out)

    def test_manifest_of_its_own(self):
        code, out = run(check_settings.MANIFEST, "@VELLUM_SETTINGS@", '[{"key": "strict"}]')
        self.assertEqual(code, 1)
        self.assertIn(f"{check_settings.MANIFEST}: strict is", out)
        self.assertIn(f"{check_settings.MANIFEST}: validate is not there", out)

    def test_values_in_documents(self):
        for value, expected in (("all", 0), ("core,sync", 0), ("1", 1), ("cpre", 1)):
            code, out = run(check_settings.PAGE, "## Notes", f"With `VELLUM_VALIDATE={value}`\n\n## Notes")
            self.assertEqual(code, expected, out)
            self.assertEqual(f"VELLUM_VALIDATE has no value {value}" in out, bool(expected))

    def test_stale_page(self):
        code, out = run(check_settings.PAGE, "| `VELLUM_STRICT` ", "| `VELLUM_STRICTER` ")
        self.assertEqual(code, 1)
        self.assertIn(f"{check_settings.PAGE}: the table is stale", out)


if __name__ == "__main__":
    unittest.main()
