#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that docs/check-groups.md has the groups of vellum check --groups; with --write, it is written anew.

usage: check_groups.py [--write] VELLUM PAGE
"""
import pathlib
import re
import subprocess
import sys
import textwrap

HEAD = """# Groups of vellum check

The groups of cases of [`vellum check`](check.md), and the sentences of the specification that each checks. Generated
from `vellum check --groups` by `tests/command/check_groups.py --write`.
"""


def paragraph(text):
    text = re.sub(r"([<*])", r"\\\1", text)
    return textwrap.fill(text if text.endswith(".") else text + ".", 118, break_long_words=False, break_on_hyphens=False)


def page_of(groups):
    page = HEAD
    line = r"^(\S+) \((\d+) cases, (\d+) of them in a quick run\)\n  (.*)\n  (.*)\n"
    for name, cases, quick, summary, sentences in re.findall(line, groups, re.M):
        assert 1 <= int(quick) <= int(cases), f"{name}: {quick} cases in a quick run"
        page += f"\n## {name}\n" + paragraph(f"{summary[0].upper()}{summary[1:]}. {cases} cases of each extension, "
                                             f"{quick} of them in a quick run")
        page += "\n\n" + paragraph("Checks: " + sentences) + "\n"
    return page


def main():
    write = "--write" in sys.argv
    vellum, page = [word for word in sys.argv[1:] if word != "--write"]
    page = pathlib.Path(page)
    groups = subprocess.run([vellum, "check", "--groups"], check=True, stdout=subprocess.PIPE, text=True).stdout
    text = page_of(groups)
    assert text.count("\n## ") == len(re.findall(r"^\S", groups, re.M)), "a group that this script does not understand"
    if write:
        page.write_text(text, encoding="utf-8")
    elif not page.exists() or page.read_text(encoding="utf-8") != text:
        sys.exit(f"{page} is stale: tests/command/check_groups.py --write VELLUM {page}")


if __name__ == "__main__":
    main()
