// SPDX-License-Identifier: Apache-2.0
// The triangle under the pointer or pinned, and the list of those worth a look.
function placeText(model, triangle) {
  const { primitive, triangle: number } = model.place(triangle);
  return `mesh ${meshName(primitive)}, primitive ${primitive.primitive}, triangle ${count(number)}`;
}

function shortPlace(model, triangle) {
  const { primitive, triangle: number } = model.place(triangle);
  return `mesh ${primitive.mesh} · prim ${primitive.primitive} · tri ${count(number)}`;
}

const coordinate = (x) => (Number.isFinite(x) ? x.toFixed(5).replace("-", "−") : String(x));

function detailsOf(model, shape, point, stacked) {
  const record = model.record[shape];
  const list = element("dl");
  const add = (name, ...value) => list.append(element("dt", {}, name), element("dd", {}, ...value));
  const triangles = model.triangles.subarray(model.firstOfShape[shape], model.firstOfShape[shape + 1]);
  const { primitive, triangle } = model.place(triangles[0]);
  add("Mesh", meshName(primitive));
  add("Primitive", `${primitive.primitive}`);
  add("Triangle", count(triangle), triangles.length > 1 ? element("span", { class: "muted" }, ` and ${plural(triangles.length - 1, "other")} at the same place`) : "");
  if (record < 0) {
    add("Special index", `−${-record}, ${stateNames[~record]}`);
  } else {
    const level = model.level(record);
    add("Level", `${level}`, element("span", { class: "muted" }, `, ${plural(4 ** level, "micro-triangle")}`));
    add("Format", model.twoState(record) ? "2 states" : "4 states", element("span", { class: "muted" }, `, ${size(model.bytes(record))}`));
    if (model.pageLevel(record) < level) add("Shown", `at level ${model.pageLevel(record)}, to keep the page small`);
  }
  const shares = model.shares(record);
  const table = element("div", { class: "shares" });
  for (const state of stateOrder)
    table.append(element("span", { class: "state" }, swatch(state), stateNames[state]), element("span", {}, percent(shares[state])));
  list.append(element("div", { class: "wide" }, stateBar(shares), table));
  const uvs = element("span", { class: "uvs" });
  for (let i = 0; i < 6; ++i) uvs.append(element("span", {}, coordinate(model.uvs[shape * 6 + i])));
  add("UVs", uvs);
  if (point && record >= 0) {
    const [u, v] = model.barycentrics(shape, ...point);
    if (u >= 0 && v >= 0 && u + v <= 1)
      add("Here", `micro-triangle ${count(curveIndex(u, v, model.level(record)))}, ${stateNames[model.stateAt(record, u, v)]}`);
  }
  if (stacked > 1) add("Below", plural(stacked - 1, "other triangle"));
  return list;
}

// The shapes of a material with the highest score, which is above 0.
function highest(first, end, score, most) {
  const found = [];
  let least = 0;
  for (let shape = first; shape < end; ++shape) {
    const value = score(shape);
    if (!(value > least)) continue;
    found.push({ shape, value });
    if (found.length >= 4 * most) {
      found.sort((a, b) => b.value - a.value || a.shape - b.shape);
      found.length = most;
      least = found[most - 1].value;
    }
  }
  return found.sort((a, b) => b.value - a.value || a.shape - b.shape).slice(0, most);
}

class WorstList {
  constructor(model, open) {
    this.model = model;
    this.open = open;
    this.order = "area";
    for (const order of ["area", "bytes"])
      document.getElementById(`by-${order}`).addEventListener("click", () => this.show(this.material, order));
  }

  show(material, order = this.order) {
    this.material = material;
    this.order = order;
    for (const each of ["area", "bytes"]) document.getElementById(`by-${each}`).setAttribute("aria-pressed", String(each === order));
    const model = this.model;
    const texels = material.width ? material.width * material.height : 0;
    const unknown = (shape) => model.unknown(model.record[shape]);
    const score = order === "area" ? (shape) => unknown(shape) * model.area(shape) : (shape) => unknown(shape) * model.bytes(model.record[shape]);
    const value = (shape, number) => {
      if (order === "bytes") return `${size(model.bytes(model.record[shape]))}, ${percent(1 - unknown(shape))} known`;
      return texels ? plural(Math.round(number * texels), "texel") : number.toPrecision(3);
    };
    document.getElementById("worst-hint").textContent = order === "area"
      ? `The largest unknown area in ${texels ? "texels" : "UV space"}: a higher level may help.`
      : "The most bytes for the least that is known: a special index may do.";
    const list = document.getElementById("worst");
    const found = highest(material.firstShape, material.endShape, score, 50);
    list.replaceChildren();
    if (!found.length) list.append(element("li", { class: "muted" }, order === "area" ? "Everything is known." : "No data is spent on unknown states."));
    for (const { shape, value: number } of found) {
      const uses = model.uses(shape);
      const first = model.triangles[model.firstOfShape[shape]];
      const button = element("button", { type: "button", "data-shape": shape, title: placeText(model, first) },
        element("span", { class: "who" }, shortPlace(model, first), uses > 1 ? element("span", { class: "muted" }, ` × ${count(uses)}`) : ""),
        element("span", { class: "muted" }, value(shape, number)), stateBar(model.shares(model.record[shape])));
      button.addEventListener("click", () => this.open(shape));
      list.append(element("li", {}, button));
    }
    list.scrollTop = 0;
  }

  mark(shape) {
    for (const button of document.querySelectorAll("#worst button")) button.setAttribute("aria-current", String(Number(button.dataset.shape) === shape));
  }
}
