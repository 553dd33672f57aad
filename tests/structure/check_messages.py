#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that docs/messages.md has every message of the layer once, with its severity, and prints what is wrong.

A message is known by its id, a string in src/layer that begins with VELLUM- or VUID-. On the page, an item of a list has the
ids of one cause in backticks, their severity in bold, and words. Rows of rules state their severity (ROW), and those that
only validation reports are no items, as are ids in src/layer/validation. Where the id is an argument of a function that
sends it (SEVERITIES), the severity is known as well; where it is passed on first, the page's counts. check_rules.py writes the
table of the rules that only validation reports.
With --write, ids that are gone are removed, severities are corrected, and new ids get items, which lack their words.

usage: check_messages.py [--write] [ROOT]
"""
import re
import textwrap

import findings

PAGE = "docs/messages.md"
COMMENT = re.compile(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*')
# A string that the formatter has split.
SEAM = re.compile(r'"\s*\n\s*"')
STRING = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
ID = re.compile(r"\bVELLUM-[A-Za-z0-9_-]*")
NUMBERED = re.compile(r"^VUID-[A-Za-z0-9_-]*$")
# A row of src/layer/rules, with a string or the name of one; and such names.
ROW = re.compile(r'\{\s*(?:"((?:VELLUM|VUID)-[^"]*)"|(k\w+)),\s*(Report|Tolerate|Reject|Depends),')
NAMED = re.compile(r'const char \*(k\w+)\s*=\s*"((?:VELLUM|VUID)-[^"]*)"')
# A list of rules that this command has like another one, under ids of its own.
SAME_RULES, OF_COMMAND, LIKE_COMMAND = ("src/layer/rules/ids.cpp", "vkCmdBuildAccelerationStructuresIndirectKHR",
                                        "vkCmdBuildAccelerationStructuresKHR")
# A member of a row whose rule only validation checks.
VALIDATED = re.compile(r"\.alignmentId =\s*$")
OF_ROWS = {"Tolerate": "warning", "Reject": "error", "Depends": None}
CALL = re.compile(r"(\w+)\s*$")
BOTH = "warning or error"
ITEM = re.compile(r"^- .*\n(?:  .*\n)*", re.M)
LISTED = re.compile(r"`(VELLUM-[A-Za-z0-9_-]+)`")
LEVEL = re.compile(rf"\*\*({BOTH}|error|warning|info)\*\*")
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


def sources(root):
    """Files of src/layer, without comments, and with what the formatter has broken in two."""
    for path in sorted((root / "src" / "layer").rglob("*")):
        if path.suffix in {".cpp", ".h"}:
            yield path.relative_to(root), SEAM.sub("", COMMENT.sub(lambda match: match[1] or "",
                                                                   path.read_text(encoding="utf-8")))


def rows(root):
    """Of each rule that is a row: its file, and the severities of its rows."""
    code = {path: text for path, text in sources(root) if "rules" == path.parent.name}
    names = {name: rule for text in code.values() for name, rule in NAMED.findall(text)}
    found = {}
    for path, text in code.items():
        for rule, name, severity in ROW.findall(text):
            if rule or name in names:
                found.setdefault(rule or names[name], (path, set()))[1].add(severity)
    return found


def messages(root):
    """Ids, each with where it is and the severities that are known."""
    ids, of_rows = {}, rows(root)
    for path, code in sources(root):
        validates = "validation" in path.parts
        for string in STRING.finditer(code):
            for name in ID.findall(string[1]) + ([] if validates else NUMBERED.findall(string[1])):
                if name not in of_rows and not VALIDATED.search(code[:string.start()]):
                    where, severities = ids.setdefault(name, (path, set()))
                    severities.add(SEVERITIES.get(caller(code, string.start())))
    for name, (path, severities) in of_rows.items():
        if severities != {"Report"}:
            ids[name] = (path, {OF_ROWS[severity] for severity in severities - {"Report"}})
    for name in [name for name, (path, _) in ids.items() if str(path) == SAME_RULES and OF_COMMAND in name]:
        like = ids.get(name.replace(OF_COMMAND, LIKE_COMMAND))
        if like:
            ids[name] = (ids[name][0], like[1])
        else:
            del ids[name]
    return ids


def severity(severities):
    """None if the level of some call is not known."""
    if None in severities:
        return None
    return BOTH if len(severities) > 1 else next(iter(severities))


def sent(name):
    """The id that a message has."""
    return f"VELLUM-{name}" if name.startswith("VUID") else name


def items_of(page):
    """Each item that lists messages, as it stands there, with its ids, severity and words."""
    items = []
    for match in ITEM.finditer(page):
        ids, level = LISTED.findall(match[0]), LEVEL.search(match[0])
        if ids and level:
            words = re.sub(r"[\s,-]+", " ", LISTED.sub("", LEVEL.sub("", match[0]))).strip()
            items.append((match[0], ids, level[1], words))
    return items


def updated(page, ids):
    known = {sent(name): severity(severities) for name, (_, severities) in ids.items()}
    for item, names, level, _ in items_of(page):
        left = [name for name in names if name in known]
        text = item
        for name in set(names) - set(left):
            text = re.sub(rf",\s*`{name}`|`{name}`,?\s*", "", text)
        levels = {known[name] for name in left} - {None}
        if len(levels) == 1:
            text = text.replace(f"**{level}**", f"**{levels.pop()}**")
        filled = textwrap.fill(" ".join(text.split()), 120, subsequent_indent="  ", break_long_words=False,
                               break_on_hyphens=False) + "\n"
        if text != item:
            page = page.replace(item, filled if left else "")
    there = {name for _, names, _, _ in items_of(page) for name in names}
    return page + "".join(f"- `{name}` **{known[name]}**\n" for name in sorted(known.keys() - there))


def write(root):
    page = root / PAGE
    page.write_text(updated(page.read_text(encoding="utf-8"), messages(root)), encoding="utf-8")


def check(root):
    items = items_of((root / PAGE).read_text(encoding="utf-8"))
    ids = messages(root)
    names = [name for _, listed, _, _ in items for name in listed]
    found = [f"{path}: {name} is put together at run time, and cannot be looked up"
             for name, (path, _) in ids.items() if name.endswith("-")]
    known = {sent(name): where for name, where in ids.items() if not name.endswith("-")}
    found += [f"{path}: {name} is not in {PAGE}" for name, (path, _) in sorted(known.items()) if name not in names]
    found += [f"{PAGE}: there is no message {name}" for name in sorted(set(names) - known.keys())]
    found += [f"{PAGE}: {name} is there {names.count(name)} times" for name in sorted(set(names)) if names.count(name) > 1]
    for _, listed, level, words in items:
        for name in listed:
            in_code = severity(known[name][1]) if name in known else None
            if in_code and level != in_code:
                found.append(f"{PAGE}: {name} is \"{level}\", in the code \"{in_code}\"")
        if not words:
            found.append(f"{PAGE}: {listed[0]} has no words")
    return found, len(known)


if __name__ == "__main__":
    findings.run(check, "messages", write)
