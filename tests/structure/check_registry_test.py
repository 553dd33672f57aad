#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_registry.py on a registry, a header and facts that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_registry.py")
REGISTRY = """<registry>
<types>
  <type category="define">#define <name>VK_HEADER_VERSION</name> 300</type>
  <type category="define">#define <name>VK_HEADER_VERSION_COMPLETE</name> VK_MAKE_API_VERSION(0, 1, 4, VK_HEADER_VERSION)</type>
  <type category="enum" name="VkStructureType"/>
  <type category="struct" name="VkOne"><member values="VK_STRUCTURE_TYPE_ONE"><type>VkStructureType</type> <name>sType</name></member>
    <member><type>void</type>* <name>pNext</name></member><member><type>uint32_t</type> <name>value</name></member></type>
</types>
<enums name="VkStructureType"><enum value="7" name="VK_STRUCTURE_TYPE_ONE"/></enums>
<enums name="VkNumber"><enum value="2" name="VK_TWO"/></enums>
<commands>
  <command><proto><type>void</type> <name>vkOne</name></proto></command>
  <command name="vkOneKHR" alias="vkOne"/>
</commands>
<feature api="vulkan" name="VK_VERSION_1_0" number="1.0"><require><type name="VkOne"/><command name="vkOne"/></require></feature>
<extensions><extension name="VK_KHR_one" number="2" supported="vulkan"><require><command name="vkOneKHR"/></require></extension></extensions>
</registry>
"""
HEADER = "typedef int VkStructureType;\ntypedef struct VkOne {\n    VkStructureType sType;\n    void *pNext;\n    int value;\n} VkOne;\n"
SIZES = "// Written by src/vk/registry.py from Vulkan's registry 1.4.300.\n    {7, 24, \"VkOne\"},\n"
ALIASES = '    {"vkOneKHR", "vkOne"},\n'
ENUMS = '    {2, "VK_TWO"},\n'


def run(sizes=SIZES, aliases=ALIASES, enums=ENUMS):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {"vk.xml": REGISTRY, "include/vulkan/vulkan_core.h": HEADER, "src/vk/structure_sizes.h": sizes,
                           "src/vk/command_aliases.h": aliases,
                           "src/vk/enum_names.h": enums}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), str(root / "vk.xml"), folder,
                                 str(root / "include/vulkan/vulkan_core.h")], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckRegistry(unittest.TestCase):
    def expect_finding(self, text, **facts):
        code, out = run(**facts)
        self.assertEqual(code, 1)
        self.assertIn(text, out)

    def test_complete(self):
        self.assertEqual(run()[0], 0)

    def test_another_size(self):
        self.expect_finding("VkOne has another size than 16", sizes=SIZES.replace("24", "16"))

    def test_another_type(self):
        self.expect_finding("the sType of VkOne is 7, not 8", sizes=SIZES.replace("{7", "{8"))

    def test_another_value(self):
        self.expect_finding("VK_TWO is 2, not 3", enums=ENUMS.replace("2", "3"))

    def test_missing(self):
        self.expect_finding("no VkOne", sizes=SIZES.replace('{7, 24, "VkOne"}', '{8, 24, "VkTwo"}'))
        self.expect_finding("no vkOneKHR", aliases="")

    def test_older_facts(self):
        code, out = run(sizes=SIZES.replace("1.4.300", "1.4.299"), aliases="")
        self.assertEqual(code, 0)
        self.assertIn("1 are newer than the facts, of 1.4.299", out)

    def test_another_alias(self):
        self.expect_finding("vkOneKHR is an alias of vkOne, not of vkTwo", aliases=ALIASES.replace('"vkOne"', '"vkTwo"'))


if __name__ == "__main__":
    unittest.main()
