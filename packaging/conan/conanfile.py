# SPDX-License-Identifier: Apache-2.0
"""Conan 2 recipe of the checkout that it is in: conan create packaging/conan -o "&:tools=True" """
import os
import re

from conan import ConanFile
from conan.errors import ConanInvalidConfiguration
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load, rmdir

required_conan_version = ">=2.0"
PARTS = ("LICENSE", "THIRD-PARTY.md", "README.md", "CHANGELOG.md", "SECURITY.md", "CMakeLists.txt",
         "cmake/*", "docs/*", "examples/*", "include/*", "src/*")


class VellumConan(ConanFile):
    name = "vellum"
    description = "Bakes opacity micromaps from alpha textures"
    license = "Apache-2.0"
    topics = ("vulkan", "ray-tracing", "opacity-micromap", "gltf")
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    # tools: the command vellum, the Vulkan layer and libvellum_gltf. The build then needs Python.
    options = {"shared": [True, False], "fPIC": [True, False], "tools": [True, False],
               "images": [True, False], "meshes": [True, False]}
    default_options = {"shared": True, "fPIC": True, "tools": False, "images": True, "meshes": True,
                       "boost/*:header_only": True}
    implements = ["auto_shared_fpic"]

    @property
    def _root(self):
        return os.path.join(self.recipe_folder, "..", "..")

    def set_version(self):
        header = load(self, os.path.join(self._root, "include", "vellum", "vellum.h"))
        numbers = re.search(r"VELLUM_HEADER_VERSION VELLUM_MAKE_VERSION\((\d+), (\d+), (\d+)\)", header)
        self.version = ".".join(numbers.groups())

    def export_sources(self):
        for part in PARTS:
            copy(self, part, self._root, self.export_sources_folder)

    def validate(self):
        if self.options.tools and not self.options.shared:
            raise ConanInvalidConfiguration("tools needs shared=True: libvellum_gltf brings the libraries that it uses")

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        if not self.options.tools:
            return
        for reference in ("boost/[>=1.74]", "cli11/[>=2.3]", "fmt/[>=9]", "openssl/[>=3 <4]", "rapidjson/[>=cci.20220822]",
                          "stb/[>=cci.20220909]", "vulkan-headers/[>=1.3.239]",
                          "vulkan-loader/[>=1.3.239]", "zlib/[>=1.2.11 <2]"):
            self.requires(reference)
        if self.options.images:
            self.requires("libavif/[>=1]")
            self.requires("libjpeg-turbo/[>=3]")
            self.requires("libpng/[>=1.6]")
            self.requires("libwebp/[>=1.3]")
        if self.options.meshes:
            self.requires("draco/[>=1.5]")
            self.requires("meshoptimizer/[>=0.20]")

    def build_requirements(self):
        self.tool_requires("cmake/[>=3.25]")
        if self.options.tools:
            self.tool_requires("glslang/[>=1.3.239]")
            self.tool_requires("spirv-tools/[>=1.3.239]")

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["VELLUM_LIBRARY_ONLY"] = not self.options.tools
        toolchain.cache_variables["VELLUM_IMAGE_LIBRARIES"] = bool(self.options.images)
        toolchain.cache_variables["VELLUM_MESH_LIBRARIES"] = bool(self.options.meshes)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()
        for notice in ("LICENSE", "THIRD-PARTY.md"):
            copy(self, notice, self.source_folder, os.path.join(self.package_folder, "licenses"))
        rmdir(self, os.path.join(self.package_folder, "lib", "pkgconfig"))
        rmdir(self, os.path.join(self.package_folder, "share", "doc"))

    def package_info(self):
        self.cpp_info.set_property("cmake_file_name", "Vellum")
        core = self.cpp_info.components["vellum"]
        core.libs = ["vellum"]
        core.set_property("cmake_target_name", "Vellum::vellum")
        core.set_property("pkg_config_name", "vellum")
        if not self.options.shared:
            core.system_libs = ["stdc++", "m", "pthread"]
        if self.options.tools:
            gltf = self.cpp_info.components["gltf"]
            gltf.libs = ["vellum_gltf"]
            gltf.requires = ["vellum"]
            gltf.set_property("cmake_target_name", "Vellum::gltf")
            gltf.set_property("pkg_config_name", "vellum-gltf")
