// SPDX-License-Identifier: Apache-2.0
// The data of the file: `facts`, and the numbers of page.h as typed arrays.
const facts = JSON.parse(document.getElementById("facts").textContent);

// State names by number, and the order in which they are listed.
const stateNames = ["transparent", "opaque", "unknown, transparent", "unknown, opaque"];
const stateOrder = [1, 0, 3, 2];

function bytesOfBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

// The position of a point with barycentrics (u, v) on the curve of a level: curveIndex of curve.h.
function spreadBits(x) {
  x = (x | (x << 8)) & 0x00ff00ff;
  x = (x | (x << 4)) & 0x0f0f0f0f;
  x = (x | (x << 2)) & 0x33333333;
  return (x | (x << 1)) & 0x55555555;
}

function curveIndex(u, v, level) {
  const steps = 1 << level;
  const cu = (u > 0 ? (u < 1 ? u : 1) : 0) * steps;
  const cv = (v > 0 ? (v < 1 ? v : 1) : 0) * steps;
  let iu = cu | 0;
  let iv = cv | 0;
  const rest = cu - iu + (cv - iv);
  if (iu >= steps) iu = steps - 1;
  if (iv >= steps) iv = steps - 1;
  const diagonal = iu + iv;
  if (diagonal >= steps) iu = steps - 1 - iv;
  const inverted = rest >= 1 && diagonal < steps - 1;
  const mask = steps - 1;
  const iw = (inverted ? ~(iu + iv) - 1 : ~(iu + iv)) & mask;
  const middleOrCorner = ~(iu ^ iw) & mask;
  const flips = (iu ^ iv) & middleOrCorner;
  let parity = flips;
  parity ^= parity >> 1;
  parity ^= parity >> 2;
  parity ^= parity >> 4;
  parity ^= parity >> 8;
  const high = ((parity ^ iu) & ~middleOrCorner & mask) | flips;
  return spreadBits(middleOrCorner) | (spreadBits(high) << 1);
}

class Model {
  constructor(buffer) {
    const words = new Uint32Array(buffer, 0, buffer.byteLength >> 2);
    const recordWords = 6;
    const shapeWords = 7;
    const shapesAt = facts.records * recordWords;
    const shapeOfAt = shapesAt + facts.shapes * shapeWords;
    const numbersAt = shapeOfAt + facts.triangles;
    this.records = words.subarray(0, shapesAt);
    this.states = new Uint8Array(buffer, (numbersAt + facts.triangles) * 4, facts.stateBytes);
    this.shapeOf = words.subarray(shapeOfAt, numbersAt);
    this.numbers = words.subarray(numbersAt, numbersAt + facts.triangles);
    const floats = new Float32Array(buffer, 0, words.length);
    const ints = new Int32Array(buffer, 0, words.length);
    this.uvs = new Float32Array(facts.shapes * 6);
    this.record = new Int32Array(facts.shapes);
    for (let s = 0; s < facts.shapes; ++s) {
      const at = shapesAt + s * shapeWords;
      this.uvs.set(floats.subarray(at, at + 6), s * 6);
      this.record[s] = ints[at + 6];
    }
    this.boxes = new Float32Array(facts.shapes * 4); // left, top, right, bottom; NaN where a coordinate is
    for (let s = 0; s < facts.shapes; ++s) {
      const b = this.bounds(s);
      this.boxes.set([b.left, b.top, b.right, b.bottom], s * 4);
    }
    this.listTriangles();
  }

  // The triangles of each shape, one shape after another.
  listTriangles() {
    this.firstOfShape = new Uint32Array(facts.shapes + 1);
    for (const shape of this.shapeOf) ++this.firstOfShape[shape + 1];
    for (let s = 0; s < facts.shapes; ++s) this.firstOfShape[s + 1] += this.firstOfShape[s];
    const next = this.firstOfShape.slice();
    this.triangles = new Uint32Array(facts.triangles);
    for (let t = 0; t < facts.triangles; ++t) this.triangles[next[this.shapeOf[t]]++] = t;
  }

  uses(shape) { return this.firstOfShape[shape + 1] - this.firstOfShape[shape]; }

  // The primitive of a triangle of the page, and its number there.
  place(triangle) {
    let low = 0;
    let high = facts.primitives.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (facts.primitives[middle].first <= triangle) low = middle;
      else high = middle - 1;
    }
    return { primitive: facts.primitives[low], triangle: this.numbers[triangle] };
  }

  level(record) { return record < 0 ? -1 : this.records[record * 6] & 255; }
  pageLevel(record) { return record < 0 ? 0 : (this.records[record * 6] >> 8) & 255; }
  twoState(record) { return record >= 0 && ((this.records[record * 6] >> 16) & 255) === 1; }

  bytes(record) {
    if (record < 0) return 0;
    return Math.ceil((4 ** this.level(record) * (this.twoState(record) ? 1 : 2)) / 8);
  }

  // The share of each state.
  shares(record) {
    if (record < 0) return [0, 1, 2, 3].map((state) => (~record === state ? 1 : 0));
    const count = 4 ** this.level(record);
    return [0, 1, 2, 3].map((state) => this.records[record * 6 + 2 + state] / count);
  }

  unknown(record) {
    if (record < 0) return ~record >= 2 ? 1 : 0;
    return (this.records[record * 6 + 4] + this.records[record * 6 + 5]) / 4 ** this.level(record);
  }

  stateAt(record, u, v) {
    if (record < 0) return ~record;
    const index = curveIndex(u, v, this.pageLevel(record));
    return (this.states[this.records[record * 6 + 1] + (index >> 2)] >> ((index & 3) * 2)) & 3;
  }

  // In squares of the unit of UVs.
  area(shape) {
    const p = this.uvs;
    const at = shape * 6;
    const area = Math.abs((p[at + 2] - p[at]) * (p[at + 5] - p[at + 1]) - (p[at + 3] - p[at + 1]) * (p[at + 4] - p[at])) / 2;
    return Number.isFinite(area) ? area : 0;
  }

  bounds(shape) {
    const p = this.uvs.subarray(shape * 6, shape * 6 + 6);
    return {
      left: Math.min(p[0], p[2], p[4]), right: Math.max(p[0], p[2], p[4]),
      top: Math.min(p[1], p[3], p[5]), bottom: Math.max(p[1], p[3], p[5]),
    };
  }

  // Barycentrics of (x, y); not finite where the triangle has no area.
  barycentrics(shape, x, y) {
    const p = this.uvs;
    const at = shape * 6;
    const ax = p[at + 2] - p[at], ay = p[at + 3] - p[at + 1];
    const bx = p[at + 4] - p[at], by = p[at + 5] - p[at + 1];
    const area = ax * by - ay * bx;
    const dx = x - p[at], dy = y - p[at + 1];
    return [(dx * by - dy * bx) / area, (dy * ax - dx * ay) / area];
  }
}
