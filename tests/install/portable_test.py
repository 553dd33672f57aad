#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds libvellum with VELLUM_PORTABLE by each compiler that is there, GCC and clang. Its sources then use nothing that other
compilers lack, and it bakes the bytes that the library of the build bakes.

Run by ctest, with the options at the end; what comes after them goes to unittest.
"""
import argparse
import hashlib
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import subprocess
import sys
import unittest
from array import array

options = argparse.Namespace()
COMPILERS = (("gcc", "g++"), ("clang", "clang++"))
# What only GCC and clang have, except that to which macros of the standard library and of the processor's headers expand.
# Attributes of vellum.h are for them alone.
EXTENSIONS = re.compile(r"__int128|__builtin_(?!offsetof|va_|inf|nan|huge_val|ia32_)\w+|__extension__|__typeof__|__asm__|\basm\b")


def bake():
    """Prints a digest of micromaps of random textures, in both kinds of arithmetic: where filters decide, and exact ones."""
    sys.path.insert(0, str(options.source / "bindings/python"))
    import vellum
    digest, random_numbers, known = hashlib.sha256(), random.Random(1), [0, 0, 0, 0]
    for case in range(400):
        size = 1 << random_numbers.randrange(1, 5)
        texels = bytes(random_numbers.choice((0, 64, 127, 128, 255)) for _ in range(size * size))
        texture = vellum.Texture(texels, width=size, height=size, filter=case % 2, address_mode_u=case % 5,
                                 address_mode_v=case % 3)
        # On texels and between them; far from the origin, where exact arithmetic needs more digits than 128 bits.
        scale, place = random_numbers.choice(((1, 0), (0.25, 0), (1 / 3, 0.1), (4, 1000), (1e-12, 1 / 7), (300, 1e-30)))
        step = random_numbers.choice((1, size, 2 * size, 8 * size))
        uvs = array("f", (place + scale * random_numbers.randrange(-step, 2 * step + 1) / step for _ in range(6 * 8)))
        tolerances = {} if case % 4 == 0 else dict.fromkeys(
            ("value_tolerance", "subtexel_tolerance", "barycentric_tolerance", "interpolation_tolerance"), 0.0)
        mesh = vellum.BakeInput([texture], uvs=uvs, cutoff=random_numbers.choice((0.5, 128 / 255, 0.1)))
        result = vellum.bake([mesh], level=case % 6, format=1 + case // 2 % 2, **tolerances)
        known = [a + b for a, b in zip(known, result.state_counts)]
        digest.update(result.data + result.indices.tobytes() + json.dumps(result.state_counts).encode())
    assert all(known), known  # each state is there
    print(digest.hexdigest(), known)


def run(*command, **variables):
    done = subprocess.run([str(word) for word in command], env={**os.environ, **variables}, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, timeout=900, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{shlex.join(map(str, command))}: status {done.returncode}\n{done.stdout}")
    return done.stdout


def baked(library):
    return run(sys.executable, __file__, "--source", options.source, "--bake", VELLUM_LIBRARY_PATH=str(library.resolve().parent),
               PYTHONDONTWRITEBYTECODE="1")


def extensions(build):
    """Uses of extensions in the project's files, as the preprocessor leaves them: (file, line)."""
    found, files = set(), set()
    for entry in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        words = shlex.split(entry["command"])
        for flag in ("-o", "-c"):
            del words[words.index(flag):words.index(flag) + 2]
        file = None
        for line in run(*words, "-E", "-dD", entry["file"]).splitlines():
            marker = re.match(r'# \d+ "([^"]*)"', line)
            if marker:
                file = pathlib.Path(marker[1])
            elif file and file.is_relative_to(options.source) and not line.startswith("#"):
                files.add(file)
                found.update((str(file.relative_to(options.source)), use) for use in EXTENSIONS.findall(line))
    return found, files


class Portable(unittest.TestCase):
    def test_each_compiler(self):
        expected = baked(options.library)
        compilers = [pair for pair in COMPILERS if shutil.which(pair[0]) and shutil.which(pair[1])]
        self.assertTrue(compilers)
        for cc, cxx in compilers:
            with self.subTest(compiler=cxx):
                build = options.scratch / cxx
                shutil.rmtree(build, ignore_errors=True)
                # Optimized less than a release, which takes half the time.
                run(options.cmake, "-S", options.source, "-B", build, "-G", options.generator, f"-DCMAKE_C_COMPILER={cc}",
                    f"-DCMAKE_CXX_COMPILER={cxx}", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG",
                    "-DVELLUM_LIBRARY_ONLY=ON", "-DVELLUM_PORTABLE=ON", "-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON",
                    "-DCMAKE_CXX_FLAGS=-pedantic-errors", "-DVELLUM_WERROR=ON")
                run(options.cmake, "--build", build)
                self.assertEqual(baked(build / "lib/libvellum.so"), expected)
                uses, files = extensions(build)
                self.assertEqual(uses, set())
                self.assertIn(options.source / "src/bake/numbers/wide.h", files)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--library", type=pathlib.Path)
    parser.add_argument("--scratch", type=pathlib.Path)
    parser.add_argument("--cmake")
    parser.add_argument("--generator")
    parser.add_argument("--bake", action="store_true")
    options, rest = parser.parse_known_args()
    if options.bake:
        bake()
    else:
        unittest.main(argv=[sys.argv[0], *rest])
