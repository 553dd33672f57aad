#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that what --json prints is by src/cli/schema.json, for every subcommand, and that the schema rejects what it should.

CHECK is a program of the tests that has vellum check with groups of its own.

usage: check_schema.py VELLUM SCHEMA CHECK
"""
import copy
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "inspect"))
import made_up

VELLUM, SCHEMA, CHECK = sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text(encoding="utf-8")), sys.argv[3]
TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float),
         "null": type(None)}
KNOWN = {"$schema", "$id", "title", "description", "$defs", "$ref", "type", "properties", "required", "minimum", "maximum",
         "additionalProperties", "items", "enum", "const", "oneOf"}


def is_type(value, name):
    return isinstance(value, TYPES[name]) and not (isinstance(value, bool) and name in ("integer", "number"))


def faults(value, schema, place="$"):
    """What of `value` breaks the schema, which has only the keywords above."""
    assert set(schema) <= KNOWN, set(schema) - KNOWN
    found = []
    if "$ref" in schema:
        found += faults(value, SCHEMA["$defs"][schema["$ref"].removeprefix("#/$defs/")], place)
    if "oneOf" in schema:
        each = [faults(value, choice, place) for choice in schema["oneOf"]]
        if sum(not f for f in each) != 1:
            found += min(each, key=len) or [f"{place}: several of oneOf"]
    types = schema.get("type", [])
    types = [types] if isinstance(types, str) else types
    if types and not any(is_type(value, name) for name in types):
        return found + [f"{place}: {value!r} is not {types}"]
    if "const" in schema and value != schema["const"] or "enum" in schema and value not in schema["enum"]:
        found.append(f"{place}: {value!r} is not {schema.get('const', schema.get('enum'))}")
    if not schema.get("minimum", float("-inf")) <= (value if is_type(value, "number") else 0) <= schema.get("maximum", float("inf")):
        found.append(f"{place}: {value} is out of range")
    if isinstance(value, list) and "items" in schema:
        for i, element in enumerate(value):
            found += faults(element, schema["items"], f"{place}[{i}]")
    if isinstance(value, dict):
        found += [f"{place}: {name} is missing" for name in schema.get("required", []) if name not in value]
        more = schema.get("additionalProperties", True)
        for name, member in value.items():
            if name in schema.get("properties", {}):
                found += faults(member, schema["properties"][name], f"{place}.{name}")
            elif more is False:
                found.append(f"{place}: {name} is unknown")
            elif more is not True:
                found += faults(member, more, f"{place}.{name}")
    return found


def report(*arguments, code=0, program=VELLUM):
    done = subprocess.run([program, *map(str, arguments), "--json"], capture_output=True, text=True, timeout=300)
    assert done.returncode == code, (arguments, done.returncode, done.stderr)
    value = json.loads(done.stdout)
    found = faults(value, SCHEMA)
    assert not found, (arguments, found)
    assert value["command"] == arguments[0]
    return value


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    tree, baked, cut = folder / "tree.glb", folder / "tree.omm.glb", folder / "cut.glb"
    tree.write_bytes(made_up.glb([("leaves", "leaf", made_up.disc(32), 4), ("twigs", "twig", made_up.holes(32), 2)]))
    cut.write_bytes(tree.read_bytes()[:200])
    bake = report("bake", tree, "--level", "3")
    assert len(bake["files"][0]["primitives"]) == 2
    report("bake", tree, "--exclude-material", "tw*", "--dry-run", "--states", "2")
    report("bake", tree, cut, "-o", folder / "out", code=1)
    report("info", tree, baked)
    report("info", baked, cut, code=1)
    report("inspect", baked, "-o", folder / "page.html", "--material", "leaf")
    report("inspect", tree, "-o", folder / "page.html", "--bake", "--exclude-material", "twig")
    report("verify", baked, tree)
    report("verify", "--exact", "--max-findings", "2", baked)
    report("verify", "--strict", cut, tree, code=1)
    report("info")
    # An empty compute shader.
    module = folder / "empty.spv"
    words = (0x07230203, 0x10500, 0, 5, 0, 2 << 16 | 17, 1, 3 << 16 | 14, 0, 1, 5 << 16 | 15, 5, 1, 0x6e69616d, 0,
             6 << 16 | 16, 1, 17, 1, 1, 1, 2 << 16 | 19, 2, 3 << 16 | 33, 3, 2, 5 << 16 | 54, 2, 1, 0, 3, 2 << 16 | 248, 4,
             1 << 16 | 253, 1 << 16 | 56)
    module.write_bytes(struct.pack(f"<{len(words)}I", *words))
    declared = folder / "declared.spv"
    report("spirv", "--enable-micromaps=7", "--entry", "main", module, "-o", declared)
    report("spirv", "--lint", module)
    assert report("spirv", "--lint", declared, cut, code=1)["files"][0]["findings"]
    report("spirv", "--rewrite", module, "-o", folder / "rewritten.spv")
    report("render", baked, "--mode", "compare", "--size", "32x32", "--frames", "2", "-o", folder / "picture.png")

    out = folder / "check"
    check = report("check", "--filter", "*.good.*", "--filter", "*.bad.*", "--filter", "*.crash.*", "--filter", "*.lost.*",
                   "--filter", "*.skip.*", "-o", out, code=1, program=CHECK)
    assert check == json.loads((out / "results.json").read_text(encoding="utf-8"))
    for path in (out / "failures").glob("*.json"):
        found = faults(json.loads(path.read_text(encoding="utf-8")), SCHEMA)
        assert not found, (path, found)
    # JUnit's XML and the CSV say the same.
    named = {case["case"]: case["result"] for case in check["cases"]}
    junit = {}
    for case in xml.etree.ElementTree.parse(out / "junit.xml").iter("testcase"):
        failure, skipped = case.find("failure"), case.find("skipped")
        junit[case.get("name")] = failure.get("type") if failure is not None else "Skip" if skipped is not None else "Pass"
        assert case.get("name").startswith(case.get("classname") + ".")
    assert junit == named, (junit, named)
    rows = [line.split(",") for line in (out / "results.csv").read_text(encoding="utf-8").splitlines()]
    assert {name: status for name, status, _ in rows} == named and all(float(row[2]) >= 0 for row in rows)
    faults_of_device = [f"{fault['fault']}: {fault['response']}" for fault in check["knownFaults"]]
    for suite in xml.etree.ElementTree.parse(out / "junit.xml").iter("testsuite"):
        assert int(suite.get("tests")) == len(suite.findall("testcase"))
        assert [p.get("value") for p in suite.iter("property")] == faults_of_device != []
        assert int(suite.get("failures")) == len(suite.findall("testcase/failure"))

    # Times of a fraction of a second mean nothing, but every part has rows.
    done = subprocess.run([VELLUM, "bench", "--seconds", "1", "-o", folder / "bench.html"], capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    bench = json.loads((folder / "bench.json").read_text(encoding="utf-8"))
    found = faults(bench, SCHEMA)
    assert not found, found
    assert all(part["rows"] and not part["failure"] for part in bench["parts"]), bench
    assert all(row["differingPixels"] == 0 for part in bench["parts"] for row in part["rows"] if row["row"] == "frame")
    assert all(row["failed"] == 0 for part in bench["parts"] for row in part["rows"] if row["row"] == "check")
    page = (folder / "bench.html").read_text(encoding="utf-8")
    assert all(word not in page for word in ("<!--@", str(folder), "/home/", "/root/"))

    # The schema is no use if it takes everything.
    assert faults({}, SCHEMA) and faults([], SCHEMA)
    for change in (lambda v: v.update(schema="vellum/0"), lambda v: v["files"][0].pop("bytes"),
                   lambda v: v["files"][0].update(more=1), lambda v: v["files"][0]["surface"].update(known="much"),
                   lambda v: v["files"][0]["micromaps"][0].update(bytes=-1)):
        wrong = copy.deepcopy(bake)
        change(wrong)
        assert faults(wrong, SCHEMA), wrong
