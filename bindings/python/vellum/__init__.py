# SPDX-License-Identifier: Apache-2.0
"""Opacity micromaps: the exact baker libvellum, glTF files, and SPIR-V modules.

    import vellum
    texture = vellum.Texture(image[:, :, 3])  # numpy, uint8; or bytes with width and height
    card = vellum.BakeInput(texture, uvs, indices)
    micromap = vellum.bake(card, level=5)
    micromap.data, micromap.triangles, micromap.usages, micromap.indices

    report = vellum.bake_gltf_file("tree.glb", "tree.omm.glb", max_level=6)

Numbers of enumerations are Vulkan's. docs/python.md has more examples, docs/baking.md explains the options.
"""
from ._bake import (LEVEL_AUTOMATIC, NO_BUDGET, AddressMode, BakeInput, BakeOptions, CompareOp, Filter, Format, Geometry, Micromap,
                    MicromapFormat, QualityOptions, SpecialIndex, State, Texture, TwoStateRule, Usage, bake, bake_version,
                    library_version, write_indices)
from ._gltf import (Gltf, GltfBakeOptions, GltfMicromap, GltfNote, GltfPrimitive, GltfReport, bake_gltf, bake_gltf_file, check_gltf,
                    read_gltf)
from ._native import Cancelled, Error, Result
from ._spirv import Spirv, SpirvEdit, SpirvEntryPoint, SpirvMode, edit_spirv

__all__ = [
    "LEVEL_AUTOMATIC", "NO_BUDGET", "AddressMode", "BakeInput", "BakeOptions", "Cancelled", "CompareOp", "Error", "Filter",
    "Format", "Geometry", "Gltf", "GltfBakeOptions", "GltfMicromap", "GltfNote", "GltfPrimitive", "GltfReport", "Micromap",
    "MicromapFormat", "QualityOptions", "Result", "SpecialIndex", "Spirv", "SpirvEdit", "SpirvEntryPoint", "SpirvMode", "State",
    "Texture", "TwoStateRule", "Usage", "bake", "bake_gltf", "bake_gltf_file", "bake_version", "check_gltf", "edit_spirv",
    "library_version", "read_gltf", "write_indices"]

library_version()  # without the library, importing fails, with what to do
