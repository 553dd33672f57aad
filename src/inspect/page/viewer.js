// SPDX-License-Identifier: Apache-2.0
// The picture of a material's UV space: texture, states, outlines of chosen shapes; zoom and pan.
class Viewer {
  constructor(canvas, model, on) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.model = model;
    this.on = on; // hover(shapes, u, v, x, y), pick(shape), moved(), busy(is)
    this.shown = [true, true, true, true];
    this.outlines = true;
    this.strength = 0.8;
    this.background = "grey";
    this.hovered = -1;
    this.pinned = -1;
    this.states = document.createElement("canvas");
    this.layers = []; // the one that is wanted, and the one before it until it is there
    this.overview = null; // the one that shows everything
    this.center = [0.5, 0.5];
    this.scale = 100; // pixels of the canvas for 1 of u or v
    this.frameRequested = false;
    this.keyboard = false;
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.listen();
  }

  setMaterial(material, index) {
    this.material = material;
    this.index = index;
    this.texture = null;
    this.variants = {};
    this.hovered = this.pinned = -1;
    const texture = material.texture || facts.materials[material.textureOf]?.texture;
    if (texture) {
      const image = new Image();
      image.onload = () => {
        if (this.material !== material) return;
        this.texture = image;
        this.draw();
      };
      image.src = texture;
    }
    this.fit();
    this.forget();
  }

  // States have to be drawn anew.
  forget() {
    this.layers = [];
    this.overview = null;
    this.work = null;
    this.draw();
  }

  resize() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(box.width * ratio)), height = Math.max(1, Math.round(box.height * ratio));
    if (width === this.canvas.width && height === this.canvas.height) return;
    const before = this.canvas.width;
    this.canvas.width = this.states.width = width;
    this.canvas.height = this.states.height = height;
    this.ratio = ratio;
    if (this.index && (this.untouched || before <= 1)) this.fit();
    this.draw();
  }

  // --- the view ---

  limits() {
    const b = this.index;
    return { left: Math.min(0, b.left), right: Math.max(1, b.right), top: Math.min(0, b.top), bottom: Math.max(1, b.bottom) };
  }

  fit() {
    this.zoomTo(this.limits(), 0.05);
    this.untouched = true;
  }

  zoomTo(bounds, margin = 0.35) {
    this.untouched = false;
    const extent = Math.max(bounds.right - bounds.left, bounds.bottom - bounds.top, 1e-9);
    this.center = [(bounds.left + bounds.right) / 2, (bounds.top + bounds.bottom) / 2];
    const scale = 1 + 2 * margin;
    this.setScale(Math.min(this.canvas.width / Math.max(bounds.right - bounds.left, extent * 1e-3),
                           this.canvas.height / Math.max(bounds.bottom - bounds.top, extent * 1e-3)) / scale);
    this.draw();
  }

  setScale(scale) {
    const b = this.limits();
    const least = 24 / Math.max(b.right - b.left, b.bottom - b.top);
    this.scale = Math.max(Math.min(least, 1), Math.min(4e6, scale));
  }

  // (x, y) in pixels of the canvas stays where it is.
  zoomBy(factor, x = this.canvas.width / 2, y = this.canvas.height / 2) {
    const [u, v] = this.uvAt(x, y);
    this.untouched = false;
    this.setScale(this.scale * factor);
    this.center = [u - (x - this.canvas.width / 2) / this.scale, v - (y - this.canvas.height / 2) / this.scale];
    this.draw();
  }

  panBy(dx, dy) {
    this.untouched = false;
    const b = this.limits();
    this.center = [Math.max(b.left, Math.min(b.right, this.center[0] - dx / this.scale)),
                   Math.max(b.top, Math.min(b.bottom, this.center[1] - dy / this.scale))];
    this.draw();
  }

  // The position of the canvas's corner in the plane, in whole pixels, so that tiles are aligned to pixels.
  corner() {
    return [Math.round(this.center[0] * this.scale - this.canvas.width / 2),
            Math.round(this.center[1] * this.scale - this.canvas.height / 2)];
  }

  uvAt(x, y) {
    const [left, top] = this.corner();
    return [(left + x) / this.scale, (top + y) / this.scale];
  }

  // --- drawing ---

  draw() {
    if (this.frameRequested || !this.index) return;
    this.frameRequested = true;
    requestAnimationFrame(() => {
      this.frameRequested = false;
      this.frame();
    });
  }

  frame() {
    const style = getComputedStyle(document.documentElement);
    this.colors = { board: style.getPropertyValue("--board"), dark: style.getPropertyValue("--board-dark") };
    this.drawBackground();
    this.composeStates();
    const context = this.context;
    context.globalAlpha = this.strength;
    context.drawImage(this.states, 0, 0);
    context.globalAlpha = 1;
    this.drawFrame();
    if (this.hovered >= 0 && this.hovered !== this.pinned) this.drawOutline(this.hovered, 1.5);
    if (this.pinned >= 0) this.drawOutline(this.pinned, 2.5);
    if (this.keyboard) this.drawCross();
    this.on.moved();
    this.workOn();
  }

  // Checks, and the texture as often as its wrap modes say.
  drawBackground() {
    const context = this.context;
    const { width, height } = this.canvas;
    const check = 10 * (this.ratio || 1);
    if (!this.checks || this.checks.key !== this.colors.board + this.ratio + getComputedStyle(this.canvas).colorScheme) {
      const pattern = document.createElement("canvas");
      pattern.width = pattern.height = 2 * check;
      const to = pattern.getContext("2d");
      const probe = document.getElementById("canvas");
      probe.style.color = "var(--board)";
      to.fillStyle = getComputedStyle(probe).color;
      to.fillRect(0, 0, 2 * check, 2 * check);
      probe.style.color = "var(--board-dark)";
      to.fillStyle = getComputedStyle(probe).color;
      to.fillRect(0, 0, check, check);
      to.fillRect(check, check, check, check);
      probe.style.color = "";
      this.checks = { pattern: context.createPattern(pattern, "repeat"), key: this.colors.board + this.ratio + getComputedStyle(this.canvas).colorScheme };
    }
    context.fillStyle = this.checks.pattern;
    context.fillRect(0, 0, width, height);
    const source = this.backgroundImage();
    if (!source) return;
    const [left, top] = this.corner();
    const cells = (start, size, wrap) => {
      const first = Math.floor(start / this.scale), last = Math.floor((start + size) / this.scale);
      return wrap === "clamp" ? [Math.min(Math.max(first, -1), 1), Math.max(Math.min(last, 1), -1)] : [first, last];
    };
    const [u0, u1] = cells(left, width, this.material.wrap[0]);
    const [v0, v1] = cells(top, height, this.material.wrap[1]);
    if ((u1 - u0 + 1) * (v1 - v0 + 1) > 900) return; // dust
    context.imageSmoothingEnabled = this.material.filter !== "nearest";
    context.imageSmoothingQuality = "medium";
    for (let v = v0; v <= v1; ++v)
      for (let u = u0; u <= u1; ++u) this.drawTexture(source, u, v, left, top);
  }

  // Draws the visible part of one repetition of the texture; with clamping, also its outermost texels beyond the edge.
  drawTexture(source, u, v, left, top) {
    const axis = (cell, corner, size, texels, wrap) => {
      const start = wrap === "clamp" && cell < 0 ? 0 : Math.max(0, cell * this.scale - corner);
      const end = wrap === "clamp" && cell > 0 ? size : Math.min(size, (cell + 1) * this.scale - corner);
      if (wrap === "clamp" && cell !== 0)
        return { start, end, first: cell < 0 ? 0 : texels - 1, count: 1, flip: false };
      let first = ((corner + start) / this.scale - cell) * texels;
      let last = ((corner + end) / this.scale - cell) * texels;
      const flip = wrap === "mirror" && (cell & 1) !== 0;
      if (flip) [first, last] = [texels - last, texels - first];
      return { start, end, first, count: last - first, flip };
    };
    const { width, height } = this.canvas;
    const x = axis(u, left, width, source.width, this.material.wrap[0]);
    const y = axis(v, top, height, source.height, this.material.wrap[1]);
    if (!(x.end > x.start && y.end > y.start && x.count > 0 && y.count > 0)) return;
    const context = this.context;
    context.save();
    if (u !== 0 || v !== 0) context.globalAlpha = 0.3; // repetitions are there, but few look for them
    context.translate(x.flip ? x.start + x.end : 0, y.flip ? y.start + y.end : 0);
    context.scale(x.flip ? -1 : 1, y.flip ? -1 : 1);
    context.drawImage(source, x.first, y.first, x.count, y.count, x.start, y.start, x.end - x.start, y.end - y.start);
    context.restore();
  }

  backgroundImage() {
    if (!this.texture || this.background === "none") return null;
    if (this.background === "color") return this.texture;
    return (this.variants[this.background] ??= this.makeVariant(this.background));
  }

  // The texture in grey, so that only states have colours, or its alpha.
  makeVariant(kind) {
    const made = document.createElement("canvas");
    made.width = this.texture.naturalWidth;
    made.height = this.texture.naturalHeight;
    const to = made.getContext("2d", { willReadFrequently: true });
    to.drawImage(this.texture, 0, 0);
    const image = to.getImageData(0, 0, made.width, made.height);
    const data = image.data;
    for (let i = 0; i < data.length; i += 4) {
      const alpha = Math.min(255, data[i + 3] * this.material.alphaFactor);
      const grey = kind === "alpha" ? alpha : 0.3 * data[i] + 0.59 * data[i + 1] + 0.11 * data[i + 2];
      data[i] = data[i + 1] = data[i + 2] = grey;
      if (kind === "alpha") data[i + 3] = 255;
    }
    to.putImageData(image, 0, 0);
    return made;
  }

  // Tiles of the layer before, scaled, and over them those that are drawn for this scale.
  composeStates() {
    if (this.overview && this.overview.scale === this.scale) this.layers = [this.overview];
    if (!this.layers.length || this.layers[0].scale !== this.scale) {
      const before = this.layers.find((layer) => layer.tiles.size > 0);
      this.layers = [{ scale: this.scale, tiles: new Map() }];
      if (before && before !== this.overview) this.layers.push(before);
      this.work = null;
    }
    const to = this.states.getContext("2d");
    const { width, height } = this.states;
    to.clearRect(0, 0, width, height);
    const [left, top] = this.corner();
    const below = this.layers.includes(this.overview) ? null : this.overview;
    for (const layer of [below, ...this.layers.slice().reverse()]) {
      if (!layer) continue;
      const size = (tileSize * this.scale) / layer.scale;
      for (const tile of layer.tiles.values()) {
        const x = tile.column * size - left, y = tile.row * size - top;
        if (x > width || y > height || x + size < 0 || y + size < 0) continue;
        to.clearRect(x, y, size, size);
        if (tile.canvas) to.drawImage(tile.canvas, x, y, size, size);
      }
    }
  }

  missingTiles() {
    const layer = this.layers[0];
    const [left, top] = this.corner();
    const { width, height } = this.canvas;
    const missing = [];
    for (let row = Math.floor(top / tileSize); row * tileSize < top + height; ++row)
      for (let column = Math.floor(left / tileSize); column * tileSize < left + width; ++column)
        if (!layer.tiles.has(`${column},${row}`)) missing.push({ column, row });
    const middle = [(left + width / 2) / tileSize - 0.5, (top + height / 2) / tileSize - 0.5];
    const distance = (tile) => Math.hypot(tile.column - middle[0], tile.row - middle[1]);
    return missing.sort((a, b) => distance(a) - distance(b));
  }

  // Draws tiles for some milliseconds of each frame until none is missing.
  workOn() {
    const until = performance.now() + 10;
    const layer = this.layers[0];
    let finished = false;
    while (performance.now() < until) {
      if (!this.work) {
        const tile = this.missingTiles()[0];
        if (!tile) break;
        this.work = { tile, steps: rasterTile(this.model, this.index, tile.column, tile.row, this.scale, this.shown, this.outlines) };
      }
      const step = this.work.steps.next();
      if (!step.done) continue;
      const { tile } = this.work;
      tile.canvas = null;
      if (step.value) {
        tile.canvas = document.createElement("canvas");
        tile.canvas.width = tile.canvas.height = tileSize;
        tile.canvas.getContext("2d").putImageData(step.value, 0, 0);
      }
      layer.tiles.set(`${tile.column},${tile.row}`, tile);
      if (layer.tiles.size > 400) layer.tiles.delete(layer.tiles.keys().next().value);
      this.work = null;
      finished = true;
    }
    const busy = this.work !== null || this.missingTiles().length > 0;
    if (!busy && this.untouched) this.overview = layer;
    if (!busy && this.layers.length > 1) {
      this.layers.length = 1;
      finished = true;
    }
    this.on.busy(busy);
    if (busy || finished) this.draw();
  }

  drawFrame() {
    const context = this.context;
    const [left, top] = this.corner();
    context.strokeStyle = getComputedStyle(this.canvas).color;
    context.globalAlpha = 0.35;
    context.lineWidth = this.ratio;
    context.setLineDash([4 * this.ratio, 4 * this.ratio]);
    context.strokeRect(-left - 0.5, -top - 0.5, this.scale + 1, this.scale + 1);
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  drawOutline(shape, width) {
    const context = this.context;
    const [left, top] = this.corner();
    const p = this.model.uvs;
    context.beginPath();
    for (let i = 0; i < 3; ++i)
      context.lineTo(p[shape * 6 + 2 * i] * this.scale - left, p[shape * 6 + 2 * i + 1] * this.scale - top);
    context.closePath();
    context.lineJoin = "round";
    context.lineWidth = (width + 2.5) * this.ratio;
    context.strokeStyle = "rgb(0 0 0 / 75%)";
    context.stroke();
    context.lineWidth = width * this.ratio;
    context.strokeStyle = "#fff";
    context.stroke();
  }

  drawCross() {
    const context = this.context;
    const x = Math.round(this.canvas.width / 2) + 0.5, y = Math.round(this.canvas.height / 2) + 0.5;
    for (const [width, color] of [[4, "rgb(0 0 0 / 70%)"], [1.5, "#fff"]]) {
      context.lineWidth = width * this.ratio;
      context.strokeStyle = color;
      context.beginPath();
      context.moveTo(x - 9 * this.ratio, y);
      context.lineTo(x + 9 * this.ratio, y);
      context.moveTo(x, y - 9 * this.ratio);
      context.lineTo(x, y + 9 * this.ratio);
      context.stroke();
    }
  }

  // --- input ---

  hoverAt(x, y) {
    const [u, v] = this.uvAt(x, y);
    const shapes = this.index.at(u, v);
    const top = shapes.length ? shapes[0] : -1;
    if (top !== this.hovered) {
      this.hovered = top;
      this.draw();
    }
    this.on.hover(shapes, u, v, x / this.ratio, y / this.ratio);
    return top;
  }

  leave() {
    this.hovered = -1;
    this.on.hover([], NaN, NaN, 0, 0);
    this.draw();
  }

  pin(shape) {
    this.pinned = shape;
    this.draw();
  }

  listen() {
    const canvas = this.canvas;
    const pointers = new Map();
    let moved = 0;
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return [(event.clientX - box.left) * this.ratio, (event.clientY - box.top) * this.ratio];
    };
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : event.deltaMode === 2 ? 300 : 1;
      this.zoomBy(Math.exp(-Math.max(-300, Math.min(300, event.deltaY * lines)) * (event.ctrlKey ? 0.01 : 0.002)), ...place(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, place(event));
      this.keyboard = false;
      if (pointers.size === 1) moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const now = place(event);
      const before = pointers.get(event.pointerId);
      if (!before) {
        this.keyboard = false;
        this.hoverAt(...now);
        return;
      }
      const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      pointers.set(event.pointerId, now);
      moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
      if (moved > 4 * this.ratio) canvas.classList.add("dragging");
      if (others.length) {
        const [x, y] = others[0];
        const apart = (p) => Math.max(8, Math.hypot(p[0] - x, p[1] - y));
        this.zoomBy(apart(now) / apart(before), (now[0] + x) / 2, (now[1] + y) / 2);
        this.panBy((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
      } else if (moved > 4 * this.ratio) {
        this.panBy(now[0] - before[0], now[1] - before[1]);
      }
    });
    const up = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      canvas.classList.remove("dragging");
      if (event.type === "pointerup" && moved <= 4 * this.ratio && pointers.size === 0) this.on.pick(this.hoverAt(...place(event)));
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("pointerleave", () => this.leave());
    canvas.addEventListener("blur", () => {
      this.keyboard = false;
      this.draw();
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = 64 * this.ratio;
    const actions = {
      ArrowLeft: () => this.panBy(step, 0), ArrowRight: () => this.panBy(-step, 0),
      ArrowUp: () => this.panBy(0, step), ArrowDown: () => this.panBy(0, -step),
      "+": () => this.zoomBy(1.4), "=": () => this.zoomBy(1.4), "-": () => this.zoomBy(1 / 1.4), _: () => this.zoomBy(1 / 1.4),
      0: () => this.fit(), n: () => this.on.step(1), p: () => this.on.step(-1),
      Enter: () => this.on.pick(this.hovered), " ": () => this.on.pick(this.hovered), Escape: () => this.on.pick(-1),
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    this.keyboard = true;
    action();
    if (!["n", "p", "Escape", "Enter", " "].includes(event.key)) this.hoverAt(this.canvas.width / 2, this.canvas.height / 2);
  }
}
