#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_synchronization.py on a registry and sources that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_synchronization.py")

REGISTRY = """<registry>
<types>
  <type category="struct" name="VkOneBarrier"><member><type>VkAccessFlags2</type></member></type>
  <type category="struct" name="VkCheckpointData2NV"><member><type>VkPipelineStageFlags2</type></member></type>
  <type category="struct" name="VkOldBarrier"><member><type>VkAccessFlags</type></member></type>
</types>
<commands>
  <command><proto><type>void</type> <name>vkQueueOne</name></proto>
    <param externsync="maybe"><type>VkQueue</type></param></command>
  <command><proto><type>void</type> <name>vkQueueTwo</name></proto><param><type>VkQueue</type></param></command>
  <command><proto><type>void</type> <name>vkQueueThree</name></proto>
    <param externsync="true"><type>VkQueue</type></param></command>
  <command><proto><type>void</type> <name>vkCmdStage</name></proto>
    <param><type>VkPipelineStageFlags2KHR</type></param></command>
</commands>
<extensions>
  <extension name="VK_EXT_three" supported="disabled"><require><command name="vkQueueThree"/></require></extension>
</extensions>
</registry>
"""
ROWS = """VELLUM_DEVICE(QueueOne, Emulated, queueOne)
VELLUM_DEVICE(CmdStage, Emulated, cmdStage, cmdStage)
VELLUM_DEVICE(QueueThree, Never, none, queueThree)
"""
CODE = """void queueOne(Device &device, VkQueue queue)
{
    const Lock lock = device.probes.lock(queue);
}

void translate(VkOneBarrier &barrier);
"""


def run(rows=ROWS, code=CODE):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {"vk.xml": REGISTRY, "src/layer/base/commands.inc": rows,
                           "src/layer/command_buffer/synchronization.cpp": code,
                           "src/layer/device_address/address_copies.cpp": ""}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), str(root / "vk.xml"), folder], stdout=subprocess.PIPE,
                                text=True, check=False)
    return result.returncode, result.stdout


class CheckSynchronization(unittest.TestCase):
    def expect_finding(self, text, **sources):
        code, out = run(**sources)
        self.assertEqual(code, 1)
        self.assertIn(text, out)

    def test_complete(self):
        code, out = run()
        self.assertEqual((code, out.strip()), (0, "0 findings in 4 commands and structures"))

    def test_queue_command_without_row(self):
        self.expect_finding("no row for vkQueueOne", rows=ROWS.replace("QueueOne", "QueueOther"))

    def test_queue_command_without_lock(self):
        self.expect_finding("queueOne does not hold the lock", code=CODE.replace("probes.lock", "other.lock"))

    def test_lock_of_another_command(self):
        self.expect_finding("queueOne does not hold the lock", code=CODE.replace("void queueOne", "void queueOther"))

    def test_structure(self):
        self.expect_finding("VkOneBarrier has stages or accesses", code=CODE.replace("VkOneBarrier", "VkOneBarriers"))

    def test_command(self):
        self.expect_finding("vkCmdStage has stages or accesses", rows=ROWS.replace("CmdStage", "CmdStages"))


if __name__ == "__main__":
    unittest.main()
