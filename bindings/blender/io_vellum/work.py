# SPDX-License-Identifier: Apache-2.0
"""What the add-on does: exports, bakes, compares levels, shows states. Functions raise Problem with a message for the user."""
import contextlib
import importlib.util
import os
import pathlib
import tempfile

import bpy
import numpy

from . import states

PREVIEW = "Vellum preview"
_SOURCE = "vellum_source"  # marks what belongs to the preview; of a copy: the object that it is seen instead of
_NOT_TAKEN = ("filepath", "check_existing", "export_format", "will_save_settings", "export_keep_originals", "filter_glob")


class Problem(Exception):
    """What is wrong, and what to do about it."""


def library():
    """The Python package: that of this add-on's ZIP, or else an installed one."""
    try:
        if importlib.util.find_spec(".vellum", __package__):
            from . import vellum
        else:
            import vellum
        return vellum
    except ImportError as error:
        raise Problem(f"Vellum's libraries cannot be loaded: {error}") from None


@contextlib.contextmanager
def _errors_of_vellum():
    vellum = library()
    try:
        yield vellum
    except (vellum.Error, ValueError, OSError, MemoryError) as error:
        raise Problem(f"The micromaps could not be baked: {error}") from None


def options(settings):
    """Those of vellum.bake_gltf() for the panel's settings."""
    found = {"blend": settings.blend}
    if settings.levels == "FIXED":
        return {**found, "level": settings.level}
    found["max_level"] = settings.max_level
    if settings.levels == "BUDGET":
        found["budget"] = settings.budget * 1024
    return found


def _export(context, path, **forced):
    """Writes a .glb or .gltf with the options that Blender's glTF exporter remembers for the scene."""
    if "io_scene_gltf2" not in context.preferences.addons:
        raise Problem("Blender's own add-on 'glTF 2.0 format' is off: turn it on in the preferences")
    clear_preview(context)
    operator = bpy.ops.export_scene.gltf
    known = operator.get_rna_type().properties.keys()
    remembered = context.scene.get("glTF2ExportSettings")
    chosen = dict(remembered.to_dict() if hasattr(remembered, "to_dict") else remembered or {})
    if path.suffix.lower() == ".glb":
        forced["export_format"] = "GLB"
    else:
        forced["export_format"] = "GLTF_EMBEDDED" if chosen.get("export_format") == "GLTF_EMBEDDED" else "GLTF_SEPARATE"
    chosen = {**{name: value for name, value in chosen.items() if name not in _NOT_TAKEN}, **forced}
    try:
        operator("EXEC_DEFAULT", filepath=str(path), check_existing=False,
                 **{name: value for name, value in chosen.items() if name in known})
    except (RuntimeError, TypeError) as error:
        lines = [line for line in str(error).splitlines() if line.strip() and not line.startswith("Location: ")]
        raise Problem(f"Blender's glTF exporter failed: {lines[-1]}") from None


def _nothing(report):
    """Why no primitive got a micromap."""
    if not report.skipped:
        return Problem("No material is alpha-clipped: set Blend Mode to Alpha Clip in the material's settings, and connect the "
                       "image's Alpha to that of the shader")
    place, reason = report.skipped[0]
    more = f", and {len(report.skipped) - 1} more" if len(report.skipped) > 1 else ""
    advice = ". Set Blend Mode to Alpha Clip in the material's settings, or turn on Also Alpha Blend" if "BLEND" in reason else ""
    return Problem(f"Nothing can be baked: {place}: {reason}{more}{advice}")


def export_baked(context, path):
    """Exports the scene to a .glb or .gltf with micromaps, and returns vellum's report. The file is written whole or not at all.
    Like those of Blender's own exporter, files of a .gltf replace earlier ones."""
    path = pathlib.Path(path)
    with tempfile.TemporaryDirectory(prefix="vellum-") as folder:
        plain = pathlib.Path(folder, path.name)
        _export(context, plain)
        with _errors_of_vellum() as vellum:
            chosen = options(context.scene.vellum)
            # First in memory, since a file would be written even if nothing is baked. The second bake finds all in the cache.
            cache = {}
            report = vellum.bake_gltf(plain.read_bytes(), name=str(plain), cache=cache, **chosen)[1]
            if not report.primitive_count:
                raise _nothing(report)
            return vellum.bake_gltf_file(plain, path, cache=cache, replace_copies=True, **chosen)


def _exported(context):
    """The bytes of a .glb of the scene."""
    with tempfile.TemporaryDirectory(prefix="vellum-") as folder:
        path = pathlib.Path(folder, "scene.glb")
        _export(context, path, export_draco_mesh_compression_enable=False)
        return path.read_bytes()


def sweep(context, progress):
    """What each level would cost: (level or None for automatic, bytes, share of the surface that is known).

    progress: called with the share that is done.
    """
    settings = context.scene.vellum
    data = _exported(context)
    scene = states.Scene(data)
    chosen = [None, *range(1, settings.max_level + 1)]
    rows = []
    with _errors_of_vellum() as vellum:
        for number, level in enumerate(chosen):
            progress(number / len(chosen))
            kind = {"max_level": settings.max_level} if level is None else {"level": level}
            baked, report = vellum.bake_gltf(data, blend=settings.blend, **kind)
            if not report.primitive_count:
                raise _nothing(report)
            rows.append((level, report.micromap_size, states.known_share(scene, vellum.read_gltf(baked))))
    return rows


def preview(context, size):
    """Shows copies of the objects with the states as colours instead of the objects. Returns the names of the materials."""
    data = _exported(context)
    with _errors_of_vellum() as vellum:
        baked, report = vellum.bake_gltf(data, **options(context.scene.vellum))
        pictures = states.draw_states(states.Scene(data), vellum.read_gltf(baked), size)
    if not pictures:
        raise _nothing(report) if not report.primitive_count else Problem("No baked material has an image to show the states of")
    images = {name: _image_of(name, picture) for name, (_, picture) in pictures.items()}
    collection = bpy.data.collections.new(PREVIEW)
    collection[_SOURCE] = True
    context.scene.collection.children.link(collection)
    materials = {}
    for source in list(context.view_layer.objects):
        used = [slot for slot in source.material_slots if slot.material and slot.material.name in pictures]
        if source.type != "MESH" or not used or source.hide_get():
            continue
        copy = source.copy()
        copy[_SOURCE] = source
        collection.objects.link(copy)
        for slot, original in zip(copy.material_slots, source.material_slots):
            name = original.material.name if original.material else ""
            if name in pictures:
                maps = source.data.uv_layers.keys()
                number = pictures[name][0]
                key = (name, maps[number] if number < len(maps) else "")
                if key not in materials:
                    materials[key] = _material_of(*key, images[name])
                slot.link = "OBJECT"
                slot.material = materials[key]
        source.hide_set(True)
        source.hide_render = True
    return sorted(pictures)


def _image_of(name, picture):
    height, width, _ = picture.shape
    image = bpy.data.images.new(f"{PREVIEW}: {name}", width, height, alpha=True)
    image[_SOURCE] = True
    image.pixels.foreach_set((picture[::-1].astype(numpy.float32) / 255).ravel())  # Blender's row 0 is the lowest
    image.pack()
    return image


def _material_of(name, uv_map, image):
    """Shows an image without light."""
    material = bpy.data.materials.new(f"{PREVIEW}: {name}")
    material[_SOURCE] = True
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    coordinates, texture = nodes.new("ShaderNodeUVMap"), nodes.new("ShaderNodeTexImage")
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    coordinates.uv_map, texture.image, texture.interpolation = uv_map, image, "Closest"
    links.new(coordinates.outputs["UV"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], output.inputs["Surface"])
    nodes.active = texture  # seen with solid shading, too, if that shows textures
    return material


def clear_preview(context):
    """Removes what preview() made, and shows the objects again."""
    for copy in [each for each in bpy.data.objects if _SOURCE in each]:
        source = copy[_SOURCE]
        if source:  # it may have been deleted
            source.hide_render = copy.hide_render
            if source.name in context.view_layer.objects:
                source.hide_set(False)
        bpy.data.objects.remove(copy)
    for items in (bpy.data.materials, bpy.data.images, bpy.data.collections):
        for item in [each for each in items if _SOURCE in each]:
            items.remove(item)
