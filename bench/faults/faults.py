#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Does `vellum check` find the planted faults? Runs it once with each fault of the tests' faulty driver, a layer above
Vellum's (tests/layer/faulty_driver), and prints how many it finds and how soon.

  faults.py --build build/release                       each fault with vellum check --quick
  faults.py --build build/release --fault index-stride --fault base-twice --seed 7
  faults.py --build build/release --list                prints the faults, what is wrong, and what they imitate
  faults.py --build build/release -- --minutes 10       other options of vellum check

A run ends with the first failing case that fails again with vellum check --replay: the fault is found. It is a flake if all
pass there. First a run without a fault must find nothing; it also shows how long a run takes on this machine, and so when
one with a fault is stopped. How soon a fault is found is stated in seconds, and as the number of the case in the order of
vellum check --list, which is the same on every machine. --output writes the table as JSON.
"""
import argparse
import collections
import contextlib
import ctypes
import json
import math
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import time

FAULTY = "VK_LAYER_VELLUM_test_faulty_driver"
VELLUM = "VK_LAYER_VELLUM_opacity_micromap"
MOCK = "VK_LAYER_VELLUM_test_mock_driver"
TEST_LAYERS = "tests/layer/layers"
POLL_SECONDS = 0.2
LIMIT, LEAST_LIMIT = 5, 120  # times the run without a fault; seconds

Fault = collections.namedtuple("Fault", "name claim imitates quirks")
Result = collections.namedtuple("Result", "fault outcome seconds case")


def known_faults(build):
    """The faults of the library, which end with the four of whole processes."""
    library = ctypes.CDLL(str(build / TEST_LAYERS / "libvellum_test_faulty_driver.so"))
    library.vellumFault.restype = ctypes.c_char_p
    faults = []
    while library.vellumFault(len(faults), 0):
        faults.append(Fault(*(library.vellumFault(len(faults), member).decode() for member in range(4))))
    return faults


def place_layers(build, folder, names):
    """Manifests in folders of their own, because old loaders order layers by folder. Returns the search path."""
    folders = []
    for number, name in enumerate(names):
        source = build / ("lib" if name == VELLUM else TEST_LAYERS)
        manifest = source / (name.replace("VK_LAYER_VELLUM_", "VkLayer_vellum_") + ".json")
        content = json.loads(manifest.read_text(encoding="utf-8"))
        content["layer"]["library_path"] = str((source / content["layer"]["library_path"]).resolve())
        place = folder / str(number)
        place.mkdir()
        (place / manifest.name).write_text(json.dumps(content), encoding="utf-8")
        folders.append(str(place))
    return ":".join(folders)


def environment(build, folder, fault):
    variables = {name: value for name, value in os.environ.items() if name != "VK_LAYER_PATH"}
    for manifest in sorted(pathlib.Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json")):
        variables.setdefault("VK_DRIVER_FILES", str(manifest))
        variables.setdefault("VK_ICD_FILENAMES", str(manifest))
    layers = [FAULTY, VELLUM] + ([MOCK] if fault.quirks else [])
    return variables | {"VELLUM_TEST_FAULT": fault.name, "VELLUM_TEST_MOCK_DRIVER": fault.quirks,
                        "VELLUM_TEST_FAULT_AFTER": variables.get("VELLUM_TEST_FAULT_AFTER", "0"),
                        "VK_INSTANCE_LAYERS": ":".join(layers), "VK_ADD_LAYER_PATH": place_layers(build, folder, layers)}


class Failures:
    """The failing cases that a run has written, and which of them fail again."""
    def __init__(self, program, output, variables):
        self.program, self.output, self.variables = program, output, variables
        self.seen = set()
        self.found = None  # name of the first that fails again

    def look(self):
        for path in sorted((self.output / "failures").glob("*.json"), key=lambda path: path.stat().st_mtime):
            if self.found or path in self.seen:
                continue
            self.seen.add(path)
            words = [self.program, "check", "--replay", str(path)]
            ended = subprocess.run(words, env=self.variables, stdin=subprocess.DEVNULL, capture_output=True, check=False)
            if ended.returncode == 1:
                self.found = path.stem


def stop(child):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def run(program, words, build, fault, seconds):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        variables = environment(build, folder, fault)
        failures = Failures(program, folder / "output", variables)
        begin = time.monotonic()
        with open(folder / "log", "w+b") as log, \
             subprocess.Popen([program, "check", "--output", str(failures.output), *words], env=variables,
                              stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                              start_new_session=True) as child:
            code = None
            try:
                while not failures.found and code is None and time.monotonic() - begin < seconds:
                    time.sleep(POLL_SECONDS)
                    elapsed = time.monotonic() - begin
                    code = child.poll()
                    failures.look()
            finally:
                stop(child)
            if code not in (None, 0, 1):
                log.seek(0)
                sys.stderr.write(log.read().decode(errors="replace"))
                raise SystemExit(f"{fault.name or 'no fault'}: vellum check returned {code}")
        outcome = "found" if failures.found or code == 1 else "flake" if failures.seen else "missed" if code == 0 else "no end"
        return Result(fault, outcome, elapsed, failures.found)


def list_cases(program, words):
    """The number of each case that these options select, from 1."""
    printed = subprocess.run([program, "check", *words, "--list"], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                             check=True).stdout
    return {name: number for number, name in enumerate(printed.split(), 1)}


def limit_of(requested, clean):
    """Seconds after which a run is stopped."""
    return requested or max(LIMIT * clean, LEAST_LIMIT)


def table(results, numbers, seed):
    lines = ["| fault | what is wrong | result | seconds | first failing case | its number |", "|---|---|---|--:|---|--:|"]
    lines += [f"| {r.fault.name} | {r.fault.claim} | {r.outcome} | {r.seconds:.1f} | {r.case or ''} "
              f"| {numbers.get(r.case, '')} |" for r in results]
    found = [r for r in results if r.outcome == "found"]
    summary = f"found {len(found)} / planted {len(results)} with seed {seed}"
    if found:
        seconds = [r.seconds for r in found]
        summary += f", median {statistics.median(seconds):.1f} seconds, longest {max(seconds):.1f}"
    if cases := [numbers[r.case] for r in found if r.case in numbers]:
        summary += f"; median case {statistics.median(cases):.0f} of {len(numbers)}, last {max(cases)}"
    return "\n".join(lines + ["", summary])


def select(known, names, parser):
    by_name = {fault.name: fault for fault in known}
    for name in names:
        if name not in by_name:
            parser.error(f"there is no fault {name}")
    return [by_name[name] for name in names] or known


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, required=True, help="a build folder with tests")
    parser.add_argument("--program", help="instead of the vellum of the build folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fault", action="append", default=[], help="only this one; repeatable")
    parser.add_argument("--seconds", type=float, help="after which a run is stopped [those of the run without a fault times "
                        f"{LIMIT}, at least {LEAST_LIMIT}]")
    parser.add_argument("--output", type=pathlib.Path, help="a file for the results as JSON")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("words", nargs="*", default=["--quick"], help="options of vellum check [--quick]")
    options = parser.parse_args()
    options.faults = select(known_faults(options.build), options.fault, parser)
    return options


def main():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that a run in progress is stopped
    options = parse()
    if options.list:
        for fault in options.faults:
            print(f"{fault.name}\n    {fault.claim}\n    like {fault.imitates}")
        return 0
    program = options.program or str(options.build / "bin/vellum")
    words = ["--seed", str(options.seed), *options.words]
    numbers = list_cases(program, words)
    clean = run(program, words, options.build, Fault("", "", "", ""), options.seconds or math.inf)
    if clean.outcome != "missed":
        raise SystemExit(f"without a fault: {clean.outcome}, {clean.case}")
    print(f"{len(numbers)} cases, {clean.seconds:.0f} s without a fault", file=sys.stderr, flush=True)
    limit = limit_of(options.seconds, clean.seconds)
    results = []
    for fault in options.faults:
        results.append(run(program, words, options.build, fault, limit))
        print(f"{results[-1].outcome:>7} {results[-1].seconds:6.1f} s  {fault.name}", file=sys.stderr, flush=True)
    print(table(results, numbers, options.seed))
    if options.output:
        rows = [{"fault": r.fault.name, "result": r.outcome, "seconds": round(r.seconds, 1), "case": r.case,
                 "number": numbers.get(r.case)} for r in results]
        report = {"seed": options.seed, "cases": len(numbers), "secondsWithoutFault": round(clean.seconds, 1), "faults": rows}
        options.output.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return 0 if all(r.outcome == "found" for r in results) else 1


if __name__ == "__main__":
    sys.exit(main())
