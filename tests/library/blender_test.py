#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The add-on for Blender as its users install it, in Blender without a window. What it writes is compared with what the command
makes of Blender's plain export.

usage: blender_test.py <folder of the libraries> <vellum> [PICTURE]    PICTURE: where to render the preview to
"""
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

try:
    import bpy
except ImportError:  # started by a shell
    blender = shutil.which("blender")
    if not blender:
        sys.exit("blender_test.py: blender is not installed")
    with tempfile.TemporaryDirectory(prefix="vellum-blender-") as user_folder:
        # Blender takes the modules of the first Python in PATH; Debian's is to be that of the system.
        sys.exit(subprocess.run(
            [blender, "--background", "--factory-startup", "--python-exit-code", "1", "--python", __file__, "--", *sys.argv[1:]],
            check=False, env={**os.environ, "PATH": os.defpath, "BLENDER_USER_SCRIPTS": user_folder,
                              "BLENDER_USER_CONFIG": user_folder, "PYTHONDONTWRITEBYTECODE": "1"}).returncode)

import numpy  # noqa: E402: Blender's

LIBRARIES, COMMAND, *PICTURES = sys.argv[sys.argv.index("--") + 1:]
ROOT = pathlib.Path(__file__).resolve().parents[2]
SIZE = 128  # texels of the texture
DATA = ("objects", "meshes", "materials", "images", "collections", "cameras")


def vellum(*words, status=0):
    """The output of the command."""
    done = subprocess.run([COMMAND, *map(str, words)], check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != status:
        raise AssertionError(f"vellum {' '.join(map(str, words))}: status {done.returncode}\n{done.stdout}")
    return done.stdout


def leaf():
    """Two leaves and a stem, of which no mirror image or rotation is the same; row 0 is the lowest: (SIZE, SIZE, 4), 0 to 1."""
    y, x = (numpy.mgrid[:SIZE, :SIZE] + 0.5) / SIZE
    inside = 1 - ((x - 0.35) / 0.3) ** 2 - ((y - 0.65) / 0.2) ** 2
    inside = numpy.maximum(inside, 1 - ((x - 0.7) / 0.12) ** 2 - ((y - 0.3) / 0.25) ** 2)
    inside = numpy.maximum(inside, 8 * (0.03 - abs(x - 0.5 + 0.2 * y)))
    alpha = numpy.clip(0.5 + 4 * inside, 0, 1)
    return numpy.stack([0.2 + 0.2 * y, 0.5 + 0 * x, 0.1 + 0 * x, numpy.round(alpha * 255) / 255], axis=-1).astype(numpy.float32)


def material_of(name, image):
    material = bpy.data.materials.new(name)
    material.use_nodes, material.blend_method, material.alpha_threshold = True, "CLIP", 0.5
    nodes, shader = material.node_tree.nodes, material.node_tree.nodes["Principled BSDF"]
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    material.node_tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    return material


def card(name, material, location, rotation=(0, 0, 0), scale=(1, 1, 1), part=1):
    """An object with a square that shows a part of the texture, from a corner on."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-1, 0, 0), (1, 0, 0), (1, 0, 2), (-1, 0, 2)], [], [(0, 1, 2, 3)])
    coordinates = mesh.uv_layers.new(name="UVMap")
    for loop, uv in zip(coordinates.data, [(0, 0), (1, 0), (1, 1), (0, 1)]):
        loop.uv = uv[0] * part, uv[1] * part
    mesh.materials.append(material)
    made = bpy.data.objects.new(name, mesh)
    made.location, made.rotation_euler, made.scale = location, rotation, scale
    bpy.context.scene.collection.objects.link(made)
    return made


def counts():
    return {name: len(getattr(bpy.data, name)) for name in DATA}


def examples_of_the_page():
    """How it is installed, and how a script exports."""
    return re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/blender.md").read_text(encoding="utf-8"), re.M | re.S)


class Addon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="vellum-blender-")
        cls.addClassCleanup(folder.cleanup)
        subprocess.run([ROOT / "bindings/blender/pack", LIBRARIES, pathlib.Path(folder.name, "vellum-blender.zip")], check=True)
        install, _ = examples_of_the_page()
        exec(install.replace("/tmp/", f"{folder.name}/"), {})
        cls.addon = sys.modules["io_vellum"]
        cls.vellum = cls.addon.work.library()

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vellum-blender-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        for name in DATA:
            items = getattr(bpy.data, name)
            for item in list(items):
                items.remove(item)
        for name in ("vellum", "glTF2ExportSettings"):
            if name in bpy.context.scene:
                del bpy.context.scene[name]
        self.settings = bpy.context.scene.vellum
        self.image = bpy.data.images.new("leaf", SIZE, SIZE, alpha=True)
        self.pixels = leaf()
        self.image.pixels.foreach_set(self.pixels.ravel())
        self.image.pack()
        self.material = material_of("leaves", self.image)
        self.cards = [card("low", self.material, (0, 0, 0)),
                      card("high", self.material, (1.5, 1, 0.5), (0, 0.4, 1), (1, 1, 1.5), 0.6),
                      card("child", self.material, (-1, 0, 1), (0.3, 0, -0.8), (0.5, 0.7, 0.6))]
        self.cards[2].parent = self.cards[1]
        self.wood = card("wood", bpy.data.materials.new("wood"), (0, 2, 0))
        bpy.context.view_layer.update()

    def plain(self, name="plain.glb"):
        path = self.folder / name
        bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB" if path.suffix == ".glb" else "GLTF_SEPARATE")
        return path

    def export(self, name="tree.glb"):
        """Exports through the add-on; what it wrote must be right."""
        path = self.folder / name
        self.assertEqual(bpy.ops.export_scene.gltf_micromaps(filepath=str(path)), {"FINISHED"})
        vellum("verify", "--strict", "--require-micromaps", path)
        return path

    def levels_of(self, path):
        return {usage.subdivision_level for micromap in self.vellum.read_gltf(path).micromaps for usage in micromap.usages}

    def assertFails(self, message, function, *arguments, **more):
        with self.assertRaisesRegex(RuntimeError, message):
            function(*arguments, **more)

    def test_export_has_the_bytes_of_the_command(self):
        expected = self.folder / "expected.glb"
        vellum("bake", self.plain(), expected)
        self.assertEqual(self.export().read_bytes(), expected.read_bytes())
        self.assertEqual(len(self.vellum.read_gltf(expected).primitives), 3)

    def test_options(self):
        self.settings.levels, self.settings.level = "FIXED", 3
        self.assertEqual(self.levels_of(self.export()), {3})
        self.settings.levels, self.settings.max_level = "AUTOMATIC", 2
        self.assertEqual(self.levels_of(self.export()), {2})
        self.settings.max_level, self.settings.levels, self.settings.budget = 8, "BUDGET", 1
        self.assertLess(0, sum(len(each.data) + len(each.triangles) for each in self.vellum.read_gltf(self.export()).micromaps))
        expected = self.folder / "expected.glb"
        vellum("bake", "--budget", "1K", self.plain(), expected)
        self.assertEqual((self.folder / "tree.glb").read_bytes(), expected.read_bytes())

    def test_name_without_an_ending(self):
        bpy.ops.export_scene.gltf_micromaps(filepath=str(self.folder / "tree.v2"))
        vellum("verify", "--strict", "--require-micromaps", self.folder / "tree.v2.glb")

    def test_example_of_the_page(self):
        _, example = examples_of_the_page()
        self.assertIn("/tmp/tree.glb", example)
        exec(example.replace("/tmp/", f"{self.folder}/"), {})
        vellum("verify", "--strict", "--require-micromaps", self.folder / "tree.glb")
        self.assertEqual((self.settings.levels, self.settings.budget), ("BUDGET", 64))

    def test_gltf_with_files(self):
        self.export("tree.gltf")
        found = {path.suffix for path in self.folder.iterdir()}
        self.assertEqual(found, {".gltf", ".bin", ".png"})
        # Once more, after a change of the mesh and of the texture.
        self.cards[0].data.vertices[0].co.x -= 1
        self.image.pixels.foreach_set(self.pixels[:, ::-1].ravel())
        self.image.pack()
        self.export("tree.gltf")

    def test_remembered_options_of_the_exporter(self):
        bpy.context.scene["glTF2ExportSettings"] = {"use_selection": True, "export_format": "GLTF_EMBEDDED"}
        for each in bpy.data.objects:
            each.select_set(each.name == "low")
        self.assertEqual(len(self.vellum.read_gltf(self.export()).primitives), 1)

    def test_blended_materials(self):
        self.material.blend_method = "BLEND"
        self.assertFails(r"Nothing can be baked: mesh 0 \"low\" primitive 0: its alphaMode is BLEND, and 2 more\. Set",
                         self.export)
        self.assertEqual(list(self.folder.iterdir()), [])
        self.settings.blend = True
        self.export()

    def test_sweep(self):
        self.assertEqual(bpy.ops.vellum.sweep(), {"FINISHED"})
        rows = {each.level: each for each in self.settings.rows}
        self.assertEqual(list(rows), [-1, *range(1, 9)])
        table = json.loads(vellum("sweep", "--json", self.plain()))
        expected = {}
        for each in table["files"][0]["rows"]:
            words = each["options"].split()
            if len(words) == 2 and words[0] == "--level":
                expected[-1 if words[1] == "auto" else int(words[1])] = each
        self.assertEqual(set(expected), set(rows))
        for level, each in expected.items():
            self.assertEqual(rows[level].size, each["bytes"], level)
            self.assertAlmostEqual(rows[level].known, each["known"], 5, level)
        self.assertLess(0.3, rows[5].known)
        self.assertLess(rows[3].known, rows[5].known)
        bpy.ops.vellum.use(level=4)
        self.assertEqual((self.settings.levels, self.settings.level), ("FIXED", 4))
        bpy.ops.vellum.use(level=-1)
        self.assertEqual(self.settings.levels, "AUTOMATIC")

    def preview(self):
        self.assertEqual(bpy.ops.vellum.preview(), {"FINISHED"})
        image = bpy.data.images["Vellum preview: leaves"]
        size = image.size[0]
        return (numpy.array(image.pixels[:]).reshape(size, size, 4) * 255).round().astype(int)

    def test_preview(self):
        before, selected = counts(), [each.name for each in bpy.context.view_layer.objects]
        self.settings.levels, self.settings.level = "FIXED", 6
        found = self.preview()
        size = len(found)
        # The alpha that a linear sampler reads at the centres of the preview's texels.
        at = (numpy.arange(size) + 0.5) / size * SIZE - 0.5
        low, part = numpy.floor(at).astype(int), at - numpy.floor(at)
        alpha = self.pixels[..., 3].astype(float)
        rows = alpha[low % SIZE] * (1 - part)[:, None] + alpha[(low + 1) % SIZE] * part[:, None]
        alpha = rows[:, low % SIZE] * (1 - part) + rows[:, (low + 1) % SIZE] * part
        state = {name: (found == colour).all(axis=-1) for name, colour in zip(("transparent", "opaque", "ut", "uo"),
                                                                               self.addon.work.states.COLOURS.astype(int))}
        self.assertTrue((sum(state.values()) == 1).all())
        self.assertLess(alpha[state["transparent"]].max(), 0.5)
        self.assertGreaterEqual(alpha[state["opaque"]].min(), 0.5)
        share = (state["ut"] | state["uo"]).mean()
        self.assertTrue(0.01 < share < 0.3, share)
        # The objects are seen by their copies.
        shown = [each for each in bpy.context.view_layer.objects if not each.hide_get()]
        self.assertEqual(sorted(each.name for each in shown if each.type == "MESH"), ["child.001", "high.001", "low.001", "wood"])
        for each in shown:
            if each.name != "wood":
                self.assertEqual(each.material_slots[0].material.name, "Vellum preview: leaves")
        self.assertEqual(self.cards[0].material_slots[0].material, self.material)
        if PICTURES:
            self.render(PICTURES[0])
        # Another preview, and an export, begin without them.
        self.preview()
        self.cards[0].name = "renamed"
        bpy.data.objects.remove(self.cards.pop())
        self.export()
        before["objects"] -= 1
        selected.remove("child")
        selected[selected.index("low")] = "renamed"
        self.assertEqual(counts(), before)
        self.assertFalse(any(each.hide_render for each in self.cards))
        self.assertCountEqual([each.name for each in bpy.context.view_layer.objects if not each.hide_get()], selected)
        self.preview()
        bpy.ops.vellum.clear_preview()
        self.assertEqual(counts(), before)

    def render(self, path):
        bpy.ops.preferences.addon_enable(module="cycles")
        scene = bpy.context.scene
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        camera.location, camera.rotation_euler = (0.6, -7.8, 2), (math.pi / 2, 0, 0)
        scene.collection.objects.link(camera)
        scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", 16
        scene.cycles.use_denoising = False  # Debian's has no denoiser
        scene.world.use_nodes, scene.world.color, scene.view_settings.view_transform = False, (1, 1, 1), "Standard"
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 400, 320, 100
        scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGB"
        scene.render.image_settings.compression = 100
        for name in dir(scene.render):
            if name.startswith("use_stamp_"):  # times and paths in the file
                setattr(scene.render, name, False)
        self.wood.hide_render = True
        scene.render.filepath = str(pathlib.Path(path).resolve())
        bpy.ops.render.render(write_still=True)
        picture = bpy.data.images.load(scene.render.filepath)
        pixels = numpy.array(picture.pixels[:]).reshape(-1, 4) * 255
        for colour in self.addon.work.states.COLOURS:
            self.assertGreater((abs(pixels - colour) < 8).all(axis=1).sum(), 30, colour)
        bpy.data.images.remove(picture)
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(bpy.data.cameras[0])
        bpy.data.images.remove(bpy.data.images["Render Result"])

    def test_nothing_to_bake(self):
        for each in self.cards:
            bpy.data.objects.remove(each)
        path = self.folder / "tree.glb"
        path.write_bytes(b"kept")
        for function in (self.export, bpy.ops.vellum.sweep, bpy.ops.vellum.preview):
            self.assertFails("Error: No material is alpha-clipped: set Blend Mode to Alpha Clip", function)
        self.assertEqual(path.read_bytes(), b"kept")

    def test_part_that_cannot_be_baked(self):
        bare = card("bare", self.material, (4, 0, 0))
        bare.data.uv_layers.remove(bare.data.uv_layers[0])
        report = self.addon.work.export_baked(bpy.context, self.folder / "tree.glb")
        self.assertEqual((report.primitive_count, len(report.skipped)), (3, 1))
        for each in self.cards:
            bpy.data.objects.remove(each)
        self.assertFails(r'Nothing can be baked: mesh \d "bare" primitive 0: it has no texture coordinates',
                         self.export, "other.glb")

    def test_files_that_cannot_be_written(self):
        (self.folder / "folder.glb").mkdir()
        (self.folder / "file").write_bytes(b"")
        for name in ("folder.glb", "file/tree.glb", "file/tree.gltf"):
            self.assertFails(r"Error: The micromaps could not be baked: .*(folder\.glb|file)", self.export, name)
        self.assertEqual({path.name for path in self.folder.rglob("*")}, {"folder.glb", "file"})

    def test_exporter_is_off(self):
        bpy.ops.preferences.addon_disable(module="io_scene_gltf2")
        self.addCleanup(bpy.ops.preferences.addon_enable, module="io_scene_gltf2")
        self.assertFails("Error: Blender's own add-on 'glTF 2.0 format' is off", self.export)

    def test_exporter_fails(self):
        bpy.context.scene["glTF2ExportSettings"] = {"export_image_format": "unknown"}
        self.assertFails("Error: Blender's glTF exporter failed: .*unknown", self.export)
        del bpy.context.scene["glTF2ExportSettings"]
        from io_scene_gltf2.blender.exp import gltf2_blender_export as exporter
        with unittest.mock.patch.object(exporter, "save", side_effect=KeyError("a cause")):
            self.assertFails("Error: Blender's glTF exporter failed: KeyError: 'a cause'\n?$", self.export)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_libraries_are_missing(self):
        loaded = {name: sys.modules.pop(name) for name in list(sys.modules) if name.startswith("io_vellum.vellum")}
        package = self.addon.work.__dict__.pop("vellum", None), self.addon.__dict__.pop("vellum", None)
        os.environ["VELLUM_LIBRARY_PATH"] = "/nowhere"
        try:
            self.assertFails(r"Error: Vellum's libraries cannot be loaded: .*/nowhere", self.export)
        finally:
            del os.environ["VELLUM_LIBRARY_PATH"]
            sys.modules.update(loaded)
            self.addon.vellum = package[1]
        self.export()

    def test_registering_twice(self):
        def state():
            return (set(dir(bpy.types)), set(dir(bpy.types.Scene)), set(dir(bpy.ops.vellum)), set(dir(bpy.ops.export_scene)),
                    len(bpy.types.TOPBAR_MT_file_export.draw._draw_funcs))
        self.assertIn("VIEW3D_PT_vellum", state()[0])
        on = state()
        bpy.ops.preferences.addon_disable(module="io_vellum")
        off = state()
        names = [name for found in off[:4] for name in found if "vellum" in name.lower() or "micromap" in name.lower()]
        self.assertEqual(names, [])
        self.assertEqual(off[4], on[4] - 1)
        for _ in range(2):
            bpy.ops.preferences.addon_enable(module="io_vellum")
            self.assertEqual(state(), on)
            bpy.ops.preferences.addon_disable(module="io_vellum")
            self.assertEqual(state(), off)
        bpy.ops.preferences.addon_enable(module="io_vellum")
        type(self).addon = sys.modules["io_vellum"]
        type(self).vellum = self.addon.work.library()

    def test_panel_draws(self):
        """Its properties and operators exist."""
        bpy.ops.vellum.sweep()
        drawn = []

        class Layout:
            def prop(self, data, name, **_):
                drawn.append(name)
                getattr(data, name)

            def operator(self, name, **_):
                drawn.append(name)
                group, _, operator = name.partition(".")
                getattr(getattr(bpy.ops, group), operator).get_rna_type()
                return self

            def label(self, text):
                drawn.append(text)

            def row(self, **_):
                return self

            grid_flow = row
        for self.settings.levels in ("AUTOMATIC", "FIXED", "BUDGET"):
            panel = type("Panel", (), {"layout": Layout()})()
            self.addon.VIEW3D_PT_vellum.draw(panel, bpy.context)
        self.assertLessEqual({"level", "budget", "max_level", "vellum.sweep", "vellum.use", "auto", "8",
                              "export_scene.gltf_micromaps"}, set(drawn))


if __name__ == "__main__":
    unittest.main(argv=[__file__, "-v"])
