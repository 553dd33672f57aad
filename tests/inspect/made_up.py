# SPDX-License-Identifier: Apache-2.0
"""glTF files made up for the tests of pages: a grid of triangles over the UV square of one masked material each."""
import json
import math
import struct
import zlib


def png(edge, alpha):
    """A green picture with the alpha that alpha(x, y) gives."""
    rows = b"".join(b"\0" + b"".join(bytes((60, 140, 40, alpha(x, y))) for x in range(edge)) for y in range(edge))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", edge, edge, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def disc(edge):
    return png(edge, lambda x, y: 255 if math.hypot(x + 0.5 - edge / 2, y + 0.5 - edge / 2) < 0.37 * edge else 0)


def holes(edge):
    return png(edge, lambda x, y: 0 if x // 8 % 2 and y // 8 % 2 else 255)


def grid(columns):
    """Positions and UVs of columns * columns squares, two triangles each."""
    positions, uvs = [], []
    for row in range(columns):
        for column in range(columns):
            for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1), (0, 1), (1, 0)):
                u, v = (column + dx) / columns, (row + dy) / columns
                uvs += (u, v)
                positions += (u, 1 - v, 0.1 * math.sin(9 * u))
    return positions, uvs


def glb(meshes):
    """meshes: (mesh name, material name, PNG, columns of the grid)."""
    binary, views, accessors = b"", [], []

    def view(data):
        nonlocal binary
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary += data + b"\0" * (-len(data) % 4)
        return len(views) - 1

    def accessor(values, components, **more):
        data = struct.pack(f"<{len(values)}f", *values)
        accessors.append({"bufferView": view(data), "componentType": 5126, "count": len(values) // components,
                          "type": f"VEC{components}", **more})
        return len(accessors) - 1

    document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(meshes)))}], "nodes": [],
                "meshes": [], "materials": [], "textures": [], "images": []}
    for number, (mesh, material, image, columns) in enumerate(meshes):
        positions, uvs = grid(columns)
        attributes = {"POSITION": accessor(positions, 3, min=[0, 0, -1], max=[1, 1, 1]), "TEXCOORD_0": accessor(uvs, 2)}
        document["nodes"].append({"mesh": number})
        document["meshes"].append({"name": mesh, "primitives": [{"attributes": attributes, "material": number}]})
        document["materials"].append({"name": material, "alphaMode": "MASK",
                                      "pbrMetallicRoughness": {"baseColorTexture": {"index": number}}})
        document["textures"].append({"source": number})
        document["images"].append({"mimeType": "image/png", "bufferView": view(image)})
    document |= {"bufferViews": views, "accessors": accessors, "buffers": [{"byteLength": len(binary)}]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return (struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)) + struct.pack("<I4s", len(text), b"JSON") +
            text + struct.pack("<I4s", len(binary), b"BIN\0") + binary)
