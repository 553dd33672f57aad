#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds parts of Vellum as packagers and other projects do: libvellum only, static, as a subproject; the layer only. Objects
are taken from a build of the same sources (reuse_objects.py).

Run by ctest, with the options that main() has; what comes after them goes to unittest.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

import reuse_objects

options = argparse.Namespace()


def run(*command, environment=None, fails=False):
    """The output of a command that must succeed, or fail."""
    done = subprocess.run([str(word) for word in command], env={**os.environ, **(environment or {})},
                          text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=900)
    if (done.returncode != 0) != fails:
        raise AssertionError(f"{' '.join(str(word) for word in command)}: status {done.returncode}\n{done.stdout}")
    return done.stdout


def folder(name):
    path = options.scratch / name
    shutil.rmtree(path, ignore_errors=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def configure(source, build, *arguments, missing=(), fails=False):
    """`missing`: packages that CMake must not find."""
    return run(options.cmake, "-S", source, "-B", build, "-G", options.generator, "-DCMAKE_BUILD_TYPE=Release",
               f"-DCMAKE_C_COMPILER={options.cc}", f"-DCMAKE_CXX_COMPILER={options.cxx}",
               *(f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in missing), *arguments, fails=fails)


def targets(build):
    return set(re.findall(r"^([\w-]+): phony", run(options.cmake, "--build", build, "--target", "help"), re.M))


NOT_FOR_THE_LIBRARY = ("Vulkan", "PNG", "JPEG", "ZLIB", "OpenSSL", "fmt", "CLI11", "GTest", "Python3")
NOT_FOR_THE_LAYER = ("PNG", "JPEG", "ZLIB", "OpenSSL", "fmt", "CLI11", "GTest")


class BuildModes(unittest.TestCase):
    def check_bake(self, output):
        self.assertRegex(output, r"\b\d+ bytes of data for \d of 2 triangles")

    def test_static_library(self):
        build, prefix = folder("static"), folder("static-prefix")
        configure(options.source, build, "-DVELLUM_LIBRARY_ONLY=ON", "-DBUILD_SHARED_LIBS=OFF", missing=NOT_FOR_THE_LIBRARY)
        run(options.cmake, "--build", build, "-j2")
        run(options.cmake, "--install", build, "--prefix", prefix)
        self.assertEqual(sorted(path.name for path in prefix.rglob("libvellum*")), ["libvellum.a"])
        for example in ("c", "cpp"):
            program = folder(f"static-{example}")
            configure(prefix / "share/doc/vellum/examples" / example, program, f"-DCMAKE_PREFIX_PATH={prefix}")
            run(options.cmake, "--build", program)
            self.check_bake(run(program / "bake"))
            self.assertNotIn("vellum", run("readelf", "--dynamic", program / "bake"))
        words = run("pkg-config", "--cflags", "--libs", "vellum", environment={
            "PKG_CONFIG_PATH": str(prefix / options.libdir / "pkgconfig")}).split()
        program = options.scratch / "static-pkg-config"
        run(options.cc, prefix / "share/doc/vellum/examples/c/bake.c", "-o", program, *words)
        self.check_bake(run(program))

    def check_subproject(self, name, how):
        source = folder(name)
        source.mkdir()
        shutil.copy(options.source / "examples/c/bake.c", source)
        (source / "CMakeLists.txt").write_text(f"""
            cmake_minimum_required(VERSION 3.25)
            project({name} LANGUAGES C CXX)
            {how}
            add_executable({name} bake.c)
            target_link_libraries({name} PRIVATE Vellum::vellum)
            install(TARGETS {name})
            foreach(variable CMAKE_CXX_VISIBILITY_PRESET CMAKE_RUNTIME_OUTPUT_DIRECTORY CMAKE_CXX_STANDARD BUILD_TESTING)
              if(DEFINED ${{variable}})
                message(FATAL_ERROR "Vellum sets ${{variable}} for its parent")
              endif()
            endforeach()
            """)
        build = source / "build"
        configure(source, build, missing=NOT_FOR_THE_LIBRARY)
        run(options.cmake, "--build", build, "-j2")
        self.assertFalse((build / "bin").exists() or (build / "lib").exists())
        self.check_bake(run(build / name))
        run(options.cmake, "--install", build, "--prefix", source / "prefix")
        self.assertEqual([path.name for path in (source / "prefix").rglob("*") if path.is_file()], [name])
        commands = json.loads((build / "compile_commands.json").read_text()) if (
            build / "compile_commands.json").exists() else []
        self.assertFalse([entry["file"] for entry in commands if "-Werror" in entry["command"]])

    def test_add_subdirectory(self):
        self.check_subproject("by_add_subdirectory", f"add_subdirectory({options.source} vellum EXCLUDE_FROM_ALL)")

    def test_fetch_content(self):
        self.check_subproject("by_fetch_content", f"""
            include(FetchContent)
            FetchContent_Declare(vellum SOURCE_DIR {options.source})
            FetchContent_MakeAvailable(vellum)""")

    def test_layer_only(self):
        build = folder("layer")
        configure(options.source, build, "-DVELLUM_LAYER_ONLY=ON", missing=NOT_FOR_THE_LAYER)
        there = targets(build)
        self.assertIn("VkLayer_vellum_opacity_micromap", there)
        self.assertFalse({"vellum", "vellum_library", "vellum_bake", "layer_tests"} & there)
        library = "libVkLayer_vellum_opacity_micromap.so"
        manifest = build / "installed/VkLayer_vellum_opacity_micromap.json"
        for value, path in (("OFF", f"../../../{options.libdir}/{library}"), ("ON", library)):
            run(options.cmake, build, f"-DVELLUM_LAYER_BY_NAME={value}")
            self.assertEqual(json.loads(manifest.read_text())["layer"]["library_path"], path)

    def test_by_default_neither_tests_nor_errors_for_warnings(self):
        build = folder("default")
        configure(options.source, build)
        there = targets(build)
        self.assertLessEqual({"vellum", "vellum_library", "VkLayer_vellum_opacity_micromap"}, there)
        self.assertFalse({"layer_tests", "vellum-bench", "opacity_micromap"} & there)
        self.assertNotIn("-Werror", (build / "compile_commands.json").read_text())

    def test_contradictions(self):
        for arguments in (("-DVELLUM_LAYER_ONLY=ON", "-DVELLUM_LIBRARY_ONLY=ON"),
                          ("-DVELLUM_LIBRARY_ONLY=ON", "-DVELLUM_TESTS=ON")):
            output = configure(options.source, folder("contradiction"), *arguments, fails=True)
            self.assertIn("VELLUM_LIBRARY_ONLY", output)


def main():
    parser = argparse.ArgumentParser()
    for path in ("build", "scratch", "source"):
        parser.add_argument(f"--{path}", type=pathlib.Path, required=True)
    for word in ("cmake", "generator", "cc", "cxx", "libdir"):
        parser.add_argument(f"--{word}", required=True)
    rest = parser.parse_known_args(namespace=options)[1]
    index = folder("reused.json")
    os.environ.update(reuse_objects.variables(options.build, options.source, index, options.source))
    tests = unittest.main(argv=[sys.argv[0], *rest], exit=False)
    print(reuse_objects.report(index))
    return 0 if tests.result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
