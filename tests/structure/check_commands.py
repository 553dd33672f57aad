#!/usr/bin/env python3
"""Checks that the layer intercepts a command by each of its names or by none, and prints which names it lacks.

Commands that became part of an extension or of Vulkan itself have other names there (vk.xml has them as aliases). Without
one, an application that uses it gets past the layer. So the version of Vulkan in the layer's manifest is one whose commands
all pass; the layer itself returns the same. Names that the registry at hand is too old to have may be there.

usage: check_commands.py [REGISTRY [ROOT]]
"""
import re
import xml.etree.ElementTree as ElementTree

import findings

ROWS = "src/layer/entry/entry.cpp"
MANIFEST = "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in"
RETURNED = "src/layer/entry/instance.cpp"
# Of VK_NV_ray_tracing, whose pipelines the layer leaves alone.
OTHERS = {"vkGetRayTracingShaderGroupHandlesNV"}


def names_of(registry):
    """The names of each command that has several."""
    names = {}
    for command in ElementTree.parse(registry).getroot().findall("commands/command"):
        if command.get("alias"):
            names.setdefault(command.get("alias"), {command.get("alias")}).add(command.get("name"))
    return names


def versions(root):
    manifest = re.findall(r'"api_version": "([\d.]+)"', (root / MANIFEST).read_text(encoding="utf-8"))
    returned = re.findall(r"specVersion = VK_MAKE_API_VERSION\(0, (\d+), (\d+), (\d+)\)",
                          (root / RETURNED).read_text(encoding="utf-8"))
    return manifest, [".".join(version) for version in returned]


def check(registry, root):
    rows = set(re.findall(r'row<\w+>\(\s*"(vk\w+)"', (root / ROWS).read_text(encoding="utf-8")))
    names = names_of(registry)
    found = [f"{ROWS}: {name} is not there, {', '.join(sorted(all_names & rows))} is"
             for all_names in names.values() if all_names & rows for name in sorted(all_names - rows - OTHERS)]
    manifest, returned = versions(root)
    if manifest != returned or not manifest:
        found.append(f"{MANIFEST}: the version is {manifest}, in {RETURNED} {returned}")
    return sorted(found), len(rows)


if __name__ == "__main__":
    findings.run_with_registry(check, "intercepted commands")
