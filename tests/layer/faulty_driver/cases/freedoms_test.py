#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`vellum check` reports no freedom of the specification as a failure: those that the faulty driver takes, and limits
that the layer simulates. One step beyond each it does."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[4]
BUILD = pathlib.Path(os.environ["VELLUM_TEST_BUILD"]).resolve()
sys.path.insert(0, str(ROOT / "bench/faults"))
import faults  # noqa: E402

# The freedom, a fault that is one step beyond it, and the groups in which both show.
FREEDOMS = [
    ("coarse-arithmetic", "instances-displaced", ("khr.resolution-query", "khr.resolution-pipeline", "khr.levels")),
    ("boxes-grown", "boxes-shrunk", ("khr.resolution-query", "khr.resolution-pipeline")),
    ("host-reads-after-barriers", "serialized-header-size", ("khr.serialization",)),
    ("clones-as-large-as-sources", "clone-is-shallow", ("ext.copies",)),
    ("instance-offsets-by-16", "instances-displaced", ("khr.builds",)),
    ("lossy-by-content", "lossy-differs-by-device", ("khr.lossy",)),
]
LIMITS = {"VELLUM_MAX_OPACITY_2_STATE_SUBDIVISION_LEVEL": "5", "VELLUM_MAX_OPACITY_4_STATE_SUBDIVISION_LEVEL": "3",
          "VELLUM_MAX_OPACITY_LOSSY_4_STATE_SUBDIVISION_LEVEL": "4"}
CASES = {"ext.copies": 60, "khr.builds": 60}  # of each group; else:
FEW_CASES = 12


class Freedoms(unittest.TestCase):
    def check(self, fault, groups, variables=None):
        """How `vellum check` ends on a device with a fault or a freedom, and what it prints."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            cases = [f"{group}.{number:04}" for group in groups for number in range(CASES.get(group, FEW_CASES))]
            (folder / "cases").write_text("\n".join(cases))
            planted = faults.Fault(fault, "", "", "")
            environment = faults.environment(BUILD, folder, planted) | (variables or {})
            ended = subprocess.run([str(BUILD / "bin/vellum"), "check", "--caselist", str(folder / "cases"), "--output",
                                    str(folder / "out"), "-j", "1", "--fail-fast"], env=environment,
                                   capture_output=True, text=True, check=False)
            return ended.returncode, ended.stdout + ended.stderr

    def test_freedoms_pass_and_what_is_beyond_fails(self):
        for freedom, beyond, groups in FREEDOMS:
            with self.subTest(freedom):
                code, text = self.check(freedom, groups)
                self.assertEqual(code, 0, text)
            with self.subTest(beyond):
                code, text = self.check(beyond, groups)
                self.assertEqual(code, 1, text)

    def test_simulated_limits(self):
        code, text = self.check("", ("khr.levels", "khr.lossy", "khr.sequences", "khr.resolution-query"), LIMITS)
        self.assertEqual(code, 0, text)


if __name__ == "__main__":
    unittest.main()
