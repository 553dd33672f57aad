// SPDX-License-Identifier: Apache-2.0
// Draws states into square tiles of pixels, each pixel once: the first shape that has it keeps it.
const tileSize = 256;
const edgeColor = [20, 22, 27];

function parseColor(text) {
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
}
const stateColors = facts.stateColors.map(parseColor);

// Pixels of a tile that are still free. Each row is a forest: a taken pixel leads to one further on.
class FreePixels {
  constructor() {
    this.next = new Uint16Array((tileSize + 1) * tileSize);
    for (let i = 0; i < this.next.length; ++i) this.next[i] = i % (tileSize + 1);
    this.left = tileSize * tileSize;
  }

  find(row, x) {
    const next = this.next;
    const base = row * (tileSize + 1);
    let found = x;
    while (next[base + found] !== found) found = next[base + found];
    while (next[base + x] !== found) {
      const step = next[base + x];
      next[base + x] = found;
      x = step;
    }
    return found;
  }

  take(row, x) {
    this.next[row * (tileSize + 1) + x] = x + 1;
    --this.left;
  }
}

// Values that are constant over the pixels of a shape in a tile.
function shapeInTile(model, shape, left, top, scale) {
  const p = model.uvs;
  const at = shape * 6;
  const x = [(p[at] - left) * scale, (p[at + 2] - left) * scale, (p[at + 4] - left) * scale];
  const y = [(p[at + 1] - top) * scale, (p[at + 3] - top) * scale, (p[at + 5] - top) * scale];
  const ax = x[1] - x[0], ay = y[1] - y[0], bx = x[2] - x[0], by = y[2] - y[0];
  const area = ax * by - ay * bx;
  const ux = by / area, uy = -bx / area, vx = -ay / area, vy = ax / area;
  const slopes = [Math.hypot(ux, uy), Math.hypot(vx, vy), Math.hypot(ux + vx, uy + vy)];
  const record = model.record[shape];
  const level = model.pageLevel(record);
  return {
    x, y, ux, uy, vx, vy, slopes, record, level, area,
    microHeight: 1 / (Math.max(...slopes) * 2 ** level), // in pixels
    firstByte: record < 0 ? 0 : model.records[record * 6 + 1],
  };
}

// The colour of a pixel whose centre is at (px, py); written to `out` as red, green, blue, alpha.
function paintPixel(model, s, px, py, shown, outlines, out) {
  const dx = px - s.x[0], dy = py - s.y[0];
  const u = dx * s.ux + dy * s.uy;
  const v = dx * s.vx + dy * s.vy;
  let red = 0, green = 0, blue = 0, alpha = 0;
  const add = (state) => {
    if (!shown[state]) return;
    const color = stateColors[state];
    red += color[0];
    green += color[1];
    blue += color[2];
    ++alpha;
  };
  let samples = 1;
  if (s.record < 0) {
    add(~s.record);
  } else if (s.microHeight < 1.4 && s.level > 0) { // several micro-triangles in the pixel
    samples = 4;
    for (let i = 0; i < 4; ++i) {
      const ox = (i & 1) / 2 - 0.25, oy = (i >> 1) / 2 - 0.25;
      add(model.stateAt(s.record, u + ox * s.ux + oy * s.uy, v + ox * s.vx + oy * s.vy));
    }
  } else {
    add(model.stateAt(s.record, u, v));
  }
  if (alpha > 0) {
    red /= alpha;
    green /= alpha;
    blue /= alpha;
  }
  alpha = (255 * alpha) / samples;
  if (outlines) {
    const w = 1 - u - v;
    if (s.microHeight >= 7 && s.level > 0 && alpha > 0) {
      const steps = 1 << s.level;
      let line = Infinity;
      for (let i = 0; i < 3; ++i) {
        const position = (i === 0 ? u : i === 1 ? v : w) * steps;
        const part = position - Math.floor(position);
        line = Math.min(line, Math.min(part, 1 - part) / (steps * s.slopes[i]));
      }
      const share = 0.45 * Math.max(0, Math.min(1, 1.1 - line));
      red += (255 - red) * share;
      green += (255 - green) * share;
      blue += (255 - blue) * share;
    }
    const edge = Math.min(u / s.slopes[0], v / s.slopes[1], w / s.slopes[2]);
    const share = Math.max(0, Math.min(1, 1.3 - edge)) * 0.8;
    if (share > 0) {
      // Over what may be nothing.
      const below = (alpha / 255) * (1 - share);
      const sum = share + below;
      red = (edgeColor[0] * share + red * below) / sum;
      green = (edgeColor[1] * share + green * below) / sum;
      blue = (edgeColor[2] * share + blue * below) / sum;
      alpha = 255 * sum;
    }
  }
  out[0] = red;
  out[1] = green;
  out[2] = blue;
  out[3] = alpha;
}

// A generator that yields now and then, so that its caller can stop in time; it returns an ImageData, or null for
// a tile with nothing in it. The tile's corner is at (column, row) * tileSize pixels of `scale` pixels for 1 of u or v.
function* rasterTile(model, index, column, row, scale, shown, outlines) {
  const left = (column * tileSize) / scale, top = (row * tileSize) / scale;
  const extent = tileSize / scale;
  const shapes = index.query({ left, top, right: left + extent, bottom: top + extent });
  if (shapes.length === 0) return null;
  const image = new ImageData(tileSize, tileSize);
  const data = image.data;
  const free = new FreePixels();
  const out = [0, 0, 0, 0];
  let work = 0;
  for (const shape of shapes) {
    if (free.left === 0) break;
    const s = shapeInTile(model, shape, left, top, scale);
    const ys = s.y, xs = s.x;
    const first = Math.max(0, Math.ceil(Math.min(ys[0], ys[1], ys[2]) - 0.5));
    const last = Math.min(tileSize - 1, Math.floor(Math.max(ys[0], ys[1], ys[2]) - 0.5));
    // Lines between tiny triangles would hide all of them.
    const lines = outlines && 1 / Math.max(...s.slopes) > 6;
    let drawn = 0;
    for (let y = first; y <= last && Number.isFinite(s.ux); ++y) {
      const center = y + 0.5;
      let low = Infinity, high = -Infinity;
      for (let i = 0; i < 3; ++i) {
        const j = i === 2 ? 0 : i + 1;
        if (ys[i] === ys[j] || Math.min(ys[i], ys[j]) > center || Math.max(ys[i], ys[j]) < center) continue;
        const x = xs[i] + ((center - ys[i]) / (ys[j] - ys[i])) * (xs[j] - xs[i]);
        low = Math.min(low, x);
        high = Math.max(high, x);
      }
      const end = Math.min(tileSize, Math.floor(high - 0.5) + 1);
      for (let x = free.find(y, Math.max(0, Math.min(tileSize, Math.ceil(low - 0.5)))); x < end; x = free.find(y, x)) {
        paintPixel(model, s, x + 0.5, center, shown, lines, out);
        const at = (y * tileSize + x) * 4;
        data[at] = out[0];
        data[at + 1] = out[1];
        data[at + 2] = out[2];
        data[at + 3] = out[3];
        free.take(y, x);
        ++drawn;
      }
    }
    // A shape too small to contain the centre of a pixel still gets one.
    if (drawn === 0) {
      const x = Math.floor((xs[0] + xs[1] + xs[2]) / 3), y = Math.floor((ys[0] + ys[1] + ys[2]) / 3);
      if (x >= 0 && y >= 0 && x < tileSize && y < tileSize && free.find(y, x) === x) {
        const shares = model.shares(s.record);
        const state = shares.indexOf(Math.max(...shares));
        if (shown[state]) data.set([...stateColors[state], 255], (y * tileSize + x) * 4);
        free.take(y, x);
      }
    }
    work += drawn + 60;
    if (work > 6000) {
      work = 0;
      yield;
    }
  }
  return image;
}
