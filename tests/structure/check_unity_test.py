#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_unity.py on sources that are made up."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_unity.py")


def source(*lines):
    return "namespace vellum\n{\nnamespace\n{\n\n" + "\n".join(lines) + "\n\n} // namespace\n\nvoid f();\n} // namespace vellum\n"


def run(first, second, other="src/part/second.cpp", name="src/part/first_posix.cpp"):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {name: first, other: second}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), folder], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckUnity(unittest.TestCase):
    def test_different_names(self):
        self.assertEqual(run(source("constexpr int kOne = 1;"), source("constexpr int kTwo = 1;"))[0], 0)

    def test_each_kind(self):
        for line in ("constexpr int kOne = 1;", "int kOne(int a)", "struct kOne {", "const Row kOne[] = {", "int kOne;"):
            code, out = run(source("enum class kOne {"), source(line))
            self.assertEqual(code, 1, line)
            self.assertIn("src/part: vellum::kOne is defined in first_posix.cpp and in second.cpp", out)

    def test_other_folders_and_systems(self):
        text = source("constexpr int kOne = 1;")
        self.assertEqual(run(text, text, "src/other/second.cpp")[0], 0)
        self.assertEqual(run(text, text, "src/part/first_windows.cpp")[0], 0)

    def test_tests(self):
        text = source("constexpr int kOne = 1;")
        code, out = run(text, text, "tests/part/b_test.cpp", "tests/part/a_test.cpp")
        self.assertEqual(code, 1)
        self.assertIn("tests/part: vellum::kOne is defined in a_test.cpp and in b_test.cpp", out)
        # Files that are compiled one by one, and a type, so that something is checked.
        self.assertEqual(run(text, text + "struct A {\n};\n", "tests/validation/b.cpp", "tests/validation/a.cpp")[0], 0)

    def test_base_classes(self):
        self.assertEqual(run(source("class First : public Base", "{", "};"), source("class Second final : public Base", "{", "};"))[0], 0)

    def test_aliases_of_namespaces(self):
        text = source("namespace fs = std::filesystem;", "constexpr int kOne = 1;")
        self.assertEqual(run(text, text)[0], 1)
        self.assertEqual(run(source("namespace fs = std::filesystem;"), source("namespace fs = std::filesystem;", "int two;"))[0], 0)

    def test_overloads(self):
        self.assertEqual(run(source("int f(int a)"), source("int f(float a)"))[0], 0)
        self.assertEqual(run(source("int f(int a)"), source("int f(int b)"))[0], 1)
        self.assertEqual(run(source("int f(int a)"), source("int f(int a, int b = 1)"))[0], 1)

    def test_aliases(self):
        self.assertEqual(run(source("using Kind = A;"), source("using Kind = A;"))[0], 0)
        self.assertEqual(run(source("using Kind = A;"), source("using Kind = B;"))[0], 1)

    def test_types_of_other_folders(self):
        def defined(line):
            return f"namespace vellum::part\n{{\n// struct A {{\nclass B;\n{line}\n    struct Inner {{\n    }};\n}};\n}}\n"

        other = "src/other/second.h"
        self.assertEqual(run(defined("struct A {"), defined("class C final : public D {"), other)[0], 0)
        code, out = run(defined("struct A {"), defined("class A final : public D {"), other)
        self.assertEqual(code, 1)
        self.assertIn("vellum::part::A is defined in src/other/second.h and in src/part/first_posix.cpp", out)
        self.assertEqual(run(defined("struct A {"), defined("enum class A : int {"), "src/part/first_windows.cpp")[0], 0)

    def test_nothing_to_check(self):
        self.assertEqual(run("", "")[0], 1)


if __name__ == "__main__":
    unittest.main()
