#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""scripts/test-gpu: the folder that is copied to a machine, and its parts there. The device has no ray queries."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ["VELLUM_TEST_BUILD"]).resolve()


def run(*words, **variables):
    return subprocess.run([str(word) for word in words], env={**os.environ, **variables}, capture_output=True, text=True,
                          check=False)


class TestGpu(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.packed, cls.out = pathlib.Path(folder.name) / "packed", pathlib.Path(folder.name) / "out"
        made = run(ROOT / "scripts/test-gpu", "pack", cls.packed, BUILD)
        if made.returncode != 0:
            raise RuntimeError(made.stderr)

    def run_parts(self, *words):
        shutil.rmtree(self.out, ignore_errors=True)
        layers = f"{self.packed / 'lib'}:{BUILD / 'tests/layer/layers'}"
        ran = run(self.packed / "test-gpu", "--out", self.out, *words, VELLUM_TEST_MOCK_DRIVER="noqueries",
                  VK_LAYER_PATH=layers, VK_INSTANCE_LAYERS="VK_LAYER_VELLUM_opacity_micromap:VK_LAYER_VELLUM_test_mock_driver")
        rows = [row.split(" | ") for row in (self.out / "summary.md").read_text().splitlines() if row.startswith("| ")]
        return ran, {row[0].lstrip("| "): row[2] for row in rows[1:]}

    def test_without_ray_queries(self):
        ran, results = self.run_parts("--minutes", "9.5", "info", "queries", "pipelines", "baker")
        self.assertEqual(results, {"info": "passed", "queries": "not supported", "pipelines": "passed", "baker": "passed"},
                         ran.stdout)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertIn("ray queries: no, pipelines: yes", (self.out / "info/output.txt").read_text())
        self.assertTrue((self.out / "pipelines/pipelines.png").exists())

    def test_check_without_ray_queries(self):
        ran, results = self.run_parts("--minutes", "1", "check")
        self.assertEqual((ran.returncode, results), (0, {"check": "passed"}), ran.stdout)
        statuses = [row.split(",")[1] for row in (self.out / "check/results/results.csv").read_text().splitlines()]
        # Cases that are skipped take no time, so a slow machine has more of them than of others.
        self.assertGreater(statuses.count("Pass"), 30)

    def test_part_that_takes_too_long(self):
        ran, results = self.run_parts("--minutes", "0.1", "micromaps", "info")
        self.assertEqual(ran.returncode, 1)
        self.assertEqual(results["info"], "passed")
        self.assertRegex(results["micromaps"], "failed: not done after [0-9]+ s")

    def test_wrong_words(self):
        self.assertEqual(run(self.packed / "test-gpu", "nothing").returncode, 2)
        self.assertEqual(run(self.packed / "test-gpu", "--minutes").returncode, 2)
        self.assertEqual(run(ROOT / "scripts/test-gpu").returncode, 2)
        self.assertEqual(run(ROOT / "scripts/test-gpu", "pack", self.packed, BUILD).returncode, 2)


if __name__ == "__main__":
    unittest.main()
