# SPDX-License-Identifier: Apache-2.0
"""Killers: programs that are run with a mutant as the layer. One that fails, crashes or hangs kills it."""
import dataclasses
import os
import pathlib
import resource
import signal
import subprocess
import tempfile
import time

from builder import folder_name

MEMORY = 12 << 30  # bytes of address space of a program
NO_LIMIT = 1 << 30       # seconds
SURVIVED = "survived"


@dataclasses.dataclass(frozen=True)
class Step:
    """One program of a killer. {layer} in a word stands for the mutant's folder, {out} for a temporary one."""
    name: str
    words: tuple
    environment: tuple = ()
    seconds: float = 900     # after which it counts as hanging
    cpu_seconds: int = 60    # the same, of all threads together


def read_steps(path, programs):
    """The steps of a list of tests: program, GoogleTest filter, variables."""
    steps = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.strip() and not line.startswith("#"):
            program, tests, *variables = line.split()
            words = (str(programs / program), f"--gtest_filter={tests}", "--gtest_brief=1", "--gtest_fail_fast")
            steps.append(Step(" ".join([program, tests, *variables]), words,
                              tuple(variable.split("=", 1) for variable in variables)))
    return steps


def environment(folder):
    """With the variable by which the tests find the layer, and without the one that hides --layer-path."""
    variables = {name: value for name, value in os.environ.items() if name != "VK_LAYER_PATH"}
    for manifest in sorted(pathlib.Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json")):
        variables.setdefault("VK_DRIVER_FILES", str(manifest))
        variables.setdefault("VK_ICD_FILENAMES", str(manifest))
    return variables | {"VELLUM_TEST_LAYER": str(folder)}


def run_step(step, folder, log):
    """How it ended: None if the program found nothing; and its seconds."""
    def begin_child():
        os.setpgid(0, 0)  # a session would leave this one's autogroup, and its priority
        resource.setrlimit(resource.RLIMIT_CPU, (step.cpu_seconds, step.cpu_seconds + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as out:
        words = [word.replace("{layer}", str(folder)).replace("{out}", out) for word in step.words]
        variables = {name: value.replace("{layer}", str(folder)) for name, value in step.environment}
        with subprocess.Popen(words, env=environment(folder) | variables, stdin=subprocess.DEVNULL,
                              stdout=log, stderr=subprocess.STDOUT, preexec_fn=begin_child) as child:
            try:
                child.wait(step.seconds)
            except subprocess.TimeoutExpired:
                pass
            hung = child.returncode is None or child.returncode == -signal.SIGXCPU
            try:
                os.killpg(child.pid, signal.SIGKILL)  # whatever it left behind
            except ProcessLookupError:
                pass
            child.wait()
    seconds = time.monotonic() - begin
    if hung:
        return "hang", seconds
    if child.returncode < 0:
        return signal.Signals(-child.returncode).name, seconds
    return f"exit {child.returncode}" if child.returncode else None, seconds


def kill(steps, folder, log_path):
    """Runs steps until one kills the layer in a folder. Returns what a result holds."""
    begin = time.monotonic()
    with open(log_path, "wb") as log:
        for step in steps:
            how, _ = run_step(step, folder, log)
            if how:
                return {"result": "killed", "by": step.name, "how": how, "seconds": round(time.monotonic() - begin, 1)}
    return {"result": SURVIVED, "seconds": round(time.monotonic() - begin, 1)}


def kill_by_all(steps, folder, log_path):
    """Runs all steps. Returns what a result holds, with every step that kills the mutant."""
    begin = time.monotonic()
    with open(log_path, "wb") as log:
        ends = {step.name: run_step(step, folder, log)[0] for step in steps}
    killers = {name: how for name, how in ends.items() if how}
    return {"result": "killed" if killers else SURVIVED, "all": killers, "seconds": round(time.monotonic() - begin, 1)}


def kill_mutant(steps, layers, name, stage):
    folder = (layers / folder_name(name)).resolve()
    if not folder.is_dir():
        raise SystemExit(f"{folder} holds no mutant")
    return (kill_by_all if stage == "suites" else kill)(steps, folder, folder / f"{stage}.log")


def suites_of(step, folder):
    """A step for each suite of a step."""
    listing = subprocess.run([step.words[0].replace("{layer}", str(folder)), "--gtest_list_tests", step.words[1]],
                             check=True, stdout=subprocess.PIPE, text=True).stdout
    cases, suite = {}, None
    for line in listing.splitlines():
        name = line.split("#")[0].rstrip()
        if not name.startswith(" "):
            suite = name
        elif not name.strip().startswith("DISABLED_"):
            cases.setdefault(suite, []).append(suite + name.strip())
    program = pathlib.PurePath(step.words[0]).name
    variables = [f"{name}={value}" for name, value in step.environment]
    return [dataclasses.replace(step, name=" ".join([program, suite.rstrip("."), *variables]),
                                words=(step.words[0], f"--gtest_filter={':'.join(members)}", *step.words[2:]))
            for suite, members in cases.items()]


def program_steps(names):
    """All cases of the programs that a mutant consists of."""
    return [Step(name, (f"{{layer}}/{name}", "--gtest_filter=*", "--gtest_brief=1", "--gtest_fail_fast"),
                 (("LD_LIBRARY_PATH", "{layer}"),)) for name in names]


def check_steps(program, arguments, seconds):
    """`vellum check` finds something (1), or cannot run (125), which the original layer does not cause."""
    words = (str(program), "check", "--layer-path", "{layer}", "--output", "{out}/results", *arguments)
    return [Step("check", words, (), seconds, NO_LIMIT)]


def cts_steps(root, deqp, cases, seconds):
    words = (str(root / "scripts/run-cts"), "--deqp", str(deqp), "--cases", str(cases), "--layer-path", "{layer}",
             "--out", "{out}", "--jobs", "1", "--timeout", "20")
    return [Step("cts", words, (), seconds, NO_LIMIT)]
