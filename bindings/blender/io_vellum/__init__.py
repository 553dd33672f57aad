# SPDX-License-Identifier: Apache-2.0
"""Exports glTF files with opacity micromaps (docs/blender.md of Vellum's sources)."""
import pathlib

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import work

bl_info = {
    "name": "Vellum: opacity micromaps",
    "author": "The Vellum project",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "File > Export, and 3D Viewport > Sidebar > Vellum",
    "description": "Export glTF files with opacity micromaps of alpha-clipped materials",
    "category": "Import-Export",
}

PREVIEW_SIZE = 1024  # texels, both ways


class VellumRow(bpy.types.PropertyGroup):
    """A row of the sweep's table."""

    level: IntProperty()  # -1: automatic
    size: IntProperty()  # bytes
    known: FloatProperty()  # 0 to 1


class VellumSettings(bpy.types.PropertyGroup):
    levels: EnumProperty(name="Levels", default="AUTOMATIC", items=(
        ("AUTOMATIC", "Automatic", "By the texels that a triangle covers"),
        ("FIXED", "One level", "The same for all triangles"),
        ("BUDGET", "Budget", "The most surface that is known for a number of bytes")))
    level: IntProperty(name="Level", default=5, min=0, max=12, description="Each level has four times the data of the one before")
    max_level: IntProperty(name="Highest level", default=8, min=0, max=12, description="Of automatic levels, and of the sweep")
    budget: IntProperty(name="KiB", default=256, min=0, max=2**21, description="Most KiB of micromaps in the file")
    blend: BoolProperty(name="Also Alpha Blend", description="Bake blended materials: opaque where alpha is 1, transparent where "
                        "it is 0")
    rows: CollectionProperty(type=VellumRow)


class _Work:
    """An operator that reports a Problem as an error."""

    def execute(self, context):
        try:
            self.work(context)
        except work.Problem as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        return {"FINISHED"}


class EXPORT_SCENE_OT_gltf_micromaps(_Work, bpy.types.Operator, ExportHelper):
    """Export a glTF file with opacity micromaps, with the options that the glTF exporter remembers and those of the Vellum panel"""

    bl_idname = "export_scene.gltf_micromaps"
    bl_label = "Export glTF with Micromaps"
    filename_ext = ".glb"
    check_extension = None  # .gltf is one, too
    filter_glob: StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})

    def work(self, context):
        path = pathlib.Path(bpy.path.abspath(self.filepath))
        if path.suffix.lower() not in (".glb", ".gltf"):
            path = path.with_name(path.name + self.filename_ext)
        report = work.export_baked(context, path)
        for place, reason in report.skipped:
            self.report({"WARNING"}, f"{place} has no micromap: {reason}")
        self.report({"INFO"}, f"{path.name}: {report.micromap_size:,} bytes of micromaps for {report.primitive_count} of "
                    f"{report.primitive_count + len(report.skipped)} alpha-clipped parts")


class VELLUM_OT_sweep(_Work, bpy.types.Operator):
    """Compare the levels: what they cost, and how much of the surface is opaque or transparent with them"""

    bl_idname = "vellum.sweep"
    bl_label = "Compare Levels"

    def work(self, context):
        manager = context.window_manager
        manager.progress_begin(0, 100)
        try:
            found = work.sweep(context, lambda share: manager.progress_update(int(100 * share)))
        finally:
            manager.progress_end()
        rows = context.scene.vellum.rows
        rows.clear()
        for level, size, known in found:
            row = rows.add()
            row.level, row.size, row.known = -1 if level is None else level, min(size, 2**31 - 1), known


class VELLUM_OT_use(bpy.types.Operator):
    """Bake with this level"""

    bl_idname = "vellum.use"
    bl_label = "Use"
    bl_options = {"UNDO"}
    level: IntProperty(min=-1, max=12, options={"HIDDEN"})

    def execute(self, context):
        settings = context.scene.vellum
        settings.levels = "AUTOMATIC" if self.level < 0 else "FIXED"
        settings.level = max(self.level, 0)
        return {"FINISHED"}


class VELLUM_OT_preview(_Work, bpy.types.Operator):
    """Show the states instead of the objects: dark blue is opaque, light blue transparent, yellow and orange unknown"""

    bl_idname = "vellum.preview"
    bl_label = "Show States"
    bl_options = {"UNDO"}

    def work(self, context):
        names = work.preview(context, PREVIEW_SIZE)
        self.report({"INFO"}, f"States of {', '.join(names)}")


class VELLUM_OT_clear_preview(bpy.types.Operator):
    """Show the objects again"""

    bl_idname = "vellum.clear_preview"
    bl_label = "Hide States"
    bl_options = {"UNDO"}

    def execute(self, context):
        work.clear_preview(context)
        return {"FINISHED"}


class VIEW3D_PT_vellum(bpy.types.Panel):
    bl_label = "Opacity Micromaps"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Vellum"

    def draw(self, context):
        layout, settings = self.layout, context.scene.vellum
        layout.prop(settings, "levels")
        if settings.levels == "FIXED":
            layout.prop(settings, "level")
        elif settings.levels == "BUDGET":
            layout.prop(settings, "budget")
        layout.prop(settings, "max_level")
        layout.prop(settings, "blend")
        row = layout.row(align=True)
        row.operator(VELLUM_OT_preview.bl_idname)
        row.operator(VELLUM_OT_clear_preview.bl_idname)
        layout.operator(VELLUM_OT_sweep.bl_idname)
        if settings.rows:
            table = layout.grid_flow(row_major=True, columns=4, align=True)
            for title in ("Level", "Bytes", "Known", ""):
                table.label(text=title)
            for each in settings.rows:
                table.label(text="auto" if each.level < 0 else str(each.level))
                table.label(text=f"{each.size:,}")
                table.label(text=f"{100 * each.known:.1f} %")
                table.operator(VELLUM_OT_use.bl_idname).level = each.level
        layout.operator(EXPORT_SCENE_OT_gltf_micromaps.bl_idname)


CLASSES = (VellumRow, VellumSettings, EXPORT_SCENE_OT_gltf_micromaps, VELLUM_OT_sweep, VELLUM_OT_use, VELLUM_OT_preview,
           VELLUM_OT_clear_preview, VIEW3D_PT_vellum)


def draw_menu(self, context):
    self.layout.operator(EXPORT_SCENE_OT_gltf_micromaps.bl_idname, text="glTF 2.0 with micromaps (.glb/.gltf)")


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.vellum = PointerProperty(type=VellumSettings)
    bpy.types.TOPBAR_MT_file_export.append(draw_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(draw_menu)
    del bpy.types.Scene.vellum
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
