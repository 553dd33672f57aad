#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_coverage.py on registries, pages and tests that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_coverage.py")
REGISTRY = """<registry><extensions>
  <extension name="VK_EXT_opacity_micromap"><require><command name="vkOneEXT"/><type name="VkOneFlagBitsEXT"/>
    <enum name="VK_ONE_BIT_EXT"/><enum name="VK_STRUCTURE_TYPE_ONE_EXT"/></require></extension>
  <extension name="VK_EXT_other"><require><command name="vkOtherEXT"/></require></extension>
</extensions></registry>
"""
PAGE = """Of Vulkan 1.4.300 (1 January 2025).

| part | tests |
|---|---|
| vkOneEXT, VkOneFlagsEXT | Suite.First, .Second, MSOther.\\* |
| VK_ONE_EXT | `layer_khr.*`, Suite\\*.Fi\\* |
"""
TESTS = """TEST(Suite, First)
TEST_F(Suite, Second)
TEST_P(MicromapStructureOther, Third)
"""


HEADER = "// xml/vk.xml, version 1.4.300.\n"
RULES = "By the page of coverage.\n"


def run(page=PAGE, tests=TESTS, header=HEADER, rules=RULES):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {"docs/design/coverage.md": page, "vk.xml": REGISTRY, "tests/layer/some_test.cpp": tests,
                           "include/vellum/vulkan_opacity_micromap.h": header, "docs/messages.md": rules}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), str(root / "vk.xml"), folder], stdout=subprocess.PIPE,
                                text=True, check=False)
    return result.returncode, result.stdout


class CheckCoverage(unittest.TestCase):
    def expect_finding(self, expected, **arguments):
        code, out = run(**arguments)
        self.assertEqual(code, 1, out)
        self.assertEqual(len(out.splitlines()), 2, out)
        self.assertIn(expected, out)

    def test_complete(self):
        self.assertEqual(run(), (0, "\n0 findings in 3 parts of the extensions\n"))

    def test_missing_parts(self):
        self.expect_finding("nothing about vkOneEXT\n", page=PAGE.replace("vkOneEXT, ", ""))
        self.expect_finding("nothing about VkOneFlagBitsEXT\n", page=PAGE.replace("VkOneFlagsEXT", "VkOne"))
        self.expect_finding("nothing about VK_ONE_BIT_EXT\n", page=PAGE.replace("VK_ONE_EXT", "VK_ONES"))

    def test_versions(self):
        self.expect_finding("version is ['1.4.299'], in docs/design/coverage.md 1.4.300\n", header=HEADER.replace("300", "299"))
        self.expect_finding("states the registry's version 1.4.301", rules="Those of Vulkan 1.4.301.\n")

    def test_missing_tests(self):
        self.expect_finding("there is no test Suite.Second\n", tests=TESTS.replace("Second", "Last"))
        self.expect_finding("there is no test MicromapStructureOther.*\n", tests=TESTS.replace("StructureOther", "Other"))
        self.expect_finding("there is no test Suite*.Fo*\n", page=PAGE.replace(".Fi\\*", ".Fo\\*"))
        self.expect_finding("there is no test Suite.Fourth\n", page=PAGE + "| no picture | Suite.Fourth |\n")


if __name__ == "__main__":
    unittest.main()
