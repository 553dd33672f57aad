#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the table of intercepted commands, and prints what is wrong.

Each command has one row, under the name that the registry describes: promoted commands are found by their aliases
(command_aliases.py), so a row of an alias is a second row. An alias that command_aliases.py adds for older registries is
the same in the registry at hand, if that has it. The version of Vulkan in the manifest is the one that the layer returns.

usage: check_commands.py [REGISTRY [ROOT]]
"""
import collections
import pathlib
import re
import sys

import findings

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "src/layer/base"))
import command_aliases  # noqa: E402

ROWS = "src/layer/entry/commands.cpp"
MANIFEST = "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in"
RETURNED = "src/layer/entry/instance.cpp"


def versions(root):
    manifest = re.findall(r'"api_version": "([\d.]+)"', (root / MANIFEST).read_text(encoding="utf-8"))
    returned = re.findall(r"specVersion = VK_MAKE_API_VERSION\(0, (\d+), (\d+), (\d+)\)",
                          (root / RETURNED).read_text(encoding="utf-8"))
    return manifest, [".".join(version) for version in returned]


def check(registry, root):
    rows = re.findall(r'row<\w+(?:, \w+)?>\(\s*"(vk\w+)"', (root / ROWS).read_text(encoding="utf-8"))
    aliases = command_aliases.aliases(registry)
    found = [f"{ROWS}: {name} is an alias of {aliases[name]}" for name in rows if name in aliases]
    found += [f"{ROWS}: {name} has {count} rows" for name, count in collections.Counter(rows).items() if count > 1]
    found += [f"command_aliases.py: {name} is an alias of {aliases[name]}"
              for name, command in command_aliases.NEWER.items() if aliases[name] != command]
    manifest, returned = versions(root)
    if manifest != returned or not manifest:
        found.append(f"{MANIFEST}: the version is {manifest}, in {RETURNED} {returned}")
    return sorted(found), len(rows)


if __name__ == "__main__":
    findings.run_with_registry(check, "intercepted commands")
