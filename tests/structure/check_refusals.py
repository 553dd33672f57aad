#!/usr/bin/env python3
"""Checks that docs/refusals.md lists every message of the layer once, and none that there is not, and prints what is wrong.

A message is known by its id, a string in src/layer that begins with VELLUM-. The page has each in backticks in the first
column of a table, those with a VUID without the prefix VELLUM-. The page's first table says how many each section has.

usage: check_refusals.py [ROOT]
"""
import re

import findings

COMMENT = re.compile(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*')
# What the formatter has broken in two.
SEAM = re.compile(r'"\s*\n\s*"')
STRING = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
ID = re.compile(r"\bVELLUM-[A-Za-z0-9_-]*")
LISTED = re.compile(r"`((?:VELLUM|VUID)-[A-Za-z0-9_-]+)`")
COUNT = re.compile(r"^\| \[(.+)\]\(#.*\) \| (\d+) \|$")


def told(root):
    """Ids of messages, and where each is."""
    ids = {}
    for path in sorted((root / "src" / "layer").rglob("*")):
        if path.suffix not in {".cpp", ".h"}:
            continue
        code = COMMENT.sub(lambda match: match[1] or "", path.read_text(encoding="utf-8"))
        for string in STRING.findall(SEAM.sub("", code)):
            for name in ID.findall(string):
                ids.setdefault(name, path.relative_to(root))
    return ids


def listed(page):
    """Ids by the section, in lower case, whose tables have them in the first column; and the numbers that the page gives."""
    sections, counts, section = {}, {}, ""
    for line in page.splitlines():
        if line.startswith("## "):
            section = line[3:].lower()
        elif match := COUNT.match(line):
            counts[match[1].lower()] = int(match[2])
        elif line.startswith("|"):
            for name in LISTED.findall(line.split("|")[1]):
                sections.setdefault(section, []).append(name if name.startswith("VELLUM-") else "VELLUM-" + name)
    return sections, counts


def check(root):
    sections, counts = listed((root / "docs" / "refusals.md").read_text(encoding="utf-8"))
    names = [name for section in sections.values() for name in section]
    ids = told(root)
    found = [f"{path}: {name} is put together at run time, and can be looked up nowhere"
             for name, path in ids.items() if name.endswith("-")]
    found += [f"{path}: {name} is not in docs/refusals.md"
              for name, path in sorted(ids.items()) if not name.endswith("-") and name not in names]
    found += [f"docs/refusals.md: there is no message {name}" for name in sorted(set(names) - ids.keys())]
    found += [f"docs/refusals.md: {name} is there {names.count(name)} times"
              for name in sorted(set(names)) if names.count(name) > 1]
    found += [f"docs/refusals.md: {len(sections.get(section, []))} messages are {section}, not {counts.get(section)}"
              for section in sorted(sections.keys() | counts.keys())
              if counts.get(section) != len(sections.get(section, []))]
    return found, len(ids)


if __name__ == "__main__":
    findings.run(check, "messages")
