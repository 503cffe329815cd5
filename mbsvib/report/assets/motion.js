// The mechanism in 3-D, and its modes in motion.
const scene = (() => {
  const given = data.scene, points = floats(given.points), a = floats(given.firstArm), b = floats(given.secondArm);
  return {...given, points, a, b, count: given.first.length};
})();
const modesOf = data.modes, motions = floats(modesOf.motion);
const state = {mode: -1, playing: false, phase: 0, drawn: 0, shape: null};

// Displacements of all points in a mode, real and imaginary part, largest one 1.
function shapeOf(mode) {
  const n = scene.count, bodies = modesOf.bodies, parts = [new Float64Array(3 * n), new Float64Array(3 * n)];
  const moved = (body, part, arm, i, weight, out) => {
    if (body >= bodies || weight === 0) return;
    const at = (j) => motions[((mode * bodies + body) * 6 + j) * 2 + part];
    const x = arm[3 * i], y = arm[3 * i + 1], z = arm[3 * i + 2], rx = at(3), ry = at(4), rz = at(5);
    out[3 * i] += weight * (at(0) + ry * z - rz * y);
    out[3 * i + 1] += weight * (at(1) + rz * x - rx * z);
    out[3 * i + 2] += weight * (at(2) + rx * y - ry * x);
  };
  for (let part = 0; part < 2; part++) {
    for (let i = 0; i < n; i++) {
      moved(scene.first[i], part, scene.a, i, 1 - scene.share[i], parts[part]);
      moved(scene.second[i], part, scene.b, i, scene.share[i], parts[part]);
    }
  }
  let largest = 0;
  for (let i = 0; i < n; i++) {
    let size = 0;
    for (let j = 3 * i; j < 3 * i + 3; j++) size += parts[0][j] ** 2 + parts[1][j] ** 2;
    largest = Math.max(largest, size);
  }
  const scale = largest > 0 ? 1 / Math.sqrt(largest) : 0;
  return parts.map((part) => part.map((value) => value * scale));
}

function moved() {
  if (!state.shape) return scene.points;
  const size = Number(by("amplitude").value) * scene.size, [re, im] = state.shape;
  const c = size * Math.cos(state.phase), s = size * Math.sin(state.phase);
  return scene.points.map((value, i) => value + c * re[i] - s * im[i]);
}

// Layers: traces of lines through points, with gaps, or of markers.
const lineNumbers = (...kinds) => scene.lines.filter((line) => kinds.includes(line[0])).flatMap(([, , from, to]) =>
  [...Array.from({length: to - from}, (_, i) => from + i), -1]);
const marksOf = (...kinds) => scene.marks.filter((mark) => kinds.includes(mark[0]));
const columns = (numbers, at) => [0, 1, 2].map((axis) => numbers.map((i) => (i < 0 ? null : at[3 * i + axis])));

const lineLayer = (layer, kinds, color, width, more = {}) => ({layer, numbers: lineNumbers(...kinds),
  trace: {type: "scatter3d", mode: "lines", hoverinfo: "skip", line: {color, width, ...more}}});
const markLayer = (layer, kinds, symbol, size, color, edge) => {
  const marks = marksOf(...kinds);
  return {layer, numbers: marks.map((mark) => mark[2]), trace: {type: "scatter3d", mode: "markers",
    marker: {symbol, size, color, line: {color: edge, width: 1.5}},
    text: marks.map((mark) => `<b>${plain(mark[1])}</b><br>${plain(mark[3])}`), hoverinfo: "text"}};
};
const layers = [
  {layer: "rest", still: true, numbers: lineNumbers("body", "beam", "rod"), trace: {type: "scatter3d", mode: "lines",
    hoverinfo: "skip", line: {color: "#c3cbd4", width: 2}}},
  {layer: "bodies", numbers: scene.faces.length ? Array.from({length: scene.count}, (_, i) => i) : [], trace: {
    type: "mesh3d", color: "#8fb0d8", opacity: 0.5, flatshading: true, hoverinfo: "skip",
    i: scene.faces.map((face) => face[0]), j: scene.faces.map((face) => face[1]), k: scene.faces.map((face) => face[2]),
    lighting: {ambient: 0.85, diffuse: 0.35, specular: 0.05}}},
  lineLayer("bodies", ["spoke"], "#7f9cc4", 2),
  lineLayer("bodies", ["body", "beam", "rod"], BLUE, 7),
  lineLayer("springs", ["spring", "gap"], ORANGE, 4),
  lineLayer("springs", ["damper"], "#8a6fb8", 4, {dash: "dash"}),
  lineLayer("joints", ["axis"], "#39434e", 3),
  markLayer("springs", ["bushing"], "square", 5, ORANGE, "#fff"),
  markLayer("joints", ["joint"], "circle", 5, "#fff", "#39434e"),
  markLayer("cut joints", ["cut"], "diamond", 6, RED, "#fff"),
  {...lineLayer("ground", ["ground"], "#7d8894", 3), still: true},
  markLayer("bodies", ["body", "node"], "circle", 5, "#16365f", "#fff"),
  lineLayer("inputs", ["input"], "#3a9a6e", 5),
  {layer: "inputs", numbers: scene.lines.filter((line) => line[0] === "input").map((line) => line[3] - 1), trace: {
    type: "scatter3d", mode: "markers", marker: {symbol: "diamond", size: 4, color: "#3a9a6e"}, hoverinfo: "text",
    text: scene.lines.filter((line) => line[0] === "input").map((line) => `<b>${plain(line[1])}</b><br>input`)}},
].filter((each) => each.numbers.length);
const SWATCH = {rest: "#c3cbd4", bodies: BLUE, springs: ORANGE, joints: "#39434e", "cut joints": RED, ground: "#9aa5b1",
                inputs: "#3a9a6e"};
const VIEWS = {"3-D": {eye: {x: 1.15, y: -1.32, z: 0.68}, up: {x: 0, y: 0, z: 1}},
               x: {eye: {x: 2.2, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}}, y: {eye: {x: 0, y: -2.2, z: 0}, up: {x: 0, y: 0, z: 1}},
               z: {eye: {x: 0, y: 0, z: 2.2}, up: {x: 0, y: 1, z: 0}}};

function room() {
  return [0, 1, 2].map((axis) => {
    let low = Infinity, high = -Infinity;
    for (let i = axis; i < scene.points.length; i += 3) { low = Math.min(low, scene.points[i]); high = Math.max(high, scene.points[i]); }
    const middle = 0.5 * (low + high), half = Math.max(0.5 * (high - low) + 0.08 * scene.size, 0.2 * scene.size);
    return [middle - half, middle + half];
  });
}

const view = by("view");
const ranges = room();
const axis3 = (name, i) => ({title: {text: `${name} [m]`, font: {size: 12, color: SOFT}}, range: ranges[i], autorange: false,
  showbackground: false, gridcolor: "#e9edf1", zeroline: false, showspikes: false, nticks: 5, tickfont: {size: 10.5, color: SOFT},
  linecolor: "#d4dae0"});
Plotly.newPlot(view, layers.map(({trace, numbers}) => {
  const [x, y, z] = columns(numbers, scene.points);
  return {...trace, x, y, z, showlegend: false};
}), layout({margin: {l: 0, r: 0, t: 0, b: 0}, uirevision: "turned", scene: {xaxis: axis3("x", 0), yaxis: axis3("y", 1),
  zaxis: axis3("z", 2), aspectmode: "data", dragmode: "orbit", camera: {...VIEWS["3-D"], projection: {type: "perspective"}}}}), CONFIG);

const moving = layers.map((each, i) => [each, i]).filter(([each]) => !each.still);

// The camera as it is right now: a drawing in the middle of a turn must not take the view back to where the turn began.
function keepCamera() {
  const inner = view._fullLayout && view._fullLayout.scene && view._fullLayout.scene._scene;
  if (!inner || !inner.getCamera) return;
  const camera = inner.getCamera();
  view.layout.scene.camera = camera;
  view._fullLayout.scene.camera = {...view._fullLayout.scene.camera, ...camera};
}

function draw() {
  const at = moved(), change = {x: [], y: [], z: []};
  for (const [{numbers}] of moving) {
    const [x, y, z] = columns(numbers, at);
    change.x.push(x); change.y.push(y); change.z.push(z);
  }
  keepCamera();
  state.drawn += 1;
  return Plotly.restyle(view, change, moving.map(([, i]) => i));
}

let last = 0, busy = false;
function frame(now) {
  if (!state.playing) return;
  requestAnimationFrame(frame);
  if (busy || now - last < 30) return;
  state.phase += 2 * Math.PI * Number(by("speed").value) * Math.min(0.1, (now - last) / 1000);
  last = now;
  busy = true;
  draw().then(() => { busy = false; }, () => { busy = false; });
}

function play(on) {
  state.playing = on && state.mode >= 0;
  by("play").textContent = state.playing ? "Pause" : "Play";
  by("play").setAttribute("aria-pressed", String(state.playing));
  if (state.playing) { last = performance.now(); requestAnimationFrame(frame); }
}

function choose(mode) {
  if (mode < 0 || mode >= modesOf.shown) return;
  state.mode = mode;
  state.shape = shapeOf(mode);
  state.phase = 0;
  for (const row of rows) row.classList.toggle("chosen", Number(row.dataset.mode) === mode);
  rows[mode].scrollIntoView({block: "nearest"});
  draw();
}

const rows = modesOf.rows.map((mode, i) => {
  const row = make("tr", null, by("modes").tBodies[0]);
  row.dataset.mode = i;
  for (const text of [String(i + 1), shown(mode.natural), shown(mode.damped), mode.ratio === null ? "∞" : shown(100 * mode.ratio, 4),
                      mode.error === null ? "–" : mode.error.toExponential(1)]) make("td", text, row);
  make("td", mode.most, row, "words");
  if (i < modesOf.shown) {
    row.tabIndex = 0;
    row.title = "Show this mode";
    row.onclick = () => { choose(i); play(true); };
    row.onkeydown = (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); row.onclick(); } };
  } else {
    row.className = "still";
  }
  return row;
});
const step = (by) => { const n = modesOf.shown; if (n) choose((Math.max(state.mode, 0) + by + n) % n); };
by("play").onclick = () => { if (state.mode < 0) choose(0); play(!state.playing); };
by("previous").onclick = () => step(-1);
by("next").onclick = () => step(1);
by("amplitude").oninput = () => { if (!state.playing) draw(); };
for (const [name, camera] of Object.entries(VIEWS)) {
  make("button", name, by("views")).onclick = () => Plotly.relayout(view, {"scene.camera": {...camera, center: {x: 0, y: 0, z: 0}, projection: {type: name === "3-D" ? "perspective" : "orthographic"}}});
}
for (const name of [...new Set(layers.map((each) => each.layer))]) {
  const label = make("label", null, by("layers")), box = make("input", null, label);
  box.type = "checkbox";
  box.checked = true;
  make("span", null, label, "swatch").style.background = SWATCH[name];
  label.appendChild(document.createTextNode(name === "rest" ? "pose at rest" : name));
  box.onchange = () => Plotly.restyle(view, {visible: box.checked},
    layers.map((each, i) => [each, i]).filter(([each]) => each.layer === name).map(([, i]) => i));
}
by("remarks").textContent = modesOf.remarks.join(" ") +
  (modesOf.shown < modesOf.rows.length ? ` The first ${modesOf.shown} of ${modesOf.rows.length} modes are shown in motion.` : "");
by("csv-modes").onclick = () => csv(`${fileName(data.name)}-modes.csv`, [
  ["mode", "natural_hz", "damped_hz", "damping_ratio", "real_1", "imag_1", "real_2", "imag_2", "relative_error", "moves_most"],
  ...modesOf.rows.map((mode, i) => [i + 1, mode.natural, mode.damped, mode.ratio, ...mode.values.flat(), mode.error, mode.most])]);
if (modesOf.shown) choose(0); else for (const id of ["play", "previous", "next"]) by(id).disabled = true;
