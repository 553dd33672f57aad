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
TABLE = """ids,severity,part,cause,cure
VELLUM-listed,warning,,"A [link](a.md#b), with a comma.",Read it.
VELLUM-shape VELLUM-size,warning or error,gpu,Shape or size.,Correct it.
VUID-vkCmdCopy-src-00001 VUID-*-src-*,error,,Copies.,Do not copy.
VUID-*-size-00002 VUID-*-00003,warning,,Sizes.,Query them.
"""


def run(code, table, *options):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {"src/layer/base/code.cpp": code, "src/layer/messages.csv": table,
                           "src/layer/rules/rows.cpp": ROWS, "src/layer/validation/checks.cpp": CHECKS}.items():
            path = pathlib.Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), *options, folder], stdout=subprocess.PIPE, text=True,
                                check=False)
        written = pathlib.Path(folder, "src/layer/messages.csv").read_text(encoding="utf-8")
    return result.returncode, result.stdout, written


class CheckMessages(unittest.TestCase):
    def expect_finding(self, code, table, *words):
        status, output, _ = run(code, table)
        self.assertEqual(status, 1, output)
        self.assertEqual(len(output.splitlines()), 2, output)
        for word in words:
            self.assertIn(word, output)

    def test_sound(self):
        self.assertEqual(run(CODE, TABLE)[0], 0, run(CODE, TABLE)[1])

    def test_not_listed(self):
        self.expect_finding(CODE + 'error("VELLUM-new");', TABLE, "code.cpp: VELLUM-new is not in")

    def test_no_such_message(self):
        self.expect_finding(CODE, TABLE + "VELLUM-gone,error,,Words.,Words.\n", "there is no message VELLUM-gone")

    def test_put_together(self):
        self.expect_finding(CODE + 'error("VELLUM-VUID-" + name);', TABLE, "put together at run time")

    def test_twice(self):
        self.expect_finding(CODE, TABLE + "VELLUM-size,warning or error,,Words.,Words.\n", "VELLUM-size has 2 causes")
        self.expect_finding(CODE, TABLE + "VUID-Copy-*,warning,,Words.,Words.\n", "VUID-Copy-size-00002 has 2 causes")

    def test_a_full_id_comes_before_patterns(self):
        more = "VUID-Copy-size-00002,warning,,Words.,Words.\n"
        self.assertEqual(run(CODE, TABLE + more)[0], 0)

    def test_other_severity(self):
        self.expect_finding(CODE, TABLE.replace("error,,Copies", "warning,,Copies"),
                            'src-00001 is "warning", in the code "error"')
        self.expect_finding(CODE + 'report.warning("VELLUM-VUID-vkCmdCopy-src-00001");', TABLE,
                            'is "error", in the code "warning or error"')

    def test_without_words(self):
        self.expect_finding(CODE, TABLE.replace("Copies.", ""), "VUID-vkCmdCopy-src-00001 has no cause")
        self.expect_finding(CODE, TABLE.replace("Query them.", ""), "VUID-*-size-00002 has no cure")

    def test_unknown_part(self):
        self.expect_finding(CODE, TABLE.replace("gpu", "cpu"), "VELLUM-shape: part is cpu")

    def test_written(self):
        code = CODE.replace("00001", "00009").replace("tolerateIf", "reject") + 'info("VELLUM-added", "text");'
        code = code.replace("VELLUM-shape", "VELLUM-form")
        _, _, table = run(code, TABLE, "--write")
        self.assertEqual(table, """ids,severity,part,cause,cure
VELLUM-listed,warning,,"A [link](a.md#b), with a comma.",Read it.
VELLUM-size,error,gpu,Shape or size.,Correct it.
VUID-vkCmdCopy-src-00001 VUID-*-src-*,error,,Copies.,Do not copy.
VUID-*-size-00002 VUID-*-00003,warning,,Sizes.,Query them.
VELLUM-added,info,,,
VELLUM-form,error,,,
""")


if __name__ == "__main__":
    unittest.main()
