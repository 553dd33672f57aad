#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that the table of docs/messages.md has every message of the layer, sorted, with its severity, and prints what is
wrong.

A message is known by its id, a string in src/layer that begins with VELLUM-. The table has each in backticks, those with a
VUID without the prefix VELLUM-. Where the id is an argument of a function that sends it (SEVERITIES), the severity is known;
where it is passed on first, the page's counts. With --write, the table is brought up to date; new rows lack their texts.

usage: check_messages.py [--write] [ROOT]
"""
import re

import findings

PAGE = "docs/messages.md"
COMMENT = re.compile(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*')
# What the formatter has broken in two.
SEAM = re.compile(r'"\s*\n\s*"')
STRING = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
ID = re.compile(r"\bVELLUM-[A-Za-z0-9_-]*")
CALL = re.compile(r"(\w+)\s*$")
ROW = re.compile(r"^\| `((?:VELLUM|VUID)-[A-Za-z0-9_-]+)` \| ([^|]*) \| (.*) \|$")
BOTH = "warning or error"
SEVERITIES = {"reject": "error", "error": "error", "tolerate": "warning", "tolerates": "warning", "warning": "warning",
              "tolerateIf": BOTH, "info": "info"}


def caller(code, end):
    """The function among whose arguments a position is; empty if a brace or a semicolon comes first."""
    depth = 0
    for at in range(end - 1, -1, -1):
        if code[at] == ")":
            depth += 1
        elif code[at] == "(" and depth:
            depth -= 1
        elif code[at] == "(":
            return CALL.search(code[:at])[1] if CALL.search(code[:at]) else ""
        elif code[at] in "{};" and not depth:
            break
    return ""


def messages(root):
    """Ids, each with where it is and the severities that are known."""
    ids = {}
    for path in sorted((root / "src" / "layer").rglob("*")):
        if path.suffix not in {".cpp", ".h"}:
            continue
        code = SEAM.sub("", COMMENT.sub(lambda match: match[1] or "", path.read_text(encoding="utf-8")))
        for string in STRING.finditer(code):
            for name in ID.findall(string[1]):
                where, severities = ids.setdefault(name, (path.relative_to(root), set()))
                severities.add(SEVERITIES.get(caller(code, string.start())))
    return ids


def severity(severities):
    """None where some call does not tell."""
    if None in severities:
        return None
    return BOTH if len(severities) > 1 else next(iter(severities))


def shown(name):
    return name.removeprefix("VELLUM-") if name.startswith("VELLUM-VUID") else name


def order(name):
    return name.startswith("VUID"), name.lower()


def rows_of(page):
    return [match.groups() for match in map(ROW.match, page.splitlines()) if match]


def updated(page, ids):
    old = {name: (level, text) for name, level, text in rows_of(page)}
    lines = page.splitlines()
    first = next(number for number, line in enumerate(lines) if ROW.match(line))
    rows = []
    for name in sorted(map(shown, ids), key=order):
        full = name if name in ids else "VELLUM-" + name
        level, text = old.get(name, ("", " | "))
        rows.append(f"| `{name}` | {severity(ids[full][1]) or level} | {text} |")
    rest = [line for line in lines[first:] if not ROW.match(line)]
    return "\n".join(lines[:first] + rows + rest) + "\n"


def write(root):
    page = root / PAGE
    page.write_text(updated(page.read_text(encoding="utf-8"), messages(root)), encoding="utf-8")


def check(root):
    page = (root / PAGE).read_text(encoding="utf-8")
    ids = messages(root)
    rows = rows_of(page)
    names = [name for name, _, _ in rows]
    found = [f"{path}: {name} is put together at run time, and cannot be looked up"
             for name, (path, _) in ids.items() if name.endswith("-")]
    known = {shown(name): path for name, (path, _) in ids.items() if not name.endswith("-")}
    found += [f"{path}: {name} is not in {PAGE}" for name, path in sorted(known.items()) if name not in names]
    found += [f"{PAGE}: there is no message {name}" for name in sorted(set(names) - known.keys())]
    found += [f"{PAGE}: {name} is there {names.count(name)} times" for name in sorted(set(names)) if names.count(name) > 1]
    found += [f"{PAGE}: {name} is not in order" for name, after in zip(names[1:], names) if order(name) < order(after)]
    for name, level, text in rows:
        full = name if name in ids else "VELLUM-" + name
        sent = severity(ids[full][1]) if full in ids else None
        if sent and level != sent:
            found.append(f"{PAGE}: {name} is \"{level}\", in the code \"{sent}\"")
        if not level or not all(cell.strip() for cell in text.split(" | ")):
            found.append(f"{PAGE}: {name} has an empty cell")
    return found, len(known)


if __name__ == "__main__":
    findings.run(check, "messages", write)
