# SPDX-License-Identifier: Apache-2.0
"""What the checks of this folder share: their command line, and how they print their findings."""
import pathlib
import sys

REGISTRY = "/usr/share/vulkan/registry/vk.xml"


def run(check, things, write=None):
    """Runs check(root), whose argument is the first of the command line, and exits. With --write, calls write(root) first."""
    root = root_from(words())
    write_if_requested(write, root)
    finish(things, *check(root))


def run_with_registry(check, things, write=None, registry=REGISTRY):
    """Runs check(registry, root) and exits, like run(); the test is skipped where there is no registry."""
    registry = pathlib.Path((words() or [registry])[0])
    root = root_from(words()[1:])
    write_if_requested(write, root)
    if not registry.exists():
        print(f"skipped: there is no {registry}")
        sys.exit(77)
    finish(things, *check(registry, root))


def words():
    return [word for word in sys.argv[1:] if word != "--write"]


def root_from(paths):
    return pathlib.Path(paths[0]) if paths else pathlib.Path(__file__).parents[2]


def write_if_requested(write, root):
    if write and "--write" in sys.argv:
        write(root)


def finish(things, findings, count):
    print(*findings, sep="\n")
    print(f"{len(findings)} findings in {count} {things}")
    sys.exit(1 if findings or not count else 0)
