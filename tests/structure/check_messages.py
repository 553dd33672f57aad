#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that src/layer/messages.csv has the cause of every message of the layer, with its severity, and prints what is wrong.

A message is known by its id, a string in src/layer that begins with VELLUM- or VUID-. A row of the table has the ids of one
cause, in which "*" stands for any text, their severity, the cause and the cure; for ids of the layer's own also the parts of
the setting `validate` that find them. An id belongs to the row that has it in full, or to the one row with a pattern for it.
Rows of src/layer/rules state their severity (ROW); what only validation reports is an error. Where the id is an argument of a
function that sends it (SEVERITIES), the severity is known as well; where it is passed on first, the table's counts.
check_rules.py writes the page from the table.
With --write, ids that are gone are removed, severities are corrected, and new ids get rows, which lack their words.

usage: check_messages.py [--write] [ROOT]
"""
import csv
import fnmatch
import io
import re

import findings

TABLE = "src/layer/messages.csv"
COLUMNS = ["ids", "severity", "part", "cause", "cure"]
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
SEVERITIES = {"reject": "error", "error": "error", "tolerate": "warning", "tolerates": "warning", "warning": "warning",
              "tolerateIf": BOTH, "info": "info"}
PARTS = {"core", "gpu", "sync"}


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
    """Ids of what is reported without validation, each with where it is and the severities that are known."""
    ids, of_rows = {}, rows(root)
    for path, code in sources(root):
        validates = "validation" in path.parts
        for string in STRING.finditer(code):
            for name in ID.findall(string[1]) + ([] if validates else NUMBERED.findall(string[1])):
                name = name.removeprefix("VELLUM-") if name.startswith("VELLUM-VUID-") else name
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


def table(root):
    with open(root / TABLE, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def causes_of(name, causes):
    """The rows for an id, of which there should be one."""
    exact = [row for row in causes if name in row["ids"].split()]
    return exact or [row for row in causes
                     if any("*" in each and fnmatch.fnmatchcase(name, each) for each in row["ids"].split())]


def updated(causes, ids):
    """The table with severities as in the code, without ids that are gone, with rows for new ones. Patterns stay."""
    known = {name: severity(severities) for name, (_, severities) in ids.items()}
    result = []
    for row in causes:
        names = row["ids"].split()
        left = [name for name in names if "*" in name or name.startswith("VUID") or name in known]
        levels = {known[name] for name in known if row in causes_of(name, causes)} - {None}
        if left:
            result.append({**row, "ids": " ".join(left), "severity": levels.pop() if len(levels) == 1 else row["severity"]})
    return result + [{"ids": name, "severity": known[name], "part": "", "cause": "", "cure": ""}
                     for name in sorted(known) if not causes_of(name, causes)]


def write(root):
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(updated(table(root), messages(root)))
    (root / TABLE).write_text(text.getvalue(), encoding="utf-8")


def check(root):
    causes, ids = table(root), messages(root)
    found = [f"{path}: {name} is put together at run time, and cannot be looked up"
             for name, (path, _) in ids.items() if name.endswith("-")]
    known = {name: where for name, where in ids.items() if not name.endswith("-")}
    for name, (path, severities) in sorted(known.items()):
        of_name = causes_of(name, causes)
        if not of_name:
            found.append(f"{path}: {name} is not in {TABLE}")
        elif len(of_name) > 1:
            found.append(f"{TABLE}: {name} has {len(of_name)} causes")
        elif severity(severities) not in (None, of_name[0]["severity"]):
            found.append(f"{TABLE}: {name} is \"{of_name[0]['severity']}\", in the code \"{severity(severities)}\"")
    for row in causes:
        found += [f"{TABLE}: there is no message {name}" for name in row["ids"].split()
                  if name.startswith("VELLUM-") and name not in known]
        found += [f"{TABLE}: {row['ids'].split()[0]} has no {column}" for column in ("cause", "cure") if not row[column]]
        if row["part"] and not set(row["part"].split(", ")) <= PARTS:
            found.append(f"{TABLE}: {row['ids'].split()[0]}: part is {row['part']}")
    return found, len(known)


if __name__ == "__main__":
    findings.run(check, "messages", write)
