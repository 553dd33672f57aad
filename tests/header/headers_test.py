#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compiles each public header alone with strict warnings: those in C as C99, C11, C++11 and C++17, those in C++ as C++20, by GCC
and clang, as far as they are there. For Windows, by clang, functions and callbacks keep their calling convention with another
default.

usage: headers_test.py --source CHECKOUT [--include FOLDER]...
"""
import argparse
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

options = argparse.Namespace()
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Wshadow", "-Wundef", "-Werror"]
LANGUAGES = {"c": (["c99", "c11"], ["-Wstrict-prototypes", "-Wmissing-prototypes"]),
             "c++": (["c++11", "c++17"], ["-Wold-style-cast"])}
COMPILERS = {"c": ("gcc", "clang"), "c++": ("g++", "clang++")}
IN_CXX = ("bake.h", "gpu_bake.h")


def compile_text(text, compiler, *flags):
    """The exit status, and the assembler code or the messages."""
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder, "use")
        source.write_text(text, encoding="utf-8")
        includes = [f"-I{options.source}/include", *(word for path in options.include for word in ("-isystem", path))]
        output = pathlib.Path(folder, "use.s")
        done = subprocess.run([compiler, *flags, *includes, "-S", "-o", output, source], check=False, capture_output=True,
                              text=True)
        return done.returncode, output.read_text(encoding="utf-8") if done.returncode == 0 else done.stderr


class Headers(unittest.TestCase):
    def check(self, name, language, standard, warnings):
        found = [compiler for compiler in COMPILERS[language] if shutil.which(compiler)]
        self.assertTrue(found)
        for compiler in found:
            with self.subTest(header=name, compiler=compiler, standard=standard):
                status, output = compile_text(f"#include <vellum/{name}>\n", compiler, "-x", language, f"-std={standard}",
                                              *WARNINGS, *warnings)
                self.assertEqual(status, 0, output)

    def test_headers(self):
        headers = {path.name for path in (options.source / "include/vellum").glob("*.h")}
        for name in sorted(headers):
            if name in IN_CXX:
                self.check(name, "c++", "c++20", ["-Wold-style-cast"])
                continue
            for language, (standards, warnings) in LANGUAGES.items():
                for standard in standards:
                    self.check(name, language, standard, warnings)

    @unittest.skipUnless(shutil.which("clang"), "clang is not installed")
    def test_another_calling_convention(self):
        # By /Gv, which is this, names of functions get a suffix, and callbacks are called in another way.
        flags = ["-x", "c", "--target=x86_64-pc-windows-msvc", "-ffreestanding", "-O1"]
        text = """#include <vellum/vellum.h>
            int call(const VellumBakeOptions *options);
            int call(const VellumBakeOptions *options) { return options->cancelled(options->userData) + (int)vellumGetVersion(); }
            double other(double a, double b);
            int use(const VellumBakeOptions *options) { return call(options) + (int)other(1, 2); }
            """
        default = compile_text(text, "clang", *flags)
        another = compile_text(text, "clang", *flags, "-Xclang", "-fdefault-calling-conv=vectorcall")
        self.assertEqual((default[0], another[0]), (0, 0), default[1] + another[1])
        self.assertIn("other@@16", another[1])  # the option has an effect
        self.assertIn("vellumGetVersion", default[1])
        self.assertNotIn("vellumGetVersion@@", another[1])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--include", action="append", default=[])
    options, rest = parser.parse_known_args()
    options.source = options.source.resolve()
    unittest.main(argv=[sys.argv[0], *rest])
