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
import made_up  # noqa: E402
from schema import faults, strict  # noqa: E402

VELLUM, READERS, CHECK = sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text(encoding="utf-8")), sys.argv[3]
SCHEMA = strict(READERS)


def report(*arguments, code=0, program=VELLUM):
    done = subprocess.run([program, *map(str, arguments), "--json"], capture_output=True, text=True, timeout=300)
    assert done.returncode == code, (arguments, done.returncode, done.stderr)
    value = json.loads(done.stdout)
    found = faults(value, SCHEMA)
    assert not found, (arguments, found)
    listed = [word for word in arguments if word in ("--list", "--groups")]
    assert value["command"] == " ".join([arguments[0], *listed])
    return value


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    tree, baked, cut = folder / "tree.glb", folder / "tree.omm.glb", folder / "cut.glb"
    tree.write_bytes(made_up.glb([("leaves", "leaf", made_up.disc(32), 4), ("twigs", "twig", made_up.holes(32), 2)]))
    cut.write_bytes(tree.read_bytes()[:200])
    bake = report("bake", tree, "--level", "3")
    assert len(bake["files"][0]["primitives"]) == 2
    report("bake", tree, "--exclude-material", "tw*", "--dry-run", "--states", "2")
    assert report("bake", tree, "--dry-run", "--cache", folder / "cache")["files"][0]["cache"] == {"hits": 0, "misses": 2}
    report("bake", tree, cut, "-o", folder / "out", code=1)
    unbaked = report("bake", tree, "--exclude-material", "*", "-o", folder / "unbaked.glb")["files"][0]
    assert not unbaked["written"] and len(unbaked["skipped"]) == 2
    report("bake", tree, "--exclude-material", "*", "--require-micromaps", "--force", code=7)
    log = folder / "log.jsonl"
    jobs = ["bake", tree, baked, "-o", folder / "logged", "--force", "--log", log, "--resume", log]
    assert len(report(*jobs)["files"]) == 2
    assert report(*jobs)["done"] == 2
    report("info", tree, baked)
    report("info", baked, cut, code=1)
    report("inspect", baked, "-o", folder / "page.html", "--material", "leaf")
    report("inspect", tree, "-o", folder / "page.html", "--bake", "--exclude-material", "twig")
    report("inspect", baked, baked)
    report("sweep", tree, "--max-level", "3")
    report("sweep", tree, cut, "-o", folder / "sweep.html", code=1)
    report("verify", baked, tree)
    report("verify", "--exact", "--max-findings", "2", baked)
    report("verify", "--strict", cut, tree, code=1)
    report("verify", "--require-micromaps", baked, tree, code=7)
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

    # vellum run writes a file.
    message = "echo error VELLUM-a: what >> $VELLUM_REPORT_FILE; echo info VELLUM-checked: builds: core, gpu >> $VELLUM_REPORT_FILE"
    for words, code in ((["sh", "-c", "exit 3"], 3), (["sh", "-c", message], 122), (["sh", "-c", "kill -SEGV $$"], 139),
                        (["there-is-no-such-program"], 127)):
        written = folder / "run.json"
        done = subprocess.run([VELLUM, "run", "--ignore", "VELLUM-b", "--json", written, "--", *words], capture_output=True,
                              timeout=300)
        value = json.loads(written.read_text(encoding="utf-8"))
        found = faults(value, SCHEMA)
        assert not found, (words, found)
        assert done.returncode == value["exitCode"] == code and value["program"] == words, value
        if code == 122:
            assert value["messages"] == [{"severity": "error", "id": "VELLUM-a", "count": 1, "text": "what", "ignored": False,
                                          "fails": True}], value
            assert value["validation"] == [["core", "gpu"]] and value["staleIgnores"] == ["VELLUM-b"], value

    listed = subprocess.run([VELLUM, "check", "--list"], capture_output=True, text=True, check=True).stdout.splitlines()
    assert report("check", "--list")["cases"] == listed
    groups = subprocess.run([VELLUM, "check", "--groups"], capture_output=True, text=True, check=True).stdout
    for group in report("check", "--groups")["groups"]:
        printed = ("{group} ({cases} cases of each extension, {quick} of them with --quick)\n  {summary}\n"
                   "  Checks: {sentences}\n").format(**group)
        assert printed in groups, group
        groups = groups.replace(printed, "")
    assert not groups
    out = folder / "check"
    check = report("check", "--filter", "*.good.*", "--filter", "*.bad.*", "--filter", "*.crash.*", "--filter", "*.lost.*",
                   "--filter", "*.skip.*", "-o", out, code=1, program=CHECK)
    assert check == json.loads((out / "results.json").read_text(encoding="utf-8"))
    for path in (out / "failures").glob("*.json"):
        found = faults(json.loads(path.read_text(encoding="utf-8")), SCHEMA)
        assert not found, (path, found)
    reproducers = {pathlib.Path(case["reproducer"]) for case in check["cases"] if "reproducer" in case}
    assert reproducers == set((out / "failures").glob("*.json"))
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

    # Readers take what later versions add; the strict schema does not.
    for change in (lambda v: v.update(more=1), lambda v: v["files"][0].update(more=1),
                   lambda v: v["files"][0]["surface"].update(more=1), lambda v: v["files"][0]["micromaps"][0].update(more={})):
        later = copy.deepcopy(bake)
        change(later)
        assert not faults(later, READERS) and faults(later, SCHEMA), later

    # A schema that accepts everything would be useless.
    assert faults({}, SCHEMA) and faults([], SCHEMA)
    for change in (lambda v: v.update(schema="vellum/0"), lambda v: v["files"][0].pop("bytes"),
                   lambda v: v["files"][0]["surface"].update(known="much"),
                   lambda v: v["files"][0]["micromaps"][0].update(bytes=-1)):
        wrong = copy.deepcopy(bake)
        change(wrong)
        assert faults(wrong, READERS) and faults(wrong, SCHEMA), wrong
