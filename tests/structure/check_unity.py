#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Finds names that two sources of one folder define in anonymous namespaces: the preset `user` compiles the sources of a folder
as one (cmake/unity.cmake), where they would be defined twice. Functions may be overloaded, aliases may mean the same.

usage: check_unity.py [ROOT]
"""
import collections
import re

import findings

SYSTEM = re.compile(r"_(posix|windows)\.cpp$")  # one of the two is compiled
TYPE = re.compile(r"^(?:enum class|enum|struct|class|union) (\w+)", re.M)
USING = re.compile(r"^using (\w+) = ([^;]*);", re.M)
OTHER = re.compile(r"^(?!template|requires|using|namespace|return)[A-Za-z_:][\w:<>,*&\[\] ]*[ *&](\w+)\s*(?:[={\[;]|\(([^()]*)\))", re.M)


def definitions(text):
    """Name, and what makes another definition legal: other parameters of a function, the same meaning of an alias; None: it must
    not be there. Aliases count outside of anonymous namespaces, too."""
    outer = ""  # the open namespaces, except those that end on the same line
    for part in re.split(r"^(?=namespace\b)|^(?<=\} // namespace\n)", text, flags=re.M):
        named = re.match(r"namespace ([\w:]+)\n", part)
        if named:
            outer += "::" + named[1]
        yield from ((outer + "::" + found[1], "=" + found[2]) for found in USING.finditer(part))
        if not re.match(r"namespace\s*\{\n", part):
            continue
        body = part[:part.rfind("\n} // namespace\n") + 1]
        yield from ((outer + "::" + found[1], None) for found in TYPE.finditer(body))
        for found in OTHER.finditer(body):
            if found[2] is None or "=" in found[2]:
                yield outer + "::" + found[1], None
            else:
                yield outer + "::" + found[1], tuple(re.sub(r"\s*\w+$", "", parameter.strip())
                                                     for parameter in found[2].split(","))


def clashes(first, second):
    if first is None or second is None:
        return True
    if isinstance(first, str) and isinstance(second, str):
        return first != second
    return isinstance(first, str) or isinstance(second, str) or first == second


def check(root):
    found, count = set(), 0
    folders = collections.defaultdict(list)
    for path in sorted((root / "src").rglob("*.cpp")):
        folders[path.parent].append(path)
    for folder, paths in folders.items():
        defined = collections.defaultdict(list)
        for path in paths:
            for name, detail in set(definitions(path.read_text(encoding="utf-8"))):
                count += 1
                for other, its in defined[name]:
                    systems = SYSTEM.search(path.name) and SYSTEM.sub("", other.name) == SYSTEM.sub("", path.name)
                    if other != path and not systems and clashes(detail, its):
                        found.add(f"{folder.relative_to(root)}: {name[2:]} is defined in {other.name} and in {path.name}")
                defined[name].append((path, detail))
    return sorted(found), count


if __name__ == "__main__":
    findings.run(check, "names")
