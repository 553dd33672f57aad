#!/usr/bin/env python3
"""Checks that the manual page and the completions have every subcommand and every option that --help tells of.

Where mandoc is installed, it must find nothing to complain of in the page; each shell that is installed must accept its
completion, and bash is asked for some.

usage: check_reference.py VELLUM FOLDER
"""
import pathlib
import re
import shutil
import subprocess
import sys

vellum, folder = sys.argv[1], pathlib.Path(sys.argv[2])
FILES = {name: (folder / name).read_text(encoding="utf-8")
         for name in ("vellum.1", "vellum.bash", "_vellum", "vellum.fish")}
complaints = []


def expect(condition, complaint):
    if not condition:
        complaints.append(complaint)


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


def help_of(*words):
    code, text = run(vellum, *words, "--help")
    expect(code == 0, f"vellum {' '.join(words)} --help: exit code {code}")
    return text


def options_in(text):
    """The long options of a --help, from the lines that declare them."""
    return {name for line in text.splitlines() if (match := re.match(r"  (?:-\w,)?(--[a-z][a-z0-9-]*)", line))
            for name in [match[1]]}


def page_section(command):
    """The part of the manual page on a subcommand."""
    return FILES["vellum.1"].split(f".SH VELLUM {command.upper()}\n")[1].split("\n.SH ")[0].replace("\\-", "-")


def fish_lines(command):
    return [line for line in FILES["vellum.fish"].splitlines() if f'"__fish_seen_subcommand_from {command}"' in line]


def bash_answers(*words):
    script = f'. "{folder}/vellum.bash"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _vellum; echo "${{COMPREPLY[@]}}"'
    return set(run("bash", "-c", script, "bash", *words)[1].split())


overview = help_of()
commands = re.findall(r"^  ([a-z]+) {2,}", overview.split("Subcommands:")[1], re.MULTILINE)
expect({"bake", "info", "render"} <= set(commands), f"--help lists only {commands}")
if shutil.which("bash"):
    expect(bash_answers("vellum", "") == set(commands), f"bash completes {bash_answers('vellum', '')}")
for command in commands:
    text = help_of(command)
    expect(f"vellum {command}" in text.split("Examples:")[-1] and "Examples:" in text, f"{command} --help: no examples")
    options = options_in(text)
    expect("--help" in options, f"{command} --help lists only {options}")
    zsh = FILES["_vellum"].split(f"\n    {command})\n")[1].split("        ;;\n")[0]
    for option in options:
        expect(f"\\fB{option}\\fR".replace("-", "\\-") in FILES["vellum.1"] and option in page_section(command),
               f"the page says nothing of {command} {option}")
        expect(f"'{option}" in zsh, f"zsh: {command} {option}")
        expect(any(f"-l {option[2:]} " in line for line in fish_lines(command)), f"fish: {command} {option}")
    if shutil.which("bash"):
        found = bash_answers("vellum", command, "--")
        expect(found == options, f"bash completes {command} {found ^ options} otherwise than --help has it")
if shutil.which("bash"):
    expect(bash_answers("vellum", "render", "--mode", "h") == {"heat"}, "bash: render --mode h")
for shell, name in (("bash", "vellum.bash"), ("zsh", "_vellum"), ("fish", "vellum.fish")):
    if shutil.which(shell):
        code, text = run(shell, "-n", str(folder / name))
        expect(code == 0, f"{shell} -n {name}: {text}")
if shutil.which("mandoc"):
    code, text = run("mandoc", "-T", "lint", "-W", "warning", str(folder / "vellum.1"))
    expect(code == 0, text)
print(*complaints, sep="\n")
sys.exit(1 if complaints else 0)
