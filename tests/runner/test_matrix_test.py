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
PASSES = "echo '100% tests passed, 0 tests failed out of 3'; echo ' 2/3 Test #2: unit.B .....***Skipped   0.1 sec'"
# vkd3d-proton's tests: `values` are what the checks of two tests meet, which differ if a variable is set.
VKD3D = f"#!{sys.executable}" + '''
import os, sys
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
        self.script("scripts/test", PASSES)
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
        for text, result in (
                ("echo '33% tests passed, 2 tests failed out of 3'; printf 'The following tests FAILED:\\n\\t  1 - unit.A (Failed)\\n"
                 "\\t  2 - unit.B (SEGFAULT)\\n'; exit 8", "**failed**: 1 of 3 tests passed, 0 skipped; failed: unit.A, unit.B"),
                (f"{PASSES}; exit 1", "**failed**: 2 of 3 tests passed, 1 skipped; failed: exit status 1"),
                ("echo '100% tests passed, 0 tests failed out of 0'", "**failed**: 0 of 0 tests passed, 0 skipped: nothing was tested"),
                ("echo 'No tests were found!!!'", "**failed**: no test ran, exit status 0")):
            self.script("scripts/test", text)
            self.assertEqual(self.matrix("debug").returncode, 1)
            self.assertEqual(self.row("debug")[2], result)

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

    def vkd3d(self, value, geometries="3"):
        self.script("build/vkd3d/tests/d3d12", VKD3D.replace("VALUE", value).replace("GEOMETRIES", geometries))
        return self.matrix("--vkd3d", self.checkout / "build/vkd3d", "vkd3d").returncode

    def test_vkd3d_compares_values(self):
        self.assertEqual(self.vkd3d("1"), 0)
        self.assertIn("bare 7 checks, 2 failed; layer 7 checks, 2 failed, 0 differ from bare", self.row("vkd3d")[2])
        self.assertEqual(self.vkd3d('os.environ.get("VELLUM_ASSUME_MICROMAPS", "0")'), 1)
        self.assertRegex(self.row("vkd3d")[2], "assume_micromaps 7 checks, 2 failed, 2 differ from bare.*; failed: assume_micromaps$")

    def test_vkd3d_without_forced_geometries(self):
        self.assertEqual(self.vkd3d("1", geometries="0"), 1)
        self.assertEqual(self.row("vkd3d")[2], "**failed**: forced EXT: nothing was tested")

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


if __name__ == "__main__":
    if not list(pathlib.Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json")) or not shutil.which("git"):
        sys.exit(77)
    os.environ.pop("VK_INSTANCE_LAYERS", None)
    unittest.main()
