#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_includes.py on trees that are made up, each with one fault."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_includes.py")

SOUND = {
    "src/core/states.h": "",
    "src/core/curve.cpp": '#include "core/states.h"\n#include <vector>\n',
    "src/spirv/link.cpp": '#include "core/states.h"\n',
    "src/shaders/base/words.h": '#include "states.h"\n',
    "src/shaders/structures/copy.comp": '#include "base/words.h"\n',
    "src/gltf/reader.cpp": '#include "bake/bake.h"\n',
    "src/bake/bake.h": '#include "core/states.h"\n',
    "src/bake/texture/texture.h": "",
    "src/verify/verify.h": '#include "bake/texture/texture.h"\n',
    "src/layer/base/report.h": '#include "shaders/copy.h"\n#include "layer/base/written_by_the_build.h"\n',
    "src/layer/memory/memory.h": '#include "layer/base/report.h"\n#include "core/states.h"\n',
    "src/layer/entry/device.h": '#include "layer/memory/memory.h"\n',
    "src/cli/main.cpp": '#include "gltf/reader.h"\n#include "options.h"\n#include "cli/base/error.h"\n',
    "src/cli/base/error.h": "",
    "src/cli/options.h": "",
    "include/vellum/header.h": "",
    "tests/layer/some_test.cpp": '#include "layer/entry/device.h"\n',
}


def run(files):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            path = pathlib.Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), folder], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckIncludes(unittest.TestCase):
    def expect_finding(self, files, *words):
        status, output = run(SOUND | files)
        self.assertEqual(status, 1, output)
        self.assertEqual(len(output.splitlines()), 2, output)
        for word in words:
            self.assertIn(word, output)

    def test_sound(self):
        self.assertEqual(run(SOUND)[0], 0, run(SOUND)[1])

    def test_up_between_parts(self):
        self.expect_finding({"src/core/up.h": '\n#include "bake/bake.h"\n'}, "src/core/up.h:2", "does not use src/bake")

    def test_command_and_layer(self):
        self.expect_finding({"src/cli/up.h": '#include "layer/base/report.h"\n'}, "src/cli uses nothing of src/layer but base/setting_names.h")

    def test_part_of_a_part(self):
        self.expect_finding({"src/verify/near.h": '#include "bake/bake.h"\n'},
                              "src/verify uses nothing of src/bake but texture/texture.h")

    def test_edge_between_subsystems(self):
        self.expect_finding({"src/layer/base/up.h": '#include "layer/memory/memory.h"\n'},
                              "base does not use memory")

    def test_up_by_a_relative_path(self):
        self.expect_finding({"src/layer/base/up.h": '  #  include "../memory/memory.h" // why\n'},
                              "base does not use memory")

    def test_up_to_a_header_of_the_build(self):
        self.expect_finding({"src/layer/base/up.h": '#include "layer/memory/written_by_the_build.h"\n'},
                              "base does not use memory")

    def test_edge_between_subsystems_of_shaders(self):
        self.expect_finding({"src/shaders/base/up.glsl": '#include "structures/copy.comp"\n'},
                              "base does not use structures")

    def test_edge_that_is_not_listed(self):
        self.expect_finding({"src/layer/structures/build.h": "",
                             "src/layer/pipelines/side.h": '#include "layer/structures/build.h"\n'},
                            "pipelines does not use structures")

    def test_up_to_the_top(self):
        self.expect_finding({"src/cli/base/up.h": '#include "cli/options.h"\n'}, "base does not use the top")

    def test_edge_inside_a_subsystem(self):
        checks = {"src/layer/validation/sync/order.h": '#include "layer/validation/model/log.h"\n',
                  "src/layer/validation/model/log.h": '#include "layer/memory/memory.h"\n',
                  "src/layer/validation/commands.h": '#include "layer/validation/sync/order.h"\n'}
        self.assertEqual(run(SOUND | checks)[0], 0)
        self.expect_finding(checks | {"src/layer/validation/sync/up.h": '#include "layer/validation/commands.h"\n'},
                            "sync does not use the top")
        self.expect_finding(checks | {"src/layer/validation/model/up.h": '#include "layer/validation/sync/order.h"\n'},
                            "model does not use sync")
        self.expect_finding({"src/layer/validation/attic/lost.cpp": ""}, "in no subsystem of src/layer/validation")

    def test_no_subsystem(self):
        self.expect_finding({"src/layer/lost.cpp": ""}, "src/layer/lost.cpp: in no subsystem")
        self.expect_finding({"src/layer/attic/lost.cpp": ""}, "src/layer/attic/lost.cpp: in no subsystem")

    def test_ranges_in_wasm(self):
        self.expect_finding({"src/gltf/any.cpp": "\nstd::ranges::any_of(values);\n"}, "src/gltf/any.cpp:2", "WebAssembly")

    def test_no_part(self):
        self.expect_finding({"src/extra/new.cpp": ""}, "src/extra/new.cpp: in no part")


if __name__ == "__main__":
    unittest.main()
