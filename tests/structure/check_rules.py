#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the table of rules, src/layer/validation/rules.csv, and what is generated from it and from src/layer/messages.csv in
docs/messages.md: a row for the full id of each message, the rules that are not checked, and totals:

- every numbered rule (VUID) that the registry has for these extensions has a row: the rules of their commands and
  structures, those that name a micromap, and those of address ranges;
- src/layer has the id of every rule that is checked, and the rule has a test: a file of wrong programs in
  tests/validation that has the id, or suite and case, with "*" for any rest. Rules whose "where" is "open" need neither.
  Where src/layer has only the end of an id ("micromap-11636"), one command with a test stands for all;
- every rule that src/layer names has a row, which does not call it impossible, and its id is stated once;
- a row may stand for rules that differ in their command or structure, in whose place it has "*"; a row with the full id
  goes before it. Each rule whose full id src/layer has needs a test of its own;
- "without" is what the row of src/layer/rules does with a command that breaks the rule;
- each message has one cause in messages.csv, where each id and pattern is that of a message;
- columns have words that are known.

With --write, the tables of the page are written anew, rows get the tests that name their id, and those without code or
test become open.

usage: check_rules.py [--write] [VALIDUSAGE [ROOT]]
"""
import collections
import csv
import fnmatch
import io
import json
import re
import xml.etree.ElementTree as ElementTree

import check_coverage
import check_messages
import findings

REGISTRY = "/usr/share/vulkan/registry/validusage.json"
TABLE = "src/layer/validation/rules.csv"
CODE = "src/layer"
VALIDATION = ("src/layer/validation", "src/layer/rules") # rows of rules are evaluated by validation as well
PROGRAMS = "tests/validation"
SUITE = "WrongPrograms"
PAGE = "docs/messages.md"
CAUSES = check_messages.TABLE
# The commands of which the state of the command buffer is checked, and a row of them; and the commands that run shaders.
COMMANDS, COMMAND = "src/layer/validation/rules/rule_check.h", re.compile(r'\{"(vkCmd\w+)", ')
RUNNING, RUNS = "src/layer/base/commands.inc", re.compile(
    r"^VELLUM_(?:(?:(?:RANGES_)?(?:DRAW|DISPATCH)|TRACE|SUBPASS_SHADING)\(|DEVICE\((?=CmdExecuteGenerated))(\w+),", re.M)
COLUMNS = ["vuid", "extension", "where", "how", "without", "test"]
MICROMAP = ("VK_EXT_opacity_micromap", "VK_KHR_opacity_micromap", "VK_ARM_pipeline_opacity_micromap")
RANGES = "VK_KHR_device_address_commands"
# KHR micromaps are acceleration structures, and some of their rules hold for micromaps.
EXTENSIONS = (*MICROMAP, RANGES, "VK_KHR_acceleration_structure", "all")
WHERE = {
    "host": "from the arguments of commands, and from what was created and recorded (`core`)",
    "gpu": "by shaders, from data that only the GPU can read (`gpu`)",
    "sync": "from the order of what is executed (`sync`)",
    "shader": "by what rays really meet, in the application's shaders (`gpu`)",
    "impossible": "cannot be checked",
    "open": "not checked yet",
}
PARTS = {"host": "core", "gpu": "gpu", "sync": "sync", "shader": "gpu"} # of the setting `validate`
CHECKED = tuple(PARTS)
WITHOUT = ("rejected", "tolerated", "tolerated or rejected", "works", "ignored", "passed on", "hidden", "undefined",
           "impossible")
OF_SEVERITY = {"error": "rejected", "warning": "tolerated", check_messages.BOTH: "tolerated or rejected"}
NUMBERED = re.compile(r"^VUID-(\w+)-(?:.*-)?(\d{5})$")
# Rules of other extensions that have micromaps.
OTHERS = re.compile("DisplacementMicromapNV|Cluster|-0799[678]$|-08701$")
OF_RANGES = range(13000, 13130)
# Rules of Vulkan 1.3.239 that later versions have under other numbers.
RENUMBERED = re.compile(r"-(?:03677|07334|07403|0743[0124]|07439|0746[567]|07501|07513|0751[789]|0752[012346]|07534|07535|"
                        r"07538|07545|07551|0757[345])$|VkCopyMicromapInfoEXT-src-07532$")
END_OF_ID = re.compile(r'"-?([A-Za-z]+-\d{5})"|"-(commandBuffer-\w+|renderpass|suspended)"')
# The names of an address range with flags, and the numbers of the rules that each of them has: these two are named after
# the flags, the others after the range.
FLAGGED, NUMBER, OF_FLAGS = (re.compile(r'FlaggedRange \w+\{"(\w+)", "(\w+)", "(\w+)"\}'), re.compile(r'"(13\d{3})"'),
                             ("13100", "13101"))
# The registry has no such rules of mesh draws, only of other draws.
OF_MESHES = re.compile(r"MeshTasksIndirect(?:Count)?2EXT-pInfo-1311[0-3]$")
NAMED = re.compile(r"VUID-[A-Za-z0-9-]+[A-Za-z0-9]")
EXPECTED = re.compile(r"VELLUM-(VUID-[A-Za-z0-9-]+[A-Za-z0-9])")
BEGIN, END = "<!-- begin {} -->\n", "<!-- end {} -->\n"


def commands_and_types(path):
    """Of each extension; vk.xml is in the folder of validusage.json."""
    names = {}
    if path.exists():
        for extension in ElementTree.parse(path).getroot().findall("extensions/extension"):
            names[extension.get("name")] = {required.get("name") for block in extension.findall("require")
                                            for required in block if required.tag in ("type", "command")}
    return names


def of_registry(path):
    """Ids of the numbered rules that need a row."""
    names = commands_and_types(path.with_name("vk.xml"))
    of_micromaps = set().union(*(names.get(extension, set()) for extension in MICROMAP))
    of_ranges = names.get(RANGES, set())
    rules = [(place, rule["vuid"], rule["text"])
             for place, groups in json.loads(path.read_text(encoding="utf-8"))["validation"].items()
             for group in groups.values() for rule in group if NUMBERED.match(rule["vuid"])]
    older = {vuid[-5:] for place, vuid, _ in rules if place not in of_ranges}
    wanted = set()
    for place, vuid, text in rules:
        named = re.search("micromap|SerializedBlockType", vuid + text, re.I) and not OTHERS.search(vuid)
        ranged = int(vuid[-5:]) in OF_RANGES or (place in of_ranges and vuid[-5:] not in older)
        if (place in of_micromaps or named or ranged) and not RENUMBERED.search(vuid):
            wanted.add(vuid)
    return wanted


def read(root):
    with open(root / TABLE, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def code_of(folder):
    """Files, without comments, and with what the formatter has broken in two."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in {".cpp", ".h"}:
            code = check_messages.COMMENT.sub(lambda match: match[1] or "", path.read_text(encoding="utf-8"))
            yield path, check_messages.SEAM.sub("", code)


def in_code(folder):
    """Ids, and patterns where the code has only the end of an id."""
    names, numbers, flagged = set(), set(), []
    for _, code in code_of(folder):
        names |= {*NAMED.findall(code), *(f"VUID-*-{numbered or other}" for numbered, other in END_OF_ID.findall(code))}
        numbers.update(NUMBER.findall(code))
        flagged += FLAGGED.findall(code)
    return names | {f"VUID-{owner}-{flags if number in OF_FLAGS else of_range}-{number}"
                    for owner, of_range, flags in flagged for number in numbers}


def in_tests(root):
    """Ids, each with the tests that expect them: the case around it, or the file of wrong programs."""
    tests = {}
    for path, code in code_of(root / "tests"):
        cases = [(match.start(), f"{match[1]}.{match[2]}") for match in check_coverage.TEST.finditer(code)]
        is_programs = path.parent == root / PROGRAMS and not cases
        for name in (NAMED if is_programs else EXPECTED).finditer(code):
            around = [path.name] if is_programs else [case for at, case in cases if at < name.start()][-1:]
            tests.setdefault(name[name.re.groups], set()).update(around)
    return tests


def end_of(vuid):
    """The id without its command or structure."""
    return vuid.split("-", 2)[-1]


def is_named(vuid, names):
    if "*" in vuid:
        return any(fnmatch.fnmatchcase(name, vuid) for name in names)
    return vuid in names or f"VUID-*-{end_of(vuid)}" in names


def expected_of(vuid, names, expected):
    """The tests that expect a rule."""
    found = set(expected.get(vuid, ()))
    if "*" in vuid:
        return set().union(*(tests for other, tests in expected.items() if fnmatch.fnmatchcase(other, vuid)))
    if not found and f"VUID-*-{end_of(vuid)}" in names:
        found = set().union(*(tests for other, tests in expected.items() if end_of(other) == end_of(vuid)))
    return found


def missing_test(row, tests, found):
    """The first test of a row that does not exist."""
    for test in row["test"].split():
        suite, _, case = test.partition(".")
        if test in found or (suite == SUITE and found):
            continue
        if not any(fnmatch.fnmatchcase(s, suite) and fnmatch.fnmatchcase(c, case) for s, cases in tests.items()
                   for c in cases):
            return test
    return None


def is_open(row, names):
    return row["where"] == "open" or (row["where"] in CHECKED and not (is_named(row["vuid"], names) and row["test"]))


# The beginnings that the column "without" may have, by the severity of a row of src/layer/rules.
BY_SEVERITY = {"Tolerate": ("tolerated",), "Reject": ("rejected",), "Depends": ("tolerated", "rejected")}


def wrong_severities(rows, severities):
    for row in rows:
        _, sent = severities.get(row["vuid"], (None, {"Report"}))
        begins = [word for severity in sent - {"Report"} for word in BY_SEVERITY[severity]]
        if begins and row["where"] in CHECKED and not row["without"].startswith(tuple(begins)):
            yield f"{row['vuid']}: without is {row['without']}, in src/layer/rules {' and '.join(sorted(sent))}"


def stated_twice(root):
    """Ids that stand in several places of src/layer. One id may stand for several rules, by its end."""
    counts = collections.Counter(name for path, code in code_of(root / CODE)
                                 for string in check_messages.STRING.findall(code) for name in NAMED.findall(string))
    return sorted(name for name, count in counts.items() if count > 1)


def wrong_row(row, names, tests, expected):
    missing = missing_test(row, tests, expected_of(row["vuid"], names, expected))
    vuid, where = row["vuid"], row["where"]
    if where not in WHERE:
        yield f"{vuid}: where is {where}"
    if row["extension"] not in EXTENSIONS:
        yield f"{vuid}: extension is {row['extension']}"
    if row["without"].split(":")[0] not in WITHOUT:
        yield f"{vuid}: without is {row['without']}"
    if not row["how"]:
        yield f"{vuid}: how is empty"
    if missing:
        yield f"{vuid}: there is no test {missing}"
    if where == "impossible" and vuid in names:
        yield f"{vuid}: src/layer names it, and where is impossible"
    if where in CHECKED:
        if not is_named(vuid, names):
            yield f"{vuid}: src/layer does not name it"
        if not row["test"]:
            yield f"{vuid}: there is no test"
        if is_numbered_pattern(row) and vuid not in names:
            yield from (f"{name}: there is no test" for name in full_ids(row, names, ())
                        if not expected_of(name, names, expected))


def where_of(row, names, everywhere):
    """As on the page: also whether only the implementation reports the rule, and not validation."""
    where = row["where"]
    if is_open(row, names):
        return where if where == "open" else f"{where} (open)"
    return where if where not in CHECKED or is_named(row["vuid"], everywhere) else f"{where} (not the driver's)"


def totals(root, rows, names, everywhere):
    commands = commands_of(root)
    wheres = [where_of(row, names, everywhere) for row in rows
              for _ in (full_ids(row, names, commands) if is_numbered_pattern(row) else [row])]
    counts = collections.Counter("open" if "open" in where else where.split()[0] for where in wheres)
    lines = ["| where | rules | how |", "|---|---|---|"]
    lines += [f"| {where} | {counts[where]} | {words} |" for where, words in WHERE.items()]
    own = sum("driver's" in where for where in wheres)
    lines += [f"| total | {len(wheres)} | {own} of them are not checked where micromaps are the driver's own |"]
    return "\n".join(lines) + "\n"


def line_of(*cells):
    return f"| {' | '.join(cells)} |"


def table_of_unchecked(rows, names, everywhere):
    lines = ["| rule | why | without validation |", "|---|---|---|"]
    lines += [line_of(f"`{row['vuid']}`", row["how"], row["without"]) for row in rows
              if where_of(row, names, everywhere).split()[0] not in CHECKED or is_open(row, names)]
    return "\n".join(lines) + "\n"


def is_numbered_pattern(row):
    return "*" in row["vuid"] and row["vuid"][-5:].isdigit()


def commands_of(root):
    """The commands whose names complete the ids of rules: those that run shaders, for rules with a number, and others."""
    running, others = root / RUNNING, root / COMMANDS
    return (sorted(f"vk{name}" for name in RUNS.findall(running.read_text(encoding="utf-8"))) if running.exists() else [],
            sorted(COMMAND.findall(others.read_text(encoding="utf-8"))) if others.exists() else [])


def full_ids(row, names, commands):
    """The ids that messages of a rule have. In the table of rules, "*" stands for the command or structure."""
    if "*" not in row["vuid"]:
        return [row["vuid"]]
    if row["vuid"] in names: # the code has the end of the id, after the command
        return [row["vuid"].replace("*", command) for command in commands[0 if is_numbered_pattern(row) else 1]]
    return sorted(name for name in names if fnmatch.fnmatchcase(name, row["vuid"]))


def reported(root, rows, names):
    """Each message: its id, the row of its rule (None: it has no VUID), and the part of validation that it needs."""
    always = check_messages.messages(root)
    commands = commands_of(root)
    found = {name: (None, None) for name in always if not name.endswith("-")}
    starred = [row for row in rows if "*" in row["vuid"]]
    for row in starred + [row for row in rows if "*" not in row["vuid"]]:
        if row["where"] in PARTS:
            found.update({name: (row, "" if name in always else PARTS[row["where"]])
                          for name in full_ids(row, names, commands)})
    for name, (row, _) in found.items(): # draws of meshes are in no registry
        if row is None and OF_MESHES.search(name):
            found[name] = (next(other for other in rows if other["vuid"].endswith(name[-6:])), "")
    return found


def cells_of(name, part, causes):
    row = (check_messages.causes_of(name, causes) or [{"severity": "", "part": "", "cause": "", "cure": ""}])[0]
    severity = "error" if part else row["severity"] # what only validation reports
    return f"`{check_messages.sent(name)}`", severity, part or row["part"] or "always", row["cause"], row["cure"]


def table_of_own(messages, causes):
    lines = ["| id | severity | checked | cause | cure |", "|---|---|---|---|---|"]
    lines += [line_of(*cells_of(name, "", causes)) for name, (row, _) in sorted(messages.items()) if row is None]
    return "\n".join(lines) + "\n"


def effect_of(row, cells):
    """What happens to the command. The implementation reports single ids of a rule with "*", and does more for those."""
    severity, checked = cells[1:3]
    return OF_SEVERITY[severity] if "*" in row["vuid"] and checked == "always" else row["without"]


def table_of_rules(messages, causes):
    lines = ["| id | severity | checked | cause | cure | the command |", "|---|---|---|---|---|---|"]
    for name, (row, part) in sorted(messages.items()):
        if row is not None:
            cells = cells_of(name, part, causes)
            lines.append(line_of(*cells, effect_of(row, cells)))
    return "\n".join(lines) + "\n"


def wrong_causes(messages, causes):
    for name in sorted(messages):
        count = len(check_messages.causes_of(name, causes))
        if count != 1:
            yield f"{name} has {count} causes"
    for row in causes:
        for name in row["ids"].split():
            if not any(fnmatch.fnmatchcase(other, name) for other in messages):
                yield f"there is no message {name}"


def between(page, name, text):
    """The page with another text between two marks."""
    begin, end = BEGIN.format(name), END.format(name)
    before, rest = page.split(begin)
    return before + begin + text + end + rest.split(end)[1]


def page_of(root, rows):
    """The page as it is and as it should be."""
    names, everywhere = in_code(root / CODE), set().union(*(in_code(root / part) for part in VALIDATION))
    messages, causes = reported(root, rows, names), check_messages.table(root)
    text = (root / PAGE).read_text(encoding="utf-8")
    new = between(text, "own", table_of_own(messages, causes))
    new = between(new, "rules", table_of_rules(messages, causes))
    new = between(new, "unchecked", table_of_unchecked(rows, names, everywhere))
    return text, between(new, "totals", totals(root, rows, names, everywhere))


def write(root):
    rows, names, expected = read(root), in_code(root / CODE), in_tests(root)
    for row in rows:
        kept = {test for test in row["test"].split() if not test.startswith(SUITE) and not test.endswith(".cpp")}
        row["test"] = " ".join(sorted(kept | expected_of(row["vuid"], names, expected)))
        if is_open(row, names):
            row["where"] = "open"
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(sorted(rows, key=lambda row: row["vuid"]))
    (root / TABLE).write_text(text.getvalue(), encoding="utf-8")
    (root / PAGE).write_text(page_of(root, rows)[1], encoding="utf-8")


def check(registry, root):
    rows, names, tests, expected = read(root), in_code(root / CODE), check_coverage.of_sources(root), in_tests(root)
    vuids = [row["vuid"] for row in rows]
    found = [f"{TABLE}: {line}" for row in rows for line in wrong_row(row, names, tests, expected)]
    if vuids != sorted(set(vuids)):
        found.append(f"{TABLE}: rows are not sorted, or a rule has two")
    patterns = [row["vuid"] for row in rows if is_numbered_pattern(row)]
    found += [f"{TABLE}: no row for {vuid}" for vuid in sorted(of_registry(registry) - set(vuids))
              if not any(fnmatch.fnmatchcase(vuid, pattern) for pattern in patterns)]
    found += [f"src/layer: {TABLE} has no row for {name}" for name in sorted(names) if not OF_MESHES.search(name)
              and not any(fnmatch.fnmatchcase(name, vuid) or fnmatch.fnmatchcase(vuid, name) for vuid in vuids)]
    found += [f"{TABLE}: {line}" for line in wrong_severities(rows, check_messages.rows(root))]
    found += [f"src/layer: {name} is stated twice" for name in stated_twice(root)]
    found += [f"{CAUSES}: {line}" for line in wrong_causes(reported(root, rows, names), check_messages.table(root))]
    text, wanted = page_of(root, rows)
    if text != wanted:
        found.append(f"{PAGE}: the tables are stale; run tests/structure/check_rules.py --write")
    print(f"{sum(is_open(row, names) for row in rows)} rules are open")
    return found, len(rows)


if __name__ == "__main__":
    findings.run_with_registry(check, "rules", write, REGISTRY)
