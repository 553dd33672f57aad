#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs vellum check --quick --fail-fast with faults of planted.md, and writes NUMBER,RESULT,SECONDS,FIRST FAILING CASE.

usage: planted.py --vellum PROGRAM --layer FOLDER --output FILE [--filter GLOB]... [NUMBER...]
    FOLDER has the layer with the faults; no NUMBER: all of planted.patch; --filter: only a part of the quick cases

Fault 0 is none, and must be missed: a case that fails without a fault finds nothing. Numbers that FILE has are passed over.
"""
import argparse
import csv
import os
import pathlib
import re
import subprocess
import tempfile
import time

LIST = pathlib.Path(__file__).with_name("planted.md")
FIRST_OF_THIRD = 301  # of planted_third.patch
RESULTS = {0: "missed", 1: "found"}


def run(options, number):
    with tempfile.TemporaryDirectory() as folder:
        begin = time.monotonic()
        words = [options.vellum, "check", "--quick", "--fail-fast", "--layer-path", options.layer, "--output", folder]
        words += [word for glob in options.filter for word in ("--filter", glob)]
        ended = subprocess.run(words, env={**os.environ, "VELLUM_TEST_PLANTED": str(number)}, stdin=subprocess.DEVNULL,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        failures = pathlib.Path(folder) / "failures.csv"
        lines = failures.read_text(encoding="utf-8").splitlines() if failures.exists() else []
        result = RESULTS.get(ended.returncode, f"status {ended.returncode}")
        return number, result, round(time.monotonic() - begin), lines[0].split(",")[0] if lines else ""


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1])
    parser.add_argument("--vellum", default="vellum")
    parser.add_argument("--layer", required=True)
    parser.add_argument("--output", type=pathlib.Path, required=True)
    parser.add_argument("--filter", action="append", default=[])
    parser.add_argument("numbers", nargs="*", type=int)
    options = parser.parse_args()
    done = set()
    if options.output.exists():
        with open(options.output, newline="", encoding="utf-8") as file:
            done = {int(row[0]) for row in csv.reader(file)}
    everything = map(int, re.findall(r"^\| (\d+) \|", LIST.read_text(encoding="utf-8"), re.MULTILINE))
    for number in options.numbers or [0, *(number for number in everything if number < FIRST_OF_THIRD)]:
        if number in done:
            continue
        row = run(options, number)
        with open(options.output, "a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(row)
        print(*row, flush=True)


if __name__ == "__main__":
    main()
