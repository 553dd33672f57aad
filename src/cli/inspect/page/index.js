// Finds the shapes of a material at a place: a grid over their bounds, each cell with the shapes that touch it.
class ShapeIndex {
  constructor(model, first, end) {
    this.model = model;
    this.first = first;
    this.end = end;
    this.left = this.top = Infinity;
    this.right = this.bottom = -Infinity;
    for (let s = first; s < end; ++s) {
      const b = model.bounds(s);
      if (!Number.isFinite(b.left + b.right + b.top + b.bottom)) continue;
      this.left = Math.min(this.left, b.left);
      this.right = Math.max(this.right, b.right);
      this.top = Math.min(this.top, b.top);
      this.bottom = Math.max(this.bottom, b.bottom);
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

  // The cells from and to which a rectangle reaches, or null for what is not finite.
  cells(b) {
    if (!Number.isFinite(b.left + b.right + b.top + b.bottom)) return null;
    const clamp = (x) => Math.max(0, Math.min(this.edge - 1, Math.floor(x)));
    const sx = this.edge / (this.right - this.left || 1);
    const sy = this.edge / (this.bottom - this.top || 1);
    return [clamp((b.left - this.left) * sx), clamp((b.top - this.top) * sy),
            clamp((b.right - this.left) * sx), clamp((b.bottom - this.top) * sy)];
  }

  countEntries(edge) {
    this.edge = edge;
    let entries = 0;
    for (let s = this.first; s < this.end; ++s) {
      const cells = this.cells(this.model.bounds(s));
      if (cells) entries += (cells[2] - cells[0] + 1) * (cells[3] - cells[1] + 1);
    }
    return entries;
  }

  fill(edge) {
    this.edge = edge;
    const forEachEntry = (visit) => {
      for (let s = this.first; s < this.end; ++s) {
        const cells = this.cells(this.model.bounds(s));
        if (!cells) continue;
        for (let y = cells[1]; y <= cells[3]; ++y)
          for (let x = cells[0]; x <= cells[2]; ++x) visit(y * edge + x, s);
      }
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
    const cells = this.cells(rectangle);
    if (!cells) return found;
    ++this.stamp;
    for (let y = cells[1]; y <= cells[3]; ++y)
      for (let x = cells[0]; x <= cells[2]; ++x)
        for (let i = this.starts[y * this.edge + x]; i < this.starts[y * this.edge + x + 1]; ++i) {
          const s = this.entries[i];
          if (this.stamps[s - this.first] === this.stamp) continue;
          this.stamps[s - this.first] = this.stamp;
          const b = this.model.bounds(s);
          if (b.left <= rectangle.right && b.right >= rectangle.left && b.top <= rectangle.bottom && b.bottom >= rectangle.top)
            found.push(s);
        }
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
