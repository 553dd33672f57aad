#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests scripts/test-matrix in a checkout whose other scripts, and programs by others, are stand-ins. usage: test_matrix_test.py"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

TEST_MATRIX = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "test-matrix"
# scripts/test with arguments for ctest: it lists the tests, or runs those of -I by their positions and writes them into a file.
CTEST = f"#!{sys.executable}" + '''
import sys, time
results = {"unit.A": "   Passed", "unit.B": "***Skipped", "unit.C": "   Passed"}
RESULTS
if "-N" in sys.argv:
    print("".join(f"  Test #{number + 7}: {name}\\n" for number, name in enumerate(results)))
    sys.exit()
chosen = [int(number) - 1 for number in sys.argv[sys.argv.index("-I") + 1].split(",")[3:]]
with open("build/ran", "a", encoding="utf-8") as ran:
    print([list(results)[number] for number in chosen], file=ran)
for number in chosen:
    name, result = list(results.items())[number]
    if result == "hangs":
        time.sleep(1000)
    print(f" {number + 1}/3 Test #{number + 7}: {name} .....{result}    0.1 sec", flush=True)
sys.exit(8 if any("Failed" in result or "Exception" in result for result in results.values()) else 0)
'''
# vkd3d-proton's tests: `values` are what the checks of two tests meet, which differ if a variable is set.
VKD3D = f"#!{sys.executable}" + '''
import os, pathlib, sys
BEGIN
if os.environ["VKD3D_TEST_FILTER"] != "raytracing":
    print("d3d12: 0 tests executed (0 failures, 0 skipped).")
    sys.exit()
done = os.environ["VKD3D_TEST_EXCLUDE"].split(",")
for test in ("test_raytracing_crash", "test_raytracing"):
    if test not in done:
        print(f"d3d12: ======== {test} begin ========", flush=True)
        if test == "test_raytracing_crash":
            os.abort()
print("test_raytracing:12: Test failed: Got", VALUE)
print("d3d12: 7 tests executed (1 failures, 0 skipped).")
if "forcing" in os.environ.get("VK_INSTANCE_LAYERS", ""):
    print("forcing: 1 devices, GEOMETRIES geometries, 1 ray tracing pipelines, 0 shader modules")
sys.exit(1)
'''


class TestMatrix(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.checkout = self.folder / "checkout"
        (self.checkout / "bench/results").mkdir(parents=True)
        self.ctest("")
        self.script("scripts/build", "true")
        shutil.copy(TEST_MATRIX, self.checkout / "scripts")
        self.git("init", "-q")
        self.commit()

    def git(self, *words):
        return subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=self.checkout, check=True,
                              stdout=subprocess.PIPE, text=True).stdout.strip()

    def commit(self):
        (self.checkout / ".gitignore").write_text("/build/\n", encoding="utf-8")
        self.git("add", "-A")
        self.git("commit", "-qm", "a")

    def script(self, name, text):
        path = self.checkout / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text if text.startswith("#!") else f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)
        return path

    def ctest(self, results):
        self.script("scripts/test", CTEST.replace("RESULTS", results))

    def ran(self):
        lines = (self.checkout / "build/ran").read_text(encoding="utf-8").splitlines()
        (self.checkout / "build/ran").unlink()
        return lines

    def matrix(self, *words):
        return subprocess.run([sys.executable, self.checkout / "scripts/test-matrix", *words], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, timeout=120, check=False)

    def row(self, part):
        lines = (self.checkout / "bench/results/matrix.md").read_text(encoding="utf-8").splitlines()
        found = [line for line in lines if line.startswith(f"| `{part}` |")]
        self.assertEqual(len(found), 1)
        return [cell.strip() for cell in found[0].strip("|").split("|")]

    def test_row(self):
        run = self.matrix("debug")
        self.assertEqual(run.returncode, 0, run.stdout)
        _, _, result, commit, _, minutes = self.row("debug")
        self.assertEqual(result, "2 of 3 tests passed, 1 skipped")
        self.assertEqual(commit, self.git("rev-parse", "--short", "HEAD"))
        self.assertEqual(minutes, "0")
        self.assertRegex(self.matrix("--list").stdout, "(?m)^debug +2 of 3 tests passed.*\n^asan +never run")

    def test_parts_without_a_result_of_this_commit_run(self):
        others = [line.split()[0] for line in self.matrix("--list").stdout.splitlines()]
        for part in set(others) - {"debug", "asan"}:  # as if each had run
            self.add_row(part)
        self.matrix("debug")
        self.commit()  # of the results alone
        run = self.matrix().stdout
        self.assertNotIn("== debug", run)
        self.assertIn("== asan", run)
        self.assertEqual(self.matrix().stdout, "")
        self.script("source", "")
        self.matrix("debug")
        self.assertRegex(self.row("debug")[3], "^[0-9a-f]+ with changes$")
        self.commit()
        self.assertIn("== debug", self.matrix("debug").stdout)

    def add_row(self, part):
        commit = self.git("rev-parse", "--short", "HEAD")
        path = self.checkout / "bench/results/matrix.md"
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        path.write_text(f"{text}| `{part}` | a | b | {commit} | 2026-01-01 | 1 |\n", encoding="utf-8")

    def test_failures_and_nothing(self):
        for results, result in (
                ('results.update({"unit.A": "***Failed  ", "unit.B": "***Exception: SegFault  "})',
                 "**failed**: 1 of 3 tests passed, 0 skipped; failed: unit.A, unit.B"),
                ('if "-I" in sys.argv: sys.exit(1)', "**failed**: 0 of 3 tests passed, 0 skipped, 3 not run; failed: exit status 1"),
                ('results = {"unit.B": "***Skipped"}', "**failed**: 0 of 1 tests passed, 1 skipped: nothing was tested"),
                ("sys.exit(1)", "**failed**: no test ran, exit status 1")):
            self.ctest(results)
            self.assertEqual(self.matrix("debug").returncode, 1)
            self.assertEqual(self.row("debug")[2], result)

    def test_goes_on_after_an_interruption(self):
        self.ctest('import os\nif not os.path.exists("build/fast"): results["unit.C"] = "hangs"')
        self.commit()
        self.assertEqual(self.matrix("debug", "--minutes", "0.05").returncode, 0)
        self.assertEqual(self.row("debug")[2], "1 of 3 tests passed, 1 skipped, 1 not run")
        self.script("build/fast", "")
        run = self.matrix("--minutes", "0.5").stdout  # without a name: it is not done
        self.assertIn("== debug goes on", run)
        self.assertEqual(self.row("debug")[2], "2 of 3 tests passed, 1 skipped")
        self.assertEqual(self.ran()[:2], ["['unit.A', 'unit.B', 'unit.C']", "['unit.C']"])
        self.assertNotIn("== debug", self.matrix("--minutes", "0.5").stdout)
        self.assertNotIn("goes on", self.matrix("debug").stdout)  # all of it, since it is done
        self.script("source", "")
        self.commit()
        self.assertNotIn("goes on", self.matrix("debug").stdout)

    def test_failures_run_again(self):
        self.ctest('import os\nif not os.path.exists("build/fast"): results["unit.C"] = "***Failed  "')
        self.commit()
        self.assertEqual(self.matrix("debug").returncode, 1)
        self.script("build/fast", "")
        self.assertEqual(self.matrix("debug").returncode, 0)
        self.assertEqual(self.row("debug")[2], "2 of 3 tests passed, 1 skipped; passed when they ran again: unit.C")
        self.assertEqual(self.ran(), ["['unit.A', 'unit.B', 'unit.C']", "['unit.C']"])

    def test_windows_goes_on_by_program(self):
        self.script("scripts/test-windows", """test "$1" = --list && { echo a; echo b; exit; }
echo "$1" >>build/ran
test "$1" = b && test ! -e build/fast && sleep 100
echo "== 3 run, 2 passed, 1 skipped, 0 excluded; programs that failed: 0\"""")
        self.commit()
        self.matrix("windows", "--minutes", "0.05")
        self.assertEqual(self.row("windows")[2], "2 of 3 cases passed, 1 skipped, 0 excluded, 1 not run of 2 programs: b")
        self.script("build/fast", "")
        self.matrix("windows")
        self.assertEqual(self.row("windows")[2], "4 of 6 cases passed, 2 skipped, 0 excluded")
        self.assertEqual(self.ran(), ["a", "b", "b"])
        self.script("scripts/test-windows", 'test "$1" = --list && echo a && exit; echo "== 3 run, 2 passed, 0 skipped, 0 excluded; '
                    'programs that failed: 1"; exit 1')
        self.assertEqual(self.matrix("windows").returncode, 1)
        self.assertEqual(self.row("windows")[2], "**failed**: 2 of 3 cases passed, 0 skipped, 0 excluded; failed: a")

    def test_parts_that_need_a_program(self):
        run = self.matrix("vkd3d")
        self.assertEqual(run.returncode, 2)
        self.assertIn("vkd3d needs --vkd3d", run.stdout)

    def test_khronos(self):
        cases = "a,Pass,0.1\\nb,Skip,0.1\\nc,Fail,0.1\\n"
        write = 'while [ "$1" != --out ]; do shift; done; mkdir -p "$2"; printf "%s" >"$2/results.csv"; exit %d'
        for text, result in ((write % (cases, 1), "**failed**: 3 cases: 1 Pass, 1 Skip, 1 Fail; failed: exit status 1"),
                             (write % ("a,Pass,0.1\\n", 0), "1 cases: 1 Pass"),
                             (write % ("a,Skip,0.1\\n", 0), "**failed**: 1 cases: 1 Skip: nothing was tested"),
                             ("exit 2", "**failed**: no case ran, exit status 2")):
            self.script("scripts/run-cts", text)
            self.matrix("--deqp", "/bin/true", "khronos-queries")
            self.assertEqual(self.row("khronos-queries")[2], result)

    def test_khronos_stopped(self):
        self.script("scripts/run-cts", 'while [ "$1" != --out ]; do shift; done; mkdir -p "$2"; printf "a\nb\nc\n" >"$2/cases.txt"; '
                    'echo a,Pass,,0.1 >"$2/progress.csv"; sleep 100')
        self.matrix("--deqp", "/bin/true", "--minutes", "0.05", "khronos-queries")
        self.assertEqual(self.row("khronos-queries")[2], "1 cases: 1 Pass, 2 not run")

    def others(self, statuses, *words, geometries="3"):
        """Cases a and b in every configuration, where `statuses` is a command of the shell that writes their results."""
        self.script("scripts/run-cts", 'while [ "$1" != --out ]; do shift; done; mkdir -p "$2"\n'
                    f'echo "forcing: 1 devices, {geometries} geometries" >"$2/chunk.stderr"\n{statuses}')
        cases = self.checkout / "build/cases.txt"
        cases.parent.mkdir(exist_ok=True)
        cases.write_text("a\nb\n", encoding="utf-8")
        return self.matrix("--deqp", "/bin/true", "--cases", cases, "khronos-others", *words).returncode

    def test_khronos_others(self):
        self.assertEqual(self.others('printf "a,Pass,0.1\nb,Fail,0.1\n" >"$2/results.csv"; exit 1'), 0)
        self.assertIn("bare 2 cases, 1 Pass, 1 Fail; layer 2 cases, 1 Pass, 1 Fail, 0 differ from bare; ", self.row("khronos-others")[2])
        self.assertEqual(self.others('echo "a,${VELLUM_ASSUME_MICROMAPS:+F}Pass,0.1" | sed s/FPass/Fail/ >"$2/results.csv"'), 1)
        self.assertRegex(self.row("khronos-others")[2], r"assume_micromaps 1 cases, 1 Fail, 1 differ .*; failed: a \(assume_micromaps\)$")
        self.assertEqual(self.others('echo a,Skip,0.1 >"$2/results.csv"'), 1)
        self.assertRegex(self.row("khronos-others")[2], "nothing was tested$")
        self.assertEqual(self.others('echo a,Pass,0.1 >"$2/results.csv"', geometries="0"), 1)
        self.assertEqual(self.row("khronos-others")[2], "**failed**: forced EXT: nothing was tested, exit status 0")

    def test_khronos_others_stopped(self):
        self.others('echo a,Pass,,0.1 >"$2/progress.csv"\n[ -n "$VELLUM_FORCING_API" ] && sleep 100\n'
                    'printf "a,Pass,0.1\\nb,Skip,0.1\\n" >"$2/results.csv"', "--minutes", "0.05")
        self.assertRegex(self.row("khronos-others")[2], "bare 2 cases, 1 Pass, 1 Skip; .*; forced EXT 1 cases, 1 Pass, 0 differ from bare; "
                         "forced KHR 0 cases, 0 differ from bare, 3 not run$")

    def vkd3d(self, value, *words, geometries="3", begin=""):
        self.script("build/vkd3d/tests/d3d12",
                    VKD3D.replace("BEGIN", begin).replace("VALUE", value).replace("GEOMETRIES", geometries))
        return self.matrix("--vkd3d", self.checkout / "build/vkd3d", "vkd3d", *words).returncode

    def test_vkd3d_compares_values(self):
        self.assertEqual(self.vkd3d("1"), 0)
        self.assertIn("bare 7 checks, 2 failed; layer 7 checks, 2 failed, 0 differ from bare", self.row("vkd3d")[2])
        self.assertEqual(self.vkd3d('os.environ.get("VELLUM_ASSUME_MICROMAPS", "0")'), 1)
        self.assertRegex(self.row("vkd3d")[2], "assume_micromaps 7 checks, 2 failed, 2 differ from bare.*; failed: assume_micromaps$")

    def test_vkd3d_without_forced_geometries(self):
        self.assertEqual(self.vkd3d("1", geometries="0"), 1)
        self.assertEqual(self.row("vkd3d")[2], "**failed**: forced EXT: nothing was tested")

    def test_vkd3d_goes_on_by_configuration(self):
        ran = """
with open(pathlib.Path(__file__).parents[2] / "ran", "a", encoding="utf-8") as ran:
    print(os.environ.get("VELLUM_FORCING_API"), file=ran)
"""
        self.assertNotEqual(self.vkd3d("1", begin=ran + 'if os.environ.get("VELLUM_FORCING_API") == "ext": os.kill(os.getppid(), 2)'), 0)
        self.assertEqual(set(self.ran()), {"None", "ext"})
        self.assertEqual(self.vkd3d("1", begin=ran), 0)
        self.assertEqual(set(self.ran()), {"ext", "khr"})
        self.assertRegex(self.row("vkd3d")[2], "bare 7 checks, 2 failed; layer 7 checks, 2 failed, 0 differ from bare; .*forced KHR 7")

    def test_vkd3d_stopped(self):
        self.assertEqual(self.vkd3d("1", "--minutes", "0.00001"), 1)
        self.assertRegex(self.row("vkd3d")[2], "5 not run of 5 configurations: bare, layer, .*: nothing was tested$")

    def programs(self, text):
        shutil.rmtree(self.checkout / "build/programs", ignore_errors=True)
        self.script("build/programs/triangle", 'case $VK_INSTANCE_LAYERS in *forcing*) echo "forcing: 1 devices, 3 geometries"; esac\n'
                    + text)
        return self.matrix("--programs", self.checkout / "build/programs", "programs").returncode

    def test_pictures_of_programs(self):
        self.assertEqual(self.programs("echo 1 >frame.ppm"), 0)
        self.assertRegex(self.row("programs")[2], "1 programs, 5 pictures$")
        self.assertEqual(self.programs('test -n "$VK_INSTANCE_LAYERS" && echo 1 >frame.ppm'), 0)
        self.assertRegex(self.row("programs")[2], "1 programs, 4 pictures$")
        self.assertEqual(self.programs('echo "$VELLUM_FORCING_API" >frame.ppm'), 1)
        self.assertRegex(self.row("programs")[2], r"failed: triangle \(forced EXT\), triangle \(forced KHR\)$")
        self.assertEqual(self.programs("true"), 1)
        self.assertRegex(self.row("programs")[2], "nothing was tested$")

    def test_program_with_nothing_to_force(self):
        self.programs("echo 1 >frame.ppm")
        self.script("build/programs/boxes", 'case $VK_INSTANCE_LAYERS in *forcing*) echo "forcing: 1 devices, 0 geometries"; esac\n'
                    "echo 1 >frame.ppm")
        programs = ("--programs", self.checkout / "build/programs", "programs")
        self.assertEqual(self.matrix(*programs).returncode, 0)
        self.assertRegex(self.row("programs")[2], "2 programs, 10 pictures; nothing to force: boxes$")
        (self.checkout / "build/programs/triangle").unlink()
        self.assertEqual(self.matrix(*programs).returncode, 1)
        self.assertRegex(self.row("programs")[2], "1 programs, 5 pictures; nothing to force: boxes: nothing was tested$")
        self.script("build/programs/boxes", "echo 1 >frame.ppm")  # the layer is not loaded
        self.assertEqual(self.matrix(*programs).returncode, 1)
        self.assertRegex(self.row("programs")[2], r"failed: boxes \(forced EXT\), boxes \(forced KHR\)$")


if __name__ == "__main__":
    if not list(pathlib.Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json")) or not shutil.which("git"):
        sys.exit(77)
    os.environ.pop("VK_INSTANCE_LAYERS", None)
    unittest.main()
