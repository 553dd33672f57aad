#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`vellum check` finds wrong bytes of commands that copy memory at device addresses, and says what is wrong."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[4]
BUILD = pathlib.Path(os.environ["VELLUM_TEST_BUILD"]).resolve()
sys.path.insert(0, str(ROOT / "bench/faults"))
sys.dont_write_bytecode = True
import faults  # noqa: E402

CASES = "\n".join(f"khr.address-copies.{number:04}" for number in range(12))


class AddressCopies(unittest.TestCase):
    def check(self, fault):
        """How `vellum check` ends on a device with the fault, what it prints, and the account and the smallest case of the
        first failure."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "cases").write_text(CASES)
            environment = faults.environment(BUILD, folder, faults.Fault(fault, "", "", ""))
            ended = subprocess.run([str(BUILD / "bin/vellum"), "check", "--caselist", str(folder / "cases"), "--output",
                                    str(folder / "out"), "-j", "1", "--fail-fast"], env=environment,
                                   capture_output=True, text=True, check=False)
            account = next((file.read_text() for file in folder.glob("out/failures/*.txt")), "")
            case = next((json.loads(file.read_text())["case"] for file in folder.glob("out/failures/*.json")), {})
            return ended.returncode, ended.stdout + ended.stderr, account, case

    def test_without_a_fault(self):
        code, text, _, _ = self.check("")
        self.assertEqual(code, 0, text)

    def test_larger_destination(self):
        code, text, account, case = self.check("memory-copy-clears-rest")
        self.assertEqual(code, 1, text)
        self.assertIn("Fail: vkCmdCopyMemoryKHR changes a byte that it must not", text)
        self.assertRegex(account, r"vkCmdCopyMemoryKHR changes a byte that it must not \(command 0: byte \d+ of buffer 0 is "
                                  r"0x[0-9a-f]{2}, not 0x[0-9a-f]{2} as before\)")
        self.assertEqual([command["command"] for command in case["addressCopies"]["commands"]], ["vkCmdCopyMemoryKHR"])
        self.assertEqual([region["spare"] for region in case["addressCopies"]["commands"][0]["regions"]], [1])

    def test_row_length(self):
        code, text, account, case = self.check("image-copy-row-length")
        self.assertEqual(code, 1, text)
        self.assertRegex(account, r"vkCmdCopyImageToMemoryKHR (changes|writes) a .*byte .* \(command 0.*: byte \d+ of buffer")
        commands = case["addressCopies"]["commands"]
        self.assertEqual([command["command"] for command in commands], ["vkCmdCopyImageToMemoryKHR"])
        self.assertEqual([region["rowLength"] > region.get("width", 1) for region in commands[0]["regions"]], [True])


if __name__ == "__main__":
    unittest.main()
