#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bakes the opacity micromap of a leaf on two triangles and prints what came out. vellum.py lies beside this file.

    VELLUM_LIBRARY=<prefix>/lib/libvellum.so python3 bake.py
"""
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


texture = vellum.Texture(paint_leaf(), width=SIZE, height=SIZE, addressModeU=vellum.CLAMP_TO_EDGE,
                         addressModeV=vellum.CLAMP_TO_EDGE)
card = vellum.BakeInput([texture], uvs=array("f", [0, 0, 1, 0, 0, 1, 1, 1]), indices=array("H", [0, 1, 2, 3, 2, 1]))
micromap = vellum.bake([card], level=5)
transparent, opaque, *unknown = micromap.stateCounts
print(f"{len(micromap.data)} bytes of data for {len(micromap.triangles)} of {len(micromap.indices)} triangles")
print(f"micro-triangles: {transparent} transparent, {opaque} opaque, {sum(unknown)} unknown")
assert micromap.state(0, 0, 0) == vellum.TRANSPARENT and micromap.state(0, 0.5, 0.45) == vellum.OPAQUE
try:
    vellum.bake([card], level=13)
except vellum.Error as error:
    print(f"as it should be: {error}")
