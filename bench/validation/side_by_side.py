#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Which rules do Vellum's validation and Khronos' validation layer report? Runs the wrong programs of tests/validation, and
the right program beside each, with both, and prints tables.

  side_by_side.py --build build/release                   with the validation layer of this machine
  side_by_side.py --build build/release --root FOLDER     with that of the Debian in FOLDER, which is made if it is not there
  side_by_side.py --build build/release --cases '*11560*' --json out.json

Vellum runs as in the tests. Khronos' layer runs above Vellum, which emulates micromaps and validates nothing: once with
its default checks, and, if these are silent, with synchronization and GPU-assisted validation as well. Each program has
a process of its own. With --root it runs there by chroot, as root, with the folder of the checkout in its place; lavapipe is
the driver.
"""
import argparse
import collections
import json
import os
import pathlib
import re
import signal
import subprocess
import sys

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = "bin/validation_tests"
PACKAGES = "libvulkan1,mesa-vulkan-drivers,vulkan-validationlayers"
DRIVER = "/usr/share/vulkan/icd.d/lvp_icd*.json"
ALL_CHECKS = {"VK_KHRONOS_VALIDATION_VALIDATE_SYNC": "1", "VK_KHRONOS_VALIDATION_GPUAV_ENABLE": "1"}
WITHOUT_BUILDS = ALL_CHECKS | {"VK_KHRONOS_VALIDATION_GPUAV_ACCELERATION_STRUCTURES_BUILDS": "0"}
LOG = {"VK_KHRONOS_VALIDATION_DEBUG_ACTION": "VK_DBG_LAYER_ACTION_LOG_MSG",
       "VK_KHRONOS_VALIDATION_LOG_FILENAME": "stdout", "VK_KHRONOS_VALIDATION_REPORT_FLAGS": "error",
       "VK_KHRONOS_VALIDATION_ENABLE_MESSAGE_LIMIT": "0"}
ERROR = re.compile(r"Validation Error: \[ (\S+) \]")
CASE = re.compile(r"^  (\S+)  # GetParam\(\) = (\S+) ?(.*)$")
ENDED = re.compile(r"^\[ +(OK|FAILED|SKIPPED) +\] (\S+?),? .*\(\d+ ms\)$", re.M)
SIGNALLED = 128

# errors: ids in the order in which they were reported; ended: "ok", "skipped", "hangs", or a signal
Run = collections.namedtuple("Run", "errors ended")
Case = collections.namedtuple("Case", "name rule variant")


class Place:
    """Where Khronos' layer runs: this machine, or the Debian in a folder."""
    def __init__(self, root, suite, mirror):
        self.root = root
        if root and not (root / "usr/share/vulkan/explicit_layer.d").exists():
            subprocess.run(["debootstrap", "--variant=minbase", f"--include={PACKAGES}", suite, str(root), *mirror],
                           check=True)

    def command(self, *words):
        if not self.root:
            return list(words)
        folder = str(CHECKOUT.parents[-2])  # the first below the root of this machine
        return [str(CHECKOUT / "scripts/scratch-root"), "run", "--bind", folder, str(self.root), *words]

    def driver(self):
        found = sorted((self.root or pathlib.Path("/")).glob(DRIVER.lstrip("/")))
        return "/" + str(found[0].relative_to(self.root or "/")) if found else ""


def cases_of(program, pattern):
    listed = subprocess.run([program, "--gtest_list_tests", f"--gtest_filter={pattern}"], check=True, text=True,
                            stdout=subprocess.PIPE).stdout
    suite, cases = "", []
    for line in listed.splitlines():
        match = CASE.match(line)
        if match:
            cases.append(Case(suite + match[1], match[2], match[3]))
        elif not line.startswith(" "):
            suite = line.split()[0]
    return cases


def vellum(program, cases, seconds):
    """How each case ended as a test."""
    output = subprocess.run([program, "--gtest_color=no", "--gtest_filter=" + ":".join(case.name for case in cases)],
                            check=False, text=True, errors="replace", stdout=subprocess.PIPE, timeout=seconds * len(cases)).stdout
    return {name: how for how, name in ENDED.findall(output)}


def run_once(place, program, names, which, checks, seconds):
    """One process, up to its end or its crash: the cases that it ran."""
    variables = {name: value for name, value in os.environ.items()
                 if name == "VELLUM_TEST_LAYER" or not name.startswith(("VELLUM_", "VK_"))}
    variables |= {"VELLUM_TEST_VALIDATION": "above", "VELLUM_TEST_PROGRAM": which, "VK_DRIVER_FILES": place.driver(),
                  **LOG, **checks}
    command = place.command(program, "--gtest_color=no", "--gtest_filter=" + ":".join(names))
    try:
        done = subprocess.run(command, check=False, env=variables, text=True, errors="replace", stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=seconds * len(names))
        output, code = done.stdout, done.returncode
    except subprocess.TimeoutExpired as late:
        output, code = (late.stdout or b"").decode(errors="replace"), None
    number = code if code is None or code <= SIGNALLED else SIGNALLED - code
    ended = "hangs" if number is None else signal.Signals(-number).name if number < 0 else f"exits with {number}"
    runs = {}
    for part in output.split("[ RUN      ] ")[1:]:
        name = part.split()[0]
        end = ENDED.search(part)
        errors = list(dict.fromkeys(ERROR.findall(part)))
        runs[name] = Run(errors, ended if not end else "skipped" if end[1] == "SKIPPED" else "ok")
    return runs


def khronos(place, program, cases, which, checks, seconds):
    """The runs of all cases by name. Those behind a crash run in a further process; what crashes runs alone as well."""
    left, runs = [case.name for case in cases], {}
    while left:
        ran = run_once(place, program, left, which, checks, seconds)
        if not ran:
            raise SystemExit("nothing runs; is the validation layer there?")
        last = list(ran)[-1]
        if ran[last].ended not in ("ok", "skipped") and len(ran) > 1:
            ran[last] = run_once(place, program, [last], which, checks, seconds).get(last, ran[last])
        runs |= ran
        left = [name for name in left if name not in ran]
        print(f"\r{which}, {len(checks)} more checks: {len(left)} left   ", end="", file=sys.stderr)
    return runs


def verdict(rule, right, wrong):
    """What a layer makes of a wrong program, given what it reports of the right one."""
    if "skipped" in (right.ended, wrong.ended):
        return "skipped"
    new = [error for error in wrong.errors if error not in right.errors]
    if right.ended != "ok":
        return f"{right.ended}, right program as well"
    # Hazards have names, not VUIDs.
    if rule in new or rule.upper().replace("SYNC-", "SYNC-HAZARD-") in new:
        return "reported" if wrong.ended == "ok" else f"reported, then {wrong.ended}"
    if wrong.ended != "ok":
        return wrong.ended
    return "another rule: " + ", ".join(new) if new else "silent"


def compare(place, program, cases, seconds):
    """For each case the verdict with each set of checks, until one is more than silence."""
    results = {case: {} for case in cases}
    left = cases
    for name, checks in (("default checks", {}), ("all checks", ALL_CHECKS), ("all checks but builds", WITHOUT_BUILDS)):
        right, wrong = (khronos(place, program, left, which, checks, seconds) for which in ("right", "wrong"))
        for case in left:
            pair = right[case.name], wrong[case.name]
            results[case][name] = {"verdict": verdict(case.rule, *pair), "right": pair[0].errors, "wrong": pair[1].errors}
        if name == "all checks":
            left = [case for case in left if right[case.name].ended not in ("ok", "skipped")]
        else:
            left = [case for case in left if results[case][name]["verdict"].startswith(("silent", "another"))]
    return results


def best(result):
    """The verdict of the last checks that did not crash on the right program, and which these were."""
    kept = [(each["verdict"], name) for name, each in result.items() if "as well" not in each["verdict"]]
    said, name = (kept or [(each["verdict"], name) for name, each in result.items()])[-1]
    if said == "silent" and kept[0][0] != "silent":
        said, name = kept[0]
    return said + (f" ({name})" if said.startswith("reported") and name != "default checks" else "")


def printed(results):
    def short(text):
        return re.sub(r"(?:VUID|UNASSIGNED)-(\w+)-(?:[\w-]*-)?(\d{5})", r"\2", text)

    kinds = collections.Counter((ours, re.sub(r"^another rule.*", "another rule", best(result)))
                                for _, ours, result in results)
    print(f"{len(results)} wrong programs\n\n| Vellum | Khronos | programs |\n|---|---|--:|")
    for (ours, theirs), count in kinds.most_common():
        print(f"| {ours} | {theirs} | {count} |")
    print("\n| rule | program | Vellum | Khronos |\n|---|---|---|---|")
    for case, ours, result in results:
        print(f"| {case.rule} | {case.variant} | {ours} | {short(best(result))} |")
    right = {(case, error) for case, _, result in results for each in result.values() for error in each["right"]}
    print(f"\nErrors of Khronos' layer in {len({case for case, _ in right})} right programs")
    for case, error in sorted(right):
        print(f"- {case.rule} {case.variant}: {error}")
    crashes = [case.rule for case, _, result in results if any("as well" in each["verdict"] for each in result.values())]
    print(f"\nCrashes of Khronos' layer in {len(crashes)} right programs: {', '.join(crashes)}")


def main():
    parser = argparse.ArgumentParser(usage=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    parser.add_argument("--root", type=pathlib.Path)
    parser.add_argument("--suite", default="testing")
    parser.add_argument("--mirror", nargs="?", default=[], type=lambda value: [value])
    parser.add_argument("--cases", default="*")
    parser.add_argument("--seconds", type=float, default=60, help="after which a program hangs")
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    program = str((options.build / PROGRAM).resolve())
    place = Place(options.root.resolve() if options.root else None, options.suite, options.mirror)
    cases = cases_of(program, options.cases)
    if not cases:
        raise SystemExit("there is no such case")
    theirs = compare(place, program, cases, options.seconds)
    ours = vellum(program, cases, options.seconds)
    words = {"OK": "reported", "FAILED": "not as expected", "SKIPPED": "skipped"}
    results = [(case, words.get(ours.get(case.name), "crashes"), result)
               for case, result in theirs.items()]
    if options.json:
        options.json.write_text(json.dumps([{**case._asdict(), "vellum": how, "khronos": result}
                                            for case, how, result in results], indent=1), encoding="utf-8")
    printed(results)


if __name__ == "__main__":
    main()
