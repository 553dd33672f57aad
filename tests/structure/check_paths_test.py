#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_paths.py on lines that are made up."""
import unittest

import check_paths


class CheckPaths(unittest.TestCase):
    def found(self, name, line):
        return len(list(check_paths.findings_of(name, line)))

    def test_text_of_a_path(self):
        for line in ("throw Error(folder.string());", "use(options.output->string());", "use(x.generic_string());"):
            self.assertEqual(self.found("src/cli/a.cpp", line), 1, line)
        self.assertEqual(self.found("src/gltf/a.cpp", "document.path().string()"), 1)
        for line in ('object["mode"].string()', "utf8Text(path)", "path.native() // not path.string()"):
            self.assertEqual(self.found("src/gltf/a.cpp", line), 0, line)

    def test_path_of_a_text(self):
        for line in ("std::filesystem::path(name)", "fs::path{text}"):
            self.assertEqual(self.found("src/layer/a.cpp", line), 1, line)
        for line in ("std::filesystem::path()", 'fs::path("lib")', "const std::filesystem::path &path)"):
            self.assertEqual(self.found("src/layer/a.cpp", line), 0, line)

    def test_cli11(self):
        self.assertEqual(self.found("src/cli/a.cpp", "#include <CLI/CLI.hpp>"), 1)
        self.assertEqual(self.found(check_paths.CLI11, "#include <CLI/CLI.hpp>"), 0)


if __name__ == "__main__":
    unittest.main()
