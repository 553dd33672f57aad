#!/usr/bin/env python3
"""Checks how the source tree is put together, and prints what breaks a rule:

- an include goes from a part of src/ only to a part that it may use, or to files of it, and from a room only to rooms
  below it;
- a part with rooms has its sources in them;
- no folder has more source files than MOST_FILES, and no source file has more lines than MOST_LINES.

usage: check_includes.py [ROOT]
"""
import pathlib
import re
import sys

# Parts of src/ and the other parts that each may use.
PARTS = {
    "core": (),
    "bake": ("core",),
    "gpubake": ("core",),
    "spirv": ("core",),
    "shaders": ("core",),
    "library": ("core", "bake"),
    "gltf": ("core", "bake"),
    "gltflibrary": ("core", "bake", "gltf", "library"),
    "layer": ("core", "spirv"),
    "verify": ("core", "bake", "gltf"),
    "cli": ("core", "bake", "gltf", "verify"),
}
# Parts that may use some files of another only. Verification shares no code with what it verifies.
ONLY = {
    ("verify", "bake"): ("texture/texture.h",),
}
# Parts with rooms: the rooms, from the lowest to the highest. "" is the folder of the part itself.
ROOMS = {
    "layer": ("ground", "memory", "objects", "commands", "micromaps", "structures", "queries", "pipelines", "translation",
              "address", "door"),
    "spirv": ("module", "translation", ""),
    "shaders": ("ground", "micromaps", "structures", "queries", "pipelines", "translation", "gpubake"),
    "bake": ("numbers", "texture", ""),
    "gltf": ("file", "data", "", "micromaps"),
    "cli": ("base", "picture", "scene", "vulkan", "renderer", "info", "inspect", "", "reference"),
}

MOST_FILES = 24
MOST_LINES = 599
FOLDERS = ("src", "include", "tests", "bench", "examples")
SOURCES = {".c", ".cpp", ".h", ".inc", ".glsl", ".comp", ".vert", ".frag", ".mesh", ".rgen", ".rmiss", ".rchit",
           ".rahit", ".rint", ".rcall"}
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"')


def sources(root, folder):
    return sorted(path for path in (root / folder).rglob("*") if path.suffix in SOURCES and path.is_file())


def place(path):
    """Part and room of a path below src/."""
    part, *rest = path.parts
    return part, rest[0] if len(rest) > 1 else ""


def included(root, path, name):
    """The path below src/ of what an include names; None if it is not of src/."""
    src = root / "src"
    for folder in (path.parent, src, src / "core", src / "shaders"):
        target = (folder / name).resolve()
        if target.is_file():
            return target.relative_to(src) if target.is_relative_to(src) else None
    # Headers that the build writes: "layer/<room>/<name>.h". Those of shaders are nobody's.
    target = pathlib.PurePath(name)
    return target if target.parts[0] in PARTS and target.parts[0] != "shaders" else None


def complaint_about_include(here, there):
    part, room = place(here)
    other, other_room = place(there)
    if part != other:
        if part in PARTS and other not in PARTS[part]:
            return f"src/{part} does not use src/{other}"
        only = ONLY.get((part, other))
        if only and there.relative_to(other).as_posix() not in only:
            return f"src/{part} uses nothing of src/{other} but {', '.join(only)}"
        return None
    rooms = ROOMS.get(part, ())
    if room in rooms and other_room in rooms and rooms.index(other_room) > rooms.index(room):
        return f"up from room {room} to {'room ' + other_room if other_room else 'the top'}"
    return None


def check(root):
    root = root.resolve()
    complaints = []
    for path in sources(root, "src"):
        here = path.relative_to(root / "src")
        part, room = place(here)
        if part not in PARTS:
            complaints.append(f"src/{here}: in no part that {pathlib.Path(__file__).name} knows")
        elif part in ROOMS and room not in ROOMS[part]:
            complaints.append(f"src/{here}: in no room of src/{part} that {pathlib.Path(__file__).name} knows")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if match := INCLUDE.match(line):
                there = included(root, path, match[1])
                if there and (wrong := complaint_about_include(here, there)):
                    complaints.append(f'src/{here}:{number}: "{match[1]}": {wrong}')
    for folder in FOLDERS:
        counts = {}
        for path in sources(root, folder):
            counts[path.parent] = counts.get(path.parent, 0) + 1
            lines = len(path.read_text(encoding="utf-8").splitlines())
            if lines > MOST_LINES:
                complaints.append(f"{path.relative_to(root)}: {lines} lines, more than {MOST_LINES}")
        for parent, count in counts.items():
            if count > MOST_FILES:
                complaints.append(f"{parent.relative_to(root)}: {count} source files, more than {MOST_FILES}")
    return complaints


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[2])
    complaints = check(root)
    print(*complaints, sep="\n")
    print(f"{len(complaints)} complaints about {sum(len(sources(root, folder)) for folder in FOLDERS)} files")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
