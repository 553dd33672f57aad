#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the speed of the WebAssembly module under Node.js with that of the native library, with one thread each: pairs of
bakes, one after the other, and the median of their ratios. 1 is as fast as native, .5 takes twice as long.

usage: VELLUM_LIBRARY_PATH=build/release/lib bench/baker/wasm.py [PACKAGE]    PACKAGE: [build/wasm/package]
"""
import array
import json
import math
import pathlib
import random
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bindings/python"))
import vellum  # noqa: E402

PAIRS, WARM = 15, 3
CHILD = """
import { pathToFileURL } from 'node:url';
import { createInterface } from 'node:readline';
const { load } = await import(pathToFileURL(process.argv[1]));
const vellum = await load();
let input, options;
for await (const line of createInterface({ input: process.stdin })) {
  if (line !== '') {
    const { size, alpha, uvs, level } = JSON.parse(line);
    input = { texture: { width: size, height: size, alpha: new Uint8Array(Buffer.from(alpha, 'base64')) }, uvs: Float32Array.from(uvs) };
    options = { level };
  }
  const start = performance.now();
  const made = vellum.bake(input, options);
  console.log(performance.now() - start, made.data.length);
}
"""


def leaves(size):
    """A texture of overlapping leaves with soft edges."""
    pick = random.Random(1)
    alpha = bytearray(size * size)
    for _ in range(60):
        x, y, turn, length = pick.random(), pick.random(), pick.uniform(0, math.pi), pick.uniform(0.05, 0.12)
        reach = int(length * size) + 1
        for j in range(max(int(y * size) - reach, 0), min(int(y * size) + reach, size)):
            for i in range(max(int(x * size) - reach, 0), min(int(x * size) + reach, size)):
                u, v = i / size - x, j / size - y
                a, b = u * math.cos(turn) + v * math.sin(turn), v * math.cos(turn) - u * math.sin(turn)
                inside = 1 - (a / length) ** 2 - (b / length * 3) ** 2
                alpha[j * size + i] = max(alpha[j * size + i], min(max(int(255 * (0.5 + inside * 4)), 0), 255))
    return bytes(alpha)


def triangles(count, edge):
    """As many triangles of about that edge, in texture coordinates."""
    pick = random.Random(2)
    uvs = []
    for _ in range(count):
        u, v, turn = pick.random(), pick.random(), pick.uniform(0, 2 * math.pi)
        uvs += [u, v, u + edge * math.cos(turn), v + edge * math.sin(turn), u - edge * math.sin(turn), v + edge * math.cos(turn)]
    return array.array("f", uvs)


SCENES = {
    "2,000 triangles, 1024 x 1024, automatic levels": (1024, 2000, 0.06, -1),
    "2,000 triangles, 1024 x 1024, level 5": (1024, 2000, 0.06, 5),
    "200 triangles, 1024 x 1024, level 8": (1024, 200, 0.3, 8),
    "20,000 triangles, 256 x 256, level 3": (256, 20000, 0.05, 3),
}


def main():
    import base64
    package = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/wasm/package").resolve()
    child = subprocess.Popen(["node", "--input-type=module", "--eval", CHILD, str(package / "index.js")], stdin=subprocess.PIPE,
                             stdout=subprocess.PIPE, text=True)
    print(f"{'scene':48} {'native':>9} {'wasm':>9} {'ratio':>6}  quartiles")
    ratios = []
    for name, (size, count, edge, level) in SCENES.items():
        alpha, uvs = leaves(size), triangles(count, edge)
        texture = vellum.Texture(alpha, width=size, height=size)
        mesh = vellum.BakeInput(texture, uvs)

        def by_wasm(line=""):
            child.stdin.write(line + "\n")
            child.stdin.flush()
            spent, data = child.stdout.readline().split()
            return float(spent), int(data)

        def natively():
            start = time.perf_counter()
            made = vellum.bake(mesh, level=level, threads=1)
            return 1000 * (time.perf_counter() - start), len(made.data)

        first = by_wasm(json.dumps({"size": size, "alpha": base64.b64encode(alpha).decode(), "uvs": list(uvs), "level": level}))
        if first[1] != natively()[1]:
            sys.exit(f"{name}: the results differ")
        for _ in range(WARM):
            by_wasm()
        pairs = [(natively()[0], by_wasm()[0]) for _ in range(PAIRS)]
        found = [native / wasm for native, wasm in pairs]
        low, middle, high = statistics.quantiles(found, n=4)
        ratios.append(middle)
        print(f"{name:48} {statistics.median(p[0] for p in pairs):6.1f} ms {statistics.median(p[1] for p in pairs):6.1f} ms {middle:6.2f}"
              f"  {low:.2f} to {high:.2f}", flush=True)
    print(f"geometric mean {math.exp(statistics.mean(map(math.log, ratios))):.2f}")
    child.stdin.close()
    return child.wait()


if __name__ == "__main__":
    sys.exit(main())
