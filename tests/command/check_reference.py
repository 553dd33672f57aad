#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that the manual pages and the completions have every subcommand and every option of --help.

If mandoc is installed, it must accept the pages; each shell that is installed must accept its completion, and bash is queried
for some.

usage: check_reference.py VELLUM FOLDER
"""
import pathlib
import re
import shutil
import subprocess
import sys

vellum, folder = sys.argv[1], pathlib.Path(sys.argv[2])
FILES = {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}
findings = []


def expect(condition, finding):
    if not condition:
        findings.append(finding)


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


def help_of(*words):
    code, text = run(vellum, *words, "--help")
    expect(code == 0, f"vellum {' '.join(words)} --help: exit code {code}")
    return text


def options_in(text):
    """The long options of a --help, from the lines that declare them."""
    lines = [match[1] for line in text.splitlines() if (match := re.match(r"  (?:-\w, |    )(--[a-z].*?)(?:  |$)", line))]
    return {option for line in lines for option in re.findall(r"--[a-z][a-z0-9-]*", line)}


def fish_lines(command):
    return [line for line in FILES["vellum.fish"].splitlines() if f'"__fish_seen_subcommand_from {command}"' in line]


def bash_answers(*words):
    script = f'. "{folder}/vellum.bash"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _vellum; echo "${{COMPREPLY[@]}}"'
    return set(run("bash", "-c", script, "bash", *words)[1].split())


overview = help_of()
commands = re.findall(r"^  ([a-z]+) {2,}", overview.split("Subcommands:")[1].split("\n\n")[0], re.MULTILINE)
expect({"bake", "check", "help", "info", "inspect", "render", "run", "spirv", "sweep", "verify"} <= set(commands),
       f"--help lists only {commands}")
SECTIONS = ("NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "FILES", "SEE ALSO")
for section in SECTIONS:
    expect(f".SH {section}\n" in FILES["vellum.1"], f"vellum.1: no {section}")
if shutil.which("bash"):
    expect(bash_answers("vellum", "") == set(commands), f"bash completes {bash_answers('vellum', '')}")
for command in commands:
    text = help_of(command)
    expect(f"vellum {command}" in text.split("Examples:")[-1] and "Examples:" in text, f"{command} --help: no examples")
    options = options_in(text)
    expect("--help" in options, f"{command} --help lists only {options}")
    zsh = FILES["_vellum"].split(f"\n    {command})\n")[1].split("        ;;\n")[0]
    expect(f"\\fBvellum {command}\\fR" in FILES["vellum.1"], f"vellum.1 has no synopsis of {command}")
    page = FILES["vellum.1"] if command == "help" else FILES[f"vellum-{command}.1"]
    if command != "help":
        for section in (*SECTIONS, "EXAMPLES"):
            expect(f".SH {section}\n" in page, f"vellum-{command}.1: no {section}")
        usage = re.search(r"Usage: (.*)", text)[1]
        expect(usage.removeprefix(f"vellum {command}").replace("-", "\\-") in page, f"vellum-{command}.1: no {usage}")
    for option in options:
        expect(f"\\fB{option}\\fR".replace("-", "\\-") in page, f"the page says nothing of {command} {option}")
        expect(f"'{option}" in zsh, f"zsh: {command} {option}")
        expect(any(f"-l {option[2:]} " in line for line in fish_lines(command)), f"fish: {command} {option}")
    if shutil.which("bash"):
        found = bash_answers("vellum", command, "--")
        expect(found == options, f"bash completes {command} {found ^ options} otherwise than --help has it")
if shutil.which("bash"):
    for words, answer in ((("render", "--mode", "h"), {"heat"}), (("bake", "--two-state-rule", "o"), {"opaque"}),
                          (("bake", "--states", ""), {"2", "4"}), (("help", "ba"), {"bake"})):
        expect(bash_answers("vellum", *words) == answer, f"bash: {words}: {bash_answers('vellum', *words)}")
for shell, name in (("bash", "vellum.bash"), ("zsh", "_vellum"), ("fish", "vellum.fish")):
    if shutil.which(shell):
        code, text = run(shell, "-n", str(folder / name))
        expect(code == 0, f"{shell} -n {name}: {text}")
layer = FILES["VK_LAYER_VELLUM_opacity_micromap.7"]
for variable in ("VELLUM_REPORT", "VELLUM_VALIDATE", "VELLUM_CACHE_FOLDER"):
    expect(f"\\fB{variable}\\fR=" in layer, f"the layer's page says nothing of {variable}")
if shutil.which("mandoc"):
    for name in (name for name in FILES if name.endswith((".1", ".7"))):
        code, text = run("mandoc", "-T", "lint", "-W", "warning", str(folder / name))
        expect(code == 0, text)
print(*findings, sep="\n")
sys.exit(1 if findings else 0)
