#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that docs/extensions.md or extensions_passed_through.txt has every Vulkan extension that may matter to the layer, once,
and prints what is missing.

Extensions matter that, by the registry (vk.xml), have to do with ray tracing, shaders, pipelines or their caches:
- their name says so;
- they depend on an extension for ray tracing;
- one of their structures extends or contains one of MATTERS, or one of their commands takes one;
- they bring SPIR-V extensions or capabilities, or flags for pipelines, shaders or acceleration structures.

The page has each in backticks, in the first column of a table whose second column says what the layer does; the file has those
that pass through, one in a line. The table of conflicting ones is generated from the code; with --write, it is written anew.
Extensions that the registry at hand is too old to have may be there. Add one to the file after you have looked at it.

The code has a list of every extension whose name says that it is for ray tracing, as others are reported when a program
enables them: those of the registry must be in it, and those in it must be on the page or in the file.

usage: check_extensions.py [--write] [REGISTRY [ROOT]]
"""
import re
import xml.etree.ElementTree as ElementTree

import findings

PLACE = "docs/extensions.md"
PASSED = "tests/structure/extensions_passed_through.txt"
CODE = "src/layer/entry/ray_tracing_extensions.cpp"
BEGIN, END = "<!-- begin conflicting -->\n", "<!-- end conflicting -->\n"
MATTERS = {
    "VkAccelerationStructureKHR", "VkMicromapEXT", "VkShaderModule", "VkShaderEXT", "VkPipelineCache",
    "VkPipelineBinaryKHR", "VkRayTracingPipelineCreateInfoKHR", "VkPipelineShaderStageCreateInfo",
    "VkShaderModuleCreateInfo", "VkPipelineCacheCreateInfo", "VkShaderCreateInfoEXT", "VkComputePipelineCreateInfo",
    "VkGraphicsPipelineCreateInfo",
}
RAY_TRACING = re.compile(r"ray_tracing|ray_query|acceleration_structure|opacity_micromap")
NAME = re.compile(RAY_TRACING.pattern + r"|shader|pipeline|micromap")
FLAG = re.compile(r"VK_(PIPELINE_CREATE|SHADER_CREATE|SHADER_MODULE|BUILD_ACCELERATION|ACCELERATION_STRUCTURE_CREATE|"
                  r"GEOMETRY)_")


def text(element, path):
    found = element.find(path)
    return found.text if found is not None else None


class Registry:
    def __init__(self, path):
        root = ElementTree.parse(path).getroot()
        self.types = {t.get("name") or text(t, "name"): t for t in root.findall("types/type")}
        self.commands = {c.get("name") or text(c, "proto/name"): c for c in root.findall("commands/command")}
        self.extensions = {e.get("name"): e for e in root.findall("extensions/extension")
                           if "vulkan" in (e.get("supported") or "").split(",")}
        self.spirv = {enable.get("extension") for enable in root.findall("spirvextensions/spirvextension/enable") +
                      root.findall("spirvcapabilities/spirvcapability/enable")}

    def original(self, table, name):
        while name in table and table[name].get("alias"):
            name = table[name].get("alias")
        return table.get(name)

    def mentioned(self, required):
        """Types that a type or a command of an extension extends, has or takes."""
        name = required.get("name")
        if required.tag == "command":
            command = self.original(self.commands, name)
            return {text(p, "type") for p in command.findall("param")} if command is not None else set()
        structure = self.original(self.types, name)
        if structure is None:
            return set()
        return set((structure.get("structextends") or "").split(",")) | {
            text(member, "type") for member in structure.findall("member")}

    def matters(self, extension):
        name = extension.get("name")
        if NAME.search(name) or RAY_TRACING.search(extension.get("depends") or extension.get("requires") or ""):
            return True
        if name in self.spirv:
            return True
        for required in extension.findall("require/*"):
            if required.tag in ("type", "command") and self.mentioned(required) & MATTERS:
                return True
            if required.tag == "enum" and FLAG.match(required.get("name") or ""):
                return True
        return False


def described(page, passed):
    """Extension: each statement about it."""
    rows = {name: ["passed through"] * passed.count(name) for name in passed}
    for line in page.splitlines():
        columns = [column.strip() for column in line.strip("|").split("|")] if line.startswith("|") else [""]
        for name in re.findall(r"`(VK_\w+)`", columns[0]):
            rows.setdefault(name, []).append("".join(columns[1:2]))
    return rows


def array(code, name):
    """The text of an array of the code."""
    return re.search(rf" {name}\[\] = {{(.*?)}};$", code, re.M | re.S)[1]


def conflicting_rows(code):
    """Of the rows of kConflicting: name, reason, and whether it conflicts with translated micromaps as well."""
    for row in re.findall(r'^    \{("VK_.*?)\},$', array(code, "kConflicting"), re.M | re.S):
        name, reason = re.findall(r'"([^"]*)"', row)[:2]
        yield name, reason, "NotBeside" in row


def conflicting_table(code):
    lines = ["| extension | why | also with translated micromaps |", "|---|---|---|"]
    lines += [f"| `{name}` | {reason} | {'yes' if translated else 'no'} |"
              for name, reason, translated in conflicting_rows(code)]
    return "\n".join(lines) + "\n"


def known(code):
    """The extensions for ray tracing that the code knows."""
    return {name for name, _, _ in conflicting_rows(code)} | set(re.findall(r'"(VK_\w+)"', array(code, "kCompatible")))


def generated(root):
    page = (root / PLACE).read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    return before + BEGIN + conflicting_table((root / CODE).read_text(encoding="utf-8")) + END + rest.split(END)[1]


def write(root):
    (root / PLACE).write_text(generated(root), encoding="utf-8")


def check(registry_path, root):
    registry = Registry(registry_path)
    page = (root / PLACE).read_text(encoding="utf-8")
    rows = described(page, (root / PASSED).read_text(encoding="utf-8").split())
    wanted = sorted(name for name, extension in registry.extensions.items() if registry.matters(extension))
    found = [f"{PLACE} and {PASSED}: nothing about {name}" for name in wanted if name not in rows]
    found += [f"{PLACE}: {name} is there {len(texts)} times" for name, texts in rows.items() if len(texts) > 1]
    found += [f"{PLACE}: an empty cell about {name}" for name, texts in rows.items() if not all(texts)]
    if page != generated(root):
        found.append(f"{PLACE}: the table of conflicting extensions is stale; "
                     "run tests/structure/check_extensions.py --write")
    code = (root / CODE).read_text(encoding="utf-8")
    parts = re.findall(r'"(\w+)"', array(code, "kRayTracing"))
    found += [f"{CODE}: {name} is neither in kConflicting nor in kCompatible" for name in sorted(registry.extensions)
              if any(part in name for part in parts) and name not in known(code)]
    found += [f"{PLACE} and {PASSED}: nothing about {name}, which {CODE} knows" for name in sorted(known(code) - set(rows))]
    return found, len(wanted)


if __name__ == "__main__":
    findings.run_with_registry(check, "extensions", write)
