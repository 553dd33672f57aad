#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures `vellum bake` without a cache, with an empty one and with a full one: each glTF file of a folder in a process of
its own, and 100 files with one texture of 2048 x 2048 in one process. Prints tables; times are CPU milliseconds of a
file, the least of several runs.

usage: cache.py VELLUM FOLDER [RUNS]
"""
import json
import math
import pathlib
import random
import resource
import struct
import subprocess
import sys
import tempfile
import zlib

SIZE = 2048
FILES = 100


def png():
    """Discs of noise that compresses like a photograph's."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    source = random.Random(1)
    colours = bytes(i & 0xf0 for i in range(256))
    rows = []
    for y in range(SIZE):
        row = bytearray(source.randbytes(4 * SIZE).translate(colours))
        alpha = bytearray(SIZE)
        for x in range(64, SIZE, 128):
            half = 3600 - (y % 128 - 64) ** 2
            if half > 0:
                reach = int(math.sqrt(half))
                alpha[x - reach:x + reach] = b"\xff" * (2 * reach)
        row[3::4] = alpha
        rows.append(b"\0" + bytes(row))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(b"".join(rows), 6)) + chunk(b"IEND", b""))


def glb(number, image):
    """100 cards of two triangles, at places of their own on the texture."""
    source = random.Random(number)
    uvs, indices = [], []
    for card in range(100):
        u, v, side = source.random(), source.random(), 0.05 + 0.1 * source.random()
        uvs += [u, v, u + side, v, u + side, v + side, u, v + side]
        indices += [4 * card + i for i in (0, 1, 2, 0, 2, 3)]
    parts = [struct.pack(f"<{3 * len(uvs) // 2}f", *([0.0] * (3 * len(uvs) // 2))), struct.pack(f"<{len(uvs)}f", *uvs),
             struct.pack(f"<{len(indices)}I", *indices), image]
    views, binary = [], b""
    for part in parts:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(part)})
        binary += part + b"\0" * (-len(part) % 4)
    text = json.dumps({
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": len(binary)}], "bufferViews": views,
        "accessors": [{"bufferView": view, "componentType": kind, "count": count, "type": shape} for view, kind, count, shape in
                      ((0, 5126, len(uvs) // 2, "VEC3"), (1, 5126, len(uvs) // 2, "VEC2"), (2, 5125, len(indices), "SCALAR"))],
        "images": [{"bufferView": 3, "mimeType": "image/png"}], "textures": [{"source": 0}],
        "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
    }).encode()
    text += b" " * (-len(text) % 4)
    return (struct.pack("<III", 0x46546c67, 2, 28 + len(text) + len(binary)) + struct.pack("<II", len(text), 0x4e4f534a) +
            text + struct.pack("<II", len(binary), 0x004e4942) + binary)


def cpu_ms(*words):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1000 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def measure(vellum, source, scratch, runs, files):
    """Milliseconds of a file without a cache, with an empty one, and with a full one."""
    output = scratch / ("out" if source.is_dir() else "out.glb")
    least = [math.inf] * 3
    for run in range(runs):
        cache = scratch / f"cache{run}"
        for i, more in enumerate(([], ["--cache", cache], ["--cache", cache])):
            least[i] = min(least[i], cpu_ms(vellum, "bake", source, "-o", output, "-j", "1", *more))
    kept = [file.stat().st_size for file in cache.rglob("*") if file.is_file()]
    return [f"{ms / files:.1f}" for ms in least] + [f"{sum(kept) / len(kept):,.0f}"]


def main():
    vellum, folder, runs = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int((sys.argv + ["5"])[3])
    print("| file | no cache, ms | miss, ms | hit, ms | entry, bytes |\n|---|--:|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        for file in sorted(folder.glob("*.gl*")):
            print("| " + " | ".join([file.name, *measure(vellum, file, scratch, runs, 1)]) + " |", flush=True)
            for cache in scratch.glob("cache*"):
                subprocess.run(["rm", "-r", cache], check=True)
        image = png()
        models = scratch / "models"
        models.mkdir()
        for number in range(FILES):
            (models / f"{number}.glb").write_bytes(glb(number, image))
        row = measure(vellum, models, scratch, max(1, runs // 3), FILES)
        print(f"| {FILES} files with one texture of {len(image) / 2**20:.1f} MiB, each | " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
