#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_extensions.py on registries and pages that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_extensions.py")

REGISTRY = """<registry>
<types>
  <type category="struct" name="VkOneEXT" structextends="VkShaderModuleCreateInfo"><member><type>int</type></member></type>
  <type category="struct" name="VkOneKHR" alias="VkOneEXT"/>
  <type category="struct" name="VkOtherEXT"><member><type>int</type></member></type>
</types>
<commands>
  <command><proto><type>void</type> <name>vkTwoEXT</name></proto><param><type>VkPipelineCache</type></param></command>
</commands>
<extensions>
  <extension name="VK_EXT_structure" supported="vulkan"><require><type name="VkOneKHR"/></require></extension>
  <extension name="VK_EXT_command" supported="vulkan,vulkansc"><require><command name="vkTwoEXT"/></require></extension>
  <extension name="VK_EXT_flag" supported="vulkan"><require><enum name="VK_SHADER_CREATE_BIT"/></require></extension>
  <extension name="VK_EXT_depends" supported="vulkan" depends="VK_KHR_ray_query"/>
  <extension name="VK_EXT_language" supported="vulkan"/>
  <extension name="VK_EXT_of_a_shader" supported="vulkan"/>
  <extension name="VK_EXT_other" supported="vulkan"><require><type name="VkOtherEXT"/></require></extension>
  <extension name="VK_EXT_never_a_shader" supported="disabled"/>
</extensions>
<spirvextensions>
  <spirvextension name="SPV_EXT_language"><enable extension="VK_EXT_language"/></spirvextension>
</spirvextensions>
</registry>
"""
ROWS = {"VK_EXT_structure": "kept", "VK_EXT_command": "kept", "VK_EXT_flag": "kept", "VK_EXT_depends": "kept",
        "VK_EXT_language": "kept", "VK_EXT_of_a_shader": "kept"}


CODE = """constexpr ConflictingExtension kConflicting[] = {
    {"VK_NV_displacement_micromap", "it extends the driver's",
     kFeatures, 1, Translated::Works, true},
    {"VK_EXT_conflicting", "its instances differ",
     static_cast<VkStructureType>(1000478000), 1, Translated::NotBesideKhr},
};
constexpr std::string_view kRayTracing[] = {"depends"};
constexpr std::string_view kCompatible[] = {
    "VK_EXT_depends",
};
"""
TABLE = """| extension | why | also with translated micromaps |
|---|---|---|
| `VK_NV_displacement_micromap` | it extends the driver's | no |
| `VK_EXT_conflicting` | its instances differ | yes |
"""


def run(rows, passed=(), table=TABLE, options=(), code=CODE):
    page = ["# Page\n\n## Not together with micromaps\n<!-- begin conflicting -->", table + "<!-- end conflicting -->\n", "## Handled\n",
            "| extension | what |", "|---|---|"]
    page += [f"| `{name}` | {text} |" for name, text in rows]
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {"docs/extensions.md": "\n".join(page) + "\n", "vk.xml": REGISTRY,
                           "tests/structure/extensions_passed_through.txt": "".join(f"{name}\n" for name in passed),
                           "src/layer/entry/ray_tracing_extensions.cpp": code}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), *options, str(root / "vk.xml"), folder],
                                stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckExtensions(unittest.TestCase):
    def test_complete(self):
        code, out = run(ROWS.items())
        self.assertEqual((code, out.strip()), (0, "0 findings in 6 extensions"))

    def test_passed_through(self):
        names = list(ROWS)
        self.assertEqual(run([(names[0], "kept")], names[1:])[0], 0)
        code, out = run(ROWS.items(), names[:1])
        self.assertEqual(code, 1)
        self.assertIn(f"{names[0]} is there 2 times", out)

    def test_more_than_the_registry_has(self):
        self.assertEqual(run([*ROWS.items(), ("VK_EXT_newer", "kept"), ("VK_EXT_other", "kept")])[0], 0)

    def test_each_reason_is_missed(self):
        for name in ROWS:
            code, out = run([row for row in ROWS.items() if row[0] != name])
            self.assertEqual(code, 1)
            self.assertIn(f"nothing about {name}\n", out)

    def test_empty_row(self):
        code, out = run([*list(ROWS.items())[1:], ("VK_EXT_structure", "")])
        self.assertEqual(code, 1)
        self.assertIn("an empty cell about VK_EXT_structure", out)

    def test_stale_table(self):
        code, out = run(ROWS.items(), table=TABLE.replace("differ", "are alike"))
        self.assertEqual(code, 1)
        self.assertIn("the table of conflicting extensions is stale", out)
        self.assertEqual(run(ROWS.items(), table="", options=["--write"])[0], 0)

    def test_unknown_to_the_code(self):
        code, out = run(ROWS.items(), code=CODE.replace('"VK_EXT_depends"', '"VK_EXT_conflicting"'))
        self.assertEqual(code, 1)
        self.assertIn("VK_EXT_depends is neither in kConflicting nor in kCompatible", out)

    def test_known_to_the_code_only(self):
        code, out = run(ROWS.items(), code=CODE.replace('"VK_EXT_depends",', '"VK_EXT_depends", "VK_EXT_mistyped",'))
        self.assertEqual(code, 1)
        self.assertIn("nothing about VK_EXT_mistyped", out)

    def test_without_registry(self):
        result = subprocess.run([sys.executable, str(CHECK), "/nowhere/vk.xml"], stdout=subprocess.PIPE, text=True,
                                check=False)
        self.assertEqual(result.returncode, 77)


if __name__ == "__main__":
    unittest.main()
