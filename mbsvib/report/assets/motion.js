// The mechanism in 3-D, and its modes in motion.
const scene = (() => {
  const given = data.scene || {size: 1, points: "", first: [], second: [], share: [], firstArm: "", secondArm: "", lines: [], marks: [], faces: []}, points = floats(given.points), a = floats(given.firstArm), b = floats(given.secondArm);
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

// Every trace costs a pass of the graphics card and a plan of its own in each frame: so lines of one width are one trace,
// with a colour at each point, and all marks are one.
const LINES = {rest: ["pose at rest", "#c3cbd4"], ground: ["ground", "#7d8894"], spoke: ["bodies", "#7f9cc4"], body: ["bodies", BLUE],
               beam: ["bodies", BLUE], rod: ["bodies", BLUE], spring: ["springs", ORANGE], gap: ["springs", ORANGE],
               damper: ["springs", "#8a6fb8"], axis: ["joints", "#39434e"], input: ["inputs", "#3a9a6e"]};
const MARKS = {bushing: ["springs", "square", 10, ORANGE, "#ffffff"], joint: ["joints", "circle", 10, "#ffffff", "#39434e"],
               cut: ["cut joints", "diamond", 11, RED, "#ffffff"], body: ["bodies", "circle", 10, "#16365f", "#ffffff"],
               node: ["bodies", "circle", 10, "#16365f", "#ffffff"], input: ["inputs", "diamond", 8, "#3a9a6e", "#3a9a6e"]};
const hidden = new Set();
const outlines = scene.lines.filter((line) => ["body", "beam", "rod"].includes(line[0]));
const drawnLines = [...scene.lines, ...outlines.map(([, name, from, to]) => ["rest", name, from, to])];
const drawnMarks = [...scene.marks, ...scene.lines.filter((line) => line[0] === "input").map(([, name, , to]) => ["input", name, to - 1, "input"])];
const columns = (numbers, at) => [0, 1, 2].map((axis) => numbers.map((i) => (i < 0 ? null : at[3 * i + axis])));

function linesOf(...kinds) {
  const numbers = [], colour = [];
  for (const [kind, , from, to] of drawnLines) {
    if (!kinds.includes(kind) || hidden.has(LINES[kind][0])) continue;
    for (let i = from; i <= to; i++) { numbers.push(i < to ? i : -1); colour.push(LINES[kind][1]); }
  }
  return {numbers, style: {"line.color": [colour]}};
}

function marks() {
  const seen = drawnMarks.filter((mark) => !hidden.has(MARKS[mark[0]][0])), each = (i) => seen.map((mark) => MARKS[mark[0]][i]);
  return {numbers: seen.map((mark) => mark[2]), style: {text: [seen.map((mark) => `<b>${plain(mark[1])}</b><br>${plain(mark[3])}`)],
    "marker.symbol": [each(1)], "marker.size": [each(2)], "marker.color": [each(3)], "marker.line.color": [each(4)]}};
}

const faces = [0, 1, 2].map((corner) => scene.faces.map((face) => face[corner]));
const lineTrace = (width) => ({type: "scatter3d", mode: "lines", hoverinfo: "skip", line: {width}});
const traces = [
  {still: true, content: () => linesOf("rest", "ground"), trace: lineTrace(2.5)},
  {content: () => ({numbers: hidden.has("bodies") || !scene.faces.length ? [] : Array.from({length: scene.count}, (_, i) => i), style: {}}),
   trace: {type: "mesh3d", color: "#8fb0d8", opacity: 0.5, flatshading: true, hoverinfo: "skip", i: faces[0], j: faces[1], k: faces[2],
     lighting: {ambient: 0.85, diffuse: 0.35, specular: 0.05}}},
  {content: () => linesOf("body", "beam", "rod"), trace: lineTrace(7)},
  {content: () => linesOf("spoke", "spring", "gap", "damper", "axis", "input"), trace: lineTrace(4)},
  {content: marks, trace: {type: "scatter3d", mode: "markers", hoverinfo: "text", marker: {line: {width: 1.5}}}},
].map((each) => ({...each, ...each.content()}));
const SWATCH = {"pose at rest": "#c3cbd4", bodies: BLUE, springs: ORANGE, joints: "#39434e", "cut joints": RED, ground: "#9aa5b1",
                inputs: "#3a9a6e"};
const VIEWS = {"3-D": {eye: {x: 1.12, y: -1.29, z: 0.72}, up: {x: 0, y: 0, z: 1}},
               x: {eye: {x: 1.9, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}}, y: {eye: {x: 0, y: -1.9, z: 0}, up: {x: 0, y: 0, z: 1}},
               z: {eye: {x: 0, y: 0, z: 1.9}, up: {x: 0, y: 1, z: 0}}};

const view = by("view");
const FILLS = 0.94;  // of the view, along its narrower side
const MOVING = 0.5;  // of the most that any mode takes a point along each axis: none goes as far along all axes
const TURNED = 1.3;  // times the scale at which it fits all views: a turn by hand may take it out of the view by as much
let preset = VIEWS["3-D"];
const HALF_ANGLE = Math.tan(Math.PI / 8);  // of the perspective, from the middle to the upper edge

// How far any mode takes each point along each axis, as a share of the amplitude, and the most along each axis.
const goes = new Float64Array(scene.points.length), farthest = [0, 0, 0];
for (let mode = 0; mode < modesOf.shown; mode++) {
  const [re, im] = shapeOf(mode);
  for (let i = 0; i < re.length; i++) goes[i] = Math.max(goes[i], Math.hypot(re[i], im[i]));
}
goes.forEach((share, i) => { farthest[i % 3] = Math.max(farthest[i % 3], share); });

// Ranges that no motion leaves, as lines end there, and proportions that fit the view, be the mechanism flat, long or tall.
function room() {
  const amplitude = Number(by("amplitude").value), ranges = [0, 1, 2].map((axis) => {
    let low = Infinity, high = -Infinity;
    for (let i = axis; i < scene.points.length; i += 3) { low = Math.min(low, scene.points[i]); high = Math.max(high, scene.points[i]); }
    if (low > high) low = high = 0;
    const middle = 0.5 * (low + high), more = Math.max(0.05, 1.02 * amplitude * farthest[axis] + 0.02) * scene.size;
    const half = Math.max(0.5 * (high - low) + more, 0.12 * scene.size);
    return [middle - half, middle + half];
  });
  const [x, y, z] = ranges.map(([low, high]) => high - low), middle = ranges.map(([low, high]) => 0.5 * (low + high));
  const fits = (camera) => fitting(camera, middle, MOVING * amplitude * scene.size);
  const scale = Math.min(fits(preset), TURNED * Math.min(...Object.values(VIEWS).map(fits)));
  return {ranges, ratio: {x: scale * x, y: scale * y, z: scale * z}};
}

// The scale at which all points, moved by so much of the shapes, are within the view of a camera.
function fitting(camera, middle, amplitude) {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const distance = Math.hypot(camera.eye.x, camera.eye.y, camera.eye.z), [right, up, ahead] = cameraAxes(camera);
  const wide = view.clientWidth / Math.max(1, view.clientHeight);
  let scale = Infinity;
  for (let i = 0; i < scene.points.length; i += 3) {
    const at = [0, 1, 2].map((axis) => scene.points[i + axis] - middle[axis]);
    const reach = (way) => amplitude * dot(way.map(Math.abs), goes.subarray(i, i + 3)), depth = dot(at, ahead) + reach(ahead);
    for (const [way, angle] of [[right, FILLS * HALF_ANGLE * wide], [up, FILLS * HALF_ANGLE]]) {
      const needed = (Math.abs(dot(at, way)) + reach(way)) / angle + depth;
      if (needed > 0) scale = Math.min(scale, distance / needed);
    }
  }
  return Number.isFinite(scale) ? Math.min(scale, 2.5 / scene.size) : 1 / scene.size;
}

const {ranges, ratio} = room();
const axis3 = (i) => ({range: ranges[i], autorange: false, visible: false, showspikes: false});

if (data.scene) Plotly.newPlot(view, traces.map(({trace, numbers, style}) => {
  const [x, y, z] = columns(numbers, scene.points), made = {...trace, x, y, z, visible: numbers.length > 0, showlegend: false};
  for (const [key, [values]] of Object.entries(style)) {
    const path = key.split("."), last = path.pop();
    path.reduce((place, name) => (place[name] = {...place[name]}), made)[last] = values;
  }
  return made;
}), layout({margin: {l: 0, r: 0, t: 0, b: 0}, uirevision: "turned", scene: {xaxis: axis3(0), yaxis: axis3(1),
  zaxis: axis3(2), aspectmode: "manual",
  aspectratio: ratio, dragmode: "orbit", camera: {...VIEWS["3-D"], projection: {type: "perspective"}}}}), CONFIG);

// The camera as it is right now: a drawing in the middle of a turn must not take the view back to where the turn began.
function keepCamera() {
  const inner = view._fullLayout && view._fullLayout.scene && view._fullLayout.scene._scene;
  if (!inner || !inner.getCamera) return;
  const camera = inner.getCamera();
  view.layout.scene.camera = camera;
  view._fullLayout.scene.camera = {...view._fullLayout.scene.camera, ...camera};
}

// Where the library lets us, points go straight to what draws them: a third of the time of its own way, which lays the
// whole figure out anew.
function straight(i, [x, y, z]) {
  const inner = view._fullLayout.scene._scene, full = view._fullData[i], drawn = inner.traces[full.uid];
  for (const trace of [view.data[i], full]) Object.assign(trace, {x, y, z});
  drawn.update(full);
}

let direct = true;
function draw() {
  if (!data.scene) return Promise.resolve();
  const at = moved(), changed = [...traces.keys()].filter((i) => !traces[i].still && traces[i].numbers.length);
  const places = changed.map((i) => columns(traces[i].numbers, at));
  state.drawn += 1;
  if (direct) {
    try {
      changed.forEach((i, k) => straight(i, places[k]));
      view._fullLayout.scene._scene.glplot.redraw();
      return Promise.resolve();
    } catch (error) {
      direct = false;  // another version of the library
    }
  }
  keepCamera();
  return changed.length ? Plotly.restyle(view, {x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2])}, changed)
    : Promise.resolve();
}

async function show(layer, wanted) {
  if (wanted) hidden.delete(layer); else hidden.add(layer);
  for (const [i, each] of traces.entries()) {
    Object.assign(each, each.content());
    const [x, y, z] = columns(each.numbers, each.still ? scene.points : moved());
    keepCamera();
    await Plotly.restyle(view, {x: [x], y: [y], z: [z], visible: each.numbers.length > 0, ...each.style}, [i]);
  }
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
  const box = rows[mode].closest(".table"), top = rows[mode].offsetTop;  // scrolls the table, never the page
  if (top < box.scrollTop + 50 || top + 34 > box.scrollTop + box.clientHeight) box.scrollTop = top - 60;
  tell(mode);
  draw();
}

// Details of a mode: eigenvalues, time constants, and shares of its strain and kinetic energy.
function tell(mode) {
  const place = by("detail"), row = modesOf.rows[mode], [re, im] = row.values[0], [re2] = row.values[1];
  place.textContent = "";
  make("h3", `Mode ${mode + 1}${row.natural > 0 ? `, ${shown(row.natural)} Hz` : ", rigid"}`, place);
  const list = make("dl", null, place), item = (what, value) => { make("dt", what, list); make("dd", value, list); };
  item("eigenvalues", im ? `${shown(re, 5)} ± ${shown(Math.abs(im))} j 1/s` : re === re2 ? `${shown(re)} 1/s, twice` : `${shown(re)} and ${shown(re2)} 1/s`);
  if (im) item("period", seconds(2 * Math.PI / Math.abs(im)));
  if (re < 0) item("decay time constant", seconds(-1 / re));
  if (re < 0 && im) item("Q", shown(0.5 / row.ratio, 4));
  const both = make("div", null, place, "holds");
  for (const [which, title] of [["strain", "Strain energy by element"], ["kinetic", "Kinetic energy by body"]]) {
    const part = make("div", null, both), all = data.shares[which].map(([name, values]) => [name, values[mode]]);
    const most = all.filter(([, value]) => value !== null && Math.abs(value) >= 0.05).sort((a, b) => Math.abs(b[1]) - Math.abs(a[1])).slice(0, 6);
    make("h3", title, part);
    for (const [name, value] of most) {
      const line = make("div", null, part, "share");
      make("span", name, line).style.setProperty("--part", `${Math.min(100, Math.abs(value))}%`);
      line.title = name;
      make("b", `${value.toFixed(1)} %`, line);
    }
    if (!most.length) make("p", which === "strain" ? "Nothing: no spring is strained." : "Nothing.", part, "none");
  }
}

const seconds = (time) => (time >= 1 ? `${shown(time, 4)} s` : time >= 1e-3 ? `${shown(1e3 * time, 4)} ms` : `${shown(1e6 * time, 4)} µs`);

function shapes() {
  const names = (data.topology || {nodes: []}).nodes.slice(0, modesOf.bodies).map((node) => node[0]), out = [];
  names.forEach((name, body) => ["x", "y", "z", "rx", "ry", "rz"].forEach((way, j) => {
    const at = (mode) => 2 * ((mode * modesOf.bodies + body) * 6 + j), digits = (value) => Number(value.toPrecision(7));
    out.push([name, way, ...Array.from({length: modesOf.shown}, (_, mode) => [digits(motions[at(mode)]), digits(motions[at(mode) + 1])]).flat()]);
  }));
  return [["body", "direction", ...Array.from({length: modesOf.shown}, (_, mode) => [`mode ${mode + 1} real`, `mode ${mode + 1} imaginary`]).flat()], ...out];
}

const rows = modesOf.rows.map((mode, i) => {
  const row = make("tr", null, by("modes").tBodies[0]);
  row.dataset.mode = i;
  for (const text of [String(i + 1), shown(mode.natural), shown(mode.damped), mode.ratio === null ? "∞" : shown(100 * mode.ratio, 4),
                      mode.error === null ? "–" : mode.error === 0 ? "0" : mode.error.toExponential(1)]) make("td", text, row);
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
by("amplitude").onchange = () => {
  const {ranges, ratio} = room();
  keepCamera();
  Plotly.relayout(view, {"scene.xaxis.range": ranges[0], "scene.yaxis.range": ranges[1], "scene.zaxis.range": ranges[2], "scene.aspectratio": ratio});
};
for (const [name, camera] of Object.entries(VIEWS)) {
  make("button", name, by("views")).onclick = () => {
    preset = camera;
    Plotly.relayout(view, {"scene.aspectratio": room().ratio, "scene.camera": {...camera, center: {x: 0, y: 0, z: 0}, projection: {type: "perspective"}}});
  };
}
const used = new Set([...drawnLines.map((line) => LINES[line[0]][0]), ...drawnMarks.map((mark) => MARKS[mark[0]][0])]);
for (const [name, colour] of Object.entries(SWATCH)) {
  if (!used.has(name)) continue;
  const label = make("label", null, by("layers")), box = make("input", null, label);
  box.type = "checkbox";
  box.checked = true;
  make("span", null, label, "swatch").style.background = colour;
  label.appendChild(document.createTextNode(name));
  box.onchange = () => show(name, box.checked);
}
by("remarks").textContent = modesOf.remarks.join(" ") +
  (data.scene && modesOf.shown < modesOf.rows.length ? ` The first ${modesOf.shown} of ${modesOf.rows.length} modes are shown in motion.` : "");
by("csv-modes").onclick = () => csv(`${fileName(data.name)}-modes.csv`, [
  ["mode", "natural_hz", "damped_hz", "damping_ratio", "real_1", "imag_1", "real_2", "imag_2", "relative_error", "largest_motion"],
  ...modesOf.rows.map((mode, i) => [i + 1, mode.natural, mode.damped, mode.ratio, ...mode.values.flat(), mode.error, mode.most])]);
by("csv-shapes").onclick = () => csv(`${fileName(data.name)}-shapes.csv`, shapes());
if (!data.scene) { document.querySelector(".stage").remove(); by("motion").querySelector(".split").classList.add("single"); by("csv-shapes").remove(); }
else if (modesOf.shown) choose(0); else for (const id of ["play", "previous", "next", "csv-shapes"]) by(id).disabled = true;
