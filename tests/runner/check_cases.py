#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that CTest runs every test case at least once, and that every file of tests is compiled.

PROGRAMS is a file that lists the GoogleTest programs of a build, one a line. A case counts as run if a test of the build
starts its program with a filter that takes it. Disabled cases never run, and so are reported, except those called
DISABLED_Run: other cases start them, as programs.

usage: check_cases.py --build FOLDER --tests FOLDER --programs PROGRAMS [--ctest CTEST]
"""
import argparse
import fnmatch
import json
import os
import pathlib
import re
import subprocess
import sys


def listed(program):
    """All cases of a program, disabled ones too."""
    listing = subprocess.run([program, "--gtest_list_tests"], stdout=subprocess.PIPE, check=True, text=True).stdout
    suite, cases = None, []
    for line in listing.splitlines():
        name = line.split("#")[0].rstrip()
        if name.startswith("  ") and suite:
            cases.append(suite + name.strip())
        elif name.endswith("."):
            suite = name
    return cases


def disabled(case):
    return any(part.startswith("DISABLED_") for part in case.replace(".", "/").split("/"))


def takes(chosen, case):
    """Whether a filter of GoogleTest takes a case. Its patterns have no brackets."""
    wanted, _, unwanted = chosen.partition("-")

    def matches(patterns):
        return any(fnmatch.fnmatchcase(case, pattern) for pattern in patterns.split(":") if pattern)

    return (not wanted or matches(wanted)) and not matches(unwanted) and not disabled(case)


def filters(tests):
    """The filters that the tests of a build start each program with."""
    found = {}
    for test in tests:
        command = test.get("command", [])
        chosen = next((word.partition("=")[2] for word in command if word.startswith("--gtest_filter=")), "")
        for word in command:
            if os.path.isabs(word):
                found.setdefault(os.path.realpath(word), []).append(chosen)
    return found


def never_run(programs, tests):
    chosen = filters(tests)
    for program in programs:
        if not os.path.exists(program):
            yield f"{os.path.basename(program)}: not built"
            continue
        for case in listed(program):
            if not case.endswith(".DISABLED_Run") and not any(takes(one, case) for one in chosen.get(os.path.realpath(program), [])):
                yield f"{os.path.basename(program)}: {case}"


# Compiled for Windows, or with VELLUM_MESH_LIBRARIES off.
OF_OTHER_BUILDS = {"gltf/uncompressed_test.cpp", "windows/settings_test.cpp"}


def sources(commands):
    """The files that are compiled, alone or as parts of a batch of a unity build."""
    for entry in commands:
        yield entry["file"]
        if re.search(r"/Unity/unity_.*\.cxx$", entry["file"]):
            yield from re.findall(r'^#include "(.*)"$', pathlib.Path(entry["file"]).read_text(encoding="utf-8"), re.M)


def not_compiled(folder, compiled):
    compiled = {os.path.realpath(file) for file in compiled}
    for file in sorted(folder.rglob("*_test.cpp")):
        name = file.relative_to(folder).as_posix()
        if str(file.resolve()) not in compiled and name not in OF_OTHER_BUILDS:
            yield name


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    parser.add_argument("--tests", type=pathlib.Path, required=True)
    parser.add_argument("--programs", type=pathlib.Path, required=True)
    parser.add_argument("--ctest", default="ctest")
    options = parser.parse_args()

    listing = subprocess.run([options.ctest, "--test-dir", options.build, "--show-only=json-v1"],
                             stdout=subprocess.PIPE, check=True, text=True).stdout
    tests = json.loads(listing[listing.index("{"):])["tests"]
    commands = json.loads((options.build / "compile_commands.json").read_text(encoding="utf-8"))
    programs = options.programs.read_text(encoding="utf-8").split("\n")
    missed = [f"never run: {case}" for case in never_run(list(filter(None, programs)), tests)]
    missed += [f"never compiled: {file}" for file in not_compiled(options.tests, sources(commands))]
    print(*missed, sep="\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
