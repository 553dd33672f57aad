#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the documents' links to files of the project and to their headings, and prints those that lead nowhere:

- links and pictures of Markdown files, outside of code;
- names of source files in code of Markdown files (`hit_records.cpp`, `pipelines/hit_records.cpp`), which may lack folders;
  those in the row of a table about a folder (| `src/bake` | ...) must be in that folder;
- ids of messages in Markdown files (`VELLUM-device`), which docs/messages.md must have;
- names of documents ("docs/baking.md") in sources and scripts;
- arrows of the diagram of subsystems that check_includes.py does not know, and the other way round.

usage: check_links.py [ROOT]
"""
import re
import subprocess

import check_includes
import findings

FENCE = re.compile(r"^```.*?^```", re.M | re.S)
CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.*?)\s*$", re.M)
SOURCE = re.compile(r"`([\w./-]+\.(?:cpp|h|comp|glsl|rahit|py|cmake))`")
FOLDER = re.compile(r"^\| `((?:src|tests)/[\w/]+)` \|(.*)$", re.M)
MESSAGES, MESSAGE = "docs/messages.md", re.compile(r"`(VELLUM-[A-Za-z0-9-]*[A-Za-z0-9])`")
NAMED = re.compile(r"\bdocs/[\w/-]+\.md\b")
SOURCES = {".c", ".cpp", ".h", ".py", ".in", ".txt", ".cmake", ".comp", ".glsl", ".rahit", ".json", ""}
# Pages with a diagram of subsystems. Nodes have their names; "top" is the folder itself.
DIAGRAMS = {"docs/design/map.md": "layer", "docs/design/validation.md": "layer/validation"}
# Tests of these scripts make up documents.
EXCLUDED = re.compile(r"tests/structure/\w+_test\.py$")


def files(root):
    """Those that git knows or would add; in a tree without git, all."""
    git = subprocess.run(["git", "-C", str(root), "ls-files", "-co", "--exclude-standard"], stdout=subprocess.PIPE,
                         stderr=subprocess.DEVNULL, text=True, check=False)
    paths = map(root.joinpath, git.stdout.split("\n")) if git.returncode == 0 else root.rglob("*")
    return sorted(path for path in set(paths) if path.is_file())


def anchors(text):
    """Of the headings, as GitHub makes them."""
    found = {}
    for heading in HEADING.findall(FENCE.sub("", text)):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        anchor = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        count = found[anchor] = found.get(anchor, -1) + 1
        if count:
            found[f"{anchor}-{count}"] = 0
    return set(found)


def findings_of_document(root, path, text, known):
    here = path.relative_to(root)
    for name in SOURCE.findall(FENCE.sub("", text)):
        if not any(("/" + file).endswith("/" + name) for file in known):
            yield f"{here}: there is no file {name}"
    for folder, row in FOLDER.findall(text):
        for name in SOURCE.findall(row):
            if not any(file.startswith(folder + "/") and file.endswith("/" + name) for file in known):
                yield f"{here}: there is no file {name} in {folder}"
    if (root / MESSAGES).is_file():
        messages = set(MESSAGE.findall((root / MESSAGES).read_text(encoding="utf-8")))
        for name in sorted(set(MESSAGE.findall(text)) - messages):
            yield f"{here}: {MESSAGES} has no {name}"
    for link in LINK.findall(CODE.sub("", FENCE.sub("", text))):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        if not target.exists():
            yield f"{here}: there is no {link}"
        elif anchor and target.suffix == ".md" and anchor not in anchors(target.read_text(encoding="utf-8")):
            yield f"{here}: {name or here} has no heading #{anchor}"


def findings_of_diagram(root, diagram, part):
    """An arrow means that a subsystem may include all that it reaches."""
    page = root / diagram
    if not page.is_file():
        return
    arrows = re.findall(r"^  (\w+) --> (\w+)$", page.read_text(encoding="utf-8"), re.M)

    def reached(name):
        return {there for here, there in arrows if here == name}.union(
            *(reached(there) for here, there in arrows if here == name))

    for name, allowed in check_includes.SUBSYSTEMS[part].items():
        if reached(name or "top") != set(allowed):
            yield f"{diagram}: {name or 'top'} reaches {sorted(reached(name or 'top'))}, in check_includes.py {sorted(allowed)}"


def check(root):
    root = root.resolve()
    found, count, paths = [], 0, files(root)
    known = [path.relative_to(root).as_posix() for path in paths]
    for path in paths:
        if path.suffix == ".md":
            count += 1
            found += findings_of_document(root, path, path.read_text(encoding="utf-8"), known)
        elif path.suffix in SOURCES and not EXCLUDED.search(path.as_posix()):
            names = NAMED.findall(path.read_text(encoding="utf-8", errors="replace"))
            found += [f"{path.relative_to(root)}: there is no {name}" for name in sorted(set(names))
                      if not (root / name).is_file()]
    for diagram, part in DIAGRAMS.items():
        found += findings_of_diagram(root, diagram, part)
    return found, count


if __name__ == "__main__":
    findings.run(check, "documents")
