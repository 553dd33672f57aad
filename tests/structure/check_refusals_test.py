#!/usr/bin/env python3
"""Tests check_refusals.py on trees that are made up, each with one fault."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_refusals.py")

CODE = """// "VELLUM-comment"
report.error("VELLUM-VUID-vkCmdCopy-"
             "src-00001", "a // text of VELLUM-shape");
report.error("VELLUM-shape", "text"); // "VELLUM-comment"
"""
PAGE = """# Refusals
Not in a table: `VELLUM-text`.

| | messages |
|---|---|
| [refused](#refused) | 1 |
| [other messages](#other-messages) | 1 |

## Refused

| messages | why |
|---|---|
| `VUID-vkCmdCopy-src-00001` | as `VELLUM-other` |

## Other messages

| messages | why |
|---|---|
| `VELLUM-shape` | |
"""


def run(code, page):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {"src/layer/room/code.cpp": code, "docs/refusals.md": page}.items():
            path = pathlib.Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), folder], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckRefusals(unittest.TestCase):
    def expect_finding(self, code, page, *words):
        status, output = run(code, page)
        self.assertEqual(status, 1, output)
        self.assertEqual(len(output.splitlines()), 2, output)
        for word in words:
            self.assertIn(word, output)

    def test_sound(self):
        self.assertEqual(run(CODE, PAGE)[0], 0, run(CODE, PAGE)[1])

    def test_not_listed(self):
        self.expect_finding(CODE + 'error("VELLUM-new");', PAGE, "code.cpp: VELLUM-new is not in")

    def test_no_such_message(self):
        self.expect_finding(CODE.replace("00001", "00002") + 'error("VELLUM-VUID-vkCmdCopy-src-00001");', PAGE,
                            "VELLUM-VUID-vkCmdCopy-src-00002 is not in")
        self.expect_finding(CODE, PAGE.replace("| 1 |\n\n## R", "| 2 |\n\n## R") + "| `VELLUM-gone` | |\n",
                            "there is no message VELLUM-gone")

    def test_put_together(self):
        self.expect_finding(CODE + 'error("VELLUM-VUID-" + name);', PAGE, "put together at run time")

    def test_twice(self):
        self.expect_finding(CODE, PAGE.replace("| 1 |\n\n## R", "| 2 |\n\n## R") + "| `VELLUM-shape` | |\n",
                            "VELLUM-shape is there 2 times")

    def test_number(self):
        self.expect_finding(CODE, PAGE.replace("| 1 |\n\n## R", "| 3 |\n\n## R"),
                            "1 messages are other messages, not 3")


if __name__ == "__main__":
    unittest.main()
