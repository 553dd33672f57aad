// SPDX-License-Identifier: Apache-2.0
// Puts the page together.
function setUpTheme(changed) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const current = () => root.dataset.theme || (dark.matches ? "dark" : "light");
  const show = () => {
    document.getElementById("theme-name").textContent = current() === "dark" ? "Dark" : "Light";
    changed();
  };
  document.getElementById("theme").addEventListener("click", () => {
    root.dataset.theme = current() === "dark" ? "light" : "dark";
    show();
  });
  dark.addEventListener("change", show);
  show();
}

function setUpTabs(choose) {
  const tabs = document.getElementById("materials");
  const buttons = facts.materials.map((material, number) => {
    const button = element("button", { type: "button", role: "tab", "aria-controls": "work", id: `material-${number}` }, material.name || "default material");
    button.addEventListener("click", () => select(number));
    tabs.append(button);
    return button;
  });
  const select = (number) => {
    buttons.forEach((button, i) => {
      button.setAttribute("aria-selected", String(i === number));
      button.tabIndex = i === number ? 0 : -1;
    });
    document.getElementById("work").setAttribute("aria-labelledby", `material-${number}`);
    choose(number);
  };
  tabs.addEventListener("keydown", (event) => {
    const now = buttons.indexOf(document.activeElement);
    const next = { ArrowRight: now + 1, ArrowLeft: now - 1, Home: 0, End: buttons.length - 1 }[event.key];
    if (now < 0 || next === undefined) return;
    event.preventDefault();
    const number = (next + buttons.length) % buttons.length;
    select(number);
    buttons[number].focus();
  });
  return select;
}

function setUpViewer(model) {
  const canvas = document.getElementById("canvas");
  const details = document.getElementById("details");
  const tip = document.getElementById("tip");
  const unpin = document.getElementById("unpin");
  const indices = new Map();
  let material = null;
  let under = { shapes: [], point: null };

  const showDetails = () => {
    const shape = viewer.pinned >= 0 ? viewer.pinned : under.shapes.length ? under.shapes[0] : -1;
    unpin.hidden = viewer.pinned < 0;
    document.getElementById("details-title").textContent = viewer.pinned >= 0 ? "Pinned triangle" : "Triangle";
    if (shape >= 0) details.replaceChildren(detailsOf(model, shape, under.point, viewer.pinned >= 0 ? 0 : under.shapes.length));
    else details.replaceChildren(element("p", { class: "muted" }, "Point at a triangle of the picture, or choose one of the list."));
  };
  const pin = (shape) => {
    viewer.pin(shape);
    worst.mark(shape);
    showDetails();
  };
  const open = (shape) => {
    under = { shapes: [], point: null };
    tip.hidden = true;
    viewer.hovered = -1;
    viewer.zoomTo(model.bounds(shape), 0.15);
    pin(shape);
    canvas.focus({ preventScroll: true });
    canvas.parentElement.scrollIntoView({ block: "nearest" });
  };
  const viewer = new Viewer(canvas, model, {
    hover(shapes, u, v, x, y) {
      under = { shapes, point: Number.isFinite(u) ? [u, v] : null };
      showDetails();
      tip.hidden = !shapes.length;
      if (!shapes.length) return;
      const shape = shapes[0];
      const [a, b] = model.barycentrics(shape, u, v);
      tip.textContent = `${shortPlace(model, model.triangles[model.firstOfShape[shape]])}: ${stateNames[model.stateAt(model.record[shape], a, b)]}`;
      const box = canvas.getBoundingClientRect();
      tip.style.left = `${Math.max(0, Math.min(x + 14, box.width - tip.offsetWidth - 6))}px`;
      tip.style.top = `${y + 18 + tip.offsetHeight > box.height ? y - tip.offsetHeight - 10 : y + 18}px`;
    },
    pick: (shape) => pin(shape === viewer.pinned ? -1 : shape),
    step(by) {
      const number = material.endShape - material.firstShape;
      if (!number) return;
      const now = viewer.pinned >= 0 ? viewer.pinned : viewer.hovered >= 0 ? viewer.hovered - by : material.firstShape - by;
      open(material.firstShape + (((now - material.firstShape + by) % number) + number) % number);
    },
    moved() {
      const texels = material.width ? viewer.scale / viewer.ratio / material.width : 0;
      document.getElementById("zoom").textContent = texels ? `${(100 * texels).toFixed(texels < 0.1 ? 1 : 0)} %` : `${viewer.scale.toPrecision(3)}`;
    },
    busy(is) {
      document.getElementById("busy").hidden = !is;
      canvas.dataset.ready = String(!is);
    },
  });
  const worst = new WorstList(model, open);
  const select = setUpTabs((number) => {
    material = facts.materials[number];
    if (!indices.has(number)) indices.set(number, new ShapeIndex(model, material.firstShape, material.endShape));
    canvas.setAttribute("aria-label", `UV space of ${material.name || "the default material"}, ${plural(material.tally.triangles, "triangle")}`);
    under = { shapes: [], point: null };
    viewer.setMaterial(material, indices.get(number));
    worst.show(material);
    showDetails();
  });

  unpin.addEventListener("click", () => pin(-1));
  const on = (id, event, act) => document.getElementById(id).addEventListener(event, act);
  on("zoom-in", "click", () => viewer.zoomBy(1.4));
  on("zoom-out", "click", () => viewer.zoomBy(1 / 1.4));
  on("fit", "click", () => viewer.fit());
  on("background", "change", (event) => {
    viewer.background = event.target.value;
    viewer.draw();
  });
  on("strength", "input", (event) => {
    viewer.strength = event.target.value / 100;
    viewer.draw();
  });
  on("outlines", "change", (event) => {
    viewer.outlines = event.target.checked;
    viewer.forget();
  });
  const legend = document.getElementById("legend");
  for (const state of stateOrder) {
    const button = element("button", { type: "button", "aria-pressed": "true" }, swatch(state), stateNames[state]);
    button.addEventListener("click", () => {
      viewer.shown[state] = !viewer.shown[state];
      button.setAttribute("aria-pressed", String(viewer.shown[state]));
      viewer.forget();
    });
    legend.append(button);
  }
  return { viewer, select, open };
}

async function start() {
  showHeader();
  showTiles();
  document.getElementById("cards").append(statesCard(), levelsCard(), bytesCard());
  const model = new Model(await inflate(bytesOfBase64(document.getElementById("numbers").textContent)));
  const { viewer, select, open } = setUpViewer(model);
  select(0);
  showMeshes();
  showPrimitives((primitive) => {
    select(primitive.material);
    if (primitive.first < primitive.end) open(model.shapeOf[primitive.first]);
  });
  setUpTheme(() => {
    viewer.checks = null;
    viewer.draw();
  });
  document.documentElement.dataset.ready = "true";
  // In a frame, the page around it makes the frame as high as this one.
  if (parent !== window)
    new ResizeObserver(() => parent.postMessage({ height: Math.ceil(document.documentElement.getBoundingClientRect().height) }, "*")).observe(document.body);
}

start().catch((error) => {
  document.getElementById("notes").append(element("p", { class: "note", role: "alert" }, `This page cannot be shown: ${error.message}`));
  throw error;
});
