// Responses of any pair, computed anew for each window, and the comparison of two systems.
const other = data.compared, sources = [data.responses, other && other.responses].map((source) =>
  source && {...source, form: formOf(source.form, source.inputs.length)});
const [responses, second] = sources, COLOURS = [BLUE, "#d55e00"], DASHES = ["solid", "dash"];
const labels = other ? other.labels : [""];
const whole = responses && [responses, second].filter(Boolean).reduce((span, {span: [low, high]}) =>
  [Math.min(span[0], low), Math.max(span[1], high)], [Infinity, 0]);
let chosen = [], frequencies = whole, times = null;

// The pair of each system that has both ports.
function choosePair() {
  const input = responses.inputs[by("input").selectedIndex][0], output = responses.outputs[by("output").selectedIndex][0];
  chosen = sources.flatMap((source, k) => {
    if (!source) return [];
    const i = source.inputs.findIndex(([name]) => name === input), j = source.outputs.findIndex(([name]) => name === output);
    if (i < 0 || j < 0) return [];
    const number = i * source.outputs.length + j, pair = pairOf(source.form, j, i);
    const points = sampled(pair, source.poles, ...whole);
    return [{k, source, pair, input, output, unit: source.units[number], outputUnit: source.outputs[j][1], inputUnit: source.inputs[i][1],
             negligible: source.negligible[number], whole: points, angles: phases(points)}];
  });
  frequencies = whole;
  times = [0, longest()];
  drawBode();
  drawStep();
}

// Time until the step responses have settled, at most 60 periods of the fastest motion that a figure can show.
function longest() {
  let end = 0;
  for (const {source, pair} of chosen) {
    const slow = source.poles.filter(([re, im]) => re < 0 || im > 0).map(([re, im]) => Math.min(re < 0 ? 4 / -re : Infinity, 60 * Math.PI / Math.hypot(re, im)));
    if (slow.length) end = Math.max(end, settling(pair, Math.max(...slow)));
  }
  return end || 1;
}

// The end of what leaves 1 % of the largest deviation from the last value, and a quarter more.
function settling(pair, end) {
  const points = steps(pair, 0, end).filter((p) => Number.isFinite(p.y)), last = (points[points.length - 1] || {}).y;
  const away = points.map((p) => Math.abs(p.y - last)), most = Math.max(...away);
  const at = away.findLastIndex((value) => value > 0.01 * most);
  return Math.min(end, at < 0 ? end : 1.25 * points[Math.min(at + 1, points.length - 1)].t);
}

function nearest(curve, f) {
  let best = 0;
  curve.whole.forEach((point, k) => { if (curve.angles[k] !== null && Math.abs(Math.log(point.f / f)) < Math.abs(Math.log(curve.whole[best].f / f))) best = k; });
  return curve.angles[best] === null ? undefined : curve.angles[best];
}

const curveStyle = ({k, negligible}) => ({color: negligible ? "#9aa5b1" : COLOURS[k], width: 2, dash: DASHES[k], simplify: false});

// Points of a window, a little wider than it so that lines leave it.
function windowOf(curve) {
  const whole_ = frequencies[0] === whole[0] && frequencies[1] === whole[1];
  if (whole_) return {points: curve.whole, angles: curve.angles};
  const points = sampled(curve.pair, curve.source.poles, ...frequencies);
  return {points, angles: phases(points, points.length ? nearest(curve, points[0].f) : undefined)};
}

function drawBode() {
  if (!chosen.length) return;
  const [low, high] = frequencies, decibel = by("decibel").checked, {unit, input, output} = chosen[0];
  const natural = [...new Set(data.modes.rows.map((mode) => mode.natural).filter((f) => f > low && f < high))];
  const marks = by("marks").checked && natural.length <= 60 ? natural.map((f) => ({type: "line", xref: "x", yref: "paper", x0: f, x1: f,
    y0: 0, y1: 1, line: {color: "#b6c0ca", width: 1, dash: "dot"}, layer: "below"})) : [];
  const traces = chosen.flatMap((curve) => {
    const {points, angles} = windowOf(curve), x = points.map((p) => p.f), line = curveStyle(curve), name = plain(labels[curve.k]);
    const head = other ? `<b>${name}</b><br>` : "";
    return [{x, y: points.map((p) => (Number.isFinite(p.log) ? (decibel ? 20 * p.log : 10 ** p.log) : null)), line, mode: "lines", name,
             hovertemplate: `${head}%{x:.6g} Hz<br>%{y:.5g} ${decibel ? "dB" : plain(unit)}<extra></extra>`},
            {x, y: angles, line, mode: "lines", yaxis: "y2", name, showlegend: false, hovertemplate: `${head}%{x:.6g} Hz<br>%{y:.2f}°<extra></extra>`}];
  });
  const narrow = by("bode").clientWidth < 560, [title, above] = heading("bode", input, output);
  Plotly.react("bode", traces, layout({showlegend: Boolean(other), legend: {orientation: "h", x: 0.5, xanchor: "center", y: 1.01, yanchor: "bottom"},
    shapes: marks, hovermode: "closest", margin: {l: narrow ? 62 : 90, r: 12, t: above, b: 54},
    title,
    xaxis: axis("frequency [Hz]", {type: "log", range: [Math.log10(low), Math.log10(high)], anchor: "y2", minor: MINOR, ...ticks(low, high)}),
    yaxis: axis(decibel ? `magnitude [dB${unit === "1" ? "" : ` re 1 ${plain(unit)}`}]` : `magnitude [${plain(unit)}]`, {type: decibel ? "linear" : "log", domain: [0.4, 1], exponentformat: "power", ...(decibel ? {} : decades(traces))}),
    yaxis2: axis("phase [deg]", {domain: [0, 0.34], ...(narrow || frequencies !== whole ? {} : quarters(traces))})}), CONFIG);
  const worst = Math.max(...chosen.map(({source}) => source.form.error));
  by("response-remark").textContent = (chosen[0].negligible ? "This response is zero by symmetry: what is drawn is rounding." :
    `Zoom in: curves are computed anew for each window.${data.scene ? " A click on a curve shows the nearest mode." : ""}`) +
    (worst > 1e-9 ? ` Curves differ from those of mbsvib by up to ${worst.toExponential(0)} of their largest value.` : "") +
    (data.motions[input] ? ` ${data.motions[input]}` : "") +
    (other && chosen.length < 2 ? ` Only one of the two systems has this input and output.` : "");
}

// Labels at quarters of a turn, at most eight of them: phases of many modes go through many turns.
function quarters(traces) {
  const values = traces.filter((trace) => trace.yaxis === "y2").flatMap(({y}) => y.filter((value) => value !== null));
  const wide = values.reduce((most, value) => Math.max(most, value), -Infinity) - values.reduce((least, value) => Math.min(least, value), Infinity);
  return {dtick: 90 * Math.max(1, Math.ceil(wide / 90 / 8))};
}
// Labels at full decades, at most eight of them, where a magnitude spans more than one.
function decades(traces) {
  const values = traces.filter((trace) => trace.yaxis !== "y2").flatMap(({y}) => y.filter((value) => value > 0)).map(Math.log10);
  const wide = values.reduce((most, value) => Math.max(most, value), -Infinity) - values.reduce((least, value) => Math.min(least, value), Infinity);
  return wide > 1.2 ? {dtick: Math.ceil(wide / 8)} : {};
}
// Ticks at 1, 2 and 5 of a decade, or at full decades, all with whole numbers; automatic ones where a window is narrow.
const MINOR = {showgrid: true, gridcolor: "#f2f4f6"};
function ticks(low, high) {
  if (high / low < 8) return {};
  const tickvals = [], lines = [], first = Math.floor(Math.log10(low)), steps = high / low < 300 ? [1, 2, 5] : [1];
  for (let k = first; k <= Math.log10(high); k++) {
    tickvals.push(...steps.map((step) => step * 10 ** k));
    lines.push(...[1, 2, 3, 4, 5, 6, 7, 8, 9].map((step) => step * 10 ** k));
  }
  return {tickvals, ticktext: tickvals.map((value) => String(Number(value.toPrecision(3)))), minor: {...MINOR, tickvals: lines}};
}

function drawStep() {
  if (!chosen.length) return;
  const {outputUnit, inputUnit} = chosen[0], narrow = by("step").clientWidth < 560;
  Plotly.react("step", chosen.map((curve) => {
    const points = steps(curve.pair, ...times).filter((p) => Number.isFinite(p.y));
    return {x: points.map((p) => p.t), y: points.map((p) => p.y), mode: "lines", line: curveStyle(curve), name: plain(labels[curve.k]),
            hovertemplate: `%{x:.6g} s<br>%{y:.6g} ${plain(outputUnit)}<extra></extra>`};
  }), layout({showlegend: Boolean(other), legend: {orientation: "h", x: 0.5, xanchor: "center", y: 1.01, yanchor: "bottom"},
    margin: {l: narrow ? 62 : 90, r: 12, t: 40, b: 54}, hovermode: "closest",
    title: {text: `Step of 1 ${plain(inputUnit)}`, x: 0.01, xref: "container", xanchor: "left", y: 0.98, yanchor: "top", font: {size: 14.5, color: INK}},
    xaxis: axis("time [s]", {range: times, exponentformat: "power"}), yaxis: axis(`response [${plain(outputUnit)}]`, {exponentformat: "power"})}), CONFIG);
}

function zoomed(id, axisName, take) {
  by(id).on("plotly_relayout", (event) => {
    if (event[`${axisName}.autorange`]) { take(null); return; }
    const range = event[`${axisName}.range`] || (`${axisName}.range[0]` in event ? [event[`${axisName}.range[0]`], event[`${axisName}.range[1]`]] : null);
    if (range) take(range.map(Number));
  });
}

// Measured values as points over what the model has for the same channels.
function drawMeasured() {
  const {frequencies: x, pairs} = other.measured, {name, unit, curves} = pairs[by("measured-pair").selectedIndex];
  const look = [{mode: "lines", line: {color: BLUE, width: 2}}, {mode: "markers", marker: {color: COLOURS[1], size: 4}}];
  const traces = curves.flatMap(({size, phase}, k) => [["size", size, "%{y:.5g}"], ["phase", phase, "%{y:.2f}°"]].map(([what, y, shape]) => ({
    x, y, ...look[k], name: plain(labels[k]), ...(what === "size" ? {} : {yaxis: "y2", showlegend: false}),
    hovertemplate: `<b>${plain(labels[k])}</b><br>%{x:.6g} Hz<br>${shape}<extra></extra>`})));
  const [title, above] = heading("measured-plot", name);
  Plotly.react("measured-plot", traces, layout({showlegend: true, legend: {orientation: "h", x: 0.5, xanchor: "center", y: 1.01, yanchor: "bottom"},
    hovermode: "closest", margin: {l: 90, r: 12, t: above, b: 54},
    title,
    xaxis: axis("frequency [Hz]", {type: "log", anchor: "y2", ...ticks(x[0] || x[1], x[x.length - 1])}),
    yaxis: axis(unit ? `magnitude [${plain(unit)}]` : "magnitude", {type: "log", domain: [0.4, 1], exponentformat: "power", ...decades(traces)}),
    yaxis2: axis("phase [deg]", {domain: [0, 0.34], dtick: 90, range: [-190, 190]})}), CONFIG);
}
if (other && other.measured && other.measured.pairs.length) {
  by("comparison").hidden = by("measured").hidden = false;
  for (const {name} of other.measured.pairs) make("option", name, by("measured-pair"));
  by("measured-pair").onchange = drawMeasured;
  drawMeasured();
}

if (responses) {
  for (const [id, ports] of [["input", responses.inputs], ["output", responses.outputs]]) {
    for (const [name, unit] of ports) make("option", unit ? `${name} [${unit}]` : name, by(id));
    by(id).onchange = choosePair;
  }
  // the first transmissibility, else the first response, that is not zero by symmetry
  const zero = responses.negligible, counts = responses.outputs.length, first = zero.findIndex((none, k) => !none && responses.units[k] === "1");
  const at = Math.max(0, first >= 0 ? first : zero.indexOf(false));
  [by("input").selectedIndex, by("output").selectedIndex] = [Math.floor(at / counts), at % counts];
  by("marks").onchange = by("decibel").onchange = drawBode;
  by("reset").onclick = () => { frequencies = whole; times = [0, longest()]; drawBode(); drawStep(); };
  choosePair();
  zoomed("bode", "xaxis", (range) => { frequencies = range ? range.map((x) => 10 ** x) : whole; drawBode(); });
  zoomed("step", "xaxis", (range) => { times = range ? [Math.max(0, range[0]), Math.max(range[1], 1e-12)] : [0, longest()]; drawStep(); });
  by("bode").on("plotly_click", (event) => {
    const at = event.points[0].x;
    let best = -1;
    modesOf.rows.slice(0, modesOf.shown).forEach((mode, i) => {
      if (mode.natural > 0 && (best < 0 || Math.abs(Math.log(mode.natural / at)) < Math.abs(Math.log(modesOf.rows[best].natural / at)))) best = i;
    });
    choose(best);
  });
  const file = (what) => `${fileName(data.name)}-${fileName(chosen[0].input)}-${fileName(chosen[0].output)}${what}.csv`;
  by("csv-response").onclick = () => {
    const named = ({k}) => (other ? ` ${labels[k]}` : ""), rows = chosen.flatMap((curve) => {
      const {points, angles} = windowOf(curve);
      return points.map((p, i) => [...(other ? [labels[curve.k]] : []), p.f, 10 ** p.log, angles[i]]);
    });
    csv(file(""), [[...(other ? ["system"] : []), "frequency [Hz]", `magnitude of ${chosen[0].output} / ${chosen[0].input} [${chosen[0].unit}]`, "phase [deg]"], ...rows]);
  };
  by("csv-step").onclick = () => csv(file("-step"), [[...(other ? ["system"] : []), "time [s]", `${chosen[0].output} [${chosen[0].outputUnit}]`],
    ...chosen.flatMap((curve) => steps(curve.pair, ...times).map((p) => [...(other ? [labels[curve.k]] : []), p.t, p.y]))]);
} else {
  by("bode").parentElement.querySelector(".bar").remove();
  for (const id of ["csv-response", "csv-step", "step"]) by(id).remove();
  empty("bode", "The model has no input, no output or no degree of freedom: there is no response to show.");
}

// Modes in pairs
if (other) {
  by("comparison").hidden = false;
  document.querySelector('nav a[href="#comparison"]').hidden = false;
  const shape = other.pairs.by === "shape", [one, two] = labels;
  by("pairs").closest(".card").hidden = by("csv-comparison").hidden = !other.pairs.rows.length;
  by("differences").hidden = !other.notes.length;
  for (const note of other.notes) make("li", note, by("differences").querySelector("ul"));
  const head = [["mode", ""], [one, "Hz"], ["mode", ""], [two, "Hz"], ["difference", "Hz"], ["difference", "%"], ["damping", `${one}, %`], ["damping", `${two}, %`], ...(shape ? [["MAC", "–"]] : [])];
  const row = make("tr", null, by("pairs").tHead);
  for (const [word, unit] of head) { const cell = make("th", word, row); make("br", null, cell); make("i", unit, cell); }
  const table = other.pairs.rows.map(([i, j, alike]) => {
    const a = i === null ? null : data.modes.rows[i], b = j === null ? null : other.modes[j];
    const change = a && b ? b.natural - a.natural : null;
    return [a && i + 1, a && a.natural, b && j + 1, b && b.natural, change, change !== null && a.natural > 0 ? 100 * change / a.natural : null,
            a && a.ratio !== null ? 100 * a.ratio : null, b && b.ratio !== null ? 100 * b.ratio : null, ...(shape ? [alike] : [])];
  });
  for (const values of table) {
    const line = make("tr", null, by("pairs").tBodies[0]);
    values.forEach((value, k) => {
      const signed = (k === 4 || k === 5) && value > 0 ? "+" : "";
      make("td", value === null ? "–" : k === 0 || k === 2 ? String(value) : signed + shown(value, k === 1 || k === 3 ? 6 : k === 8 ? 3 : 4), line);
    });
    if (shape && values[8] !== null && values[8] < 0.5) line.className = "unlike";
  }
  by("comparison-remark").textContent = !table.length ? "No measured mode is that of an output." : shape ? "Modes are paired by their shapes (MAC; where frequencies are within 0.1 %, by the plane of the shapes). Pairs in grey are hardly alike (MAC below 0.5)."
    : "Modes are paired by their natural frequencies: there are no shapes of common bodies.";
  by("csv-comparison").onclick = () => csv(`${fileName(data.name)}-comparison.csv`, [head.map(([word, unit]) => `${word} ${unit}`.trim()), ...table]);
}
