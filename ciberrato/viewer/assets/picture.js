// The picture of the lab: layers from the floor up to the labels, redrawn where something has changed.

import { reflectors } from "./infrared.js";
import { drawBeacons, drawFloor, drawStarts, drawTargets, drawWalls, wallColor, wallHeights } from "./lab.js";
import { Labels, ON } from "./labels.js";
import { cellAt, extent, Paint, rampTable } from "./paint.js";
import { DEFAULT_ANGLES, Robots } from "./robots.js";
import { drawShapes } from "./shapes.js";
import { $, camera, dirty, remember, state, store } from "./state.js";
import { html, say, svg } from "./svg.js";
import { choose, shownBelief } from "./time.js";

const TRAIL_CYCLES = 600;
const MOST_TRAIL_POINTS = 400;
const EDGE = 12;
// Letters in pixels, and letters of a label; small ones where the lab is small.
const LETTERS = { page: [12, 24], small: [10, 12], projection: [20, 24] };
const SMALL = 16;
// From here on a robot has left the place that its agent's belief is about.
const MOVED = 0.3;

const paint = new Paint($("paint"));
const floorRoot = svg("g");
const sceneRoot = svg("g");
const below = svg("g");
const wallGroup = svg("g");
const shapeGroup = svg("g");
const modeGroup = svg("g");
const thenGroup = svg("g");
const labelGroup = svg("g");
export const robots = new Robots(choose);
$("floor").append(floorRoot);
sceneRoot.append(below, robots.cones, wallGroup, modeGroup, thenGroup, shapeGroup, robots.bodies);
$("scene").append(sceneRoot, labelGroup);
const labels = new Labels(labelGroup);
let modeLabels = [];
let modesOf;

export function drawLab() {
  const { lab } = state;
  floorRoot.replaceChildren();
  below.replaceChildren();
  wallGroup.replaceChildren();
  $("layers").hidden = $("zoom").hidden = !lab;
  if (!lab) return;
  floorRoot.append(drawFloor(lab));
  below.append(drawTargets(lab), drawStarts(state.grid));
  wallGroup.append(drawWalls(lab), drawBeacons(lab));
  state.scene = reflectors(lab);
  camera.setLab(lab);
  dirty.camera = true;
  drawLegend();
  showLayers();
  fitStage();
}

/** Measure what buttons and legend leave to the lab; where the page scrolls, the stage is as high as the lab needs. */
export function fitStage() {
  const stage = $("stage");
  const below = (id) => {
    const { offsetTop, offsetHeight } = $(id);
    return offsetHeight ? offsetTop + offsetHeight : 0;
  };
  const top = Math.max(below("layers"), below("zoom")) + EDGE;
  const bottom = $("legend").offsetHeight + EDGE;
  stage.style.setProperty("--inset", `${top + bottom}px`);
  if (state.lab) stage.style.setProperty("--shape", String(Math.min(2, state.lab.height / state.lab.width)));
  camera.insets = { top, bottom, side: EDGE };
  if (camera.fitted) camera.fit();
  dirty.camera = true;
}

export function drawLegend() {
  const { lab } = state;
  if (!lab) return;
  const heights = wallHeights(lab);
  const used = heights.filter((height) => lab.walls.some((wall) => wall[0] === height));
  const entries = used.map((height, index) => entry(wallColor(height, heights), index ? String(height) : `wall height ${height}`));
  if (lab.walls.some(([height]) => height <= 0)) entries.unshift(entry("var(--line)", "lines"));
  if (state.beliefs.size) {
    const swatch = html("canvas", { width: 84, height: 1 });
    const context = swatch.getContext("2d");
    const pixels = context.createImageData(84, 1);
    const ramp = rampTable(theme());
    for (let i = 0; i < 84; i += 1) {
      const at = 4 * Math.round(i / 83 * 255);
      for (let c = 0; c < 4; c += 1) pixels.data[4 * i + c] = ramp[at + c];
    }
    context.putImageData(pixels, 0, 0);
    entries.push(html("span", {}, "belief", swatch));
  }
  $("legend").replaceChildren(...entries);
  fitStage();
}

function entry(color, text) {
  const swatch = html("i");
  swatch.style.setProperty("--swatch", color);
  return html("span", {}, swatch, text);
}

function trails(frame) {
  if (!state.layers.trails) return [];
  const end = store.floor(frame.time);
  let begin = store.floor(frame.time - TRAIL_CYCLES);
  begin = Math.max(begin, 0);
  const stride = Math.max(1, Math.ceil((end - begin) / MOST_TRAIL_POINTS));
  const points = new Map();
  // Counted from the start of the run, so that the same points are taken in every frame.
  for (let i = Math.ceil(begin / stride) * stride; i <= end; i = i === end ? end + 1 : Math.min(end, i + stride)) {
    for (const robot of store.frames[i].robots) {
      if (robot.x === null || robot.state === "Removed") continue;
      const list = points.get(robot.id) ?? [];
      const n = list.length;
      if (n && Math.abs(list[n - 2] - robot.x) + Math.abs(list[n - 1] - robot.y) < 0.02) continue;
      list.push(robot.x, robot.y);
      points.set(robot.id, list);
    }
  }
  return [...points].map(([id, list]) => ({ id, points: list }));
}

function drawModes(belief) {
  modeGroup.replaceChildren();
  if (!belief || !state.lab) return [];
  const [left, bottom, right, top] = extent(belief, state.lab);
  const width = (right - left) / belief.columns;
  const height = (top - bottom) / belief.rows;
  const inset = Math.min(width, height) * 0.07;
  return belief.modes.filter(([, , , mass]) => mass >= 0.02).map(([row, column, , mass], index) => {
    const x = left + column * width;
    const y = bottom + row * height;
    modeGroup.append(svg("rect", {
      class: `mode-ring${index ? "" : " first"}`, x: x + inset, y: y + inset, width: width - 2 * inset, height: height - 2 * inset, rx: inset,
    }));
    const text = `${(100 * mass).toFixed(0)} %`;
    return { key: `mode ${index}`, text, at: [x + inset, y + height - inset], className: "mode-text", choices: ON, corner: true };
  });
}

/** A belief is about the moment of its last reading: ring where the robot was then, once it has gone on. */
function drawThen(belief, list) {
  const place = belief?.place;
  const id = state.beliefs.get(state.source)?.robot;
  const now = list.find((robot) => robot.id === id);
  const moved = place && now && now.x !== null && Math.hypot(now.x - place[0], now.y - place[1]) > MOVED;
  const key = moved ? `${belief.time} ${place}` : "";
  if (thenGroup.dataset.shown !== key) {
    thenGroup.dataset.shown = key;
    thenGroup.replaceChildren();
    if (!moved) return null;
    const [left, bottom, right, top] = extent(belief, state.lab);
    const [width, height] = [(right - left) / belief.columns, (top - bottom) / belief.rows];
    const cell = cellAt(belief, state.lab, ...place);
    if (cell) {
      const [row, column] = cell;
      thenGroup.append(svg("rect", { class: "then-cell", x: left + column * width, y: bottom + row * height, width, height }));
    }
    thenGroup.append(svg("circle", { class: "then", cx: place[0], cy: place[1], r: 0.5 }));
  }
  return moved ? { key: "then", text: `cycle ${belief.time}`, at: place, className: "then-text", world: 0.5 } : null;
}

function updateLabels(list, then) {
  labels.setSize(...LETTERS[camera.k < SMALL ? "small" : state.projection ? "projection" : "page"]);
  const place = ({ at: [x, y], world = 0, corner, ...rest }) => {
    const [px, py] = camera.toScreen(x, y);
    const shift = corner ? [4 + labels.width(rest.text) / 2, 3 + labels.size * 0.6] : [0, 0];
    return { ...rest, x: px + shift[0], y: py + shift[1], reach: world * camera.k };
  };
  const seen = list.filter((robot) => robot.x !== null && robot.state !== "Removed");
  // The chosen one's name is there in any case; the others' give way.
  const order = [...seen].sort((a, b) => (b.id === state.chosen) - (a.id === state.chosen));
  const tags = state.layers.names ? order.map((robot) => place({
    key: `robot ${robot.id}`, text: state.names.get(robot.id) || `robot ${robot.id}`, className: "tag", at: [robot.x, robot.y],
    world: 0.5, needed: robot.id === state.chosen,
  })) : [];
  // Texts of agents stand where the agent says, or beside it.
  const texts = (state.live ? state.texts : []).map((text) => place({ ...text, className: "shape-text" }));
  // Numbers on the robots stay legible, too.
  const bodies = seen.map((robot) => {
    const [x, y] = camera.toScreen(robot.x, robot.y);
    const half = 0.3 * camera.k;
    return [x - half, y - half, x + half, y + half];
  });
  const about = [...(camera.k > 13 ? modeLabels : []), ...(then ? [then] : [])].map(place);
  labels.update([...tags, ...about, ...texts], bodies, camera);
}

/** Draw what is out of date. */
export function drawPicture(frame, list, passed) {
  const target = state.follow && list.find((robot) => robot.id === state.chosen);
  if (target && target.x !== null) {
    const before = camera.transform;
    camera.approach(target.x, target.y, 1 - Math.exp(-passed / 160));
    if (before !== camera.transform) dirty.camera = true;
  }
  if (dirty.camera) {
    floorRoot.setAttribute("transform", camera.transform);
    sceneRoot.setAttribute("transform", camera.transform);
    dirty.paint = true;
    dirty.camera = false;
  }
  robots.update(list, {
    reflectors: state.scene, chosen: state.chosen,
    wanted: ({ id, state: what }) => what !== "Removed" && (state.layers.cones === "all" || (state.layers.cones === "chosen" && id === state.chosen)),
    angles: (id) => state.angles.get(id) ?? DEFAULT_ANGLES, names: state.names,
  });
  const belief = shownBelief();
  if (belief !== modesOf) {
    modesOf = belief;
    modeLabels = drawModes(belief);
  }
  const then = drawThen(belief, list);
  updateLabels(list, then);
  // Shapes say what is now: they are not kept.
  shapeGroup.style.display = state.live ? "" : "none";
  if (dirty.paint || !state.live) {
    paint.draw(camera, { lab: state.lab, belief, trails: trails(frame) });
    dirty.paint = false;
  }
}

/** Take over the shapes of all agents. */
export function setShapes(shapes) {
  state.texts = drawShapes(shapeGroup, shapes);
  dirty.paint = true;
}

export function resize(width, height) {
  camera.resize(width, height);
  paint.resize(width, height);
  fitStage();
  dirty.camera = true;
}

export function theme() {
  return document.documentElement.dataset.theme;
}

export function setTheme(name) {
  document.documentElement.dataset.theme = name;
  paint.setTheme(name);
  dirty.paint = true;
  drawLegend();
}

export function showLayers() {
  const { layers } = state;
  $("layer-cones").setAttribute("aria-pressed", String(layers.cones !== "none"));
  say($("layer-cones").querySelector("span"), layers.cones === "all" ? "All cones" : "Cones");
  for (const name of ["trails", "belief", "names", "starts"]) $(`layer-${name}`).setAttribute("aria-pressed", String(layers[name]));
  const starts = document.getElementById("starts");
  if (starts) starts.style.display = layers.starts ? "" : "none";
  dirty.paint = true;
  remember("layers", JSON.stringify(layers));
}
