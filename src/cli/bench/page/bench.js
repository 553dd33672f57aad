// SPDX-License-Identifier: Apache-2.0
// Draws the tables and charts of the report.
const report = JSON.parse(document.getElementById("report").textContent);
const element = (name, text, parent) => {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
};
const byId = (id) => document.getElementById(id);
const rows = (part, kind) => part.rows.filter((row) => row.row === kind);
const number = (value, digits = 2) => value === null ? "–" : value.toLocaleString("en", {
  minimumFractionDigits: digits, maximumFractionDigits: digits });
// Of a noisy run no ratio is stated.
const ratio = (values, digits) => report.noisy ? "–" : values.map((value) => number(value, digits)).join(" – ");
const implementation = (part) => ({ emulated: "emulated", ext: "translated to EXT", driver: "of the driver" })[part.implementation]
  + ", " + part.api.toUpperCase();
const table = (parent, heads, lines) => {
  if (lines.length === 0) return;
  const box = element("div", undefined, parent);
  box.className = "scroll";
  const made = element("table", undefined, box);
  const head = element("tr", undefined, element("thead", undefined, made));
  heads.forEach((text) => { element("th", text, head).scope = "col"; });
  const body = element("tbody", undefined, made);
  lines.forEach((cells) => {
    const line = element("tr", undefined, body);
    cells.forEach((cell, column) => { element("td", cell, line).dataset.head = heads[column]; });
  });
};
const svg = (name, attributes, parent, text) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
};

// Ratios as dots with bars, one line each, next to their names; in a narrow page below them.
const narrow = window.matchMedia("screen and (max-width: 499px)");
const draw = (box, title, frames) => {
  const [left, right, width, step, drop] = narrow.matches ? [12, 12, 340, 44, 20] : [150, 60, 700, 26, 0];
  const height = 40 + step * frames.length;
  const most = Math.max(1.2, ...frames.map((f) => f.ratio[2])) * 1.05;
  const x = (value) => left + value / most * (width - left - right);
  box.replaceChildren();
  const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title }, box);
  const unit = [0.1, 0.2, 0.25, 0.5, 1, 2, 5, 10].find((u) => most / u <= width / 85) || 20;
  for (let value = 0; value <= most; value += unit) {
    svg("line", { x1: x(value), x2: x(value), y1: 8, y2: height - 24, class: "grid" }, picture);
    svg("text", { x: x(value), y: height - 8, "text-anchor": "middle" }, picture, String(Math.round(value * 100) / 100));
  }
  svg("line", { x1: x(1), x2: x(1), y1: 4, y2: height - 24, class: "axis", "stroke-width": 2 }, picture);
  frames.forEach((frame, i) => {
    const y = 22 + step * i + drop;
    const kind = report.noisy ? "even" : frame.ratio[2] < 1 ? "good" : frame.ratio[0] > 1 ? "bad" : "even";
    svg("text", { x: 8, y: y + 4 - drop }, picture, `level ${frame.level}, ${frame.heavy ? "heavy" : "plain"}`);
    svg("line", { x1: x(frame.ratio[0]), x2: x(frame.ratio[2]), y1: y, y2: y, class: kind, "stroke-width": 6, "stroke-opacity": .4 }, picture);
    svg("circle", { cx: x(frame.ratio[1]), cy: y, r: 5, class: kind }, picture);
    svg("text", { x: width - 8, y: y + 4 - drop, "text-anchor": "end" }, picture, ratio([frame.ratio[1]]));
  });
};
const chart = (parent, title, frames) => {
  const box = element("div", undefined, parent);
  draw(box, title, frames);
  narrow.addEventListener("change", () => draw(box, title, frames));
};

const device = report.parts.flatMap((part) => rows(part, "device"))[0];
if (device) {
  document.title = byId("device").textContent = `Opacity micromaps on ${device.name}`;
}
byId("about").textContent = [device && device.driver, device && `Vulkan ${device.vulkan}`, device && device.kind,
  `vellum ${report.version}`, report.date.replaceAll("-", "\u2011")].filter(Boolean).join(" · ");
report.verdict.forEach((text) => element("li", text, byId("verdict")));

report.parts.filter((part) => part.name.startsWith("frames")).forEach((part) => {
  const frames = rows(part, "frame");
  if (frames.length === 0) return;
  byId("frames").hidden = false;
  const title = `${part.trace === "query" ? "Ray queries" : "Ray tracing pipeline"}, micromaps ${implementation(part)}`;
  element("h3", title, byId("charts"));
  chart(byId("charts"), title, frames);
  const box = element("details", undefined, byId("charts"));
  element("summary", "Numbers", box);
  table(box, ["", "alpha test, ms", "micromaps, ms", "by the CPU's clock, ms", "ratio", "pairs", "candidates per ray", "differing pixels"],
  frames.map((f) => [`level ${f.level}, ${f.heavy ? "heavy" : "plain"}, ${f.width} × ${f.height}`, number(f.alpha), number(f.micromaps),
    `${number(f.alphaWall)} / ${number(f.micromapsWall)}`, ratio(f.ratio, 3), f.pairs,
    f.candidatesPerRay.map((c) => number(c, 3)).join(" → "), f.differingPixels]));
  element("p", frames[0].timestamps ? "Times are by the GPU's timestamps." : "The device has no timestamps of use: times are by the CPU's clock.",
    box).className = "muted";
});

report.parts.filter((part) => part.name.startsWith("builds")).forEach((part) => {
  const builds = rows(part, "build"), micromaps = rows(part, "micromap");
  if (builds.length + micromaps.length === 0) return;
  byId("builds").hidden = false;
  element("h3", `Micromaps ${implementation(part)}`, byId("build-tables"));
  table(byId("build-tables"), ["without micromaps", "without the layer, ms", "with the layer, ms", "by the CPU's clock, ms", "ratio", "per second"],
    builds.map((b) => [b.what, number(b.withoutLayer, 3), number(b.withLayer, 3),
      `${number(b.withoutLayerWall, 3)} / ${number(b.withLayerWall, 3)}`, ratio(b.ratio),
      number(1000 * b.structures / b.withLayer, 0)]));
  table(byId("build-tables"), ["micromaps, one after another", "triangles", "ms", "by the CPU's clock, ms", "per second"],
    micromaps.map((m) => [`level ${m.level}`, m.triangles, number(m.milliseconds[1], 3), number(m.wall, 3),
      number(1000 / m.wall, 0)]));
});

report.parts.filter((part) => part.name.startsWith("pipelines")).forEach((part) => {
  const pipelines = rows(part, "pipeline");
  if (pipelines.length === 0) return;
  byId("pipelines").hidden = false;
  element("h3", `Micromaps ${implementation(part)}`, byId("pipeline-tables"));
  table(byId("pipeline-tables"), ["", "without the layer", "with the layer", "ratio"],
    pipelines.map((p) => [`${p.trace === "query" ? "ray queries" : "ray tracing pipeline"}, ${p.withMicromaps ? "with" : "without"} micromaps`,
      number(p.withoutLayer, 1), number(p.withLayer, 1), ratio([p.ratio])]));
});

// The scene is the same for all frames of a level.
const memories = report.parts.filter((part) => part.name.startsWith("frames") && part.trace === "query")
  .flatMap((part) => rows(part, "frame").filter((f) => !f.heavy).map((f) => [part, f]));
if (memories.length > 0) {
  const kibibytes = (bytes) => number(bytes / 1024, 0);
  byId("memory").hidden = false;
  table(byId("memory-table"), ["", "micromaps", "acceleration structures", "without micromaps"],
    memories.map(([part, f]) => [`level ${f.level}, ${implementation(part)}`, kibibytes(f.micromapBytes),
      kibibytes(f.micromapsStructureBytes), kibibytes(f.alphaStructureBytes)]));
}

const checks = report.parts.flatMap((part) => rows(part, "check").map((row) => [part, row]));
if (checks.length > 0) {
  byId("checks").hidden = false;
  table(byId("check-table"), ["micromaps", "passed", "failed", "skipped", "rays"],
    checks.map(([part, c]) => [implementation(part), c.passed, c.failed, c.skipped, c.rays.toLocaleString("en")]));
}
if (device) {
  byId("details").hidden = false;
  table(byId("limits"), ["limit", "value"], Object.entries(device.limits).map(([name, value]) => [name, value.toLocaleString("en")]));
  byId("extensions").textContent = device.extensions.join(" ");
}
table(byId("run"), ["part", "seconds", "result"],
  report.parts.map((part) => [part.name, number(part.seconds, 1), part.failure || "complete"]));
