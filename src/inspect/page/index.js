// SPDX-License-Identifier: Apache-2.0
// Finds the shapes of a material at a place: a grid over their bounds, each cell with the shapes that touch it.
class ShapeIndex {
  constructor(model, first, end) {
    this.model = model;
    this.first = first;
    this.end = end;
    this.left = this.top = Infinity;
    this.right = this.bottom = -Infinity;
    for (let s = first; s < end; ++s) {
      const [left, top, right, bottom] = model.boxes.subarray(s * 4, s * 4 + 4);
      if (!Number.isFinite(left + top + right + bottom)) continue;
      this.left = Math.min(this.left, left);
      this.top = Math.min(this.top, top);
      this.right = Math.max(this.right, right);
      this.bottom = Math.max(this.bottom, bottom);
    }
    this.empty = !(this.left <= this.right);
    if (this.empty) this.left = this.top = 0, this.right = this.bottom = 1;
    // Finer where there are more shapes, coarser again where they are so large that the lists would be long.
    let edge = Math.max(1, Math.min(512, Math.ceil(Math.sqrt((end - first) * 2))));
    while (edge > 1 && this.countEntries(edge) > 4e6) edge = edge >> 1;
    this.fill(edge);
    this.stamps = new Uint32Array(end - first);
    this.stamp = 0;
  }

  // Calls visit(x0, y0, x1, y1) with the cells that a rectangle reaches from and to, if it is finite.
  cells(left, top, right, bottom, visit) {
    if (!Number.isFinite(left + top + right + bottom)) return;
    const last = this.edge - 1;
    const clamp = (x) => Math.max(0, Math.min(last, Math.floor(x)));
    const sx = this.edge / (this.right - this.left || 1);
    const sy = this.edge / (this.bottom - this.top || 1);
    visit(clamp((left - this.left) * sx), clamp((top - this.top) * sy), clamp((right - this.left) * sx), clamp((bottom - this.top) * sy));
  }

  cellsOf(shape, visit) {
    const b = this.model.boxes;
    this.cells(b[shape * 4], b[shape * 4 + 1], b[shape * 4 + 2], b[shape * 4 + 3], visit);
  }

  countEntries(edge) {
    this.edge = edge;
    let entries = 0;
    for (let s = this.first; s < this.end; ++s)
      this.cellsOf(s, (x0, y0, x1, y1) => { entries += (x1 - x0 + 1) * (y1 - y0 + 1); });
    return entries;
  }

  fill(edge) {
    this.edge = edge;
    const forEachEntry = (visit) => {
      for (let s = this.first; s < this.end; ++s)
        this.cellsOf(s, (x0, y0, x1, y1) => {
          for (let y = y0; y <= y1; ++y)
            for (let x = x0; x <= x1; ++x) visit(y * edge + x, s);
        });
    };
    this.starts = new Uint32Array(edge * edge + 1);
    forEachEntry((cell) => ++this.starts[cell + 1]);
    for (let i = 0; i < edge * edge; ++i) this.starts[i + 1] += this.starts[i];
    const next = this.starts.slice();
    this.entries = new Uint32Array(this.starts[edge * edge]);
    forEachEntry((cell, s) => { this.entries[next[cell]++] = s; });
  }

  // Shapes whose bounds meet the rectangle, in order.
  query(rectangle) {
    const found = [];
    if (this.empty || rectangle.right < this.left || rectangle.left > this.right ||
        rectangle.bottom < this.top || rectangle.top > this.bottom) return found;
    ++this.stamp;
    const boxes = this.model.boxes;
    this.cells(rectangle.left, rectangle.top, rectangle.right, rectangle.bottom, (x0, y0, x1, y1) => {
      for (let y = y0; y <= y1; ++y)
        for (let i = this.starts[y * this.edge + x0]; i < this.starts[y * this.edge + x1 + 1]; ++i) {
          const s = this.entries[i];
          if (this.stamps[s - this.first] === this.stamp) continue;
          this.stamps[s - this.first] = this.stamp;
          if (boxes[s * 4] <= rectangle.right && boxes[s * 4 + 2] >= rectangle.left &&
              boxes[s * 4 + 1] <= rectangle.bottom && boxes[s * 4 + 3] >= rectangle.top) found.push(s);
        }
    });
    return found.sort((a, b) => a - b);
  }

  // Shapes at a point, in order; at most `most`.
  at(u, v, most = 200) {
    const found = [];
    for (const s of this.query({ left: u, right: u, top: v, bottom: v })) {
      const [a, b] = this.model.barycentrics(s, u, v);
      if (a >= 0 && b >= 0 && a + b <= 1) found.push(s);
      if (found.length === most) break;
    }
    return found;
  }
}
