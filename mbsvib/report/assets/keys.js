// The keyboard: it turns the mechanism, zooms curves, and reaches the tools and legends of all figures.
const TURN = Math.PI / 18, CLOSER = 0.85, POLE = 89.9 * Math.PI / 180;

// Keys of a figure that has the focus; while it has, it says which they are.
function keys(id, actions, words) {
  const element = by(id);
  element.tabIndex = 0;
  element.setAttribute("role", "application");
  element.setAttribute("aria-label", `${element.getAttribute("aria-label")}. ${words}`);
  element.dataset.keys = words;
  element.addEventListener("keydown", (event) => {
    const action = actions[event.key === "=" ? "+" : event.key === "_" ? "-" : event.key];
    if (event.target !== element || !action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  });
}

// Turn about the vertical axis and towards it, and go closer. At a pole the upward direction says where the eye came from.
function turn(about, upward, closer = 1) {
  const {eye, up} = cameraNow(), flat = Math.hypot(eye.x, eye.y), distance = closer * Math.hypot(flat, eye.z);
  const from = flat > 1e-3 * distance ? Math.atan2(eye.y, eye.x) : Math.atan2(-up.y, -up.x) + (eye.z < 0 ? Math.PI : 0);
  const height = Math.max(-POLE, Math.min(POLE, Math.atan2(eye.z, flat) + upward)), angle = from + about;
  Plotly.relayout(view, {"scene.camera": {center: {x: 0, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, projection: {type: "perspective"},
    eye: {x: distance * Math.cos(height) * Math.cos(angle), y: distance * Math.cos(height) * Math.sin(angle), z: distance * Math.sin(height)}}});
}

// A window of a range after a zoom about its middle or a shift by a share of it, within limits.
function windowed([low, high], [least, most], share, shift) {
  const half = 0.5 * share * (high - low), middle = 0.5 * (low + high) + shift * (high - low);
  if (2 * half >= most - least) return [least, most];
  const at = Math.min(most - half, Math.max(least + half, middle));
  return [at - half, at + half];
}

function windowKeys(change, whole) {
  return {"+": () => change(CLOSER ** 4, 0), "-": () => change(CLOSER ** -4, 0), ArrowLeft: () => change(1, -0.25), ArrowRight: () => change(1, 0.25), Home: whole};
}
const WINDOW_KEYS = "Keys: + and − zoom, ← → move, Home shows all";

if (data.scene) {
  keys("view", {ArrowLeft: () => turn(-TURN, 0), ArrowRight: () => turn(TURN, 0), ArrowUp: () => turn(0, TURN), ArrowDown: () => turn(0, -TURN),
    "+": () => turn(0, 0, CLOSER), "-": () => turn(0, 0, 1 / CLOSER), Home: () => by("views").firstElementChild.click()}, "Keys: arrows turn, + and − zoom, Home resets");
}
if (responses) {
  keys("bode", windowKeys((share, shift) => {
    const window_ = windowed(frequencies.map(Math.log10), whole.map(Math.log10), share, shift).map((x) => 10 ** x);
    frequencies = Math.abs(window_[0] / whole[0] - 1) + Math.abs(window_[1] / whole[1] - 1) < 1e-9 ? whole : window_;
    drawBode();
  }, () => by("reset").click()), WINDOW_KEYS);
  keys("step", windowKeys((share, shift) => {
    times = windowed(times, [0, Math.max(times[1], longest())], share, shift);
    drawStep();
  }, () => by("reset").click()), WINDOW_KEYS);
}

// Tools and legends that the library makes for the mouse: Tab reaches them, Enter and the space bar press them.
const PRESSED = ".modebar-btn, .legendtoggle";
function reach() {
  for (const each of document.querySelectorAll(PRESSED)) {
    if (each.hasAttribute("tabindex")) continue;
    each.setAttribute("tabindex", "0");
    each.setAttribute("role", "button");
    const text = each.dataset.title || each.parentNode.textContent;
    if (text) each.setAttribute("aria-label", text);
  }
}
new MutationObserver(reach).observe(document.body, {childList: true, subtree: true});
reach();
document.addEventListener("keydown", (event) => {
  const each = event.target.closest && event.target.closest(PRESSED);
  if (!each || (event.key !== "Enter" && event.key !== " ")) return;
  event.preventDefault();
  if (each.matches(".modebar-btn")) each.dispatchEvent(new MouseEvent("click", {bubbles: true}));
  else for (const type of ["mousedown", "mouseup"]) each.dispatchEvent(new MouseEvent(type, {bubbles: true, view: window}));
});

// Arrows go from one tab to the next, as in other lists of tabs.
for (const list of document.querySelectorAll('[role="tablist"]')) {
  list.addEventListener("keydown", (event) => {
    const tabs = [...list.children], step_ = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (!step_) return;
    const next = tabs[(tabs.indexOf(event.target) + step_ + tabs.length) % tabs.length];
    next.focus();
    next.click();
  });
}
