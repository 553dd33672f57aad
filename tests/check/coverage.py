#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks which members of which structures the cases of `vellum check --quick` vary, and with which values.

The recorder (tests/layer/recorder), a layer above Vellum's, writes the values; the members, enumerants and commands are those
of Vulkan's headers. Whatever is not varied needs a reason in not_varied.txt: lines "NAME: REASON", where a NAME may have
wildcards. A reason for something that is varied is an error too, and so is a page without a member. With --write, the page is
written anew.

usage: coverage.py BUILD PAGE [--write] [--recorded FOLDER] [-- OPTION...]     options of vellum check instead of --quick --jobs 1
"""
import collections
import fnmatch
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
HEAD = """# Values that vellum check gives

Which group of [`vellum check`](../check.md) gives which values to each member of the structures, and each parameter of the
commands, of `VK_EXT_opacity_micromap`, `VK_KHR_opacity_micromap`, `VK_KHR_acceleration_structure`,
`VK_KHR_ray_tracing_pipeline` and queries, recorded during `vellum check --quick` on lavapipe. Structures that devices fill in
are not listed. Written by `tests/check/coverage.py --write`; the test `check.coverage` fails if a member or an enumerant stops
varying, or a new one appears in Vulkan's headers, and [not_varied.txt](../../tests/check/not_varied.txt) has no reason for it.

Numbers above 8 are shown as powers of two; addresses by their alignment, up to 256.
"""
LAYERS = "VK_LAYER_VELLUM_test_recorder", "VK_LAYER_VELLUM_opacity_micromap"
WORDS = {"pointer": {0: "null", 1: "given"}, "handle": {0: "null", 1: "given"},
         "real": {-1: "negative", 0: "0", 1: "positive", 2: "NaN"}}


def record(build, options):
    """Member: value: groups that gave it."""
    with tempfile.TemporaryDirectory() as folder:
        test_layers = build / "tests/layer/layers"
        path = f"{test_layers}:{build / 'lib'}"
        environment = {**os.environ, "VELLUM_TEST_RECORD": folder, "VK_INSTANCE_LAYERS": ":".join(LAYERS),
                       "VK_LAYER_PATH": path, "VK_ADD_LAYER_PATH": path}
        status = subprocess.run([build / "bin/vellum", "check", *options, "--output", f"{folder}/results"], env=environment,
                                check=False).returncode
        if status != 0:
            sys.exit(f"vellum check ended with status {status}")
        return read(pathlib.Path(folder))


def read(folder):
    values = collections.defaultdict(lambda: collections.defaultdict(set))
    for file in folder.glob("*.tsv"):
        for line in file.read_text(encoding="utf-8").splitlines():
            group, member, value = line.split("\t")
            values[member][int(value)].add(group)
    if not values:
        sys.exit("nothing was recorded")
    return values


def enumerants(listing, values):
    """Enumerant: the groups that used it; of each enumeration that a member has."""
    found = {}
    for enumeration, names in listing["values"].items():
        members = [name for name, member in listing["members"].items() if member.get("values") == enumeration]
        for name, number in names.items():
            groups = set()
            for member in members:
                for value, users in values.get(member, {}).items():
                    if value & number == number if listing["members"][member]["kind"] == "flags" else value == number:
                        groups |= users
            found[name] = enumeration, groups
    return found


def gaps(listing, values):
    """Everything that is there, and what of it is not varied: a member with one value, a handle or pointer that is never
    given, an enumerant or command without use. One that is always given differs each time."""
    everything = [*listing["commands"], *listing["members"]]
    missing = [name for name in listing["commands"] if not values.get(name)]
    missing += [name for name, member in listing["members"].items()
                if (1 not in values.get(name, {}) if member["kind"] in ("pointer", "handle") else len(values.get(name, {})) < 2)]
    used = enumerants(listing, values)
    return everything + list(used), missing + [name for name, (_, groups) in used.items() if not groups]


def reasons():
    rows = [line.split(": ", 1) for line in (HERE / "not_varied.txt").read_text(encoding="utf-8").splitlines()
            if line and not line.startswith("#")]
    return dict(rows)


def evaluate(missing, why):
    """Findings, and the reason of each that is missing."""
    given = {name: next((reason for pattern, reason in why.items() if fnmatch.fnmatchcase(name, pattern)), None)
             for name in missing}
    findings = [f"{name} is not varied, and not_varied.txt gives no reason" for name, reason in given.items() if not reason]
    # Other versions of lavapipe have other known faults.
    findings += [f"not_varied.txt: {pattern} is varied, or does not exist" for pattern, reason in why.items()
                 if not reason.startswith("lavapipe 25 ") and not any(fnmatch.fnmatchcase(name, pattern) for name in missing)]
    return findings, given


def shown(member, values):
    words = WORDS.get(member["kind"])
    if words:
        return ", ".join(words[value] for value in sorted(values))
    if member["kind"] == "address":
        return ", ".join(f"aligned to {value}" if value else "null" for value in sorted(values))
    if "values" in member:
        return f"{len(values)} values or combinations" if len(values) > 1 else "1 value"
    numbers = sorted(values)
    if len(numbers) > 8:
        return f"{', '.join(map(str, numbers[:5]))} ... {numbers[-1]}"
    return ", ".join(map(str, numbers))


def groups_text(groups):
    groups = sorted(groups - {"none"})
    return ", ".join(groups) if len(groups) <= 4 else f"{len(groups)} groups"


def page_of(listing, values, given):
    lines = [HEAD, "## Structures and commands", "", "| member or parameter | values | groups, or why it does not vary |", "|---|---|---|"]
    for name, member in listing["members"].items():
        recorded = values.get(name, {})
        # A group varies a member if it gives a value that is not the one that all give.
        common = max(recorded.values(), key=len, default=set())
        common_value = next((value for value, groups in recorded.items() if groups is common), None)
        varying = set().union(*(groups for value, groups in recorded.items() if value != common_value)) if recorded else set()
        lines.append(f"| {name} | {shown(member, recorded)} | {given.get(name) or groups_text(varying)} |")
    lines += ["", "## Enumerants", "", "| enumerant | groups, or why it is not used |", "|---|---|"]
    for name, (_, groups) in enumerants(listing, values).items():
        lines.append(f"| {name} | {given.get(name) or groups_text(groups)} |")
    lines += ["", "## Commands", "", "| command | groups, or why it is not used |", "|---|---|"]
    for name in listing["commands"]:
        users = set().union(*values[name].values()) if values.get(name) else set()
        lines.append(f"| {name} | {given.get(name) or groups_text(users)} |")
    return "\n".join(lines) + "\n"


def name_as_on(page, listing):
    """Values of the listing by those of their names that the page has. Newer headers have other names."""
    others = listing["other names"]
    for values in listing["values"].values():
        renamed = {next((each for each in [name, *others.get(name, [])] if each in page), name): number
                   for name, number in values.items()}
        values.clear()
        values.update(renamed)


def main():
    words = sys.argv[1:]
    options = words[words.index("--") + 1:] if "--" in words else ["--quick", "--jobs", "1"]
    words = words[:words.index("--")] if "--" in words else words
    recorded = None
    if "--recorded" in words:
        recorded = words.pop(words.index("--recorded") + 1)
        words.remove("--recorded")
    build, page = [pathlib.Path(word).resolve() for word in words if word != "--write"]
    listing = json.loads((build / "tests/layer/recorder/members.json").read_text(encoding="utf-8"))
    named = set(re.findall(r"^\| ([\w.]+) \|", page.read_text(encoding="utf-8"), re.M)) if page.exists() else set()
    name_as_on(named, listing)
    values = read(pathlib.Path(recorded)) if recorded else record(build, options)
    everything, missing = gaps(listing, values)
    findings, given = evaluate(missing, reasons())
    if "--write" in sys.argv:
        page.write_text(page_of(listing, values, given), encoding="utf-8")
    findings += [f"{page.name}: {name} is not listed" for name in everything if name not in named]
    print(*findings, sep="\n")
    print(f"{len(everything)} members, parameters, enumerants and commands: {len(everything) - len(missing)} varied, "
          f"{len(missing)} not; {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
