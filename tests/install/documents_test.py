#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the commands of the README and of docs/install.md as they stand there, in a fresh clone with an empty home folder.

From the README, the commands under "Install". From docs/install.md, each block that is marked as sh. Packages must be installed;
with --packages, blocks that are marked as sh-packages are run too, for a scratch root. With --build, a build of the checkout,
objects are taken from there (reuse_objects.py), unless the checkout has changes that a clone lacks.

usage: documents_test.py --source CHECKOUT --scratch FOLDER [--build FOLDER] [--packages]
"""
import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys

import reuse_objects

SHOWN = ("PATH", "TERM", "LANG", "CCACHE_", "CMAKE_", "VK_DRIVER_FILES", "VK_ICD_FILENAMES")


def blocks(text, languages):
    return [body for language, body in re.findall(r"^```([\w-]*)\n(.*?)^```$", text, re.M | re.S) if language in languages]


def section(text, title):
    found = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", text, re.M | re.S)
    if not found:
        raise SystemExit(f"there is no section {title}")
    return found[1]


def check(commands, options):
    shutil.rmtree(options.scratch, ignore_errors=True)
    home = options.scratch / "home"
    home.mkdir(parents=True)
    subprocess.run(["git", "clone", "--quiet", options.source, options.scratch / "vellum"], check=True)
    script = options.scratch / "commands.sh"
    script.write_text("set -euo pipefail\n" + "\n".join(commands))
    environment = {variable: value for variable, value in os.environ.items() if variable.startswith(SHOWN)}
    index = options.scratch / "reused.json"
    reuse = reuse_objects.variables(options.build, options.source, index, options.scratch / "vellum") if options.build else {}
    if reuse:
        environment |= reuse
    elif shutil.which("ccache"):
        # The pages build the same more than once, in several folders.
        environment = {"CMAKE_C_COMPILER_LAUNCHER": "ccache", "CMAKE_CXX_COMPILER_LAUNCHER": "ccache",
                       "CCACHE_DIR": str(options.scratch / "ccache"), "CCACHE_NOHASHDIR": "1",
                       "CCACHE_BASEDIR": str(options.scratch), "CCACHE_SLOPPINESS":
                       "pch_defines,time_macros,include_file_mtime,include_file_ctime", **environment}
    code = subprocess.run(["bash", "-x", script], cwd=options.scratch / "vellum", env={**environment, "HOME": str(home)},
                          check=False).returncode
    left = [path for path in home.rglob("*") if not path.is_dir()]
    if reuse:
        print(reuse_objects.report(index))
    print(f"{len(commands)} blocks of commands, status {code}; {len(left)} files in the home folder after them")
    return code == 0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--scratch", type=pathlib.Path, required=True)
    parser.add_argument("--build", type=pathlib.Path)
    parser.add_argument("--packages", action="store_true")
    options = parser.parse_args()
    readme = blocks(section((options.source / "README.md").read_text(encoding="utf-8"), "Install"), {"", "sh"})
    page = blocks((options.source / "docs/install.md").read_text(encoding="utf-8"),
                  {"sh", "sh-packages"} if options.packages else {"sh"})
    if len(readme) < 2 or len(page) < 5:
        print("the pages have fewer commands than expected")
        return 1
    return 0 if check(readme + page, options) else 1


if __name__ == "__main__":
    sys.exit(main())
