#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_commands.py on lists that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_commands.py")


def run(*names, returned="1, 4, 300"):
    rows = "".join(f"VELLUM_DEVICE({name}, Device, function)\n" for name in names)
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {"src/layer/base/commands.inc": rows,
                           "src/vk/command_aliases.h": '    {"vkTwoKHR", "vkTwo"},\n',
                           "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in": '{"api_version": "1.4.300"}',
                           "src/layer/entry/instance.cpp":
                               f"specVersion = VK_MAKE_API_VERSION(0, {returned});"}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), folder], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckCommands(unittest.TestCase):
    def expect_finding(self, text, *names, **values):
        code, out = run(*names, **values)
        self.assertEqual(code, 1)
        self.assertIn(text, out)

    def test_one_row_each(self):
        self.assertEqual(run("One", "TwoKHR", "Three")[0], 0)

    def test_row_of_an_alias(self):
        self.expect_finding("vkTwo has 2 rows", "One", "Two", "TwoKHR")

    def test_two_rows(self):
        self.expect_finding("vkOne has 2 rows", "One", "Two", "One")

    def test_other_version(self):
        self.expect_finding("the version is ['1.4.300']", "Two", returned="1, 3, 300")

    def test_nothing_to_check(self):
        self.assertEqual(run()[0], 1)


if __name__ == "__main__":
    unittest.main()
