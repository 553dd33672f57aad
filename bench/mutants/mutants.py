#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Mutation testing of the layer: how many faults that are put into its sources do our programs find?

  mutants.py list   --seed 1 --count 10                      prints mutants
  mutants.py build  --seed 1 --count 200 --work FOLDER       builds a layer of each
  mutants.py kill tests --programs build/release/bin --work FOLDER
  mutants.py kill suites --work FOLDER                       not only the first that kills a mutant, but each suite
  mutants.py kill check-quick --vellum build/release/bin/vellum --work FOLDER
  mutants.py kill check-10 --vellum build/release/bin/vellum --work FOLDER --survivors
  mutants.py kill cts --deqp deqp-vk --cases FILE --work FOLDER
  mutants.py report --work FOLDER                            prints the table and the survivors
  mutants.py matrix --work FOLDER                            prints which suites kill which mutants

With `--of programs`, of the baker, glTF, the verifier and the libraries, whose tests are linked with them.

Commands can be stopped and called again. A killer is run against the original first, which must survive.
"""
import argparse
import concurrent.futures
import pathlib
import sys

import builder
import killers
import report
import selection
from results import Results

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def changed_lines(mutant, source):
    at = mutant.line - 1
    return source.splitlines()[at].strip(), mutant.apply(source).splitlines()[at].strip()


def chosen(options):
    mutants = selection.all_mutants(ROOT, options.of)
    if options.id:
        return [mutant for mutant in mutants if mutant.id in options.id]
    return selection.choose(mutants, options.seed, options.count)


def list_mutants(options):
    for mutant in chosen(options):
        before, after = changed_lines(mutant, (ROOT / mutant.file).read_text(encoding="utf-8"))
        print(f"{mutant.id}\n    - {before}\n    + {after}")


def build(options):
    results = Results(options.work / "results.jsonl")
    missing = [mutant for mutant in chosen(options) if not results.find(mutant.id, "build")]
    if not missing:
        return
    maker = builder.Builder(ROOT, options.work, options.layers, options.jobs, options.of)
    maker.prepare()
    for mutant in missing:
        before, after = changed_lines(mutant, (ROOT / mutant.file).read_text(encoding="utf-8"))
        result, seconds = maker.make(mutant)
        results.add(mutant.id, "build", result=result, seconds=seconds, before=before, after=after)
        print(f"{result:>9} {seconds:6.1f} s  {mutant.id}", flush=True)


def steps_of(options):
    if options.killer == "suites":
        original = options.layers / builder.ORIGINAL
        steps = (killers.program_steps(builder.PROGRAMS) if options.of == "programs"
                 else killers.read_steps(options.list, options.programs.resolve()))
        return [suite for step in steps for suite in killers.suites_of(step, original)]
    if options.killer == "tests":
        return killers.read_steps(options.list, options.programs.resolve())
    if options.killer == "cts":
        return killers.cts_steps(ROOT, options.deqp.resolve(), options.cases.resolve(), options.limit or 1800)
    arguments = ["--quick"] if options.killer == "check-quick" else ["--minutes", "10"]
    arguments += ["--seed", str(options.seed), "--jobs", "1", "--fail-fast", *options.argument]
    return killers.check_steps(options.vellum.resolve(), arguments,
                               options.limit or (600 if options.killer == "check-quick" else 1200))


def wanted(options, results):
    """Mutants that were built and that the killer has not been run against."""
    names = report.survivors(results) if options.survivors else results.of_stage("build")
    return [name for name in names
            if results.find(name, "build")["result"] == "built" and not results.find(name, options.killer)]


def kill(options):
    results = Results(options.work / "results.jsonl")
    names = wanted(options, results)
    if not names:
        return
    steps = steps_of(options)
    original = killers.kill_mutant(steps, options.layers, builder.ORIGINAL, options.killer)
    print(f"original: {original}", flush=True)
    if original["result"] != killers.SURVIVED:
        sys.exit("the original layer does not survive; see its log")

    def one(name):
        return results.add(name, options.killer,
                           **killers.kill_mutant(steps, options.layers, name, options.killer))

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for record in pool.map(one, names):
            print(f"{record['result']:>9} {record['seconds']:6.1f} s  {record['id']}"
                  f"  {record.get('by', '')} {record.get('how', '')}", flush=True)


def print_matrix(options):
    print("\n".join(report.matrix(Results(options.work / "results.jsonl"))))


def print_report(options):
    results = Results(options.work / "results.jsonl")
    print("\n".join(report.report(results, report.read_equivalent(options.equivalent))))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)

    def add(name, function, choice=False, work=True):
        command = commands.add_parser(name)
        command.set_defaults(function=function)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--of", choices=list(builder.TARGETS), default="layer")
        if choice:
            command.add_argument("--count", type=int, default=10)
            command.add_argument("--id", action="append", help="this mutant; may be repeated")
        if work:
            command.add_argument("--work", type=pathlib.Path, required=True,
                                 help="folder for sources, build and results.jsonl")
            command.add_argument("--layers", type=pathlib.Path, help="folder for the mutants (default: WORK/layers)")
            command.add_argument("--jobs", type=int, default=2)
        return command

    add("list", list_mutants, choice=True, work=False)
    add("build", build, choice=True)
    killing = add("kill", kill)
    killing.add_argument("killer", choices=["tests", "suites", "check-quick", "check-10", "cts"])
    killing.add_argument("--survivors", action="store_true", help="only mutants that all killers so far let live")
    killing.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    killing.add_argument("--list", type=pathlib.Path, default=HERE / "tests.txt", help="what the killer tests runs")
    killing.add_argument("--vellum", type=pathlib.Path, default=ROOT / "build/release/bin/vellum")
    killing.add_argument("--argument", action="append", default=[], help="for vellum check; may be repeated")
    killing.add_argument("--deqp", type=pathlib.Path)
    killing.add_argument("--cases", type=pathlib.Path)
    killing.add_argument("--limit", type=float, help="seconds after which vellum check or deqp-vk counts as hanging")
    add("matrix", print_matrix)
    reporting = add("report", print_report)
    reporting.add_argument("--equivalent", type=pathlib.Path, default=HERE / "equivalent.txt")
    options = parser.parse_args()
    if "work" in options:
        options.work = options.work.resolve()
        options.layers = (options.layers or options.work / "layers").resolve()
        options.work.mkdir(parents=True, exist_ok=True)
    if "killer" in options and options.killer == "cts" and not (options.deqp and options.cases):
        parser.error("cts needs --deqp and --cases")
    return options


def main():
    options = arguments()
    options.function(options)


if __name__ == "__main__":
    main()
