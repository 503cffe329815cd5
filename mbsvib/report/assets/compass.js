// Directions of the axes and a length in the plane through the middle, in a corner: clear of the mechanism in every view.
const COMPASS = {size: 92, wide: 190, arm: 26, apart: 13, longest: 84};

// Unit vectors of a camera to the right, upward and towards it.
function cameraAxes({eye, up}) {
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((value) => value / Math.hypot(...a)), vector = ({x, y, z}) => [x, y, z];
  const towards = unit(vector(eye)), right = unit(cross(vector(up), towards));
  return [right, cross(towards, right), towards];
}

function cameraNow() {
  const inner = view._fullLayout.scene._scene;
  return inner && inner.getCamera ? inner.getCamera() : view.layout.scene.camera;
}

// Pixels that one metre takes in the middle of the scene.
function pixelsPerMetre(camera) {
  const full = view._fullLayout.scene, [low, high] = full.xaxis.range;
  const scale = full.aspectratio.x / (high - low), distance = Math.hypot(camera.eye.x, camera.eye.y, camera.eye.z);
  return scale * 0.5 * view.clientHeight / (HALF_ANGLE * distance);
}

// 1, 2 or 5 times a power of ten metres, and how it is written.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most)), length = power * [5, 2, 1].find((k) => k * power <= most);
  const [factor, unit] = length < 0.9e-3 ? [1e6, "µm"] : length < 0.9 ? [1e3, "mm"] : length < 900 ? [1, "m"] : [1e-3, "km"];
  return [length, `${Number((factor * length).toPrecision(2))} ${unit}`];
}

// Points of the mechanism at rest, in pixels of the view from its upper left corner.
function projected(camera) {
  const [right, up, towards] = cameraAxes(camera), {xaxis, yaxis, zaxis, aspectratio} = view._fullLayout.scene;
  const middle = [xaxis, yaxis, zaxis].map(({range}) => 0.5 * (range[0] + range[1])), scale = aspectratio.x / (xaxis.range[1] - xaxis.range[0]);
  const distance = Math.hypot(camera.eye.x, camera.eye.y, camera.eye.z), half = 0.5 * view.clientHeight / HALF_ANGLE, points = [];
  for (let i = 0; i < scene.points.length; i += 3) {
    const along = (way) => scale * way.reduce((sum, part, k) => sum + part * (scene.points[i + k] - middle[k]), 0);
    const near = half / Math.max(1e-3, distance - along(towards));
    points.push([0.5 * view.clientWidth + near * along(right), 0.5 * view.clientHeight - near * along(up)]);
  }
  return points;
}

// The corner with the fewest points of the mechanism; that of the tools is taken.
function placeCompass() {
  const {clientWidth: width, clientHeight: height} = view, points = projected(preset), {wide, size} = COMPASS;
  const corners = [["left", "bottom"], ["left", "top"], ["right", "bottom"]].map(([side, edge]) => points.filter(([x, y]) =>
    (side === "left" ? x < wide : x > width - wide) && (edge === "top" ? y < size : y > height - size)).length);
  const least = corners.indexOf(Math.min(...corners));
  compass.style.cssText = ["left:4px;bottom:4px", "left:4px;top:4px", "right:4px;bottom:4px"][least];
}

function drawCompass() {
  const camera = cameraNow(), [right, up, towards] = cameraAxes(camera), middle = COMPASS.size / 2;
  const parts = ["x", "y", "z"].map((name, k) => ({name, x: right[k], y: -up[k], away: towards[k]})).sort((a, b) => a.away - b.away);
  const arms = parts.map(({x, y}) => `M${middle} ${middle}l${(COMPASS.arm * x).toFixed(1)} ${(COMPASS.arm * y).toFixed(1)}`).join("");
  const labels = [];
  for (const {name, x, y} of parts) {
    const length = Math.hypot(x, y);
    if (length < 0.2) continue;  // it points at the eye
    let out = COMPASS.arm * length + 8, at;
    do {
      at = [middle + out * x / length, middle + out * y / length];
      out += 2;
    } while (labels.some(({at: other}) => Math.hypot(at[0] - other[0], at[1] - other[1]) < COMPASS.apart));
    labels.push({name, at});
  }
  const [length, words] = roundLength(COMPASS.longest / pixelsPerMetre(camera)), bar = length * pixelsPerMetre(camera);
  compass.querySelector(".arms").setAttribute("d", arms);
  compass.querySelector(".bar").setAttribute("d", `M${COMPASS.size + 8} 46v6h${bar.toFixed(1)}v-6`);
  const texts = [...compass.querySelectorAll("text")];
  texts.slice(0, 3).forEach((text, k) => {
    text.textContent = labels[k] ? labels[k].name : "";
    if (labels[k]) { text.setAttribute("x", labels[k].at[0]); text.setAttribute("y", labels[k].at[1]); }
  });
  texts[3].textContent = words;
  texts[3].setAttribute("x", COMPASS.size + 8 + bar / 2);
}

const compass = by("compass");
if (data.scene) {
  for (const event of ["plotly_relayouting", "plotly_relayout", "plotly_afterplot"]) view.on(event, drawCompass);
  by("views").addEventListener("click", placeCompass);
  new ResizeObserver(placeCompass).observe(view);
  placeCompass();
  drawCompass();
}
