// SPDX-License-Identifier: Apache-2.0
// Elements and numbers of pages. Text comes from files, so all of it goes through textContent.
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") made.className = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

const whole = new Intl.NumberFormat("en-US");
const count = (number) => whole.format(number);
const plural = (number, one, many = `${one}s`) => `${count(number)} ${number === 1 ? one : many}`;

function percent(share) {
  if (share > 0 && share < 0.0005) return "< 0.1 %";
  return `${(100 * share).toFixed(1)} %`;
}

function size(bytes) {
  if (bytes < 10000) return `${count(bytes)} B`;
  for (const [unit, factor] of [["kB", 1e3], ["MB", 1e6], ["GB", 1e9]])
    if (bytes < factor * 1e3) return `${(bytes / factor).toFixed(bytes < factor * 10 ? 2 : bytes < factor * 100 ? 1 : 0)} ${unit}`;
  return `${(bytes / 1e12).toFixed(1)} TB`;
}

function row(...cells) {
  return element("tr", {}, ...cells);
}
const cell = (content, number = false) => element("td", number ? { class: "number" } : {}, content);
const head = (content, number = false) => element("th", number ? { class: "number", scope: "col" } : { scope: "col" }, content);
