#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the list of commands, and prints what is wrong.

Each command has one row: promoted commands are found by their aliases (vk/command_aliases.h), so a row of an alias is a second
row. The version of Vulkan in the manifest is the one that the layer returns.

usage: check_commands.py [ROOT]
"""
import collections
import re

import findings

ROWS = "src/layer/base/commands.inc"
ALIASES = "src/vk/command_aliases.h"
MANIFEST = "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in"
RETURNED = "src/layer/entry/instance.cpp"


def versions(root):
    manifest = re.findall(r'"api_version": "([\d.]+)"', (root / MANIFEST).read_text(encoding="utf-8"))
    returned = re.findall(r"specVersion = VK_MAKE_API_VERSION\(0, (\d+), (\d+), (\d+)\)",
                          (root / RETURNED).read_text(encoding="utf-8"))
    return manifest, [".".join(version) for version in returned]


def check(root):
    rows = re.findall(r"^VELLUM_\w+\((\w+), ", (root / ROWS).read_text(encoding="utf-8"), re.M)
    aliases = dict(re.findall(r'^    \{"vk(\w+)", "vk(\w+)"\},$', (root / ALIASES).read_text(encoding="utf-8"), re.M))
    counts = collections.Counter(aliases.get(name, name) for name in rows)
    found = [f"{ROWS}: vk{name} has {count} rows" for name, count in counts.items() if count > 1]
    manifest, returned = versions(root)
    if manifest != returned or not manifest:
        found.append(f"{MANIFEST}: the version is {manifest}, in {RETURNED} {returned}")
    return sorted(found), len(rows)


if __name__ == "__main__":
    findings.run(check, "commands")
