#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Records the processor time of tests, and prints it.

usage: cpu_times.py test NAME COMMAND...    runs a test's command and records what it and its processes used
       cpu_times.py ctest ARGUMENTS...      runs ctest; before its closing lines, prints the tests that used most

Times are lines in the file that the variable VELLUM_TEST_CPU_TIMES names: seconds and a name. Without the variable, `test` records
nothing, and `ctest` uses a temporary file. Other programs may add lines before `ctest` is run, as scripts/phase does.
"""
import os
import pathlib
import re
import resource
import signal
import subprocess
import sys
import tempfile

VARIABLE = "VELLUM_TEST_CPU_TIMES"
SHOWN = 15
CLOSING = re.compile(r"\d+% tests passed, \d+ tests failed out of \d+$")


def used():
    """Processor seconds of this process and of all processes that it has waited for."""
    return sum(usage.ru_utime + usage.ru_stime for usage in map(
        resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def record(name):
    """Adds what this process used, under a name."""
    if path := os.environ.get(VARIABLE):
        with open(path, "a", encoding="utf-8") as file:
            file.write(f"{used():.2f} {name}\n")


def run_test(name, command):
    """Ends as the command does."""
    if VARIABLE not in os.environ:
        os.execvp(command[0], command)
    status = subprocess.run(command, check=False).returncode
    record(name)
    if status < 0:
        signal.signal(-status, signal.SIG_DFL) if -status != signal.SIGKILL else None
        os.kill(os.getpid(), -status)
    return status


def table(text):
    """The names that used most, those with equal names together, and all together."""
    seconds = {}
    for line in text.splitlines():
        number, name = line.split(maxsplit=1)
        seconds[name] = seconds.get(name, 0) + float(number)
    most = sorted(seconds, key=seconds.get, reverse=True)
    rows = [(seconds[name], name) for name in most[:SHOWN]]
    if most[SHOWN:]:
        rows.append((sum(seconds[name] for name in most[SHOWN:]), f"{len(most) - SHOWN} others"))
    rows.append((sum(seconds.values()), "in all"))
    return "CPU seconds:\n" + "".join(f"{number:8.1f}  {name}\n" for number, name in rows)


def run_ctest(arguments, path):
    # ctest gets an interrupt as well, and ends by itself.
    signal.signal(signal.SIGINT, lambda *_: None)
    printed = False

    def show():
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        sys.stdout.write("\n" + table(text) + "\n")

    with subprocess.Popen(["ctest", *arguments], stdout=subprocess.PIPE, env=os.environ | {VARIABLE: str(path)}) as child:
        for line in child.stdout:
            line = line.decode(errors="replace")
            if not printed and CLOSING.match(line):
                show()
                printed = True
            sys.stdout.write(line)
            sys.stdout.flush()
    if not printed:
        show()
    return child.returncode if child.returncode >= 0 else 128 - child.returncode


def main():
    what, *words = sys.argv[1:]
    if what == "test":
        return run_test(words[0], words[1:])
    with tempfile.TemporaryDirectory() as folder:
        return run_ctest(words, pathlib.Path(os.environ.get(VARIABLE, pathlib.Path(folder) / "cpu_times")))


if __name__ == "__main__":
    sys.exit(main())
