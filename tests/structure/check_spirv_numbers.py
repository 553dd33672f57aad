#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the numbers of SPIR-V in src/spirv/module with the registry's grammar, and prints those that differ: the
constants of numbers.h, and which instructions have results (module.cpp). The grammar may be older than they are: what it
does not have is not compared.

usage: check_spirv_numbers.py [GRAMMAR [ROOT]]
"""
import json
import re

import findings

GRAMMAR = "/usr/include/spirv/unified1/spirv.core.grammar.json"
# Instructions of kernels that grammars until 2025 describe wrongly: OpAsmTargetINTEL, OpRead- and OpWritePipeBlocking.
CORRECTED = {5609, 5946, 5947}


def numbers_of(grammar):
    """The number of each name, as spirv.hpp has them: OpLoad, CapabilityShader, LoopControlUnrollMask."""
    numbers = {"MagicNumber": int(grammar["magic_number"], 16)}
    for instruction in grammar["instructions"]:
        for name in [instruction["opname"], *instruction.get("aliases", [])]:
            numbers[name] = instruction["opcode"]
    for kind in grammar["operand_kinds"]:
        mask = kind["category"] == "BitEnum"
        for enumerant in kind.get("enumerants", []):
            for name in [enumerant["enumerant"], *enumerant.get("aliases", [])]:
                value = enumerant["value"]
                if mask:
                    name = "MaskNone" if name == "None" else name + "Mask"
                numbers[kind["kind"] + name] = int(value, 0) if isinstance(value, str) else value
    return numbers


def shapes_of(grammar):
    """Whether each opcode has a result, and a type of it."""
    shapes = {}
    for instruction in grammar["instructions"]:
        operands = [operand["kind"] for operand in instruction.get("operands", [])]
        shapes[instruction["opcode"]] = ("IdResult" in operands, "IdResultType" in operands)
    return shapes


def ranges_in(text, name):
    body = re.search(name + r"\[\] = \{\n(.*?)\n\};", text, re.S)[1]
    return {opcode for first, last in re.findall(r"\{(\d+), (\d+)\}", body) for opcode in range(int(first), int(last) + 1)}


def check(path, root):
    grammar = json.loads(path.read_text(encoding="utf-8"))
    module = root / "src/spirv/module"
    found = []
    stated = re.findall(r"constexpr uint32_t (\w+) = (\w+);", (module / "numbers.h").read_text(encoding="utf-8"))
    known = numbers_of(grammar)
    for name, number in stated:
        if name in known and known[name] != int(number, 0):
            found.append(f"src/spirv/module/numbers.h: {name} is {number}, in the registry {known[name]}")
    text = (module / "module.cpp").read_text(encoding="utf-8")
    results, typed = ranges_in(text, "kResults"), ranges_in(text, "kTypedResults")
    for opcode, shape in shapes_of(grammar).items():
        if opcode not in CORRECTED and (opcode in results or opcode in typed, opcode in typed) != shape:
            found.append(f"src/spirv/module/module.cpp: opcode {opcode}: the registry has {shape} (result, type)")
    return found, len(stated)


if __name__ == "__main__":
    findings.run_with_registry(check, "numbers", registry=GRAMMAR)
