#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that code in the documents is the code of the sources it is taken from.

A code block that follows `<!-- FILE: REGION -->` must equal what FILE has between the lines `// [REGION]` and
`// [REGION end]`, without their common indentation. With --update, blocks that differ are replaced.

usage: check_quotes.py [--update] [ROOT]
"""
import pathlib
import re
import sys
import textwrap

QUOTE = re.compile(r"<!-- (\S+): ([\w ]+) -->\n```(\w+)\n(.*?)```\n", re.S)


def region_of(text, name):
    """The lines of a region, or None."""
    found = re.search(rf"^ *// \[{name}\]\n(.*?)^ *// \[{name} end\]\n", text, re.M | re.S)
    return textwrap.dedent(found[1]) if found else None


def check(page, root, update=False):
    """Findings in one page, and how many quotes it has."""
    findings = []
    count = 0

    def compare(match):
        nonlocal count
        count += 1
        source = root / match[1]
        code = region_of(source.read_text(encoding="utf-8"), match[2]) if source.exists() else None
        if code is None:
            findings.append(f"{page.name}: {match[1]} has no region {match[2]}")
        elif code != match[4]:
            if update:
                return match[0].replace(f"\n{match[4]}```\n", f"\n{code}```\n")
            findings.append(f"{page.name}: the code of {match[1]}: {match[2]} differs from the source")
        return match[0]

    text = page.read_text(encoding="utf-8")
    new = QUOTE.sub(compare, text)
    if new != text:
        page.write_text(new, encoding="utf-8")
    return findings, count


def main():
    arguments = [word for word in sys.argv[1:] if word != "--update"]
    root = pathlib.Path(arguments[0] if arguments else pathlib.Path(__file__).parents[2])
    findings, count = [], 0
    for page in sorted([root / "README.md", *(root / "docs").rglob("*.md")]):
        found, quotes = check(page, root, "--update" in sys.argv)
        findings += found
        count += quotes
    print(*findings, sep="\n")
    print(f"{len(findings)} of {count} quotes differ")
    return 1 if findings or not count else 0


if __name__ == "__main__":
    sys.exit(main())
