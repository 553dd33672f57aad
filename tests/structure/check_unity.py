#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Finds names that are defined twice:
- in the anonymous namespaces of two sources of one folder of src/ or tests/: a unity build compiles the sources of a folder as
  one (cmake/unity.cmake). Functions may be overloaded, aliases may mean the same.
- types that two files define in one namespace: a program in which both are takes the functions of one for those of the other,
  without a word from the linker ([basic.def.odr]).

usage: check_unity.py [ROOT]
"""
import collections
import re

import findings

# Their targets have the property UNITY_BUILD OFF.
FILE_BY_FILE = ("tests/layer/faulty_driver", "tests/layer/layers", "tests/validation")
# It defines types of src/ once more, for a program that does not have the originals.
REPLACEMENT = "tests/command/check/fake_groups.cpp"
SYSTEM = re.compile(r"_(posix|windows)\.cpp$")  # one of the two is compiled
TYPE = re.compile(r"^(?:enum class|enum|struct|class|union) (\w+)", re.M)
USING = re.compile(r"^using (\w+) = ([^;]*);", re.M)
OTHER = re.compile(r"^(?!(?:template|requires|using|namespace|return|enum|struct|class|union)\b)[A-Za-z_:][\w:<>,*&\[\] ]*[ *&](\w+)\s*(?:[={\[;]|\(([^()]*)\))", re.M)


def definitions(text):
    """Name, and what makes another definition legal: other parameters of a function, the same meaning of an alias; None: it must
    not be there. Aliases count outside of anonymous namespaces, too."""
    outer = ""  # the open namespaces, except those that end on the same line
    for part in re.split(r"^(?=namespace\b(?! \w+ =))|^(?<=\} // namespace\n)", text, flags=re.M):
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
                yield outer + "::" + found[1], tuple(re.sub(r"\s*\w+$", "", parameter.strip()).replace("std::filesystem", "fs")
                                                     for parameter in found[2].split(","))


# What has to be passed over, a namespace, a type with its body, or a brace.
TOKEN = re.compile(r"""//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])+'|^[ \t]*\#(?:[^\n]*\\\n)*[^\n]*
    |(?P<namespace>\bnamespace\b\s*(?P<of>[\w:]*)\s*\{)
    |\b(?:enum\s+class|enum|struct|class|union)\s+(?P<type>\w+)\s*(?:final\s*)?(?::(?!:)[^;{}()]*)?\{|[{}]""", re.S | re.M | re.X)
ANONYMOUS = "(anonymous)"


def types(text):
    """The types that a file defines in named namespaces, with these."""
    scopes = []  # the name of a namespace, or None for another brace
    for token in TOKEN.finditer(text):
        if token["namespace"]:
            scopes.append(token["of"] or ANONYMOUS)
        elif token["type"]:
            if None not in scopes and ANONYMOUS not in scopes:
                yield "::".join([*scopes, token["type"]])
            scopes.append(None)
        elif token[0] == "{":
            scopes.append(None)
        elif token[0] == "}" and scopes:
            scopes.pop()


def clashes(first, second):
    if first is None or second is None:
        return True
    if isinstance(first, str) and isinstance(second, str):
        return first != second
    return isinstance(first, str) or isinstance(second, str) or first == second


def check(root):
    found, count = set(), 0
    texts = {path: path.read_text(encoding="utf-8") for folder in ("src", "tests") for path in sorted((root / folder).rglob("*"))
             if path.suffix in (".h", ".cpp")}
    folders = collections.defaultdict(list)
    for path in texts:
        if path.suffix == ".cpp" and str(path.parent.relative_to(root)) not in FILE_BY_FILE:
            folders[path.parent].append(path)
    for folder, paths in folders.items():
        defined = collections.defaultdict(list)
        for path in paths:
            for name, detail in set(definitions(texts[path])):
                count += 1
                for other, its in defined[name]:
                    systems = SYSTEM.search(path.name) and SYSTEM.sub("", other.name) == SYSTEM.sub("", path.name)
                    if other != path and not systems and clashes(detail, its):
                        found.add(f"{folder.relative_to(root)}: {name[2:]} is defined in {other.name} and in {path.name}")
                defined[name].append((path, detail))
    having = collections.defaultdict(list)
    for path, text in texts.items():
        if path == root / REPLACEMENT:
            continue
        for name in set(types(text)):
            count += 1
            having[name].append(path)
    for name, paths in having.items():
        if len({SYSTEM.sub("", str(path)) for path in paths}) > 1:
            found.add(f"{name} is defined in {' and in '.join(str(path.relative_to(root)) for path in paths)}")
    return sorted(found), count


if __name__ == "__main__":
    findings.run(check, "names")
