# SPDX-License-Identifier: Apache-2.0
"""pipeline_merge.py IN.spvasm OUT.spvasm

Makes of a module that spirv-link has put together one as compilers of several entry points write it: entry points
share their built-in variables, and functions that are the same are there once.
"""
import re
import sys

lines = open(sys.argv[1]).read().splitlines()


def ids(line):
    return re.findall(r"%\w+", line)


# Keeps one variable for each built-in.
first, same = {}, {}
for line in lines:
    match = re.match(r"\s*OpDecorate (%\w+) BuiltIn (\w+)$", line)
    if match and match[1] != first.setdefault(match[2], match[1]):
        same[match[1]] = first[match[2]]
dropped = set(same)
if not dropped:
    sys.exit("no built-in variable is shared")


def renamed(line, names):
    return re.sub(r"%\w+", lambda m: names.get(m[0], m[0]), line)


out = []
for line in lines:
    words = line.split()
    if words and (words[0] in dropped or (words[0] in ("OpName", "OpDecorate") and words[1] in dropped)):
        continue
    if words and words[0] == "OpEntryPoint":
        head, interface = line.split('"')[0] + '"' + line.split('"')[1] + '"', ids(line.split('"')[2])
        line = head + " " + " ".join(dict.fromkeys(same.get(i, i) for i in interface))
    out.append(renamed(line, same))
lines = out

# Functions with the same body. Innermost first: those they call are the same by then.
shared = 0
again = True
while again:
    again = False
    bodies, start = {}, None
    for n, line in enumerate(lines):
        if " = OpFunction " in line:
            start = n
        elif line.strip() == "OpFunctionEnd":
            body = lines[start : n + 1]
            own = [l.split()[0] for l in body if " = " in l]
            names = {name: "%%local%d" % i for i, name in enumerate(own)}
            key = "\n".join(" ".join(renamed(l, names).split()) for l in body)
            if key in bodies:
                gone = set(own)
                lines = lines[:start] + lines[n + 1 :]
                lines = [
                    l for l in lines if not (l.split() and l.split()[0] in ("OpName", "OpDecorate") and l.split()[1] in gone)
                ]
                lines = [renamed(l, {own[0]: bodies[key]}) for l in lines]
                shared += 1
                again = True
                break
            bodies[key] = own[0]
if not shared:
    sys.exit("no function is shared")
open(sys.argv[2], "w").write("\n".join(lines) + "\n")
