#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints random bakes as JSON, one a line, with the results of the native library: what WebAssembly must return.

usage: VELLUM_LIBRARY_PATH=folder make_cases.py COUNT [SEED]    folder: of libvellum
"""
import base64
import hashlib
import json
import pathlib
import random
import re
import struct
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "python"))
import vellum  # noqa: E402

TEXELS = {vellum.Format.R8_UNORM: ("B", 255), vellum.Format.R16_UNORM: ("H", 65535), vellum.Format.R16_SFLOAT: ("e", None),
          vellum.Format.R32_SFLOAT: ("f", None)}
UVS = {vellum.Format.R32G32_SFLOAT: "f", vellum.Format.R16G16_SFLOAT: "e", vellum.Format.R16G16_UNORM: "H"}
LEVELS = range(-1, 10)


def text(data):
    return base64.b64encode(data).decode()


def a_texture(pick, width, height):
    format = pick.choice(list(TEXELS))
    code, top = TEXELS[format]
    size = struct.calcsize(code)
    kind = pick.choice(("noise", "disc", "steps"))
    values = bytearray()
    stride = size * pick.choice((1, 1, 4))
    offset = pick.randrange(stride - size + 1)
    for y in range(height):
        for x in range(width):
            alpha = {"noise": pick.random(), "disc": float((x - width / 2) ** 2 + (y - height / 2) ** 2 < width * height / 8),
                     "steps": (x * 7 + y * 3) % 16 / 15}[kind]
            value = round(alpha * top) if top else alpha
            values += struct.pack(f"<{offset}x{code}{stride - size - offset}x", value)
    return bytes(values), {"width": width, "height": height, "format": format, "filter": pick.randrange(2),
                           "addressModeU": pick.randrange(5), "addressModeV": pick.randrange(5), "offset": offset,
                           "pixelStride": stride, "scale": pick.choice((1.0, 1.0, 0.75)), "border": pick.choice((0.0, 1.0))}


def an_input(pick, most_triangles):
    width, height = (pick.choice((1, 2, 3, 8, 17, 32, 48)) for _ in range(2))
    textures = [a_texture(pick, width, height)]
    if pick.random() < 0.2:
        textures.append(a_texture(pick, max(width // 2, 1), max(height // 2, 1)))
    triangles = pick.randrange(1, most_triangles + 1)
    format = pick.choice(list(UVS))
    spread = pick.choice((0.1, 1, 1, 5))
    vertices = 3 * triangles if pick.random() < 0.5 else pick.randrange(3, 3 + 2 * triangles)
    coordinate = (lambda: pick.randrange(65536)) if UVS[format] == "H" else (lambda: pick.uniform(-spread, spread))
    uvs = struct.pack(f"<{2 * vertices}{UVS[format]}", *(coordinate() for _ in range(2 * vertices)))
    members = {"uvFormat": format, "cutoff": pick.choice((0.5, 0.5, 0.25, 1 / 3, 0.0, 1.0, pick.random()))}
    if pick.random() < 0.3:
        members["uvTransform"] = [struct.unpack("f", struct.pack("f", pick.uniform(-1.5, 1.5)))[0] for _ in range(6)]
    indices = None
    if vertices != 3 * triangles:
        code = pick.choice("BHI")
        indices = (code, struct.pack(f"<{3 * triangles}{code}", *(pick.randrange(min(vertices, 256)) for _ in range(3 * triangles))))
    if pick.random() < 0.2:
        members["levels"] = bytes(pick.randrange(7) for _ in range(triangles))
    if pick.random() < 0.2:
        members["formats"] = bytes(pick.randrange(1, 3) for _ in range(triangles))
    return textures, uvs, indices, members


def some_options(pick, level):
    options = {"format": pick.randrange(1, 3), "twoStateRule": pick.randrange(3), "level": level,
               "compareOp": pick.choice((1, 3, 4, 6)), "disallowMixedSpecialIndices": pick.random() < 0.2}
    if pick.random() < 0.3:
        options.update(valueTolerance=0.0, subtexelTolerance=0.0, barycentricTolerance=0.0, interpolationTolerance=0.0)
    if pick.random() < 0.2:
        options["budget"] = pick.randrange(4000)
    if pick.random() < 0.2:
        options["minKnown"] = pick.random()
    if level < 0:
        options.update(maxLevel=pick.randrange(8), texelsPerEdge=pick.choice((0.5, 1.0, 4.0)))
    return options


def digest_of(micromap):
    return hashlib.sha256(micromap.data + micromap.triangles + bytes(micromap.indices)).hexdigest()


def in_python(members):
    """addressModeU is address_mode_u."""
    return {re.sub("[A-Z]", lambda letter: "_" + letter[0].lower(), name): value for name, value in members.items()}


def a_case(pick, number):
    level = LEVELS[number % len(LEVELS)]
    inputs = [an_input(pick, 12 if level < 7 else 2) for _ in range(pick.choice((1, 1, 1, 2)))]
    options = some_options(pick, level)
    # Inputs that share their textures, and coordinates of the first, which are found to be the same.
    shared = number % 5 == 4
    if shared:
        textures, *first = inputs[0]
        inputs = [(textures, *first), (textures, *first), (textures, *an_input(pick, 6)[1:])]
        options.update(level=-1, maxLevel=5, texelsPerEdge=0.5, budget=pick.randrange(200))
    made = []
    for textures, uvs, indices, members in inputs:
        view = memoryview(indices[1]).cast(indices[0]) if indices else None
        made.append(vellum.BakeInput([vellum.Texture(texels, **in_python(t)) for texels, t in textures], uvs, view,
                                     **in_python(members)))
    micromap = vellum.bake(made, threads=1, **in_python(options))
    as_text = [{"textures": [dict(t, alpha=text(texels)) for texels, t in textures], "uvs": text(uvs),
                "indices": indices and [indices[0], text(indices[1])],
                "members": {name: list(value) if isinstance(value, bytes) else value for name, value in members.items()}}
               for textures, uvs, indices, members in inputs]
    return {"inputs": as_text, "shared": shared, "options": options, "digest": digest_of(micromap),
            "distinct": micromap.distinct_count, "bytes": len(micromap.data)}


def main():
    count, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    for number in range(count):
        print(json.dumps(a_case(random.Random(f"{seed} {number}"), number)))


if __name__ == "__main__":
    main()
