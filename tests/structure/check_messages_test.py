#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_messages.py on trees that are made up, each with one fault."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_messages.py")

CODE = """// "VELLUM-comment"
report.error("VELLUM-VUID-vkCmdCopy-"
             "src-00001", "a // text of VELLUM-shape");
if (!check.tolerateIf(sizes(1), isLarge ? "VELLUM-shape" : "VELLUM-size", "text")) return; // "VELLUM-comment"
const Ids ids = {"VELLUM-listed"};
"""
ROWS = """constexpr const char *kSize = "VUID-Copy-size-00002";
Rule kRows[] = {{kSize, Tolerate, nullptr, find}, {"VUID-Copy-only-00003", Report, nullptr, find}};
"""
CHECKS = 'fault("VUID-vkCmdCopy-checked-00004");\n'
PAGE = """# Messages
Not in a list: `VELLUM-text`. **error**: rejected.

- **error**: a list of another kind.

## The layer
- `VELLUM-listed` **warning** A [link](a.md#b).
- **warning or error** Shape or size, in words
  that need two lines. `VELLUM-shape`,
  `VELLUM-size`

## Rules
- **error** Copies. `VELLUM-VUID-vkCmdCopy-src-00001`
- **warning** Sizes. `VELLUM-VUID-Copy-size-00002`
"""


def run(code, page, *options):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {"src/layer/base/code.cpp": code, "docs/messages.md": page, "src/layer/rules/rows.cpp": ROWS,
                           "src/layer/validation/checks.cpp": CHECKS}.items():
            path = pathlib.Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), *options, folder], stdout=subprocess.PIPE, text=True,
                                check=False)
        written = pathlib.Path(folder, "docs/messages.md").read_text(encoding="utf-8")
    return result.returncode, result.stdout, written


class CheckMessages(unittest.TestCase):
    def expect_finding(self, code, page, *words):
        status, output, _ = run(code, page)
        self.assertEqual(status, 1, output)
        self.assertEqual(len(output.splitlines()), 2, output)
        for word in words:
            self.assertIn(word, output)

    def test_sound(self):
        self.assertEqual(run(CODE, PAGE)[0], 0, run(CODE, PAGE)[1])

    def test_not_listed(self):
        self.expect_finding(CODE + 'error("VELLUM-new");', PAGE, "code.cpp: VELLUM-new is not in")

    def test_no_such_message(self):
        self.expect_finding(CODE, PAGE + "- `VELLUM-gone` **error** Words.\n", "there is no message VELLUM-gone")

    def test_put_together(self):
        self.expect_finding(CODE + 'error("VELLUM-VUID-" + name);', PAGE, "put together at run time")

    def test_twice(self):
        self.expect_finding(CODE, PAGE + "- `VELLUM-size` **warning or error** Words.\n", "VELLUM-size is there 2 times")

    def test_other_severity(self):
        self.expect_finding(CODE, PAGE.replace("**error** Copies", "**warning** Copies"),
                            'src-00001 is "warning", in the code "error"')
        self.expect_finding(CODE + 'report.warning("VELLUM-VUID-vkCmdCopy-src-00001");', PAGE,
                            'is "error", in the code "warning or error"')

    def test_without_words(self):
        self.expect_finding(CODE, PAGE.replace("Copies. ", ""), "VUID-vkCmdCopy-src-00001 has no words")

    def test_written(self):
        code = CODE.replace("00001", "00002").replace("tolerateIf", "reject") + 'info("VELLUM-added", "text");'
        code = code.replace("VELLUM-shape", "VELLUM-form")
        _, _, page = run(code, PAGE, "--write")
        self.assertEqual(page[page.index("## The layer"):], """## The layer
- `VELLUM-listed` **warning** A [link](a.md#b).
- **error** Shape or size, in words that need two lines. `VELLUM-size`

## Rules
- **warning** Sizes. `VELLUM-VUID-Copy-size-00002`
- `VELLUM-VUID-vkCmdCopy-src-00002` **error**
- `VELLUM-added` **info**
- `VELLUM-form` **error**
""")


if __name__ == "__main__":
    unittest.main()
