#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the facts in src/vk that come from Vulkan's registry against the headers and the registry at hand, and prints what
differs: the size of each structure, by the C compiler, the values of sTypes and other names, and aliases of commands. What the headers lack
may be there. What the facts lack is a finding unless the headers are newer.

usage: check_registry.py [REGISTRY [ROOT [HEADER [COMPILER]]]]
"""
import pathlib
import re
import subprocess
import sys
import tempfile

import findings

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "src/vk"))
import registry as vulkan  # noqa: E402

SIZES = "src/vk/structure_sizes.h"
ALIASES = "src/vk/command_aliases.h"
ENUMS = "src/vk/enum_names.h"
# Structures that only drivers write, which registries before 1.4 do not say.
WRITTEN = {"VkAccelerationStructureBuildSizesInfoKHR", "VkCooperativeMatrixPropertiesNV", "VkDeviceFaultInfoEXT",
           "VkPhysicalDeviceExtendedDynamicState3PropertiesEXT", "VkPhysicalDeviceFragmentShadingRateEnumsPropertiesNV",
           "VkPhysicalDeviceGraphicsPipelineLibraryPropertiesEXT", "VkPipelinePropertiesIdentifierEXT",
           "VkQueueFamilyGlobalPriorityPropertiesKHR", "VkSurfaceCapabilitiesPresentBarrierNV",
           "VkSurfaceProtectedCapabilitiesKHR"}
HEADER = "/usr/include/vulkan/vulkan_core.h"


def declared(header):
    """Structures with an sType that the header declares without further macros: of provisional extensions none."""
    text = re.sub(r"#ifdef VK_ENABLE_BETA_EXTENSIONS\n.*?#endif", "", header.read_text(encoding="utf-8"), flags=re.S)
    return set(re.findall(r"typedef struct (Vk\w+) \{\s*VkStructureType\s+sType;", text))


def number(version):
    return tuple(int(part) for part in version.split("."))


def differing(rows, header, compiler):
    """Structures that the compiler has another size for."""
    asserts = "".join(f'_Static_assert(sizeof({name}) == {size}, "{name} {size}");\n' for name, size in rows)
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder) / "sizes.c"
        source.write_text(f"#include <{header}>\n{asserts}", encoding="utf-8")
        result = subprocess.run([compiler, "-fsyntax-only", "-I", header.parent.parent, source], stderr=subprocess.PIPE,
                                text=True, check=False)
    wrong = re.findall(r'failed: \\?"(Vk\w+) (\d+)', result.stderr)
    if result.returncode != 0 and not wrong:
        sys.exit(result.stderr)
    return wrong


def check(registry, root, header=HEADER, compiler="cc"):
    text = (root / SIZES).read_text(encoding="utf-8")
    sizes = {name: (int(value), int(size)) for value, size, name in
             re.findall(r'^    \{(\d+), (\d+), "(\w+)"\},$', text, re.M)}
    aliases = dict(re.findall(r'^    \{"(\w+)", "(\w+)"\},$', (root / ALIASES).read_text(encoding="utf-8"), re.M))
    version = re.search(r"registry ([\d.]+)\.$", text, re.M)[1]
    at_hand = vulkan.Registry(registry)
    header = pathlib.Path(header)
    known = declared(header)
    found = [f"{SIZES}: {name} has another size than {size}"
             for name, size in differing([(n, s) for n, (_, s) in sizes.items() if n in known], header, compiler)]
    structures = {name: value for value, name, _ in at_hand.structures()}
    found += [f"{SIZES}: the sType of {name} is {structures[name]}, not {value}"
              for name, (value, _) in sizes.items() if structures.get(name, value) != value]
    enums = {name: value for value, name in
             re.findall(r'^    \{(-?\d+), "(\w+)"\},$', (root / ENUMS).read_text(encoding="utf-8"), re.M)}
    found += [f"{ENUMS}: {name} is {at_hand.value(name)}, not {value}" for name, value in enums.items()
              if name in at_hand.values and at_hand.value(name) != value]
    for name, command in at_hand.aliases().items():
        if name in aliases and aliases[name] != aliases.get(command, command):
            found.append(f"{ALIASES}: {name} is an alias of {command}, not of {aliases[name]}")
    originals = {at_hand.original(n, at_hand.types) for n in known if n in at_hand.types}
    values = {value for value, _ in sizes.values()}
    missing = [f"{SIZES}: no {name}" for name in sorted(originals - WRITTEN) if structures.get(name, None) not in values | {None}]
    missing += [f"{ALIASES}: no {name}" for name in at_hand.aliases() if name not in aliases]
    if number(at_hand.version) > number(version):
        print(f"{len(missing)} are newer than the facts, of {version}: src/vk/registry.py")
        missing = []
    return found + missing, len(known) + len(enums) + len(aliases)


if __name__ == "__main__":
    options = sys.argv[3:]
    findings.run_with_registry(lambda registry, root: check(registry, root, *options), "structures and aliases")
