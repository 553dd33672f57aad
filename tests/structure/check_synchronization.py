#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that the layer handles what the registry (vk.xml) states about queues, stages and accesses, and prints what it lacks:

- Every command whose queue is externally synchronized holds the lock of probes, which submit to a queue of the application
  (src/layer/command_buffer/driver_probe.h).
- Every structure and command with 64-bit pipeline stages or accesses replaces those of micromaps, or is listed here with
  the reason why it need not.

usage: check_synchronization.py [REGISTRY [ROOT]]
"""
import re
import xml.etree.ElementTree as ElementTree

import findings

ROWS = "src/layer/base/commands.inc"
CODE = "src/layer/command_buffer/synchronization.cpp"
OTHER_CODE = ["src/layer/device_address/address_copies.cpp"]
FLAGS = re.compile(r"VkPipelineStage(Flags|FlagBits)2|VkAccess(Flags|FlagBits)2")
NOT_HANDLED = {
    "VkQueueFamilyCheckpointProperties2NV": "returned by the driver",
    "VkCheckpointData2NV": "returned by the driver",
}


def types(element, path):
    return {child.text for child in element.findall(path)}


def supported(element):
    """Whether an extension, or whatever else requires a command, is for Vulkan."""
    return "vulkan" in (element.get("supported") or "vulkan").split(",")


def queue_commands(root):
    """The commands whose first parameter is an externally synchronized queue; "maybe": unless the driver synchronizes it."""
    disabled = {required.get("name") for extension in root.findall("extensions/extension") if not supported(extension)
                for required in extension.findall("require/command")}
    for command in root.findall("commands/command"):
        parameter = command.find("param")
        if parameter is None or parameter.find("type").text != "VkQueue":
            continue
        name = command.find("proto/name").text
        if parameter.get("externsync") in ("true", "maybe") and name not in disabled:
            yield name


def holders_of_flags(root):
    """Structures and commands that have stages or accesses of 64 bits."""
    for structure in root.findall("types/type"):
        if structure.get("category") == "struct" and any(FLAGS.match(t) for t in types(structure, "member/type")):
            yield structure.get("name")
    for command in root.findall("commands/command"):
        if any(FLAGS.match(t) for t in types(command, "param/type")):
            yield command.find("proto/name").text


def body(code, function):
    found = re.search(rf"^\w[\w: ]*\b{function}\(.*?^}}$", code, re.M | re.S)
    return found[0] if found else ""


def check(registry, root):
    tree = ElementTree.parse(registry).getroot()
    code = (root / CODE).read_text(encoding="utf-8")
    rows = {"vk" + name: function for name, function in
            re.findall(r"^VELLUM_\w+\((\w+), \w+, (\w+)", (root / ROWS).read_text(encoding="utf-8"), re.M) if function != "none"}
    found = []
    queues = sorted(queue_commands(tree))
    for name in queues:
        if name not in rows:
            found.append(f"{ROWS}: no row for {name}, whose queue is externally synchronized")
        elif "probes.lock(" not in body(code, rows[name]):
            found.append(f"{CODE}: {rows[name]} does not hold the lock of probes")
    everything = code + "".join((root / file).read_text(encoding="utf-8") for file in OTHER_CODE)
    holders = sorted(set(holders_of_flags(tree)))
    for name in holders:
        handled = name in rows if name.startswith("vk") else re.search(rf"\b{name}\b", everything)
        if not handled and name not in NOT_HANDLED:
            found.append(f"{CODE}: {name} has stages or accesses, and nothing replaces those of micromaps")
    return found, len(queues) + len(holders)


if __name__ == "__main__":
    findings.run_with_registry(check, "commands and structures")
