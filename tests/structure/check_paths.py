#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that paths become text, and text paths, as UTF-8 (core/utf8_path.h), and prints what does something else:

- path::string(), and a path made of a text: on Windows libstdc++ converts each character by itself, so that letters outside
  ASCII are lost, or an exception is thrown;
- CLI11 without the overload that makes paths of UTF-8 (cli/options/options.h).

A text that is assigned to a path is not found, since the check knows no types. Files of POSIX alone are excluded.

usage: check_paths.py [ROOT]
"""
import re

import findings

CLI11 = "src/cli/options/options.h"
COMMAND = ("src/cli/", "src/base/", "src/render/", "src/inspect/", "src/job/")
SOURCES = (*COMMAND, "src/gpu", "src/check", "src/verify", "src/gltf", "src/gltflibrary", "src/library", "src/layer")
POSIX = re.compile(r"_posix\.(cpp|h)$")
# Values of JSON have a function of that name as well, though not in the command and its parts.
STRING = re.compile(r"(?:\.|->)(?:generic_)?string\(\)")
STRING_OF_PATH = re.compile(r"(?:[pP]ath|[fF]older|[fF]ile|[iI]nput|[oO]utput|[sS]tem|[eE]xtension)_?(?:\(\))?"
                            r"(?:\.|->)(?:generic_)?string\(\)")
MADE = re.compile(r"\b(?:fs|filesystem)::path[({](?![)}\"L]|u8)")


def findings_of(name, text):
    if "#include <CLI/CLI.hpp>" in text and name != CLI11:
        yield f"{name}: includes <CLI/CLI.hpp>, not {CLI11}"
    string = STRING if name.startswith(COMMAND) else STRING_OF_PATH
    for number, line in enumerate(text.splitlines(), 1):
        code = re.sub(r"//.*", "", line)
        if string.search(code):
            yield f"{name}:{number}: string() of a path; utf8Text() is UTF-8"
        if MADE.search(code):
            yield f"{name}:{number}: a path of a text; utf8Path() takes UTF-8"


def check(root):
    found, count = [], 0
    for folder in SOURCES:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".cpp", ".h") and not POSIX.search(path.name):
                count += 1
                found += findings_of(path.relative_to(root).as_posix(), path.read_text(encoding="utf-8"))
    return found, count


if __name__ == "__main__":
    findings.run(check, "sources")
