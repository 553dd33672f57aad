#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bakes the opacity micromap of a leaf on two triangles and prints what came out. With names of files, bakes a glTF file and
prints its primitives. The package `vellum` is installed by pip: docs/python.md.

usage: bake.py [INPUT OUTPUT]
"""
import sys
from array import array

import vellum

SIZE = 64


def paint_leaf():
    """An ellipse with a soft border, as 8-bit alpha."""
    alpha = bytearray()
    for y in range(SIZE):
        for x in range(SIZE):
            dx = (x + 0.5) / SIZE * 2 - 1
            dy = ((y + 0.5) / SIZE * 2 - 1) / 0.6
            inside = 0.5 + (0.8 - (dx * dx + dy * dy)) * 8
            alpha.append(int(min(max(inside, 0), 1) * 255))
    return alpha


def bake_leaf():
    texture = vellum.Texture(paint_leaf(), width=SIZE, height=SIZE, address_mode_u=vellum.AddressMode.CLAMP_TO_EDGE,
                             address_mode_v=vellum.AddressMode.CLAMP_TO_EDGE)
    card = vellum.BakeInput(texture, uvs=array("f", [0, 0, 1, 0, 0, 1, 1, 1]), indices=array("H", [0, 1, 2, 3, 2, 1]))
    micromap = vellum.bake(card, level=5)
    transparent, opaque, *unknown = micromap.state_counts
    print(f"{len(micromap.data)} bytes of data for {len(micromap.triangles) // 8} of {len(micromap.indices)} triangles")
    print(f"micro-triangles: {transparent} transparent, {opaque} opaque, {sum(unknown)} unknown")
    assert micromap.state(0, 0, 0) == vellum.State.TRANSPARENT and micromap.state(0, 0.5, 0.45) == vellum.State.OPAQUE
    try:
        vellum.bake(card, level=13)
    except vellum.Error as error:
        print(f"as it should be: {error}")


def bake_file(source, output):
    report = vellum.bake_gltf_file(source, output, max_level=6, progress=lambda done, total: print(f"\r{done}/{total}", end=""))
    print(f"\r{report.micromap_size} bytes of micromaps for {report.primitive_count} primitives")
    for place, reason in report.skipped:
        print(f"{place} is not baked: {reason}")
    for primitive in vellum.read_gltf(output).primitives:
        special = sum(index < 0 for index in primitive.indices)
        print(f"{primitive.name}: {len(primitive.indices)} triangles, {special} of them with a special index")


if len(sys.argv) == 3:
    bake_file(*sys.argv[1:])
else:
    bake_leaf()
