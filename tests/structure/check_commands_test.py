#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_commands.py on registries and tables that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_commands.py")
REGISTRY = """<registry><commands>
  <command><proto><type>void</type> <name>vkOne</name></proto></command>
  <command name="vkOneKHR" alias="vkOne"/>
  <command name="vkOneEXT" alias="vkOne"/>
  <command><proto><type>void</type> <name>vkTwo</name></proto></command>
  <command name="vkTwoKHR" alias="vkTwo"/>
</commands></registry>
"""


def run(*names, returned="1, 4, 300", more=""):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "src/layer/entry").mkdir(parents=True)
        rows = "".join(f'    row<function>("{name}", Scope::Device),\n' for name in names)
        (root / "src/layer/entry/commands.cpp").write_text(rows, encoding="utf-8")
        (root / "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in").write_text(
            '{"layer": {"api_version": "1.4.300"}}', encoding="utf-8")
        (root / "src/layer/entry/instance.cpp").write_text(f"specVersion = VK_MAKE_API_VERSION(0, {returned});",
                                                          encoding="utf-8")
        (root / "vk.xml").write_text(REGISTRY.replace("</commands>", more + "</commands>"), encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), str(root / "vk.xml"), folder], stdout=subprocess.PIPE,
                                text=True, check=False)
    return result.returncode, result.stdout


class CheckCommands(unittest.TestCase):
    def test_one_row_each(self):
        self.assertEqual(run("vkOne", "vkTwo", "vkThree")[0], 0)

    def test_row_of_an_alias(self):
        code, out = run("vkOne", "vkTwoKHR")
        self.assertEqual(code, 1)
        self.assertIn("vkTwoKHR is an alias of vkTwo", out)
        self.assertNotIn("vkOne", out)

    def test_two_rows(self):
        code, out = run("vkOne", "vkTwo", "vkOne")
        self.assertEqual(code, 1)
        self.assertIn("vkOne has 2 rows", out)

    def test_alias_that_the_registry_has_otherwise(self):
        code, out = run("vkOne", more='<command name="vkMapMemory2KHR" alias="vkMapMemory3"/>')
        self.assertEqual(code, 1)
        self.assertIn("vkMapMemory2KHR is an alias of vkMapMemory3", out)

    def test_other_version(self):
        code, out = run("vkTwo", returned="1, 3, 300")
        self.assertEqual(code, 1)
        self.assertIn("the version is ['1.4.300']", out)

    def test_nothing_to_check(self):
        self.assertEqual(run()[0], 1)


if __name__ == "__main__":
    unittest.main()
