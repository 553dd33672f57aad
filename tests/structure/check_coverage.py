#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks docs/design/coverage.md against the registry and the tests, and prints what differs:

- every command, type and value that the registry (vk.xml) has for the extensions is on the page;
- every test that the page names exists. Names are suite and case; one that begins with a dot belongs to the suite before it,
  "*" stands for any rest, MS for MicromapStructure;
- the header for older Vulkan headers is of the version that the page names, the only one that states it.

usage: check_coverage.py [REGISTRY [ROOT]]
"""
import fnmatch
import re
import xml.etree.ElementTree as ElementTree

import findings

PAGE = "docs/design/coverage.md"
RULES = "docs/messages.md"
HEADER = "include/vellum/vulkan_opacity_micromap.h"
EXTENSIONS = ("VK_EXT_opacity_micromap", "VK_KHR_opacity_micromap", "VK_ARM_pipeline_opacity_micromap",
              "VK_KHR_device_address_commands")
# Values that a structure or a type of flags implies, and values whose meaning does not belong to these extensions.
IMPLIED = re.compile(r"VK_STRUCTURE_TYPE_|_MAX_ENUM|VK_OBJECT_TYPE_MICROMAP_EXT$")
TEST = re.compile(r"^(?:TEST|TEST_F|TEST_P|TYPED_TEST)\(\s*(\w+),\s*(\w+)", re.M)
NAMED = re.compile(r"(?<![\w/.*-])((?:[A-Z][\w*]*)?)\.([A-Z*][\w*]*)")


def of_registry(path):
    names = set()
    for extension in ElementTree.parse(path).getroot().findall("extensions/extension"):
        if extension.get("name") in EXTENSIONS:
            names |= {required.get("name") for block in extension.findall("require") for required in block
                      if required.tag in ("type", "command", "enum")}
    return {name for name in names if name and not IMPLIED.search(name)}


def is_named(name, page):
    names = {name, name.replace("FlagBits", "Flags"), re.sub("_(EXT|KHR)$", "", name)}
    pages = (page, page.replace("_BIT", ""))
    return any(re.search(rf"\b{each.replace('_BIT', '')}\b", text) for each in names for text in pages)


def of_sources(root):
    """Suite: its cases."""
    tests = {}
    for path in (root / "tests").rglob("*"):
        if path.suffix in {".cpp", ".h"}:
            for suite, case in TEST.findall(path.read_text(encoding="utf-8")):
                tests.setdefault(suite, set()).add(case)
    return tests


def missing_tests(page, tests):
    for line in page.splitlines():
        if not line.startswith("|"):
            continue
        suite = ""
        for named, case in NAMED.findall(re.sub(r"`[^`]*`", "", line).replace("\\*", "*")):
            suite = re.sub(r"^MS(?=[A-Z*]|$)", "MicromapStructure", named) or suite
            if not any(fnmatch.fnmatchcase(s, suite) and fnmatch.fnmatchcase(c, case)
                       for s, cases in tests.items() for c in cases):
                yield f"{suite}.{case}"


def check_versions(root, page):
    """The registry's version stands on the page, and in the header, which is used without it."""
    version = re.search(r"Vulkan (1\.4\.\d+) \(", page)
    stated = version[1] if version else None
    header = re.findall(r"\b1\.4\.\d+\b", (root / HEADER).read_text(encoding="utf-8"))
    if stated is None or header != [stated]:
        yield f"{HEADER}: the registry's version is {header}, in {PAGE} {stated}"
    for other in re.findall(r"Vulkan (1\.4\.\d+)", (root / RULES).read_text(encoding="utf-8")):
        yield f"{RULES}: states the registry's version {other}, as {PAGE} does"


def check(registry, root):
    page = (root / PAGE).read_text(encoding="utf-8")
    wanted, tests = of_registry(registry), of_sources(root)
    found = [f"{PAGE}: nothing about {name}" for name in sorted(wanted) if not is_named(name, page)]
    found += check_versions(root, page)
    found += [f"{PAGE}: there is no test {test}" for test in sorted(set(missing_tests(page, tests)))]
    return found, len(wanted)


if __name__ == "__main__":
    findings.run_with_registry(check, "parts of the extensions")
