#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares two reports of `vellum bench` of one device: whether each ratio of the second lies within the spread of the
first, or the other way round, and by how much the medians differ. Prints Markdown; exits with 1 where a pair disagrees.

usage: bench/compare_reports.py FIRST.json SECOND.json
"""
import json
import pathlib
import sys


def ratios(path):
    """(part, what is measured) -> lower quartile, median, upper quartile"""
    found = {}
    for part in json.loads(pathlib.Path(path).read_text())["parts"]:
        for row in part["rows"]:
            if row["row"] == "frame":
                found[part["name"], f"level {row['level']}, {'heavy' if row['heavy'] else 'plain'}"] = row["ratio"]
            elif row["row"] == "build":
                found[part["name"], row["what"]] = row["ratio"]
    return found


def agree(a, b):
    return a[0] <= b[2] and b[0] <= a[2]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    first, second = map(ratios, sys.argv[1:])
    if not first or first.keys() != second.keys():
        sys.exit("the reports did not measure the same")
    print("| part | ratio of | first | second | difference of the medians | spreads overlap |\n|---|---|--:|--:|--:|---|")
    disagreeing = 0
    for key, a in first.items():
        b = second[key]
        disagreeing += not agree(a, b)
        print(f"| {key[0]} | {key[1]} | {a[1]:.3f} ({a[0]:.3f} to {a[2]:.3f}) | {b[1]:.3f} ({b[0]:.3f} to {b[2]:.3f}) "
              f"| {100 * (b[1] / a[1] - 1):+.1f} % | {'yes' if agree(a, b) else 'no'} |")
    print(f"\n{len(first) - disagreeing} of {len(first)} agree.")
    return disagreeing != 0


if __name__ == "__main__":
    sys.exit(main())
