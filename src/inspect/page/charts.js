// SPDX-License-Identifier: Apache-2.0
// The parts that need no canvas: numbers, charts, tables, meshes.
function part(share, color, title) {
  const made = element("i", { title });
  made.style.width = `${100 * share}%`;
  made.style.background = color;
  return made;
}

function stateBar(shares, extra = "") {
  const bar = element("div", { class: `bar ${extra}`, role: "img",
    "aria-label": stateOrder.map((s) => `${stateNames[s]} ${percent(shares[s])}`).join(", ") });
  for (const state of stateOrder)
    if (shares[state] > 0) bar.append(part(shares[state], facts.stateColors[state], `${stateNames[state]} ${percent(shares[state])}`));
  return bar;
}

function swatch(state) {
  const made = element("i", { class: "swatch", "aria-hidden": "true" });
  made.style.background = facts.stateColors[state];
  return made;
}

// A single bar of a histogram, in parts.
function histogramBar(parts, most) {
  const bar = element("div", { class: "bar plain", "aria-hidden": "true" });
  for (const [number, color, title] of parts) if (number > 0) bar.append(part(number / most, color, title));
  return element("td", { class: "bar-cell" }, bar);
}

function meshName(primitive) {
  return primitive.name ? `${primitive.mesh} ${primitive.name}` : `${primitive.mesh}`;
}

function showHeader() {
  const file = facts.file;
  document.getElementById("name").textContent = file.name;
  const parts = [size(file.bytes), file.baked ? "baked in memory" : file.extension];
  document.getElementById("about").textContent = parts.join(" · ");
  const notes = document.getElementById("notes");
  for (const material of facts.materials)
    if (material.problem) notes.append(element("p", { class: "note" }, `Shown without the texture: ${material.problem}`));
  if (facts.leftOut) notes.append(element("p", { class: "note" }, `${plural(facts.leftOut, "triangle")} more than a page can hold: they count in the numbers, and are in no picture. Options of vellum inspect choose others.`));
}

function showTiles() {
  const t = facts.tally;
  const special = t.special.reduce((a, b) => a + b, 0);
  const known = t.states[0] + t.states[1];
  const bytes = t.dataBytes + t.records * 8 + t.indexBytes;
  const tile = (label, value, more) => element("div", { class: "tile" }, element("span", {}, label), element("b", {}, value), element("span", {}, more));
  document.getElementById("tiles").append(
    facts.file.surfaceKnown === undefined
      ? tile("Triangles known", percent(known), "each triangle counted alike")
      : facts.file.surfaceTwoStates
        ? tile("Surface opaque or transparent", percent(facts.file.surfaceKnown),
          `${percent(facts.file.surfaceTwoStates)} in triangles with 2 states: approximate`)
      : tile("Surface known", percent(facts.file.surfaceKnown), facts.file.surfaceWithout
        ? `${percent(facts.file.surfaceWithout)} has no micromap` : `${percent(1 - facts.file.surfaceKnown)} is left to the shader`),
    tile("Triangles", count(t.triangles), `${percent(t.triangles ? special / t.triangles : 0)} with a special index`),
    tile("Micromap triangles", count(t.records), `used by ${plural(t.triangles - special, "triangle")}`),
    tile("Bytes", size(bytes), `${size(bytes - t.indexBytes)} of micromaps + ${size(t.indexBytes)} of indices`),
    tile("Primitives", count(facts.file.micromapPrimitives), `of ${count(facts.file.primitives)}, in ${plural(facts.file.meshes, "mesh", "meshes")}`));
}

function statesCard() {
  const t = facts.tally;
  const area = t.uvArea.reduce((a, b) => a + b, 0);
  const table = element("table", {}, element("thead", {}, row(head("State"), head("of triangles", true), head("of UV area", true), head("special", true))));
  const body = element("tbody");
  for (const state of stateOrder)
    body.append(row(cell(element("span", { class: "state" }, swatch(state), stateNames[state])), cell(percent(t.states[state]), true),
      cell(area ? percent(t.uvArea[state] / area) : "–", true), cell(count(t.special[state]), true)));
  table.append(body);
  return element("div", { class: "card" }, element("h3", {}, "States"), stateBar(t.states, "tall"), table);
}

function levelsCard() {
  const t = facts.tally;
  const rows = [];
  t.levels.forEach(([two, four], level) => {
    if (two + four) rows.push([`${level}`, count(4 ** level), two + four, [[four, "var(--bar)", `${count(four)} of 4 states`], [two, "var(--bar-light)", `${count(two)} of 2 states`]]]);
  });
  const special = t.special.reduce((a, b) => a + b, 0);
  if (special) rows.push(["special", "1", special, stateOrder.map((s) => [t.special[s], facts.stateColors[s], `${stateNames[s]}: ${count(t.special[s])}`])]);
  const most = Math.max(1, ...rows.map((r) => r[2]));
  const body = element("tbody");
  for (const [name, micro, number, parts] of rows) body.append(row(cell(name), cell(micro, true), histogramBar(parts, most), cell(count(number), true)));
  const two = t.levels.reduce((sum, level) => sum + level[0], 0), four = t.levels.reduce((sum, level) => sum + level[1], 0);
  const formats = element("p", { class: "muted", style: "" }, `Formats: ${count(four)} with 4 states, ${count(two)} with 2 states, ${count(special)} without data`);
  formats.style.marginTop = "12px";
  return element("div", { class: "card" }, element("h3", {}, "Levels"),
    element("table", {}, element("thead", {}, row(head("Level"), head("micro-triangles", true), head(""), head("triangles", true))), body), formats);
}

function bytesCard() {
  const t = facts.tally;
  const rows = [["States", t.dataBytes, "var(--accent)"], ["Micromap triangles", t.records * 8, "var(--bar)"], ["Indices", t.indexBytes, "var(--bar-light)"]];
  const total = rows.reduce((sum, r) => sum + r[1], 0);
  const bar = element("div", { class: "bar tall", role: "img", "aria-label": rows.map((r) => `${r[0]} ${size(r[1])}`).join(", ") });
  const body = element("tbody");
  for (const [name, bytes, color] of rows) {
    if (bytes) bar.append(part(bytes / total, color, `${name} ${size(bytes)}`));
    const mark = element("i", { class: "swatch", "aria-hidden": "true" });
    mark.style.background = color;
    body.append(row(cell(element("span", {}, mark, name)), cell(size(bytes), true), cell(total ? percent(bytes / total) : "–", true)));
  }
  body.append(row(cell("Together"), cell(size(total), true), cell(facts.file.baked ? "" : `${percent(total / facts.file.bytes)} of the file`, true)));
  body.lastChild.className = "gap";
  return element("div", { class: "card" }, element("h3", {}, "Bytes"), bar, element("table", {}, body));
}

function showMeshes() {
  const list = document.getElementById("meshes");
  for (const mesh of facts.meshes) {
    const primitives = facts.primitives.filter((p) => p.mesh === mesh.mesh);
    const triangles = primitives.reduce((sum, p) => sum + p.tally.triangles, 0);
    const unknown = primitives.reduce((sum, p) => sum + (p.tally.states[2] + p.tally.states[3]) * p.tally.triangles, 0);
    const name = mesh.name || `mesh ${mesh.mesh}`;
    list.append(element("figure", {}, element("img", { src: mesh.picture, alt: `${name} in the colours of its states`, width: 360, height: 360, loading: "lazy" }),
      element("figcaption", {}, name, element("span", {}, `${plural(triangles, "triangle")}, ${percent(triangles ? unknown / triangles : 0)} unknown`))));
  }
  const more = facts.file.inspectedMeshes - facts.meshes.length;
  if (more > 0) list.after(element("p", { class: "muted keys" }, `${plural(more, "mesh", "meshes")} more; --mesh chooses.`));
}

function showPrimitives(open) {
  const table = document.getElementById("primitives");
  table.append(element("thead", {}, row(head("Mesh"), head("Primitive", true), head("Material"), head("Triangles", true), head("Levels", true), head("States"), head("Unknown", true), head("Bytes", true))));
  const body = element("tbody");
  const most = 500;
  for (const p of facts.primitives.slice(0, most)) {
    const levels = p.tally.levels.map(([two, four], level) => (two + four ? level : -1)).filter((level) => level >= 0);
    const button = element("button", { type: "button" }, meshName(p));
    button.addEventListener("click", () => open(p));
    const states = element("td", { class: "bar-cell" }, stateBar(p.tally.states));
    body.append(row(cell(button), cell(`${p.primitive}`, true), cell(facts.materials[p.material].name || "default"), cell(count(p.tally.triangles), true),
      cell(levels.length ? (levels.length > 1 ? `${levels[0]}–${levels[levels.length - 1]}` : `${levels[0]}`) : "–", true), states,
      cell(percent(p.tally.states[2] + p.tally.states[3]), true), cell(size(p.tally.dataBytes + p.tally.records * 8 + p.tally.indexBytes), true)));
  }
  table.append(body);
  if (facts.primitives.length > most) table.after(element("p", { class: "muted" }, `and ${count(facts.primitives.length - most)} more`));
}
