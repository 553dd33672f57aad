#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the commands of a document and compares what they print with what it says.

Commands are the lines that begin with `$ ` in blocks marked `console`, which may be indented; the lines up to the next one
are their output, stdout and stderr together. In output, `...` stands for any text within a line, and alone in a line for any
lines. Numbers of candidates may differ by half: drivers visit them in different orders. The commands of a page run in its
order, in one empty folder in which `examples` is the checkout's, and `build/release` is BUILD; each must succeed. Each has a shell of its own, in which earlier commands that begin with `export`
hold. A picture after a comment `<!-- commands write PATH -->` must equal that file of the folder. With --update, output and
pictures that differ are replaced; lines with `...` are kept where they match.

usage: run_page.py [--update] PAGE ROOT SCRATCH [BUILD]
"""
import pathlib
import re
import shutil
import subprocess
import sys
import textwrap

BLOCK = re.compile(r"^( *)```console\n(.*?)^\1```$", re.M | re.S)
PICTURE = re.compile(r"<!-- commands write (\S+) -->\s*!\[[^\]]*\]\(([^)]+)\)")


def commands_in(block):
    """Pairs of a command and its output, both of them text."""
    parts = re.split(r"^\$ (.*)\n", block, flags=re.M)
    return list(zip(parts[1::2], parts[2::2]))


NUMBER = re.compile(r"(\d[\d.]*)")


def matches(expected, actual):
    """True if the text is the other one, in which `...` stands for any."""
    lines, numbers = [], []
    for line in expected.splitlines():
        if line == "...":
            lines.append(r"(?:.*\n)*?")
            continue
        pattern = ".*".join(re.escape(part) for part in line.split("..."))
        if re.search(r"\bcandidates\b", line) and "..." not in line:
            parts = NUMBER.split(re.sub(r" +", " ", line))
            numbers += map(float, parts[1::2])
            pattern = r"(\d[\d.]*)".join(re.escape(part).replace(r"\ ", " +") for part in parts[0::2])
        lines.append(pattern + r"\n")
    found = re.fullmatch("".join(lines), actual)
    return found is not None and all(number / 1.5 <= float(value) <= number * 1.5
                                     for number, value in zip(numbers, found.groups()))


def updated(expected, actual):
    """The actual output, with the lines that have `...` where they match one."""
    kept = [line for line in expected.splitlines() if "..." in line and line != "..."]
    lines = []
    for line in actual.splitlines():
        lines.append(next((old for old in kept if matches(old + "\n", line + "\n")), line))
    return "\n".join(lines) + "\n" if lines else ""


def run(command, folder):
    done = subprocess.run(["bash", "-c", command], cwd=folder, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, timeout=300)
    return done.returncode, done.stdout


def check(page, folder, update=False):
    """Findings, and how many commands ran."""
    text = page.read_text(encoding="utf-8")
    findings, count, exports = [], 0, ""
    pairs = [(indent, *pair) for indent, block in BLOCK.findall(text) for pair in commands_in(textwrap.dedent(block))]
    for indent, command, expected in pairs:
        count += 1
        code, actual = run(exports + command, folder)
        if command.startswith("export "):
            exports += command + "\n"
        if code != 0:
            findings.append(f"{page.name}: $ {command}\nexit code {code}\n{actual}")
        elif not matches(expected, actual):
            if update:
                old, new = (textwrap.indent(f"$ {command}\n{output}", indent)
                            for output in (expected, updated(expected, actual)))
                text = text.replace(old, new)
            else:
                findings.append(f"{page.name}: $ {command}\nexpected:\n{expected}printed:\n{actual}")
    for written, name in PICTURE.findall(text):
        source, picture = pathlib.Path(folder) / written, page.parent / name
        if source.exists() and update:
            shutil.copyfile(source, picture)
        elif not source.exists() or source.read_bytes() != picture.read_bytes():
            findings.append(f"{page.name}: {name} is not what commands write to {written}")
    if update:
        page.write_text(text, encoding="utf-8")
    return findings, count


def main():
    arguments = [word for word in sys.argv[1:] if word != "--update"]
    page, root, scratch, *build = (pathlib.Path(word).resolve() for word in arguments)
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    (scratch / "examples").symlink_to(root / "examples")
    for folder in build:
        (scratch / "build").mkdir()
        (scratch / "build/release").symlink_to(folder)
    findings, count = check(page, scratch, "--update" in sys.argv)
    print(*findings, sep="\n")
    print(f"{len(findings)} of {count} commands of {page.name} print something else")
    return 1 if findings or not count else 0


if __name__ == "__main__":
    sys.exit(main())
