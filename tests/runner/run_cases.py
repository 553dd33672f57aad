#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the cases of a GoogleTest program in as few processes as they need: one, unless something goes wrong.

A case that crashes the program, or that takes longer than --timeout seconds, has failed; the cases after it run in a
new process. If the program fails although all its cases pass (a sanitizer found a leak, say), each case runs once more in
a process of its own, to find out which ones it is. The output of each case that fails is printed, then what each
failure was and how to run that case alone. The exit status is 0 if nothing failed and 77 if all cases were skipped.
With --ctest it prints the tests of the program for CTest instead of running them: one for each test suite.

Cases may have labels (tests/layer/harness/program/labels.h), which a program prints with --labels: a pattern of cases and its
labels on each line. --with and --without choose cases by them; the labels "slow" and "threads" are those of --slow and --threads.

usage: run_cases.py [options] PROGRAM [--gtest_filter=...]
"""
import argparse
import collections
import fnmatch
import os
import re
import resource
import selectors
import signal
import subprocess
import sys
import time

sys.dont_write_bytecode = True
import cpu_times  # noqa: E402

ALL_SKIPPED = 77
RUN = re.compile(r"^\[ RUN      \] (\S+)$")
# A case may have written to the same line before.
END = re.compile(r"\[(       OK |  FAILED  |  SKIPPED )\] ([^\s,]+)(?:, where .*)? \(\d+ ms\)$")
STATUS = {"       OK ": "passed", "  FAILED  ": "failed", "  SKIPPED ": "skipped"}


class Process:
    """One run of the program. results: the cases that ended, in order, each with its status and output."""

    def __init__(self, command, cases, timeout):
        self.results = collections.OrderedDict()
        self.current = None   # the case that was running when the program ended
        self.outside = []     # what it printed between cases and after the last one
        self.hung = False
        self.lines = []
        self.deadline = time.monotonic() + timeout
        # A session of its own, so that what the case started ends with it.
        self.child = subprocess.Popen(command + ["--gtest_color=no", "--gtest_filter=" + ":".join(cases)],
                                      stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                      start_new_session=True)
        Process.running = self.child
        self.read(timeout)
        self.kill()
        self.status = self.child.wait()
        Process.running = None

    running = None

    def kill(self):
        """Ends whatever is left of the session."""
        try:
            os.killpg(self.child.pid, signal.SIGKILL if self.hung else signal.SIGTERM)
        except (ProcessLookupError, PermissionError):
            pass

    def read(self, timeout):
        selector = selectors.DefaultSelector()
        selector.register(self.child.stdout, selectors.EVENT_READ)
        pending = b""
        while True:
            if not selector.select(max(0.0, self.deadline - time.monotonic())):
                self.hung = True
                break
            data = os.read(self.child.stdout.fileno(), 65536)
            if not data:
                break
            *lines, pending = (pending + data).split(b"\n")
            for line in lines:
                if self.line(line.decode(errors="replace")):
                    self.deadline = time.monotonic() + timeout
        if pending:
            self.line(pending.decode(errors="replace"))

    def line(self, line):
        """Whether a case begins or ends with it."""
        if match := RUN.match(line):
            self.current, self.lines = match[1], []
            return True
        elif self.current is None:
            self.outside.append(line)
        elif (match := END.search(line)) and match[2] == self.current:
            if before := line[:match.start()]:
                self.lines.append(before)
            self.results[self.current] = (STATUS[match[1]], "\n".join(self.lines))
            self.current, self.lines = None, []
            return True
        else:
            self.lines.append(line)
        return False

    def ending(self, timeout):
        if self.hung:
            return f"not done after {timeout:g} s, killed"
        if self.status < 0:
            try:
                return f"crashed: {signal.Signals(-self.status).name}"
            except ValueError:
                return f"crashed: signal {-self.status}"
        return f"the program ended with status {self.status}"


class Run:
    def __init__(self, options):
        self.options = options
        self.results = {}      # case: (status, what went wrong)
        self.elsewhere = []    # failures that are no case's

    def record(self, case, status, reason, output):
        self.results[case] = (status, reason)
        if status == "failed":
            self.show(f"{self.options.prefix}{case}: FAILED ({reason})", output)
        elif status == "skipped":
            print(f"{self.options.prefix}{case}: skipped", output, sep="\n", flush=True)

    @staticmethod
    def show(title, output):
        print(f"---- {title}", output, "----", sep="\n", flush=True)

    def all(self, cases):
        rest = list(cases)
        while rest:
            process = Process(self.options.program, rest, self.options.timeout)
            for case, (status, output) in process.results.items():
                self.record(case, status, "failed", output)
            ended = process.ending(self.options.timeout)
            if process.current:
                self.record(process.current, "failed", ended, "\n".join(process.lines))
            left = [case for case in rest if case not in self.results]
            if process.current is None and (left or not self.explained(process)):
                # It failed outside all cases.
                if len(left) == len(rest):
                    self.record(left[0], "failed", f"before its beginning: {ended}", "\n".join(process.outside))
                    left = left[1:]
                elif len(rest) == 1:
                    self.record(rest[0], "failed", f"at its end: {ended}", "\n".join(process.outside))
                else:
                    self.separately([case for case in rest if case not in left], process, ended)
            rest = left

    @staticmethod
    def explained(process):
        """Whether the status of a program that ran all its cases is what they say."""
        failed = any(status == "failed" for status, _ in process.results.values())
        return not process.hung and process.status == (1 if failed else 0)

    def separately(self, cases, process, ended):
        """The program failed outside its cases: runs each of them alone."""
        found = False
        for case in cases:
            alone = Process(self.options.program, [case], self.options.timeout)
            status = alone.results.get(case, ("failed", ""))[0]
            if alone.current is None and status != "failed" and self.explained(alone):
                continue
            found = True
            if self.results[case][0] != "failed":
                output = "\n".join([alone.results.get(case, ("", ""))[1], *alone.lines, *alone.outside])
                self.record(case, "failed", f"alone: {alone.ending(self.options.timeout)}", output)
        if not found:
            self.elsewhere.append(f"after {cases[-1]}: {ended}")
            self.show(f"{self.options.prefix}{self.elsewhere[-1]}", "\n".join(process.outside))

    def report(self, seconds):
        counts = collections.Counter(status for status, _ in self.results.values())
        failed = [case for case, (status, _) in self.results.items() if status == "failed"]
        for case in failed:
            print(f"FAILED: {self.options.prefix}{case} ({self.results[case][1]})")
        for failure in self.elsewhere:
            print(f"FAILED: {self.options.prefix}{failure}")
        if failed:
            variables = [f"{name}={value}" for name, value in os.environ.items()
                         if name.startswith("VELLUM_TEST_") and name != cpu_times.VARIABLE]
            print("one of them alone:", *variables, *self.options.program, f"--gtest_filter={failed[0]}")
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(f"{counts['passed']} passed, {counts['failed'] + len(self.elsewhere)} failed, {counts['skipped']} skipped,"
              f" {seconds:.1f} s, {used.ru_utime + used.ru_stime:.1f} s of CPU")
        if failed or self.elsewhere:
            return 1
        return ALL_SKIPPED if counts["skipped"] and not counts["passed"] else 0


def list_cases(program, chosen):
    """All cases that the filter takes, in order, except disabled ones."""
    command = program + ["--gtest_list_tests"] + ([f"--gtest_filter={chosen}"] if chosen else [])
    listing = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    cases, suite = [], None
    for line in listing.splitlines():
        name = line.split("#")[0].rstrip()
        if name.startswith("  ") and suite:
            if not name.strip().startswith("DISABLED_") and not suite.split("/")[-1].startswith("DISABLED_"):
                cases.append(suite + name.strip())
        elif name.endswith("."):
            suite = name
    return cases


class Labels:
    """The labels of a program's cases."""

    def __init__(self, program, cases):
        self.of = {case: set() for case in cases}
        listing = subprocess.run(program + ["--labels"], stdout=subprocess.PIPE, check=True, text=True).stdout
        for line in listing.splitlines():
            pattern, *labels = line.split()
            named = [case for case in cases if fnmatch.fnmatchcase(case, pattern)]
            if not named:
                sys.exit(f"{program[-1]}: no case is called {pattern}, which has labels")
            for case in named:
                self.of[case].update(labels)

    def has(self, case, labels):
        return not self.of[case].isdisjoint(labels)

    def choose(self, cases, wanted, unwanted):
        unknown = set(wanted + unwanted) - set().union(*self.of.values())
        if unknown:
            sys.exit(f"no case has the label {', '.join(sorted(unknown))}")
        return [case for case in cases
                if (not wanted or self.has(case, wanted)) and not self.has(case, unwanted)]


def by_suite(cases):
    suites = collections.OrderedDict()
    for case in cases:
        suites.setdefault(case.split(".")[0], []).append(case)
    return suites


def quoted(text):
    return "[==[" + text + "]==]"


def matches(suite, patterns):
    return any(fnmatch.fnmatchcase(suite, pattern) for pattern in patterns)


def print_for_ctest(options, cases, labels):
    """In CTest's own language. What costs most begins first, so that several jobs end together."""
    suites, whole = by_suite(cases), by_suite(list_cases(options.program, ""))
    for suite, members in suites.items():
        name = options.prefix + suite
        cost = options.cost * len(members)
        command = [sys.executable, os.path.abspath(__file__), f"--timeout={options.timeout:g}",
                   f"--prefix={options.prefix}", *(f"--emulator={word}" for word in options.emulator), options.program[-1],
                   "--gtest_filter=" + (f"{suite}.*" if members == whole[suite] else ":".join(members))]
        print(f"add_test({quoted(name)} {' '.join(map(quoted, command))})")
        slow = (matches(suite, options.slow)
                or labels is not None and any(labels.has(case, ["slow"]) for case in members))
        ctest_labels = [] if slow else ["quick"]
        threads = (matches(suite, options.threads)
                   or labels is not None and any(labels.has(case, ["threads"]) for case in members))
        ctest_labels += ["threads"] if threads else []
        properties = ["SKIP_RETURN_CODE", str(ALL_SKIPPED), "COST", f"{cost:g}",
                      "TIMEOUT", f"{options.timeout * (len(members) + 1):g}"]
        if ctest_labels:
            properties += ["LABELS", ";".join(ctest_labels)]
        if options.environment:
            properties += ["ENVIRONMENT", ";".join(options.environment)]
        print(f"set_tests_properties({quoted(name)} PROPERTIES {' '.join(map(quoted, properties))})")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--timeout", type=float, default=300, help="seconds that a case may take")
    parser.add_argument("--prefix", default="", help="of the names that are printed")
    parser.add_argument("--ctest", action="store_true", help="print the tests for CTest")
    parser.add_argument("--environment", action="append", default=[], help="with --ctest: NAME=VALUE")
    parser.add_argument("--slow", action="append", default=[], help="with --ctest: suites without the label quick")
    parser.add_argument("--threads", action="append", default=[], help="with --ctest: suites with the label threads")
    parser.add_argument("--cost", type=float, default=0.2, help="with --ctest: seconds that a case takes, about")
    parser.add_argument("--labelled", action="store_true", help="the program prints labels")
    parser.add_argument("--with", dest="wanted", action="append", default=[], metavar="LABEL",
                        help="only cases with this label, or with one of these")
    parser.add_argument("--without", dest="unwanted", action="append", default=[], metavar="LABEL",
                        help="no cases with this label")
    parser.add_argument("--emulator", action="append", default=[], metavar="WORD",
                        help="of a command that runs the program, which is for another platform")
    parser.add_argument("program")
    parser.add_argument("--gtest_filter", dest="filter", default="")
    options = parser.parse_args()
    options.program = [*options.emulator, options.program]

    cases = list_cases(options.program, options.filter)
    labels = None
    if options.labelled or options.wanted or options.unwanted:
        labels = Labels(options.program, list_cases(options.program, ""))
        cases = labels.choose(cases, options.wanted, options.unwanted)
    if options.ctest:
        print_for_ctest(options, cases, labels)
        return 0
    if not cases:
        sys.exit(f"{options.program[-1]}: no case matches {options.filter!r}")

    name = options.prefix + cases[0].split(".")[0]

    def stop(number, _):
        if Process.running:
            os.killpg(Process.running.pid, signal.SIGKILL)
            Process.running.wait()
        cpu_times.record(name)
        sys.exit(128 + number)

    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
    begin = time.monotonic()
    run = Run(options)
    run.all(cases)
    cpu_times.record(name)
    return run.report(time.monotonic() - begin)


if __name__ == "__main__":
    sys.exit(main())
