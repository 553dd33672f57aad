#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What can be tested of the add-on for Blender without Blender: its ZIP, versions, syntax, and how it reads micromaps.
blender_test.py tests the rest.

usage: blender_package_test.py <folder of the libraries> <vellum> [unittest's arguments]
"""
import ast
import importlib.util
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import tomllib
import unittest
import zipfile

LIBRARIES, COMMAND = sys.argv[1:3]
ROOT = pathlib.Path(__file__).resolve().parents[2]
PACK = ROOT / "bindings/blender/pack"


def run(*words, status=0):
    done = subprocess.run([str(word) for word in words], check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != status:
        raise AssertionError(f"{' '.join(map(str, words))}: status {done.returncode}\n{done.stdout}")
    return done.stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="vellum-blender-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.zip = cls.folder / "addon.zip"
        run(sys.executable, PACK, LIBRARIES, cls.zip)
        with zipfile.ZipFile(cls.zip) as archive:
            archive.extractall(cls.folder)
        cls.addon = cls.folder / "io_vellum"
        cls.version = run(COMMAND, "--version").split()[1]

    def test_content(self):
        interface = self.version.rpartition(".")[0]
        for name in ("LICENSE", "THIRD-PARTY.md", "vellum/__init__.py", f"vellum/libvellum.so.{interface}",
                     f"vellum/libvellum_gltf.so.{interface}"):
            self.assertTrue((self.addon / name).is_file(), name)
        again = self.folder / "again.zip"
        licenses = self.folder / "licenses"
        licenses.mkdir()
        run("env", "SOURCE_DATE_EPOCH=1", sys.executable, PACK, LIBRARIES, again)  # as some build systems have it
        self.assertEqual(again.read_bytes(), self.zip.read_bytes())
        (licenses / "versions.txt").write_text("draco 1.5 draco\n", encoding="utf-8")
        run(sys.executable, PACK, LIBRARIES, again, licenses)
        with zipfile.ZipFile(again) as archive:
            self.assertEqual(archive.read("io_vellum/licenses/versions.txt"), b"draco 1.5 draco\n")

    def test_libraries_are_missing(self):
        output = run(sys.executable, PACK, self.folder / "nowhere", self.folder / "none.zip", status=1)
        self.assertIn("nowhere has no libvellum and libvellum_gltf", output)
        self.assertEqual([path.name for path in self.folder.glob("none*")], [])

    def test_versions(self):
        tree = ast.parse((self.addon / "__init__.py").read_text(encoding="utf-8"))
        info, = (ast.literal_eval(each.value) for each in tree.body
                 if isinstance(each, ast.Assign) and each.targets[0].id == "bl_info")
        manifest = tomllib.loads((self.addon / "blender_manifest.toml").read_text(encoding="utf-8"))
        self.assertEqual(".".join(map(str, info["version"])), self.version)
        self.assertEqual(manifest["version"], self.version)
        self.assertEqual((manifest["id"], manifest["name"], manifest["type"]), (self.addon.name, info["name"], "add-on"))
        # What Blender 4.2 requires of them.
        self.assertLessEqual({"schema_version", "tagline", "maintainer", "license", "blender_version_min"}, set(manifest))
        self.assertLessEqual(max(map(len, [manifest["tagline"], *manifest["permissions"].values()])), 72)

    def test_syntax(self):
        found = sorted(self.addon.rglob("*.py"))
        self.assertGreater(len(found), 5)
        for path in found:
            compile(path.read_text(encoding="utf-8"), path, "exec")

    @unittest.skipUnless(importlib.util.find_spec("numpy"), "numpy is not installed")
    def test_known_surface(self):
        """That of the command, for a model with many instances."""
        model = self.folder / "tree.glb"
        run(sys.executable, ROOT / "examples/python/tree.py", model)
        sys.path.insert(0, str(self.addon))
        import states
        import vellum
        scene, rows = states.Scene(model.read_bytes()), json.loads(run(COMMAND, "sweep", "--json", "--max-level", 6, model))
        compared = [row for row in rows["files"][0]["rows"] if row["states"] == 4 and row["level"]]
        self.assertEqual([row["level"] for row in compared], [1, 2, 3, 4, 5, 6])
        for row in compared:
            baked, report = vellum.bake_gltf(model.read_bytes(), level=row["level"])
            self.assertEqual(report.micromap_size, row["bytes"])
            self.assertAlmostEqual(states.known_share(scene, vellum.read_gltf(baked)), row["known"], 6)

    @unittest.skipUnless(importlib.util.find_spec("numpy"), "numpy is not installed")
    def test_pictures_of_states(self):
        """A material without a texture, which is one state all over, has no picture."""
        model = self.folder / "pictures.glb"
        run(sys.executable, ROOT / "examples/python/tree.py", model)
        sys.path.insert(0, str(self.addon))
        import states
        import vellum
        data = model.read_bytes()
        pictures = states.draw_states(states.Scene(data), vellum.read_gltf(vellum.bake_gltf(data)[0]), 64)
        self.assertEqual([picture.any() for _, picture in pictures.values()], [True])
        length, = struct.unpack_from("<I", data, 12)
        text = json.loads(data[20:20 + length])
        for material in text["materials"]:
            material.get("pbrMetallicRoughness", {}).pop("baseColorTexture", None)
        changed = json.dumps(text).encode()
        changed += b" " * (-len(changed) % 4)
        rest = data[20 + length:]
        bare = data[:8] + struct.pack("<II4s", 20 + len(changed) + len(rest), len(changed), b"JSON") + changed + rest
        baked = vellum.read_gltf(vellum.bake_gltf(bare)[0])
        self.assertEqual(len(baked.primitives), len(pictures))
        self.assertEqual(states.draw_states(states.Scene(bare), baked, 64), {})


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
