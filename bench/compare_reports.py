#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares two reports of `vellum bench` of one device: do their ratios agree?

The spread of a ratio is half the distance of its quartiles, relative to its median; that of a pair is the root of the sum
of both squares. The medians

  agree        if they differ by at most 5 %, and the spread is no wider than that
  differ       if they differ by more than 5 %, and by more than the spread
  undecided    otherwise: the spread is wide. Overlapping it is no agreement; measure again on an idle machine.

Prints Markdown; exits with 0 where all agree, 1 where some differ, 2 where none differs and some are undecided.

usage: bench/compare_reports.py FIRST.json SECOND.json
"""
import json
import math
import pathlib
import sys

LIMIT = 0.05
AGREE, DIFFER, UNDECIDED = "agree", "differ", "undecided"


def ratios(path):
    """(part, what is measured) -> lower quartile, median, upper quartile"""
    found = {}
    for part in json.loads(pathlib.Path(path).read_text(encoding="utf-8"))["parts"]:
        for row in part["rows"]:
            if row["row"] == "frame":
                found[part["name"], f"level {row['level']}, {'heavy' if row['heavy'] else 'plain'}"] = row["ratio"]
            elif row["row"] == "build":
                found[part["name"], row["what"]] = row["ratio"]
    return found


def spread(quartiles):
    return (quartiles[2] - quartiles[0]) / 2 / quartiles[1]


def compare(a, b):
    """The verdict on two ratios, the difference of their medians and their spread together, both relative."""
    if not all(a + b):  # of a device whose clock stands still
        return UNDECIDED, math.nan, math.nan
    difference, both = b[1] / a[1] - 1, math.hypot(spread(a), spread(b))
    if abs(difference) > max(LIMIT, both):
        return DIFFER, difference, both
    return UNDECIDED if both > LIMIT else AGREE, difference, both


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    first, second = map(ratios, sys.argv[1:])
    if not first or first.keys() != second.keys():
        sys.exit("the reports did not measure the same")
    print("| part | ratio of | first | second | medians differ by | spread | |\n|---|---|--:|--:|--:|--:|---|")
    verdicts = []
    for key, a in first.items():
        b = second[key]
        verdict, difference, both = compare(a, b)
        verdicts.append(verdict)
        shown = ["–" if not all(r) else f"{r[1]:.3f} ({r[0]:.3f} to {r[2]:.3f})" for r in (a, b)]
        print(f"| {key[0]} | {key[1]} | {shown[0]} | {shown[1]} | {100 * difference:+.1f} % | {100 * both:.1f} % | {verdict} |")
    counts = {verdict: verdicts.count(verdict) for verdict in (AGREE, DIFFER, UNDECIDED)}
    print(f"\n{counts[AGREE]} of {len(first)} agree, {counts[DIFFER]} differ, {counts[UNDECIDED]} undecided.")
    return 1 if counts[DIFFER] else 2 if counts[UNDECIDED] else 0


if __name__ == "__main__":
    sys.exit(main())
