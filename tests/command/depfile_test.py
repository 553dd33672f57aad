#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds with Ninja and Make by the depfiles of `vellum bake`, with names that have to be escaped.

usage: depfile_test.py VELLUM
"""
import base64
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import urllib.parse
import zlib

VELLUM = pathlib.Path(sys.argv.pop(1)).resolve()
FOLDER = "a b: #1 $x"
IMAGE = "leaf #2 $y \u00e9.png"


def png(alpha):
    """An image of 8 x 8 texels, half of which have this alpha."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    row = b"\0" + b"\xff\xff\xff\xff" * 4 + bytes((255, 255, 255, alpha)) * 4
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 8, 8, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(row * 8)) + chunk(b"IEND", b""))


def write_gltf(folder, mode="MASK"):
    folder.mkdir(parents=True, exist_ok=True)
    positions = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    uvs = struct.pack("<6f", 0, 0, 1, 0, 0, 1)
    (folder / "mesh.bin").write_bytes(positions + uvs)
    (folder / IMAGE).write_bytes(png(0))
    (folder / "tree.gltf").write_text(json.dumps({
        "asset": {"version": "2.0"},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{"alphaMode": mode, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": urllib.parse.quote(IMAGE)}],
        "accessors": [{"bufferView": view, "componentType": 5126, "count": 3, "type": kind}
                      for view, kind in ((0, "VEC3"), (1, "VEC2"))],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
        "buffers": [{"uri": "mesh.bin", "byteLength": 60}],
    }))


def run(*words, folder):
    return subprocess.run([str(word) for word in words], cwd=folder, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, timeout=60, check=False)


class Depfile(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        self.input = self.root / FOLDER
        self.time = 1_000_000_000
        write_gltf(self.input)
        for file in self.input.iterdir():
            self.touch(file)

    def touch(self, file):
        """Later than everything so far, and earlier than now."""
        self.time += 10
        os.utime(file, (self.time, self.time))

    def check(self, build, up_to_date):
        """`build` makes tree.omm.gltf beside the input."""
        output = self.input / "tree.omm.gltf"

        def rebuilt():
            before = output.stat().st_mtime_ns if output.exists() else 0
            done = run(*build, folder=self.root)
            self.assertEqual(done.returncode, 0, done.stdout)
            after = output.stat().st_mtime_ns
            self.assertEqual(after == before, up_to_date in done.stdout, done.stdout)
            return after != before

        self.assertTrue(rebuilt())
        self.assertFalse(rebuilt())
        for name, content in (("tree.gltf", None), ("mesh.bin", None), (IMAGE, png(64))):
            if content:
                (self.input / name).write_bytes(content)
            os.utime(self.input / name)
            self.assertTrue(rebuilt(), name)
            self.assertFalse(rebuilt(), name)
        # A file that is no longer named, and no longer there.
        text = (self.input / "tree.gltf").read_text()
        data = "data:application/octet-stream;base64," + base64.b64encode((self.input / "mesh.bin").read_bytes()).decode()
        (self.input / "tree.gltf").write_text(text.replace("mesh.bin", data))
        (self.input / "mesh.bin").unlink()
        self.assertTrue(rebuilt())
        self.assertFalse(rebuilt())

    def write_makefile(self):
        name = FOLDER.replace("$", "$$")
        target = name.replace(" ", "\\ ").replace("#", "\\#").replace(":", "\\:")
        (self.root / "Makefile").write_text(f"""
{target}/tree.omm.gltf:
\t'{VELLUM}' bake '{name}/tree.gltf' -o '$@' --depfile tree.d --cache cache
-include tree.d
""")

    @unittest.skipUnless(shutil.which("ninja"), "there is no ninja")
    def test_ninja(self):
        folder = FOLDER.replace("$", "$$").replace(" ", "$ ").replace(":", "$:")
        (self.root / "build.ninja").write_text(f"""
rule bake
  command = '{VELLUM}' bake $in -o $out --depfile tree.d --cache cache
  depfile = tree.d
  deps = gcc
build {folder}/tree.omm.gltf: bake {folder}/tree.gltf
""")
        self.check(["ninja", "-v"], "no work to do")

    @unittest.skipUnless(shutil.which("make"), "there is no make")
    def test_make(self):
        self.write_makefile()
        self.check(["make"], "up to date")

    @unittest.skipUnless(shutil.which("make"), "there is no make")
    def test_a_failed_bake_is_repeated(self):
        self.write_makefile()
        self.assertEqual(run("make", folder=self.root).returncode, 0)
        for name, content in ((IMAGE, b"x"), ("tree.gltf", b"x")):
            whole = (self.input / name).read_bytes()
            (self.input / name).write_bytes(content)
            for _ in range(2):
                done = run("make", folder=self.root)
                self.assertNotEqual(done.returncode, 0, done.stdout)
            (self.input / name).write_bytes(whole)
            done = run("make", folder=self.root)
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertNotIn("up to date", done.stdout)
            self.assertIn("up to date", run("make", folder=self.root).stdout)

    def test_all_outputs_of_a_folder(self):
        write_gltf(self.root / "in/sub", mode="OPAQUE")
        shutil.copytree(self.input, self.root / "in/other")
        done = run(VELLUM, "bake", "in", "-o", "out", "--depfile", "deps/all.d", folder=self.root)
        self.assertEqual(done.returncode, 0, done.stdout)
        text = (self.root / "deps/all.d").read_text(encoding="utf-8")
        image = IMAGE.replace("#", "\\#").replace("$", "$$").replace(" ", "\\ ")
        for part in ("other", "sub"):
            self.assertIn(f"out/{part}/tree.gltf: \\\n  in/{part}/tree.gltf \\\n  in/{part}/{image} \\\n  in/{part}/mesh.bin\n", text)
            self.assertIn(f"\nin/{part}/mesh.bin:\n", text)

    def test_rejected(self):
        for words in (["-", "--depfile", "x.d"], ["out.gltf", "--depfile", "-"], ["out.gltf", "--depfile", "x.gltf"],
                      ["out.gltf", "--dry-run", "--depfile", "x.d"],
                      ["out.gltf", "--depfile", "x.d", "--log", "log", "--resume", "log"]):
            done = run(VELLUM, "bake", self.input / "tree.gltf", *words, folder=self.root)
            self.assertEqual(done.returncode, 2, done.stdout)
        # A file that is read, or written otherwise.
        (self.root / "list").write_text(f"{FOLDER}/tree.gltf\n")
        for depfile in (self.input / IMAGE, self.input / "mesh.bin", f"out/{IMAGE}", "list", "log"):
            before = {file: file.read_bytes() for file in [*self.input.iterdir(), self.root / "list"]}
            done = run(VELLUM, "bake", "--files", "list", "-o", "out", "--log", "log", "--depfile", depfile, folder=self.root)
            self.assertEqual(done.returncode, 2, done.stdout)
            self.assertEqual(before, {file: file.read_bytes() for file in before})
        (self.root / "list").write_text(f"{FOLDER}/tree.gltf\tout/a%b.gltf\n")
        done = run(VELLUM, "bake", "--files", "list", "--depfile", "x.d", folder=self.root)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("pattern", done.stdout)
        # Make would not rebuild.
        write_gltf(self.root / "a=b")
        for given, output in ((f"{FOLDER}/tree.gltf", "out/a=b.gltf"), ("a=b/tree.gltf", "out/ab.gltf")):
            done = run(VELLUM, "bake", given, output, "--depfile", "x.d", folder=self.root)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn("assignment", done.stdout)
        (self.root / "a\nb").mkdir()
        shutil.copy(self.input / "tree.gltf", self.root / "a\nb")
        done = run(VELLUM, "bake", "a\nb/tree.gltf", "--copy", "--depfile", "x.d", folder=self.root)
        self.assertEqual(done.returncode, 1, done.stdout)


if __name__ == "__main__":
    unittest.main()
