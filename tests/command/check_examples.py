#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks examples that would pass although they test nothing: names of cases in the help and the page of vellum check are of
groups that exist, and the jobs of docs/ci.md validate, fail where nothing was checked, and publish JUnit's results.

usage: check_examples.py VELLUM DOCS
"""
import pathlib
import re
import subprocess
import sys

vellum, docs = sys.argv[1], pathlib.Path(sys.argv[2])
findings = []


def run(*arguments):
    return subprocess.run([vellum, *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


groups = set(re.findall(r"^(\S+) \(", run("check", "--groups"), re.M))
texts = {"vellum check --help": run("check", "--help"), "check.md": (docs / "check.md").read_text(encoding="utf-8")}
for place, text in texts.items():
    named = re.findall(r"\b(?:khr|ext)\\?\.([a-z-]+)\\?\.", text)
    findings += [f"{place}: there is no group {group}" for group in named if group not in groups]
    if not named:
        findings.append(f"{place}: no case is named, or this script does not find it")

jobs = "\n".join(re.findall(r"^```\w*\n(.*?)^```", (docs / "ci.md").read_text(encoding="utf-8"), re.M | re.S))
jobs = jobs.replace("\\\n", " ").splitlines()
options = ("--validate", "--fail-on warning", "--require-checks", "--junit ")
variables = ("-e VELLUM_VALIDATE", "-e VELLUM_FAIL_ON", "-e VELLUM_REQUIRE_CHECKS")
for kind, needed, least in ((r"vellum +run ", options, 4), (r"docker run (?!.*--entrypoint)", variables, 1)):
    lines = [line for line in jobs if re.search(kind, line)]
    findings += [f"ci.md: no {what}: {line}" for line in lines for what in needed if what not in line]
    if len(lines) < least:
        findings.append(f"ci.md: {len(lines)} lines with {kind}")
print(*findings, sep="\n")
sys.exit(1 if findings else 0)
