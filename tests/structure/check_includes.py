#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks how the source tree is put together, and prints what breaks a rule:

- an include goes from a part of src/ only to a part that it may use, or to files of it, and from a subsystem only to those
  that it may use;
- a part with subsystems has its sources in them;
- what becomes WebAssembly uses no algorithm of std::ranges, which the library of Debian 12's Emscripten lacks.

usage: check_includes.py [ROOT]
"""
import pathlib
import re

import findings

# Parts of src/ and the other parts that each may use.
PARTS = {
    "core": (),
    "base": ("core",),
    "bake": ("core",),
    "gpubake": ("core",),
    "spirv": ("core",),
    "shaders": ("core",),
    "library": ("core", "bake", "spirv"),
    "gltf": ("core", "base", "bake"),
    "gltflibrary": ("core", "base", "bake", "gltf", "library"),
    "layer": ("core", "spirv", "vk"),
    "verify": ("core", "base", "bake", "gltf"),
    "wasm": ("core", "base", "gltf", "library", "gltflibrary", "verify", "inspect"),
    "vk": (),
    "gpu": ("core", "base", "vk"),
    "job": ("core", "base"),
    "render": ("core", "base", "bake", "gltf", "vk", "gpu"),
    "inspect": ("core", "base", "bake", "gltf"),
    "check": ("vk", "gpu"),
    "cli": ("core", "base", "bake", "gltf", "verify", "spirv", "vk", "gpu", "render", "inspect", "job",
            "check", "layer"),
}
# Parts that may use some files of another only. Verification shares no code with what it verifies.
ONLY = {
    ("verify", "bake"): ("texture/texture.h",),
    ("library", "spirv"): ("module/micromap_mode.h",),
    ("cli", "layer"): ("base/setting_names.h",),
}
# Parts with subsystems: each subsystem and those that it may include. "" is the folder of the part itself.
def below(*subsystems):
    """Each may include all that stand before it."""
    return {name: subsystems[:i] for i, name in enumerate(subsystems)}


LOW = ("base", "input", "memory", "rules", "command_buffer", "state")
CHECKS = ("model", "rules", "gpu") # what the checks of validation may use; these use the ones before them
SUBSYSTEMS = {
    "layer": below(*LOW) | {
        "micromaps": LOW,
        "structures": LOW + ("micromaps",),
        "query_pool": LOW + ("micromaps", "structures"),
        "pipelines": LOW,
        "khr_over_ext": LOW + ("micromaps", "structures", "query_pool"),
        "device_address": LOW + ("micromaps", "structures", "query_pool"),
        "validation": LOW[:-1],
        "entry": LOW + ("micromaps", "structures", "query_pool", "pipelines", "khr_over_ext", "device_address", "validation"),
    },
    "layer/validation": below(*CHECKS) | {
        "traces": CHECKS,
        "sync": CHECKS[:2],
        "ranges": CHECKS[:2],
        "": CHECKS + ("traces", "sync", "ranges"),
    },
    "spirv": below("module", "sites", ""),
    "shaders": {
        "base": (), "micromaps": ("base",), "structures": ("base",), "query_pool": ("base",), "pipelines": ("base",),
        "khr_over_ext": ("base",), "gpubake": ("base",), "validation": ("base",),
    },
    "bake": below("numbers", "texture", ""),
    "check": below("oracle", "case", "groups"),
    "gltf": below("file", "data", "", "micromaps"),
    "cli": below("base", "options", "info", "check", "run", "bench", "spirv", "verify", "bake", "sweep", "", "manual"),
}

SOURCES = {".c", ".cpp", ".h", ".inc", ".glsl", ".comp", ".vert", ".frag", ".mesh", ".rgen", ".rmiss", ".rchit",
           ".rahit", ".rint", ".rcall"}
WASM = {"wasm", *PARTS["wasm"], "bake"}
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"')


def sources(root):
    return sorted(path for path in (root / "src").rglob("*") if path.suffix in SOURCES and path.is_file())


def places(path):
    """Part and subsystem of a path below src/; for a subsystem that has subsystems itself, it and that one as well."""
    *folders, _ = path.parts
    parts = ["/".join(folders[:count + 1]) for count in range(len(folders))]
    return {part: (folders + [""])[count] for count, part in enumerate(parts, 1)
            if count == 1 or part in SUBSYSTEMS}


def included(root, path, name):
    """The path below src/ of what an include names; None if it is not of src/."""
    src = root / "src"
    for folder in (path.parent, src, src / "core", src / "shaders"):
        target = (folder / name).resolve()
        if target.is_file():
            return target.relative_to(src) if target.is_relative_to(src) else None
    # Headers that the build writes: "layer/<subsystem>/<name>.h". Those of shaders belong to no subsystem.
    target = pathlib.PurePath(name)
    return target if target.parts[0] in PARTS and target.parts[0] != "shaders" else None


def finding_of_include(here, there):
    part, other = here.parts[0], there.parts[0]
    if part != other:
        if part in PARTS and other not in PARTS[part]:
            return f"src/{part} does not use src/{other}"
        only = ONLY.get((part, other))
        if only and there.relative_to(other).as_posix() not in only:
            return f"src/{part} uses nothing of src/{other} but {', '.join(only)}"
        return None
    others = places(there)
    for part, subsystem in places(here).items():
        allowed, other = SUBSYSTEMS.get(part, {}).get(subsystem), others.get(part)
        if allowed is not None and other is not None and other != subsystem and other not in allowed:
            return f"{subsystem or 'the top'} does not use {other or 'the top'}"
    return None


def check(root):
    root = root.resolve()
    found = []
    for path in sources(root):
        here = path.relative_to(root / "src")
        if here.parts[0] not in PARTS:
            found.append(f"src/{here}: in no part that {pathlib.Path(__file__).name} knows")
        for part, subsystem in places(here).items():
            if part in SUBSYSTEMS and subsystem not in SUBSYSTEMS[part]:
                found.append(f"src/{here}: in no subsystem of src/{part} that {pathlib.Path(__file__).name} knows")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if here.parts[0] in WASM and "std::ranges::" in line:
                found.append(f"src/{here}:{number}: src/{here.parts[0]} becomes WebAssembly and has no std::ranges")
            if match := INCLUDE.match(line):
                there = included(root, path, match[1])
                if there and (wrong := finding_of_include(here, there)):
                    found.append(f'src/{here}:{number}: "{match[1]}": {wrong}')
    return found, len(sources(root))


if __name__ == "__main__":
    findings.run(check, "files")
