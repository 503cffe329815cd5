// Energy, topology and accuracy.
// Energy
const modeAxis = (id, count) => axis("mode", {range: [0.5, count + 0.5], showgrid: false, dtick: Math.ceil(count / Math.max(1, Math.min(20, by(id).clientWidth / 45)))});

// A map of elements over modes: white at zero, blue above and red below it, with numbers where cells have room.
function drawShares(which) {
  for (const id of ["strain", "kinetic"]) by(id).setAttribute("aria-selected", String(id === which));
  const rowsOf = data.shares[which], count = modesOf.rows.length, z = rowsOf.map(([, values]) => values.slice(0, count));
  const low = Math.min(0, ...z.flat()), high = Math.max(1, ...z.flat()), size = Math.max(high, -low);
  const colour = (share, rgb) => `rgb(${rgb.map((value) => Math.round(255 + (value - 255) * Math.abs(share) / size)).join()})`;
  const zero = -low / (high - low), scale = [[0, colour(low, [196, 50, 31])], [zero, "#fff"], [1, colour(high, [43, 92, 158])]];
  const names = rowsOf.map(([name]) => inLines(name, Math.max(16, by("shares").clientWidth / 18)));
  by("shares").style.height = `${124 + Math.max(88, rowsOf.length * (8 + 14 * Math.max(1, ...names.map((lines) => lines.length))))}px`;
  Plotly.react("shares", [{type: "heatmap", z, x: z.length ? z[0].map((_, i) => i + 1) : [], y: rowsOf.map((_, i) => i), xgap: count > 40 ? 0 : 1, ygap: 1,
    zmin: low, zmax: high, colorscale: scale.slice(zero ? 0 : 1), colorbar: {title: {text: "share [%]", side: "right"}, thickness: 12},
    text: z.map((values) => values.map((value) => (Math.abs(value) >= 0.5 ? value.toFixed(0) : ""))), customdata: rowsOf.map(([name]) => Array(count).fill(plain(name))),
    texttemplate: count <= 20 && by("shares").clientWidth > 34 * count + 220 ? "%{text}" : "",
    hovertemplate: "<b>%{customdata}</b><br>mode %{x}: %{z:.2f} %<extra></extra>"}],
  layout({xaxis: modeAxis("shares", count), yaxis: {tickvals: rowsOf.map((_, i) => i), ticktext: names.map((lines) => lines.map(plain).join("<br>")), ticks: "outside", tickcolor: "#fff", ticklen: 4,
    autorange: "reversed", showgrid: false, zeroline: false, automargin: true}, margin: {l: 20, r: 10, t: matchMedia("(hover: none)").matches ? 36 : 14, b: 50}}), CONFIG);  // above: room for the tools
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
  ["energy [%]", "element", ...modesOf.rows.map((_, i) => `mode ${i + 1}`)],
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

const span = (nodes) => Math.max(...nodes.map((node) => node[1])) - Math.min(...nodes.map((node) => node[1]));
function drawGraph() {
  const {nodes, edges} = data.topology, ground = nodes.length - 1, seen = {}, at = (i) => [nodes[i][1], nodes[i][2]];
  const kinds = {tree: {name: "joint of the tree", color: INK, width: 2.2}, floating: {name: "no joint: floats", color: "#9aa5b1", width: 1.5, dash: "dot"},
                 cut: {name: "cut joint", color: RED, width: 2.4, dash: "dash"}, spring: {name: "spring or damper", color: ORANGE, width: 1.3},
                 coupler: {name: "gear or coupler", color: "#2c8a5b", width: 1.6, dash: "dot"}};
  const drawn = Object.fromEntries(Object.keys(kinds).map((kind) => [kind, {x: [], y: [], mx: [], my: [], text: []}]));
  for (const [kind, name, words, first, second] of edges) {
    const key = `${Math.min(first, second)}-${Math.max(first, second)}`, nth = (seen[key] = (seen[key] ?? -1) + 1);
    const side = (nth % 2 ? 1 : -1) * Math.ceil(nth / 2) * 0.22 * (nodes[first][2] === nodes[second][2] && first > second ? -1 : 1);
    const flat = nth === 0 && nodes[first][2] === nodes[second][2] && Math.abs(nodes[first][1] - nodes[second][1]) > 1 ? 0.18 : 0;
    const [low, high] = nodes[first][2] <= nodes[second][2] ? [first, second] : [second, first];
    const [x, y] = bent(at(low), at(high), side + flat), place = drawn[kind];
    place.x.push(...x, null); place.y.push(...y, null);
    place.mx.push(x[8]); place.my.push(y[8]);
    place.text.push(`<b>${plain(name)}</b><br>${plain(words)}${kind === "cut" ? ", cut" : ""}<br>${plain(nodes[first][0])} – ${plain(nodes[second][0])}`);
  }
  const traces = Object.entries(kinds).filter(([kind]) => drawn[kind].x.length).flatMap(([kind, {name, color, width, dash}]) => [
    {x: drawn[kind].x, y: drawn[kind].y, mode: "lines", name, legendgroup: kind, hoverinfo: "skip", line: {color, width, dash: dash || "solid"}},
    {x: drawn[kind].mx, y: drawn[kind].my, mode: "markers", legendgroup: kind, showlegend: false, hoverinfo: "text", text: drawn[kind].text,
     marker: {size: 7, color: kind === "cut" ? RED : "#fff", line: {color, width: 1.5}}}]);
  const labels = nodes.length <= 80, levels = Math.max(...nodes.map((node) => node[2])) + 2.2;
  // where levels are closer than names are high, names stand beside their bodies, and the figure grows
  const crowded = labels && (by("graph").clientHeight - 60) / levels < 36;
  if (crowded) by("graph").style.height = `${Math.max(by("graph").clientHeight, Math.round(22 * levels + 60))}px`;
  traces.push({x: nodes.map((node) => node[1]), y: nodes.map((node) => node[2]), mode: "markers", showlegend: false,
    hoverinfo: "text", text: nodes.map((node) => plain(node[0])), marker: {size: nodes.map((_, i) => (i === ground ? 17 : 13)),
    symbol: nodes.map((_, i) => (i === ground ? "square" : "circle")), color: nodes.map((_, i) => (i === ground ? "#6b7682" : BLUE)), line: {color: "#fff", width: 2}}});
  // on paper, so that no line runs through a name
  const annotations = !labels ? [] : nodes.map((node, i) => ({x: node[1], y: node[2], text: plain(node[0]), showarrow: false,
    ...(crowded && i !== ground ? {xanchor: "right", xshift: -9} : {yshift: i === ground ? -21 : 18}), bgcolor: "rgba(255,255,255,0.85)", borderpad: 1, font: {size: nodes.length > 30 ? 10 : 12, color: INK}}));
  const bare = {visible: false}, letter = nodes.length > 30 ? 6 : 7;
  // wide enough for the names of neighbours in a row, and for those at the ends, within a card that scrolls
  const wide = labels ? nodes.flatMap(([name, x, y]) => nodes.filter(([, other, row]) => row === y && other > x)
    .map(([next, other]) => (letter * (crowded ? next.length + 2 : 0.5 * (name.length + next.length)) + 12) * 1.2 * span(nodes) / (other - x) + letter * Math.max(name.length, next.length))) : [];
  by("graph").style.minWidth = `${Math.min(2400, Math.max(0, ...wide))}px`;
  Plotly.newPlot("graph", traces, layout({margin: {l: 12, r: 12, t: 8, b: 8}, xaxis: {...bare}, hovermode: "closest", annotations,
    yaxis: {...bare, range: [crowded ? -1.6 : -0.6, Math.max(...nodes.map((node) => node[2])) + 0.6]}, legend: {orientation: "h", x: 0, y: 0, yanchor: "top"}}), CONFIG);
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
    hovertemplate: "mode %{x}: %{y:.1e}<extra></extra>"}], layout({margin: {l: 80, r: 18, t: 14, b: 50}, xaxis: modeAxis("errors", errors.length),
    yaxis: axis("relative error [1]", {type: "log", exponentformat: "power", dtick: 2,
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
