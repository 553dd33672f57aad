#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Installs a build into a scratch prefix, moves that, and uses what lies there as a user who has not seen the sources would.

Run by ctest, with the options that main() has; what comes after them goes to unittest.
"""
import argparse
import base64
import fnmatch
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import unittest
import zlib

options = argparse.Namespace()
SANITIZERS = ["-fsanitize=address,undefined"]
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-pedantic"]
FUNCTIONS = {"vellumBake", "vellumDestroyMicromap", "vellumGetBakeVersion", "vellumGetGeometryInfo",
             "vellumGetMicromapInfo", "vellumGetState", "vellumGetVersion", "vellumInitBakeInput", "vellumInitBakeOptions",
             "vellumInitTexture", "vellumIsFlagSet", "vellumResultName", "vellumWriteIndices"}
SPIRV_FUNCTIONS = {"vellumDestroySpirv", "vellumEditSpirv", "vellumGetSpirvEntryPointInfo", "vellumGetSpirvInfo",
                   "vellumInitSpirvOptions"}
GLTF_FUNCTIONS = {"vellumBakeGltf", "vellumBakeGltfMemory", "vellumCheckGltf", "vellumCheckGltfMemory", "vellumReadGltfMemory",
                   "vellumDestroyGltf", "vellumFindGltfPrimitive",
                  "vellumGetGltfInfo", "vellumGetGltfMicromapInfo", "vellumGetGltfPrimitiveInfo",
                  "vellumInitGltfBakeOptions", "vellumReadGltf"}
NOTICES = {"share/doc/vellum/LICENSE", "share/doc/vellum/THIRD-PARTY.md"}


def run(*command, environment=None, folder=None):
    """The output of a command that must succeed."""
    done = subprocess.run([str(word) for word in command], env={**os.environ, **(environment or {})}, cwd=folder,
                          text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(str(word) for word in command)}: status {done.returncode}\n{done.stdout}")
    return done.stdout


def triangle():
    """A .gltf with one alpha-tested triangle over a texture that is opaque on the left."""
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    def uri(kind, data):
        return f"data:{kind};base64,{base64.b64encode(data).decode()}"

    row = bytes([0]) + bytes([255, 255, 255, 255]) * 8 + bytes([255, 255, 255, 0]) * 8
    png = (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 16, 16, 8, 6, 0, 0, 0)) +
           chunk(b"IDAT", zlib.compress(row * 16)) + chunk(b"IEND", b""))
    buffer = struct.pack("<9f6f", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0.1, 0.1, 0.9, 0.1, 0.1, 0.9)
    return json.dumps({
        "asset": {"version": "2.0"},
        "meshes": [{"name": "leaf", "primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": uri("image/png", png)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
        "buffers": [{"uri": uri("application/octet-stream", buffer), "byteLength": 60}]})


def flags():
    return SANITIZERS if options.sanitize else []


class Installation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(options.scratch, ignore_errors=True)
        first = options.scratch / "first"
        run(options.cmake, "--install", options.build, "--prefix", first)
        # No installed file may depend on the path of installation.
        cls.prefix = options.scratch / "second place"
        first.rename(cls.prefix)
        cls.lib = cls.prefix / options.libdir
        cls.examples = cls.prefix / "share/doc/vellum/examples"

    def check_example(self, output):
        """All three print these; so small a difference as rounding of the alpha makes none at a level of 5."""
        self.assertRegex(output, r"\b\d+ bytes of data for \d of 2 triangles")
        counts = re.search(r"micro-triangles: (\d+) transparent, (\d+) opaque, (\d+) unknown", output)
        self.assertIsNotNone(counts, output)
        self.assertEqual(sum(map(int, counts.groups())), 2 * 4**5)
        self.assertGreater(min(map(int, counts.groups())), 20, output)

    def build_by_cmake(self, example, compiler, program="bake", arguments=()):
        return run(self.configure_and_build(example, compiler) / program, *arguments)

    def configure_and_build(self, example, compiler, disabled=("PNG", "Vulkan"), more=()):
        folder = options.scratch / f"cmake-{example}"
        run(options.cmake, "-S", self.examples / example, "-B", folder, "-G", options.generator,
            f"-DCMAKE_PREFIX_PATH={self.prefix}", f"-D{compiler}",
            f"-DCMAKE_{compiler.split('_')[1]}_FLAGS={' '.join([*WARNINGS, *more, *flags()])}",
            # Programs that use the library do not need what it is made of.
            *(f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in disabled))
        run(options.cmake, "--build", folder)
        return folder

    def build_by_pkg_config(self, example, *compiler, package="vellum", source="bake.c*", arguments=()):
        program = options.scratch / f"pkg-config-{example}"
        options_of_package = run("pkg-config", "--cflags", "--libs", package, environment={
            "PKG_CONFIG_PATH": str(self.lib / "pkgconfig")})
        words = options_of_package.replace("\\ ", "\0").split()
        source, = (self.examples / example).glob(source)
        run(*compiler, *WARNINGS, *flags(), source, "-o", program, *(word.replace("\0", " ") for word in words))
        return run(program, *arguments, environment={"LD_LIBRARY_PATH": str(self.lib)})

    def test_c_by_find_package(self):
        self.check_example(self.build_by_cmake("c", f"CMAKE_C_COMPILER={options.cc}"))

    def test_cpp_by_find_package(self):
        self.check_example(self.build_by_cmake("cpp", f"CMAKE_CXX_COMPILER={options.cxx}"))

    def test_opacity_micromap_by_find_package(self):
        """Both programs, with the installed layer: equal counts, whatever the extension."""
        folder = self.configure_and_build("opacity_micromap", f"CMAKE_CXX_COMPILER={options.cxx}", disabled=("PNG",),
                                          more=["-Wno-missing-field-initializers"])
        environment = {"VK_LAYER_PATH": str(self.prefix / "share/vulkan/explicit_layer.d"),
                       "ASAN_OPTIONS": "detect_leaks=0"}
        for manifest in pathlib.Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"):
            environment |= {"VK_DRIVER_FILES": str(manifest), "VK_ICD_FILENAMES": str(manifest)}
        counts = set()
        for extension in ("ext", "khr"):
            output = run(folder / f"opacity_micromap_{extension}", environment=environment)
            self.assertIn(f"VK_{extension.upper()}_opacity_micromap on ", output)
            counts.add(output.splitlines()[1])
        self.assertEqual(len(counts), 1, counts)
        counted = r"^(\d+ of 40000 rays pass), (\d+) alpha tests, 0 rays differ from the texture$"
        passing, tests = re.search(counted, counts.pop()).groups()
        documented = re.search(counted, (options.source / "docs/vulkan-integration.md").read_text(), re.M).groups()
        self.assertEqual(passing, documented[0])
        self.assertAlmostEqual(int(tests), int(documented[1]), delta=10)  # drivers differ in what lies on edges

    def test_c_by_pkg_config(self):
        self.check_example(self.build_by_pkg_config("c", options.cc, "-std=c99"))

    def test_cpp_by_pkg_config(self):
        self.check_example(self.build_by_pkg_config("cpp", options.cxx, "-std=c++20"))

    def test_python(self):
        environment = {"VELLUM_LIBRARY_PATH": str(self.lib), "PYTHONPATH": str(options.source / "bindings/python"),
                       "PYTHONDONTWRITEBYTECODE": "1"}
        if options.sanitize:
            environment["LD_PRELOAD"] = " ".join(
                run(options.cc, f"-print-file-name={name}").strip() for name in ("libasan.so", "libstdc++.so.6"))
            environment["ASAN_OPTIONS"] = "detect_leaks=0"
        output = run(sys.executable, self.examples / "python/bake.py", environment=environment)
        self.check_example(output)
        self.assertIn("level is 13, not 0 to 12 or VELLUM_LEVEL_AUTOMATIC", output)

    def check_gltf_example(self, build):
        folder = options.scratch / "gltf-files"
        folder.mkdir(exist_ok=True)
        (folder / "leaf.gltf").write_text(triangle())
        output = build((folder / "leaf.gltf", folder / "leaf.omm.gltf"))
        self.assertRegex(output, r"^1 micromaps by EXT_mesh_opacity_micromap\n"
                         r"micromap 0: \d+ bytes of data for 1 triangles: "
                         r'1 of level \d, 4-state\nmesh 0 "leaf" primitive 0: micromap 0, 1 triangles, '
                         r"0 of them with a special index; 1 of level \d, 4-state\n$")

    def test_gltf_by_find_package(self):
        self.check_gltf_example(lambda files: self.build_by_cmake(
            "gltf", f"CMAKE_C_COMPILER={options.cc}", "micromaps", files))

    def test_gltf_by_pkg_config(self):
        self.check_gltf_example(lambda files: self.build_by_pkg_config(
            "gltf", options.cc, "-std=c99", package="vellum-gltf", source="micromaps.c", arguments=files))

    def test_gpu_baker_by_find_package(self):
        project = options.scratch / "gpubake"
        project.mkdir()
        (project / "CMakeLists.txt").write_text("""
            cmake_minimum_required(VERSION 3.21)
            project(gpubake LANGUAGES CXX)
            set(CMAKE_CXX_STANDARD 20)
            find_package(Vellum REQUIRED COMPONENTS GpuBake)
            add_executable(output output.cpp)
            target_link_libraries(output PRIVATE Vellum::gpubake)
            """)
        (project / "output.cpp").write_text("""
            #include <cstdio>
            #include <vellum/gpu_bake.h>
            int main()
            {
                vellum::GpuBakeOutput output{};
                output.triangles[5] = 3;
                std::printf("%llu bytes\\n", static_cast<unsigned long long>(
                    vellum::GpuBaker::recordBytes(output)));
            }
            """)
        run(options.cmake, "-S", project, "-B", project / "build", "-G", options.generator,
            f"-DCMAKE_PREFIX_PATH={self.prefix}", f"-DCMAKE_CXX_COMPILER={options.cxx}",
            f"-DCMAKE_CXX_FLAGS={' '.join(WARNINGS + flags())}")
        run(options.cmake, "--build", project / "build")
        self.assertEqual(run(project / "build/output"), "24 bytes\n")

    def test_version_of_the_package(self):
        project = options.scratch / "versions"
        project.mkdir()
        major, minor, _ = options.version.split(".")
        (project / "CMakeLists.txt").write_text(f"""
            cmake_minimum_required(VERSION 3.16)
            project(versions LANGUAGES NONE)
            find_package(Vellum {major}.{minor} REQUIRED)
            if(NOT Vellum_VERSION STREQUAL "{options.version}")
              message(FATAL_ERROR "version ${{Vellum_VERSION}}")
            endif()
            find_package(Vellum {major}.{int(minor) + 1} QUIET)
            if(Vellum_FOUND)
              message(FATAL_ERROR "later version found")
            endif()
            find_package(Vellum COMPONENTS Gtlf)
            if(Vellum_FOUND)
              message(FATAL_ERROR "a component that does not exist was found")
            endif()
            """)
        output = run(options.cmake, "-S", project, "-B", project / "build", "-G", options.generator,
                     f"-DCMAKE_PREFIX_PATH={self.prefix}", "--log-level=STATUS")
        self.assertIn("has no component Gtlf", " ".join(output.split()))
        self.assertEqual(run("pkg-config", "--modversion", "vellum", environment={
            "PKG_CONFIG_PATH": str(self.lib / "pkgconfig")}).strip(), options.version)

    def test_headers_compile_alone(self):
        include = self.prefix / "include"
        compilers = {"c": [options.cc], "c++": [options.cxx]}
        if shutil.which("clang"):
            compilers["c"].append("clang")
            compilers["c++"].append("clang++")
        for header, language, standard in (("vellum.h", "c", "c99"), ("vellum.h", "c", "c11"),
                                           ("vellum.h", "c++", "c++11"), ("vellum.h", "c++", "c++20"),
                                           ("bake.h", "c++", "c++20"), ("spirv.h", "c", "c99"),
                                           ("spirv.h", "c++", "c++11"), ("gltf.h", "c", "c99"),
                                           ("gltf.h", "c++", "c++11")):
            more = ["-Wconversion", "-Wshadow"] + (["-Wold-style-cast"] if language == "c++" else [])
            source = options.scratch / f"alone.{'c' if language == 'c' else 'cpp'}"
            # Twice, for the guard; and every macro of it.
            source.write_text(f"#include <vellum/{header}>\n#include <vellum/{header}>\n"
                              "int use(void);\nint use(void)\n{\n    return VELLUM_LEVEL_AUTOMATIC + "
                              "(VELLUM_NO_BUDGET > VELLUM_HEADER_VERSION ? 1 : 0);\n}\n")
            for compiler in compilers[language]:
                run(compiler, f"-std={standard}", "-fsyntax-only", *WARNINGS, *more, f"-I{include}", source)

    def check_exports(self, name, version, headers, needs):
        """The functions of the headers under their version, and nothing else."""
        library = self.lib / f"{name}.so"
        lines = [line.split() for line in run("nm", "--dynamic", "--defined-only", library).splitlines()]
        symbols = {words[2]: words[1] for words in lines if words[1] != "A"}  # A: the version itself
        self.assertEqual(set(symbols), {f"{function}@@{version}" for functions in headers.values() for function in functions})
        self.assertEqual(set(symbols.values()), {"T"})
        for header, functions in headers.items():
            text = (self.prefix / "include/vellum" / header).read_text()
            self.assertEqual(set(re.findall(r"VELLUM_API[^;]*?\b(vellum\w+)\(", text)), functions)
        dynamic = run("readelf", "--dynamic", "--wide", library)
        minor = ".".join(options.version.split(".")[:2])
        self.assertIn(f"Library soname: [{name}.so.{minor}]", dynamic)
        self.assertTrue((self.lib / f"{name}.so.{minor}").exists())
        self.assertNotRegex(dynamic, "RPATH|RUNPATH")
        for needed in re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic):
            self.assertRegex(needed, rf"^(libc|libm|libgcc_s|libstdc\+\+|ld-linux-[\w-]+{needs}"
                             + (r"|libasan|libubsan" if options.sanitize else "") + r")\.so")

    def test_exports(self):
        self.check_exports("libvellum", "VELLUM_0.1", {"vellum.h": FUNCTIONS, "spirv.h": SPIRV_FUNCTIONS}, "")
        self.check_exports("libvellum_gltf", "VELLUM_GLTF_0.1", {"gltf.h": GLTF_FUNCTIONS},
                           "|libdraco|libmeshoptimizer|libavif|libwebp|libpng16|libjpeg|libcrypto")

    def test_layer_and_command(self):
        manifest = self.prefix / "share/vulkan/explicit_layer.d/VkLayer_vellum_opacity_micromap.json"
        layer = json.loads(manifest.read_text())["layer"]
        self.assertTrue((self.prefix / "share/man/man7" / f"{layer['name']}.7").exists())
        self.assertEqual(layer["name"], "VK_LAYER_VELLUM_opacity_micromap")
        self.assertTrue((manifest.parent / layer["library_path"]).exists(), layer["library_path"])
        self.assertIn("strict", [setting["key"] for setting in layer["features"]["settings"]])
        self.assertIn("render", run(self.prefix / "bin/vellum", "--help"))
        self.assertTrue((self.prefix / "include/vellum/vulkan_opacity_micromap.h").exists())

    def test_nothing_else_is_installed(self):
        there = {str(path.relative_to(self.prefix)) for path in self.prefix.rglob("*") if not path.is_dir()}
        lib = options.libdir
        patterns = (r"bin/vellum", r"include/vellum/\w+\.h", rf"{lib}/libvellum(_gltf)?\.so[.\d]*",
                    rf"{lib}/libvellum-gpubake\.a",
                    rf"{lib}/libVkLayer_vellum_opacity_micromap\.so", rf"{lib}/cmake/Vellum/Vellum[\w-]+\.cmake",
                    rf"{lib}/cmake/Vellum/opacity_micromap_mode\.cmake",
                    rf"{lib}/pkgconfig/vellum(-gltf)?\.pc", r"share/vulkan/explicit_layer\.d/[\w.]+\.json",
                    r"share/man/man1/vellum(-\w+)?\.1", r"share/man/man7/VK_LAYER_VELLUM_opacity_micromap\.7",
                    r"share/vellum/schema\.json", r"share/bash-completion/completions/vellum",
                    r"share/zsh/site-functions/_vellum", r"share/fish/vendor_completions\.d/vellum\.fish",
                    r"share/doc/vellum/examples/\w+/[\w./-]+", r"share/doc/vellum/docs/[\w./-]+\.(md|png|svg)",
                    r"share/doc/vellum/(LICENSE|(THIRD-PARTY|README|CHANGELOG|SECURITY)\.md)")
        self.assertEqual([path for path in sorted(there) if not any(re.fullmatch(p, path) for p in patterns)], [])

    def installed(self, component):
        prefix = options.scratch / f"component-{component}"
        run(options.cmake, "--install", options.build, "--prefix", prefix, "--component", component)
        return {str(path.relative_to(prefix)) for path in prefix.rglob("*") if not path.is_dir()}

    def test_components(self):
        """Each file but the licence is in one component."""
        lib = options.libdir
        files = {component: self.installed(component) for component in ("layer", "command", "runtime", "devel", "doc")}
        for component, paths in files.items():
            self.assertLessEqual(NOTICES, paths, component)
        self.assertEqual(files["layer"] - NOTICES, {
            f"{lib}/libVkLayer_vellum_opacity_micromap.so",
            "share/vulkan/explicit_layer.d/VkLayer_vellum_opacity_micromap.json",
            "share/man/man7/VK_LAYER_VELLUM_opacity_micromap.7"})
        self.assertIn("bin/vellum", files["command"])
        self.assertEqual({re.sub(r"[.\d]*$", "", path) for path in files["runtime"] - NOTICES},
                         {f"{lib}/libvellum.so", f"{lib}/libvellum_gltf.so"})
        self.assertIn(f"{lib}/libvellum.so", files["devel"])
        self.assertNotIn(f"{lib}/libvellum.so", files["runtime"])
        self.assertEqual([path for path in files["doc"] if not path.startswith("share/doc/vellum/")], [])
        there = {str(path.relative_to(self.prefix)) for path in self.prefix.rglob("*") if not path.is_dir()}
        self.assertEqual(set.union(*files.values()), there)
        self.assertEqual(sum(len(paths - NOTICES) for paths in files.values()), len(there - NOTICES))

    def test_debian_packages(self):
        """The lists in debian/ have all files of the components, and nothing else."""
        soname = options.version.rpartition(".")[0]
        packages = {"layer": "vulkan-layer-vellum", "command": "vellum", "runtime": f"libvellum{soname}",
                    "devel": "libvellum-dev", "doc": "vellum-doc"}
        for component, package in packages.items():
            lines = (options.source / "debian" / f"{package}.install").read_text().splitlines()
            listed = [line.split()[0].removeprefix("usr/").replace("lib/*", options.libdir) for line in lines]
            patterns = [fnmatch.translate(entry) + "|" + fnmatch.translate(f"{entry}/*") for entry in listed]
            files = self.installed(component) - NOTICES
            self.assertEqual([path for path in sorted(files) if not any(re.match(p, path) for p in patterns)], [], package)
            self.assertEqual([p for p in patterns if not any(re.match(p, path) for path in files)], [], package)

    def test_links_of_the_installed_documents(self):
        """Each leads to something that is installed."""
        root = self.prefix / "share/doc/vellum"
        pages = list(root.rglob("*.md"))
        texts = {page: re.sub(r"(?ms)^```.*?^```", "", page.read_text()) for page in pages}
        dead = [f"{page.relative_to(root)}: {target}" for page in pages
                for target in re.findall(r"\]\(([^)#:\s]+)[)#]", texts[page]) if not (page.parent / target).exists()]
        self.assertEqual(dead, [])
        self.assertIn("(../../../../include/vellum/vellum.h)", texts[root / "docs/library.md"])
        self.assertIn(" CONTRIBUTING.md of the source", texts[root / "docs/design/map.md"])
        self.assertIn("The complete tables (`bench/results/lavapipe.md` of the source)", texts[root / "docs/performance.md"])
        self.assertIn("(design/gpu-baker.md)", texts[root / "docs/library.md"])

    def test_what_the_installed_documents_name(self):
        """A section that names a file or folder which is not installed has the words "the source". design/ is about the source."""
        root = self.prefix / "share/doc/vellum"
        found = []
        for page in [root / "README.md", *(root / "docs").glob("*.md")]:
            text = re.sub(r"(?s)<!--.*?-->", "", page.read_text())
            for section in re.split(r"(?m)^## ", text):
                found += [f"{page.name}: {section.splitlines()[0]}: {name}" for name in
                          re.findall(r"(?<![\w/.])(?:bench|bindings|cmake|packaging|scripts|tests)/[\w./-]*\w", section)
                          if not re.search(r"\bthe source\b", section, re.I) and not (root / name).exists()]
            if page.name != "messages.md":
                names = set(re.findall(r"`(\w+\.(?:cpp|py|js))`", text))
                found += [f"{page.name}: {name}" for name in sorted(names) if not list(root.rglob(name))]
        self.assertEqual(found, [])


def main():
    parser = argparse.ArgumentParser()
    for path in ("build", "scratch", "source"):
        parser.add_argument(f"--{path}", type=pathlib.Path, required=True)
    for word in ("cmake", "generator", "cc", "cxx", "libdir", "version"):
        parser.add_argument(f"--{word}", required=True)
    parser.add_argument("--sanitize", action="store_true")
    rest = parser.parse_known_args(namespace=options)[1]
    unittest.main(argv=[sys.argv[0], *filter(None, rest)])  # CMake gives an empty word for no --sanitize


if __name__ == "__main__":
    main()
