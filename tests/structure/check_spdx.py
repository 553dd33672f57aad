#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that every source file begins with its licence, which is the project's; with --write, adds what is missing.

usage: check_spdx.py [--write] [ROOT]
"""
import subprocess

import findings

TAG = "SPDX-License-Identifier: Apache-2.0"
SLASHES = {".c", ".cpp", ".h", ".inc", ".js", ".glsl", ".comp", ".vert", ".frag", ".mesh", ".rgen", ".rmiss", ".rchit", ".rahit",
           ".rint", ".rcall"}
HASHES = {".py", ".cmake", ".sh"}
STARS = {".css", ".map"}


def line_for(path, text):
    """The line with the tag; None for what is no source file."""
    name = path.name.removesuffix(".in")
    suffix = name[name.rfind("."):] if "." in name else ""
    if suffix in SLASHES:
        return f"// {TAG}\n"
    if suffix in HASHES or name in ("CMakeLists.txt", "Containerfile") or text.startswith("#!") or path.parent.name == "scripts":
        return f"# {TAG}\n"
    return f"/* {TAG} */\n" if suffix in STARS else None


def without(root):
    """Source files without the tag, with their text and the line that they should have; and how many source files there are."""
    names = subprocess.run(["git", "-C", root, "ls-files", "-z"], check=True, stdout=subprocess.PIPE, text=True).stdout
    missing, count = [], 0
    for name in names.rstrip("\0").split("\0"):
        path = root / name
        if not path.is_file():
            continue
        text = path.read_bytes().decode("utf-8", errors="surrogateescape")
        line = line_for(path, text)
        if line:
            count += 1
            if line not in text.splitlines(keepends=True)[:2]:
                missing.append((path, text, line))
    return missing, count


def write(root):
    for path, text, line in without(root)[0]:
        end = text.index("\n") + 1 if text.startswith("#!") else 0
        path.write_bytes((text[:end] + line + text[end:]).encode("utf-8", errors="surrogateescape"))


def check(root):
    missing, count = without(root)
    return [f"{path.relative_to(root)}: does not begin with {line.strip()}" for path, _, line in missing], count


if __name__ == "__main__":
    findings.run(check, "source files", write)
