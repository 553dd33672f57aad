#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes tree.glb, a tree of alpha-tested leaf cards: the model of docs/tutorial.md. Equal bytes on every machine.

usage: tree.py [FILE]
"""
import json
import math
import random
import struct
import sys
import zlib

SIZE = 256  # texels of the texture
CARD = [(0, 0), (1, 0), (1, 1), (0, 1)]  # texture coordinates; v = 1 is where a card is attached

# The leaves of a twig: where each is attached, its direction in degrees, its length, all in parts of the card.
LEAVES = [(0.5, 0.92 - 0.115 * i, side * (62 - 4 * i) - 90, 0.47 - 0.03 * i) for i in range(7) for side in (-1, 1)]
LEAVES.append((0.5, 0.25, -90, 0.24))


def twig(x, y):
    """How far inside a leaf or the stem a point of the card is, in parts of the card, and a shade of green."""
    inside, shade = (0.012 - abs(x - 0.5) if y > 0.2 else -1.0), 0.5
    for number, (from_x, from_y, angle, length) in enumerate(LEAVES):
        cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        along = ((x - from_x) * cos + (y - from_y) * sin) / length
        across = abs((y - from_y) * cos - (x - from_x) * sin) / length
        if 0 < along < 1:
            leaf = (0.13 * math.sin(math.pi * along ** 0.8) - across) * length
            if leaf > inside:
                inside, shade = leaf, 0.7 + 0.3 * (number % 4) / 3 - (0.25 if across < 0.015 else 0)
    return inside, shade


def png():
    rows = bytearray()
    for y in range(SIZE):
        rows.append(0)  # no filter
        for x in range(SIZE):
            inside, shade = twig((x + 0.5) / SIZE, (y + 0.5) / SIZE)
            rows += bytes([int(74 * shade), int(118 * shade), int(40 * shade),
                           int(255 * min(max(0.5 + inside * SIZE / 2, 0), 1))])
    # Stored without compression: what a compressor writes depends on its version.
    blocks = [bytes(rows[i:i + 65535]) for i in range(0, len(rows), 65535)]
    data = b"\x78\x01" + b"".join(
        struct.pack("<BHH", block is blocks[-1], len(block), len(block) ^ 0xffff) + block for block in blocks)
    data += struct.pack(">I", zlib.adler32(rows))

    def chunk(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", data) + chunk(b"IEND", b""))


def add(a, b, scale=1.0):
    return [a[i] + scale * b[i] for i in range(3)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    length = math.sqrt(sum(x * x for x in a))
    return [x / length for x in a]


class Mesh:
    def __init__(self):
        self.positions, self.normals, self.uvs, self.indices = [], [], [], []

    def quad(self, corners, normals, uvs):
        first = len(self.positions)
        for corner, normal, uv in zip(corners, normals, uvs):
            self.positions.append([round(x, 4) for x in corner])
            self.normals.append([round(x, 4) for x in unit(normal)])
            self.uvs.append(uv)
        self.indices += [first + i for i in (0, 1, 2, 0, 2, 3)]


class Tree:
    def __init__(self):
        self.bark, self.leaves, self.random = Mesh(), Mesh(), random.Random(7)

    def direction(self, about, spread):
        return unit([x + spread * (self.random.random() * 2 - 1) for x in about])

    def branch(self, start, direction, length, radius, depth):
        end = add(start, direction, length)
        side = unit(cross(direction, [0.3, 0.2, 1]))
        other = cross(direction, side)
        ring = [add([x * math.cos(a) for x in side], other, math.sin(a)) for a in
                [2 * math.pi * i / 7 for i in range(8)]]
        for a, b in zip(ring, ring[1:]):
            self.bark.quad([add(start, a, radius), add(start, b, radius), add(end, b, radius * 0.7),
                            add(end, a, radius * 0.7)], [a, b, b, a], CARD)
        if depth == 0:
            for _ in range(7):
                self.card(add(start, direction, length * self.random.random()), self.direction(direction, 0.9))
            return
        for i in range(5):
            begin = add(start, direction, length * (1 if i == 0 else 0.45 + 0.5 * self.random.random()))
            self.branch(begin, self.direction(add(direction, [0, 0.3, 0]), 1.0), length * 0.68, radius * 0.52,
                        depth - 1)

    def card(self, at, direction):
        size = 0.42 + 0.2 * self.random.random()
        side = unit(cross(direction, self.direction([0, 1, 0], 0.5)))
        corners = [add(add(at, direction, size * (1 - v)), side, size * (u - 0.5)) for u, v in CARD]
        self.leaves.quad(corners, [add(cross(side, direction), [0, 1, 0])] * 4, CARD)


def main():
    tree = Tree()
    tree.branch([0, 0, 0], unit([0.05, 1, 0]), 1.3, 0.11, 3)
    binary, views, accessors, primitives = bytearray(), [], [], []

    def view(content):
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(content)})
        binary.extend(content + bytes(-len(content) % 4))
        return len(views) - 1

    def accessor(code, component, kind, values, **more):
        flat = [x for value in values for x in value] if kind != "SCALAR" else values
        accessors.append({"bufferView": view(struct.pack(f"<{len(flat)}{code}", *flat)), "componentType": component,
                          "count": len(values), "type": kind, **more})
        return len(accessors) - 1

    for material, mesh in enumerate((tree.bark, tree.leaves)):
        bounds = {"min": [min(column) for column in zip(*mesh.positions)],
                  "max": [max(column) for column in zip(*mesh.positions)]}
        primitives.append({"attributes": {"POSITION": accessor("f", 5126, "VEC3", mesh.positions, **bounds),
                                          "NORMAL": accessor("f", 5126, "VEC3", mesh.normals),
                                          "TEXCOORD_0": accessor("f", 5126, "VEC2", mesh.uvs)},
                           "indices": accessor("I", 5125, "SCALAR", mesh.indices), "material": material})
    image = view(png())
    document = {
        "asset": {"version": "2.0", "generator": "examples/python/tree.py of Vellum"},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"name": "tree", "primitives": primitives}],
        "materials": [{"name": "bark", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.14, 0.09, 1],
                                                                "metallicFactor": 0}},
                      {"name": "leaves", "alphaMode": "MASK", "doubleSided": True,
                       "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}],
        "textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071, "wrapT": 33071}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}]}
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(sys.argv[1] if len(sys.argv) > 1 else "tree.glb", "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(binary), b"BIN\0") + binary)


if __name__ == "__main__":
    main()
