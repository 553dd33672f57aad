# SPDX-License-Identifier: Apache-2.0
"""Builds mutants in a copy of the sources, of which one file at a time is changed.

Of the layer, only the layer, without tests. Of the baker, glTF, the verifier and the libraries, the programs of their tests. Both
with -O1. ccache makes it cheap to return to the original.
"""
import dataclasses
import filecmp
import hashlib
import os
import pathlib
import shutil
import subprocess
import time

LAYER = "VkLayer_vellum_opacity_micromap"
ORIGINAL = "original"


@dataclasses.dataclass(frozen=True)
class Target:
    """What is built of mutants: parts of the sources, options of CMake, targets of ninja, and the files to keep."""
    parts: tuple
    options: tuple
    names: tuple
    binaries: tuple
    others: tuple = ()


PROGRAMS = ("vellum_unit_test", "vellum_gltf_test", "vellum_verify_test", "vellum_library_test")
TARGETS = {
    "layer": Target(("CMakeLists.txt", "cmake", "include", "src"), ("-DVELLUM_LAYER_ONLY=ON",), (LAYER,),
                    (f"lib/lib{LAYER}.so",), (f"lib/{LAYER}.json",)),
    "programs": Target(("CMakeLists.txt", "cmake", "include", "src", "tests"), ("-DVELLUM_TESTS=ON",), PROGRAMS,
                       (*(f"bin/{name}" for name in PROGRAMS), "lib/libvellum.so", "lib/libvellum_gltf.so")),
}


def folder_name(mutant_id):
    return mutant_id.replace("/", "_").replace(":", "-")


def copy_changed(source, target):
    """Copies a file unless it is there already. The copy is new, so that ninja builds what depends on it."""
    if not os.path.exists(target) or not filecmp.cmp(source, target, shallow=False):
        shutil.copyfile(source, target)
    return target


class Builder:
    def __init__(self, root, work, layers, jobs, target):
        self.root = root
        self.target = TARGETS[target]
        self.source = work / "source"
        self.build = work / "build"
        self.layers = layers
        self.jobs = jobs
        self.original = None

    def prepare(self):
        """Copies and builds the original."""
        for part in self.target.parts:
            if (self.root / part).is_dir():
                shutil.copytree(self.root / part, self.source / part, copy_function=copy_changed, dirs_exist_ok=True)
            else:
                self.source.mkdir(parents=True, exist_ok=True)
                copy_changed(self.root / part, self.source / part)
        options = [*self.target.options, "-DVELLUM_INSTALL=OFF", "-DCMAKE_BUILD_TYPE=Release",
                   "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG"]
        if shutil.which("ccache"):
            options.append("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
        subprocess.run(["cmake", "-G", "Ninja", "-S", self.source, "-B", self.build, *options], check=True,
                       stdout=subprocess.DEVNULL)
        if not self.compile():
            raise SystemExit("the original does not compile:\n" + self.output)
        self.original = self.keep(ORIGINAL)

    def compile(self):
        done = subprocess.run(["ninja", "-C", self.build, f"-j{self.jobs}", *self.target.names], check=False, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.output = done.stdout
        return done.returncode == 0

    def keep(self, name):
        """Keeps what was built, stripped, in one folder. Returns its hash."""
        folder = self.layers / folder_name(name)
        folder.mkdir(parents=True, exist_ok=True)
        digest = hashlib.sha256()
        for binary in self.target.binaries:
            kept = folder / pathlib.PurePath(binary).name
            subprocess.run(["strip", "-s", "-o", kept, self.build / binary], check=True)
            digest.update(kept.read_bytes())
        for file in self.target.others:
            shutil.copy(self.build / file, folder)
        return digest.hexdigest()

    def make(self, mutant):
        """built, same (the binary of the original) or stillborn; and the seconds that it took."""
        path = self.source / mutant.file
        text = path.read_text(encoding="utf-8")
        begin = time.monotonic()
        try:
            path.write_text(mutant.apply(text), encoding="utf-8")
            result = "built" if self.compile() else "stillborn"
        finally:
            # The file is newer than what was made of the mutant; so ninja makes that again.
            path.write_text(text, encoding="utf-8")
            os.utime(path)
        if result == "built" and self.keep(mutant.id) == self.original:
            shutil.rmtree(self.layers / folder_name(mutant.id))
            result = "same"
        return result, round(time.monotonic() - begin, 1)
