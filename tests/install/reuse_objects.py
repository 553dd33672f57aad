#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A compiler launcher for tests that build Vellum once more: what a build has compiled in the same way is copied from it.

The same way: the same file, by the same compiler, with the same options but -Werror. The files of a unity batch may have been
compiled one by one; their objects are put together. Everything else is compiled. A test calls variables() and sets what it
returns for its builds.

usage: reuse_objects.py COMPILER ARGUMENTS...
"""
import json
import os
import re
import sys

VARIABLE = "VELLUM_REUSED_OBJECTS"


def general(text, source, build):
    """Without the paths that differ between builds."""
    return text.replace(build, "<build>").replace(source, "<source>")


def parse(words, source, build):
    """Input, output, the file for dependencies, and the other words, all of them general."""
    found = {"-c": "", "-o": "", "-MF": "", "-MT": ""}
    options, words = [], iter(words)
    for word in words:
        if word in found:
            found[word] = next(words)
        elif word not in ("-MD", "-Werror"):
            options.append(general(word, source, build))
    return general(found["-c"], source, build), found["-o"], found["-MF"], options


def batch_in(path, source, build):
    """The files of a unity batch, general."""
    with open(path, encoding="utf-8") as batch:
        return re.findall(r'^#include "(.*)"$', general(batch.read(), source, build), re.M)


def write_index(build, source, path, other_source):
    """All that a build of `source` has compiled, for the builds of `other_source`, which has the same files."""
    import shlex  # of no use to the launcher
    entries = {}
    for command in json.loads((build / "compile_commands.json").read_text()):
        file, output, _, options = parse(shlex.split(command["command"]), str(source), str(build))
        entries.setdefault(file, []).append([options, str(build / output)])
    path.write_text(json.dumps({"source": str(other_source), "log": f"{path}.log", "entries": entries,
                                "origin": [str(source), str(build)]}))


def variables(build, source, path, other_source):
    """The variables for builds of `source`, or of a clone of it. None if the clone may lack changes."""
    if not (build / "compile_commands.json").exists():
        return {}
    import subprocess
    changes = subprocess.run(["git", "-C", source, "status", "--porcelain", "--", "CMakeLists.txt", "cmake", "include", "src"],
                             capture_output=True, text=True, check=False)
    if source != other_source and (changes.returncode or changes.stdout):
        return {}
    write_index(build, source, path, other_source)
    # Isolated and without site packages, because Python would load hundreds of files at its start.
    launcher = ";".join([os.path.realpath(sys.executable), "-I", "-S", os.path.realpath(__file__)])
    return {VARIABLE: str(path), "CMAKE_C_COMPILER_LAUNCHER": launcher, "CMAKE_CXX_COMPILER_LAUNCHER": launcher}


def report(path):
    """How many files were copied and compiled."""
    log = path.with_name(path.name + ".log")
    lines = log.read_text().splitlines() if log.exists() else []
    return f"{lines.count('copied')} objects were copied, {len(lines) - lines.count('copied')} files compiled"


def object_of(entries, file, options):
    for known, path in entries.get(file, []):
        if known == options and os.path.exists(path):
            return path
    return None


def objects_for(index, words):
    """The objects that together are what the command makes, where, and for what dependencies."""
    # If Vellum is part of another project, its folder is a subfolder of the build folder.
    folder = words[words.index("-o") + 1].partition("src/")[0] if "-o" in words else ""
    build = os.path.join(os.getcwd(), folder).rstrip("/")
    file, output, dependencies, options = parse(words, index["source"], build)
    entries = index["entries"]
    whole = object_of(entries, file, options)
    if not re.search(r"/Unity/unity_.*\.cxx$", file):
        return [whole], output, dependencies
    members = batch_in(file.replace("<build>", build), index["source"], build)
    if whole and batch_in(whole.removesuffix(".o"), *index["origin"]) == members:
        return [whole], output, dependencies
    return [object_of(entries, member, options) for member in members], output, dependencies


def main():
    words = sys.argv[1:]
    with open(os.environ[VARIABLE], encoding="utf-8") as file:
        index = json.load(file)
    objects, output, dependencies = objects_for(index, words)
    copied = output and objects and all(objects)
    with open(index["log"], "a", encoding="utf-8") as log:
        log.write("copied\n" if copied else f"compiled {' '.join(words)}\n")
    if not copied:
        os.execvp(words[0], words)
    if len(objects) == 1:
        with open(objects[0], "rb") as old, open(output, "wb") as new:
            new.write(old.read())
    elif status := os.spawnlp(os.P_WAIT, "ld", "ld", "-r", "-o", output, *objects):
        return status
    if dependencies:
        with open(dependencies, "w", encoding="utf-8") as file:
            file.write(f"{output}:\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
