// Energy, topology and accuracy.
// Energy
const withShares = Math.min(60, modesOf.rows.length);
function drawShares(which) {
  for (const id of ["strain", "kinetic"]) by(id).setAttribute("aria-selected", String(id === which));
  const rowsOf = data.shares[which], numbers = modesOf.rows.slice(0, withShares).map((_, i) => i + 1);
  const words = which === "strain" ? "strain energy" : "kinetic energy";
  Plotly.react("shares", rowsOf.map(([name, values], i) => ({type: "bar", name: plain(name), x: numbers, y: values,
    marker: {color: name === "all others" ? "#d5dbe1" : PALETTE[i % PALETTE.length], pattern: {shape: i >= PALETTE.length ? "/" : "", solidity: 0.25}},
    hovertemplate: `<b>${plain(name)}</b><br>mode %{x}: %{y:.2f} %<extra></extra>`})),
  layout({barmode: "relative", bargap: 0.28, showlegend: true, legend: {traceorder: "normal", font: {size: 12}, y: 0.93},
    xaxis: axis("mode [–]", {dtick: Math.ceil(numbers.length / 20), range: [0.4, numbers.length + 0.6], showgrid: false}),
    yaxis: axis(`share of ${words} [%]`)}), CONFIG);
}
if (!data.topology) {
  for (const id of ["energy", "structure"]) { by(id).remove(); document.querySelector(`nav a[href="#${id}"]`).remove(); }
} else if (modesOf.shown) {
  by("strain").onclick = () => drawShares("strain");
  by("kinetic").onclick = () => drawShares("kinetic");
  drawShares(data.shares.strain.length ? "strain" : "kinetic");
} else {
  empty("shares", "No mode has any energy.");
}
if (data.topology) by("csv-energy").onclick = () => csv(`${fileName(data.name)}-energy.csv`, [
  ["energy [%]", "element", ...modesOf.rows.slice(0, withShares).map((_, i) => `mode ${i + 1}`)],
  ...["strain", "kinetic"].flatMap((which) => data.shares[which].map(([name, values]) => [which, name, ...values]))]);

// Topology: edges between the same two bodies bend away from each other.
function bent(from, to, bend) {
  const xs = [], ys = [], [x0, y0] = from, [x1, y1] = to;
  const cx = 0.5 * (x0 + x1) + bend * (y1 - y0 || 1), cy = 0.5 * (y0 + y1) - bend * (x1 - x0);
  for (let i = 0; i <= 16; i++) {
    const s = i / 16, a = (1 - s) ** 2, b = 2 * s * (1 - s), c = s * s;
    xs.push(a * x0 + b * cx + c * x1);
    ys.push(a * y0 + b * cy + c * y1);
  }
  return [xs, ys];
}

function drawGraph() {
  const {nodes, edges} = data.topology, ground = nodes.length - 1, seen = {}, at = (i) => [nodes[i][1], nodes[i][2]];
  const kinds = {tree: {name: "joint of the tree", color: INK, width: 2.2}, floating: {name: "no joint: floats", color: "#9aa5b1", width: 1.5, dash: "dot"},
                 cut: {name: "cut joint", color: RED, width: 2.4, dash: "dash"}, spring: {name: "spring or damper", color: ORANGE, width: 1.3},
                 coupler: {name: "gear or coupler", color: "#2c8a5b", width: 1.6, dash: "dot"}};
  const drawn = Object.fromEntries(Object.keys(kinds).map((kind) => [kind, {x: [], y: [], mx: [], my: [], text: []}]));
  for (const [kind, name, words, first, second] of edges) {
    const key = `${Math.min(first, second)}-${Math.max(first, second)}`, nth = (seen[key] = (seen[key] ?? -1) + 1);
    const side = (nth % 2 ? 1 : -1) * Math.ceil(nth / 2) * 0.22 * (first < second ? 1 : -1);
    const flat = nth === 0 && nodes[first][2] === nodes[second][2] && Math.abs(nodes[first][1] - nodes[second][1]) > 1 ? 0.18 : 0;
    const [x, y] = bent(at(first), at(second), side + flat), place = drawn[kind];
    place.x.push(...x, null); place.y.push(...y, null);
    place.mx.push(x[8]); place.my.push(y[8]);
    place.text.push(`<b>${plain(name)}</b><br>${plain(words)}${kind === "cut" ? ", cut" : ""}<br>${plain(nodes[first][0])} – ${plain(nodes[second][0])}`);
  }
  const traces = Object.entries(kinds).filter(([kind]) => drawn[kind].x.length).flatMap(([kind, {name, color, width, dash}]) => [
    {x: drawn[kind].x, y: drawn[kind].y, mode: "lines", name, legendgroup: kind, hoverinfo: "skip", line: {color, width, dash: dash || "solid"}},
    {x: drawn[kind].mx, y: drawn[kind].my, mode: "markers", legendgroup: kind, showlegend: false, hoverinfo: "text", text: drawn[kind].text,
     marker: {size: 7, color: kind === "cut" ? RED : "#fff", line: {color, width: 1.5}}}]);
  const labels = nodes.length <= 80;
  traces.push({x: nodes.map((node) => node[1]), y: nodes.map((node) => node[2]), mode: "markers", showlegend: false,
    hoverinfo: "text", text: nodes.map((node) => plain(node[0])), marker: {size: nodes.map((_, i) => (i === ground ? 17 : 13)),
    symbol: nodes.map((_, i) => (i === ground ? "square" : "circle")), color: nodes.map((_, i) => (i === ground ? "#6b7682" : BLUE)), line: {color: "#fff", width: 2}}});
  // on paper, so that no line runs through a name
  const annotations = nodes.length > 80 ? [] : nodes.map((node, i) => ({x: node[1], y: node[2], text: plain(node[0]), showarrow: false,
    yshift: i === ground ? -21 : 18, bgcolor: "rgba(255,255,255,0.85)", borderpad: 1, font: {size: nodes.length > 30 ? 10 : 12, color: INK}}));
  const bare = {visible: false};
  Plotly.newPlot("graph", traces, layout({margin: {l: 12, r: 12, t: 8, b: 8}, xaxis: {...bare}, hovermode: "closest", annotations,
    yaxis: {...bare, range: [-0.6, Math.max(...nodes.map((node) => node[2])) + 0.6]}, legend: {orientation: "h", x: 0, y: 0, yanchor: "top"}}), CONFIG);
}
function structure() {
drawGraph();
by("csv-topology").onclick = () => csv(`${fileName(data.name)}-topology.csv`, [["part", "name", "what", "first", "second"],
  ...data.topology.edges.map(([kind, name, words, first, second]) => [kind, name, words, data.topology.nodes[first][0], data.topology.nodes[second][0]])]);
chips(by("cut"), data.cut, false, "None: the joints make no loop.");
chips(by("redundant"), data.redundant, true, "None: every constraint counts.");
if (!data.loops.length) make("p", "No loop has constraints.", by("loops"), "none");
for (const loop of data.loops) {
  const pivots = loop.rank ? `; smallest pivot kept ${shown(loop.kept, 3)}, largest dropped ${shown(loop.dropped, 3)}` : "";
  const names = loop.joints.length > 8 ? `${loop.joints.slice(0, 8).join(", ")}, … (${loop.joints.length})` : loop.joints.join(", ");
  make("p", `${names}: ${loop.rank} of ${loop.rows} constraint rows independent${pivots}; loop size ${shown(loop.length, 3)} m`, by("loops"));
}
}
if (data.topology) structure();

// Accuracy
if (modesOf.rows.length) {
  const errors = modesOf.rows.map((mode) => Math.max(mode.error || 0, 1e-17));
  Plotly.newPlot("errors", [{type: "scatter", mode: "markers", x: errors.map((_, i) => i + 1), y: errors, marker: {color: BLUE, size: errors.length > 80 ? 4 : 7},
    hovertemplate: "mode %{x}: %{y:.1e}<extra></extra>"}], layout({margin: {l: 80, r: 18, t: 34, b: 50},
    title: {text: "Estimated relative error of the eigenvalues", x: 0, xref: "paper", font: {size: 14, color: INK}},
    xaxis: axis("mode [–]", {range: [0.4, errors.length + 0.6], dtick: Math.ceil(errors.length / 20), showgrid: false}),
    yaxis: axis("relative error [–]", {type: "log", exponentformat: "power", dtick: 2,
      range: [-17.2, Math.max(-9.5, Math.ceil(Math.log10(Math.max(...errors))) + 0.5)]})}), CONFIG);
} else {
  empty("errors", "There are no eigenvalues.");
}
if (data.explained === null) by("skipped").parentElement.remove();
else {
  for (const text of data.skipped) make("li", text, by("skipped"));
  by("explained").textContent = data.explained;
}
document.body.dataset.ready = "yes";
