# SPDX-License-Identifier: Apache-2.0
"""The table of a run, in Markdown."""
import collections
import pathlib

from killers import SURVIVED


def read_equivalent(path):
    """Survivors that are equivalent: the id of each mutant and why no program can notice it."""
    explained = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.strip() and not line.startswith("#"):
            name, why = line.split(maxsplit=1)
            explained[name] = why
    return explained


def share(part, whole):
    return f"{100 * part / whole:.1f} %" if whole else "-"


def median(values):
    return sorted(values)[len(values) // 2] if values else 0


def table(results, equivalent):
    """Counts of all mutants, then of each killer."""
    builds = results.of_stage("build")
    count = collections.Counter(record["result"] for record in builds.values())
    explained = {name for name in builds if builds[name]["result"] == "built" and name in equivalent}
    run = {name for name, stage in results.records if stage != "build"}
    alive = [name for name in builds if builds[name]["result"] == "built" and name not in explained and name in run]
    seconds = [record["seconds"] for record in builds.values()]
    lines = ["| mutants | |", "|---|--:|", f"| chosen | {len(builds)} |",
             f"| stillborn: do not compile | {count['stillborn']} |",
             f"| equivalent: the same binary | {count['same']} |",
             f"| equivalent: explained | {len(explained)} |",
             f"| counted: a killer was run against them | {len(alive)} |",
             f"| seconds to build one, median | {median(seconds):.1f} |", "",
             "| killer | mutants | killed | share | seconds to kill, median |", "|---|--:|--:|--:|--:|"]
    killed_by_any = set()
    for stage in results.stages():
        records = [record for name, record in results.of_stage(stage).items() if name in alive]
        killed = [record for record in records if record["result"] == "killed"]
        if stage != "build" and records:
            killed_by_any |= {record["id"] for record in killed}
            lines.append(f"| {stage} | {len(records)} | {len(killed)} | {share(len(killed), len(records))} | "
                         f"{median([record['seconds'] for record in killed]):.1f} |")
    lines.append(f"| any of them | {len(alive)} | {len(killed_by_any)} | {share(len(killed_by_any), len(alive))} | |")
    return lines + by_key(alive, killed_by_any, "operator", lambda name: name.split(":")[2]) + \
        by_key(alive, killed_by_any, "folder", lambda name: str(pathlib.PurePosixPath(name.split(":")[0]).parent))


def by_key(alive, killed, title, key):
    whole = collections.Counter(map(key, alive))
    part = collections.Counter(map(key, killed))
    return ["", f"| {title} | mutants | killed |", "|---|--:|--:|",
            *(f"| {name} | {whole[name]} | {part[name]} |" for name in sorted(whole))]


def survivors(results):
    """Those built that at least one killer was run against, and none killed."""
    builds = results.of_stage("build")
    outcomes = collections.defaultdict(set)
    for stage in results.stages():
        if stage != "build":
            for name, record in results.of_stage(stage).items():
                outcomes[name].add(record["result"])
    return [name for name in builds if builds[name]["result"] == "built" and outcomes[name] == {SURVIVED}]


def matrix(results):
    """A row for each suite: how many mutants it kills, how many that no other suite kills, and its mutants by number."""
    records = results.of_stage("suites")
    numbers = {name: number for number, name in enumerate(records, 1)}
    kills = {}
    for name, record in records.items():
        for suite in record["all"]:
            kills.setdefault(suite, []).append(name)
    counts = collections.Counter(name for names in kills.values() for name in names)
    lines = ["| suite | kills | alone | mutants |", "|---|--:|--:|---|"]
    for suite, names in sorted(kills.items(), key=lambda item: -len(item[1])):
        alone = sum(counts[name] == 1 for name in names)
        lines.append(f"| {suite} | {len(names)} | {alone} | {' '.join(str(numbers[name]) for name in names)} |")
    lines += ["", "| number | mutant | killed by |", "|--:|---|--:|"]
    return lines + [f"| {numbers[name]} | {name} | {counts[name]} |" for name in records]


def change(record):
    return [f"    - {record['before']}", f"    + {record['after']}"]


def report(results, equivalent):
    lines = table(results, equivalent)
    builds = results.of_stage("build")
    lines += ["", "## Survivors"]
    for name in survivors(results):
        if name not in equivalent:
            lines += ["", f"{name}", "", *change(builds[name])]
    lines += ["", "## Explained as equivalent"]
    for name in survivors(results):
        if name in equivalent:
            lines += ["", f"{name}: {equivalent[name]}", "", *change(builds[name])]
    return lines
