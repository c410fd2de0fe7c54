// The picture of the lab: layers from the floor up to the labels, redrawn where something has changed.

import { reflectors } from "./infrared.js";
import { drawBeacons, drawFloor, drawStarts, drawTargets, drawWalls, wallColor, wallHeights } from "./lab.js";
import { extent, Paint, rampTable } from "./paint.js";
import { DEFAULT_ANGLES, Robots } from "./robots.js";
import { drawShapes, Labels } from "./shapes.js";
import { $, camera, dirty, remember, state, store } from "./state.js";
import { html, say, svg } from "./svg.js";
import { choose, shownBelief } from "./time.js";

const TRAIL_CYCLES = 600;
const MOST_TRAIL_POINTS = 400;

const paint = new Paint($("paint"));
const floorRoot = svg("g");
const sceneRoot = svg("g");
const below = svg("g");
const wallGroup = svg("g");
const shapeGroup = svg("g");
const modeGroup = svg("g");
const labelGroup = svg("g");
export const robots = new Robots(choose);
$("floor").append(floorRoot);
sceneRoot.append(below, robots.cones, wallGroup, modeGroup, shapeGroup, robots.bodies);
$("scene").append(sceneRoot, labelGroup);
const labels = new Labels(labelGroup);
let modeLabels = [];
let modesOf;

export function drawLab() {
  const { lab } = state;
  floorRoot.replaceChildren();
  below.replaceChildren();
  wallGroup.replaceChildren();
  if (!lab) return;
  floorRoot.append(drawFloor(lab));
  below.append(drawTargets(lab), drawStarts(state.grid));
  wallGroup.append(drawWalls(lab), drawBeacons(lab));
  state.scene = reflectors(lab);
  camera.setLab(lab);
  dirty.camera = true;
  drawLegend();
  showLayers();
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
    return { text: `${(100 * mass).toFixed(0)} %`, at: [x + inset, y + height - inset], className: "mode-text", shift: [4, 12] };
  });
}

function updateLabels(list) {
  const place = ({ at: [x, y], shift = [0, 0], ...rest }) => {
    const [px, py] = camera.toScreen(x, y);
    return { ...rest, x: px + shift[0], y: py + shift[1] };
  };
  const tags = state.layers.names ? list.filter((robot) => robot.x !== null && robot.state !== "Removed").map((robot) => place({
    text: state.names.get(robot.id) || `robot ${robot.id}`, className: "tag", at: [robot.x, robot.y], shift: [0, 0.5 * camera.k + 15],
  })) : [];
  const texts = (state.live ? state.texts : []).map(({ text, color, at, lift }) => place({ text, color, className: "shape-text", at, shift: [0, -lift] }));
  labels.update([...(camera.k > 13 ? modeLabels : []).map(place), ...tags, ...texts]);
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
    angles: (id) => state.angles.get(id) ?? DEFAULT_ANGLES,
  });
  const belief = shownBelief();
  if (belief !== modesOf) {
    modesOf = belief;
    modeLabels = drawModes(belief);
  }
  updateLabels(list);
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
