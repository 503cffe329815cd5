"use strict";
// What all parts of the page share: data, elements, numbers, downloads.
const data = JSON.parse(document.getElementById("data").textContent);
const by = (id) => document.getElementById(id);
const INK = "#1d2733", SOFT = "#5b6876", GRID = "#e6eaee", BLUE = "#2b5c9e", ORANGE = "#dd7a1f", RED = "#c4321f";
const FONT = {family: 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif', size: 13, color: INK};
const CONFIG = {displaylogo: false, showSendToCloud: false, plotlyServerURL: "", plotGlPixelRatio: Math.min(2, window.devicePixelRatio || 1), responsive: true,
                modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d", "resetCameraLastSave3d", "tableRotation"]};

// Plotly takes some tags in its labels; names are texts, whatever signs they hold.
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

// A name in lines of at most so many letters, where it can be parted: at blanks, . and _.
function inLines(name, letters) {
  const out = [""];
  for (const piece of name.split(/(?<=[\s._])/)) {
    if (out.at(-1) && (out.at(-1) + piece).length > letters) out.push(piece);
    else out[out.length - 1] += piece;
  }
  return out;
}
// The title of a figure, names with an arrow between them, and the margin above it that this takes.
function heading(id, ...names) {
  const whole = names.join(" → "), letters = by(id).clientWidth / 8.5;
  const lines = whole.length <= letters ? [whole] : names.flatMap((name, k) => inLines(k ? `→ ${name}` : name, letters));
  return [{text: lines.map(plain).join("<br>"), x: 0.01, xref: "container", xanchor: "left", y: 0.985, yanchor: "top", pad: {t: 5 * (lines.length - 1)}, font: {size: 14.5, color: INK}},
    40 + 19 * (lines.length - 1)];
}

function floats(code) {
  const bytes = Uint8Array.from(atob(code), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer), out = new Float64Array(bytes.length / 4);
  for (let i = 0; i < out.length; i++) out[i] = view.getFloat32(4 * i, true);
  return out;
}

function make(tag, text, parent, className) {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = text;
  if (className) element.className = className;
  if (parent) parent.appendChild(element);
  return element;
}

// Six digits; null stands for what is not finite.
function shown(value, digits = 6) {
  if (value === null || value === undefined) return "∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-3) return value.toExponential(digits - 2).replace("e+", "e").replace("-", "−").replace("e-", "e−");
  return value.toPrecision(digits).replace("-", "−");
}

const counted = (number, what) => `${number} ${what}${number === 1 ? "" : "s"}`;

function quoted(value) {
  if (value === null || value === undefined) return "";
  const text = String(value);
  return /[",\n\r]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

function download(name, text, type) {
  const link = make("a"), address = URL.createObjectURL(new Blob([text], {type}));
  link.href = address;
  link.download = name;
  document.body.appendChild(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

const csv = (name, rows) => download(name, rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n", "text/csv");
const fileName = (name) => name.replace(/[^\w.-]+/g, "_");

function axis(title, more = {}) {
  return {title: {text: title, standoff: 8}, gridcolor: GRID, linecolor: "#aab4be", tickcolor: "#aab4be", ticks: "outside",
          ticklen: 4, zeroline: false, showline: true, automargin: true, ...more};
}

function layout(more) {
  return {font: FONT, paper_bgcolor: "#fff", plot_bgcolor: "#fff", margin: {l: 70, r: 18, t: 14, b: 50},
          hoverlabel: {font: {size: 12.5}, bgcolor: "#fff", bordercolor: "#c9d1da"}, ...more};
}

function empty(id, words) {
  const place = by(id);
  place.style.height = "auto";
  make("p", words, place, "note");
}

function chips(place, names, bad, none) {
  if (!names.length) { make("p", none, place, "none"); return; }
  const list = make("ul", null, place, bad ? "chips bad" : "chips");
  for (const name of names) make("li", name, list);
}

const SINGLE = {"degrees of freedom": "degree of freedom", bodies: "body", joints: "joint", "springs and dampers": "spring or damper",
                "loops cut": "loop cut", "redundant constraints": "redundant constraint", inputs: "input", outputs: "output", states: "state"};
for (const [what, count] of data.facts) {
  if (!count && what !== "degrees of freedom") continue;
  const item = make("li", null, by("facts"));
  make("b", String(count), item);
  item.appendChild(document.createTextNode(count === 1 ? SINGLE[what] || what : what));
}
by("made").textContent = `mbsvib ${data.version} · SI units, radians · nothing is loaded from a network`;
by("json").onclick = () => download(`${fileName(data.name)}.json`, by("data").textContent, "application/json");
