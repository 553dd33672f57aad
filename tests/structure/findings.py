"""What the checks of this folder share: their command line, and how they print their findings."""
import pathlib
import sys

REGISTRY = "/usr/share/vulkan/registry/vk.xml"


def run(check, things):
    """Runs check(root), whose argument is the first of the command line, and exits."""
    finish(things, *check(root_from(sys.argv[1:])))


def run_with_registry(check, things):
    """Runs check(registry, root) and exits; the test is skipped where there is no registry."""
    registry = pathlib.Path((sys.argv[1:] or [REGISTRY])[0])
    if not registry.exists():
        print(f"skipped: there is no {registry}")
        sys.exit(77)
    finish(things, *check(registry, root_from(sys.argv[2:])))


def root_from(words):
    return pathlib.Path(words[0]) if words else pathlib.Path(__file__).parents[2]


def finish(things, findings, count):
    print(*findings, sep="\n")
    print(f"{len(findings)} findings in {count} {things}")
    sys.exit(1 if findings or not count else 0)
