// The page: what comes from the viewer process, what is shown of it, and what people do.

import { Camera } from "./camera.js";
import { reflectors } from "./infrared.js";
import { bindKeys, bindPointer } from "./input.js";
import { drawBeacons, drawFloor, drawStarts, drawTargets, drawWalls, wallColor, wallHeights } from "./lab.js";
import { extent, Paint, probability, rampTable, readBelief } from "./paint.js";
import { BeliefPanel, drawEvents, drawTicks, eventText, RobotList } from "./panels.js";
import { DEFAULT_ANGLES, Robots } from "./robots.js";
import { drawShapes, Labels } from "./shapes.js";
import { Socket } from "./socket.js";
import { between, readFrame, Store } from "./store.js";
import { html, robotColor, say, svg } from "./svg.js";

const $ = (id) => document.getElementById(id);
const TRAIL_CYCLES = 600;
const MOST_TRAIL_POINTS = 400;
const PANEL_MILLISECONDS = 100;
const PHASES = { empty: "no robots", ready: "ready", running: "running", stopped: "stopped", finished: "finished" };
const EMPTY = { time: 0, phase: "empty", robots: [] };

const state = {
  epoch: -1, lab: null, scene: null, grid: [], simTime: 0, cycleTime: 50, control: false, recording: false,
  connected: false, connection: "searching", simulator: "", rate: 0, frame: EMPTY, names: new Map(), angles: new Map(),
  marks: [], asked: 0, beliefs: new Map(), past: null, source: null, texts: [],
  live: true, t: 0, playing: false, speed: 1, chosen: null, choiceMade: false, follow: false,
  layers: { cones: "chosen", trails: true, belief: true, names: true, starts: true },
};
const store = new Store();
const camera = new Camera();
const paint = new Paint($("paint"));
// Movement is smoothed from what is shown to what has come, in the time that a frame takes.
const tween = { from: EMPTY, to: EMPTY, start: 0, length: 50 };
const dirty = { paint: true, camera: true, panels: true, events: true };
const counters = { painted: 0, frames: 0 };

// --- the scene ------------------------------------------------------------------------------------

const floorRoot = svg("g");
const sceneRoot = svg("g");
const below = svg("g");
const wallGroup = svg("g");
const shapeGroup = svg("g");
const modeGroup = svg("g");
const labelGroup = svg("g");
const robots = new Robots((id) => choose(id));
$("floor").append(floorRoot);
sceneRoot.append(below, robots.cones, wallGroup, modeGroup, shapeGroup, robots.bodies);
$("scene").append(sceneRoot, labelGroup);
const labels = new Labels(labelGroup);
const robotList = new RobotList($("robots"), {
  onChoose: (id) => choose(state.chosen === id ? null : id),
  onRemove: (id) => confirmed(`Remove ${state.names.get(id) || `robot ${id}`}? It stays out until the simulator is reset.`, "Remove", () => socket.send({ do: "remove", robot: id })),
});
const beliefPanel = new BeliefPanel({
  entropy: $("entropy"), best: $("best-cell"), truth: $("true-cell"), modes: $("modes"), curve: $("curve"),
});

function drawLab() {
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

function drawLegend() {
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

// --- messages of the viewer process -----------------------------------------------------------------

const handlers = {
  world(message) {
    if (message.epoch !== state.epoch) beginEpoch(message.epoch);
    Object.assign(state, {
      lab: message.lab, grid: message.grid, simTime: message.simTime, cycleTime: message.cycleTime,
      control: message.control, recording: message.recording,
    });
    document.body.dataset.recording = String(message.recording);
    $("controls").hidden = !message.control;
    $("live").hidden = message.recording;
    say($("lab-name"), message.lab ? message.lab.name : "No lab yet");
    document.title = message.lab ? `${message.lab.name} – ciberrato` : "ciberrato viewer";
    drawLab();
    if (message.span[1] > 0) {
      socket.send({ ask: "frames", from: 0, to: message.span[1], most: 512 });
      if (message.recording && state.live) seek(message.span[0]);
    }
  },
  status(message) {
    state.connection = message.connection;
    state.simulator = message.simulator;
  },
  roster(message) {
    state.names = new Map(message.robots.map(({ id, name }) => [id, name]));
    state.angles = new Map(message.robots.filter(({ angles }) => angles).map(({ id, angles }) => [id, angles]));
    dirty.events = true;
    dirty.paint = true;
  },
  frame(message) {
    if (message.epoch !== state.epoch) return;
    counters.frames += 1;
    state.rate = message.rate;
    const frame = readFrame(message.frame);
    const now = performance.now();
    // What is on the screen is where the movement goes on from.
    tween.from = { robots: liveRobots(now) };
    tween.length = 0.8 * tween.length + 0.2 * Math.min(250, Math.max(16, now - tween.start));
    tween.to = frame;
    tween.start = now;
    state.frame = frame;
    if (frame.robots.length) store.insert(frame);
    if (!state.choiceMade && state.chosen === null && frame.robots.length) state.chosen = frame.robots[0].id;
    if (message.marks > state.asked) {
      socket.send({ ask: "marks", skip: state.marks.length });
      state.asked = message.marks;
    }
    if (state.live && state.layers.trails) dirty.paint = true;
  },
  frames(message) {
    if (message.epoch !== state.epoch) return;
    for (const frame of message.frames) store.insert(readFrame(frame));
    askedWindow = null;
    dirty.paint = true;
  },
  marks(message) {
    if (message.epoch !== state.epoch || message.skip !== state.marks.length) return;
    state.marks.push(...message.marks);
    dirty.events = true;
    const last = message.marks.at(-1);
    if (last) say($("announcer"), eventText(last[1], last[2], state.names));
  },
  belief(message) {
    if (message.epoch !== state.epoch) return;
    const known = state.beliefs.get(message.source);
    const series = known?.series ?? [];
    const entryOf = { robot: message.robot, version: message.version, belief: readBelief(message.belief), series };
    state.beliefs.set(message.source, entryOf);
    if (known && message.version === known.version + 1 && (series.at(-1)?.[0] ?? -1) < message.series[0]) series.push(message.series);
    else socket.send({ ask: "series", source: message.source });
    if (!known) showSources();
    dirty.paint = true;
    dirty.panels = true;
  },
  series(message) {
    const known = state.beliefs.get(message.source);
    if (message.epoch !== state.epoch || !known) return;
    known.series = message.series;
    dirty.panels = true;
  },
  past(message) {
    askedPast = null;
    if (message.epoch !== state.epoch) return;
    state.past = { source: message.source, at: message.at, belief: message.belief ? readBelief(message.belief) : null };
    dirty.paint = true;
    dirty.panels = true;
  },
  shapes(message) {
    state.texts = drawShapes(shapeGroup, message.shapes);
    dirty.paint = true;
  },
};

function beginEpoch(epoch) {
  store.clear();
  robots.clear();
  robotList.clear();
  Object.assign(state, { epoch, marks: [], asked: 0, past: null, source: null, frame: EMPTY, live: true, playing: false, chosen: null, choiceMade: false });
  state.beliefs.clear();
  Object.assign(tween, { from: EMPTY, to: EMPTY });
  askedWindow = null;
  askedPast = null;
  showSources();
  Object.assign(dirty, { paint: true, events: true, panels: true });
}

function showSources() {
  const select = $("belief-source");
  const names = [...state.beliefs.keys()];
  if (!names.includes(state.source)) state.source = names[0] ?? null;
  select.replaceChildren(...names.map((name) => html("option", { value: name }, name)));
  select.value = state.source ?? "";
  select.hidden = names.length < 2;
  $("belief-panel").hidden = !names.length;
  $("layer-belief").hidden = !names.length;
  drawLegend();
}

// --- what is shown --------------------------------------------------------------------------------

let askedWindow = null;
let askedPast = null;

function liveRobots(now) {
  return between(tween.from, tween.to, Math.min(1, (now - tween.start) / tween.length));
}

/** The robots to draw, and the frame whose numbers stand in the panels. */
function shown(now) {
  if (state.live) return { frame: state.frame, robots: liveRobots(now) };
  const at = Math.max(0, store.floor(state.t));
  const frame = store.frames[at];
  if (!frame) return { frame: state.frame, robots: state.frame.robots };
  const next = store.frames[at + 1];
  if (!next) return { frame, robots: frame.robots };
  const part = (state.t - frame.time) / (next.time - frame.time);
  return { frame, robots: part > 0 ? between(frame, next, part) : frame.robots };
}

function shownBelief() {
  if (!state.layers.belief || state.source === null) return null;
  if (state.live) return state.beliefs.get(state.source)?.belief ?? null;
  return state.past?.source === state.source ? state.past.belief : null;
}

/** Ask for the frames and the belief around the time that is looked at. */
function fetchPast() {
  if (state.live) return;
  const time = Math.floor(state.t);
  if (store.gapAt(time) && askedWindow === null) {
    askedWindow = time;
    socket.send({ ask: "frames", from: Math.max(0, time - 100), to: time + 300, most: 512 });
  }
  if (state.source !== null && askedPast === null && (state.past?.source !== state.source || state.past.at !== time)) {
    const series = state.beliefs.get(state.source)?.series ?? [];
    let due = -1;
    for (const [when] of series) if (when <= time) due = when;
    if (state.past?.source === state.source && (state.past.belief?.time ?? -1) === due) return;
    askedPast = time;
    socket.send({ ask: "belief", source: state.source, time });
  }
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

let modeLabels = [];
let modesOf;

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

// --- the loop -------------------------------------------------------------------------------------

let lastTime = 0;
let lastPanels = 0;
let drawn = null;

/** What the picture depends on, apart from what is marked as dirty; the same again need not be drawn. */
function pictureKey(now) {
  if (!state.live) return `${state.t} ${store.times.length}`;
  return now - tween.start > tween.length ? `live ${tween.start}` : null;
}

function paintFrame(now) {
  requestAnimationFrame(paintFrame);
  counters.painted += 1;
  const passed = Math.min(200, now - lastTime);
  lastTime = now;
  if (state.playing) advance(passed);
  fetchPast();
  const { frame, robots: list } = shown(now);
  const key = pictureKey(now);
  const still = key !== null && key === drawn && !state.follow && !dirty.camera && !dirty.paint;
  drawn = key;
  if (!still) drawPicture(frame, list, passed);
  if (now - lastPanels > PANEL_MILLISECONDS) {
    lastPanels = now;
    updatePanels(frame);
  }
}

function drawPicture(frame, list, passed) {
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

function advance(milliseconds) {
  state.t += milliseconds / state.cycleTime * state.speed;
  if (state.t >= store.last) {
    state.t = store.last;
    state.playing = false;
    if (!state.recording) goLive();
  }
}

function updatePanels(frame) {
  const time = state.live ? frame.time : Math.floor(state.t);
  say($("time"), String(time));
  say($("sim-time"), state.simTime ? ` / ${state.simTime}` : "");
  say($("rate"), state.connected && state.live ? (state.rate < 10 ? state.rate.toFixed(1) : state.rate.toFixed(0)) : "–");
  const phase = $("phase");
  say(phase, PHASES[frame.phase] ?? frame.phase);
  phase.dataset.phase = frame.phase;
  updateStatus();
  const alive = state.connected && state.connection === "watching";
  $("start").disabled = !alive || !["ready", "stopped"].includes(state.frame.phase);
  $("stop").disabled = !alive || state.frame.phase !== "running";
  $("reset").disabled = !alive;
  say($("robot-count"), frame.robots.length ? String(frame.robots.length) : "");
  $("no-robots").hidden = frame.robots.length > 0;
  robotList.update(frame.robots, {
    names: state.names, chosen: state.chosen, control: state.control && state.live, reflectors: state.scene,
    angles: (id) => state.angles.get(id) ?? DEFAULT_ANGLES
  });
  updateScrubber(time);
  const known = state.beliefs.get(state.source);
  if (known) {
    const current = state.live ? known.belief : state.past?.source === state.source ? state.past.belief : null;
    beliefPanel.update(current, known.series, [store.first, Math.max(store.last, 1)], time);
  }
  $("follow").setAttribute("aria-pressed", String(state.follow));
  $("live").setAttribute("aria-pressed", String(state.live));
  const icon = state.playing ? "#i-pause" : "#i-play";
  if ($("play").querySelector("use").getAttribute("href") !== icon) $("play").querySelector("use").setAttribute("href", icon);
  if (dirty.events) {
    dirty.events = false;
    drawEvents($("events"), state.marks, state.names, (when) => seek(when));
    $("no-events").hidden = state.marks.length > 0;
  }
}

let ticksFor = "";

function updateScrubber(time) {
  const scrubber = $("scrubber");
  const last = Math.max(store.last, state.frame.time);
  scrubber.disabled = last <= 0;
  if (Number(scrubber.max) !== last) scrubber.max = String(last);
  if (Number(scrubber.value) !== time) scrubber.value = String(time);
  scrubber.style.setProperty("--done", `${last > 0 ? 100 * time / last : 0}%`);
  scrubber.setAttribute("aria-valuetext", `cycle ${time} of ${last}`);
  const key = `${state.marks.length} ${last}`;
  if (key !== ticksFor) {
    ticksFor = key;
    drawTicks($("ticks"), state.marks, [0, last]);
  }
}

function updateStatus() {
  const status = $("status");
  const [key, text] = !state.connected ? ["gone", "the viewer process is gone; trying again"]
    : state.recording ? ["recording", `recorded run ${state.simulator}`]
      : state.connection === "watching" ? ["watching", `watching ${state.simulator}`]
        : [state.connection, `looking for a simulator at ${state.simulator}`];
  status.dataset.state = key;
  say(status, text);
  const notice = $("notice");
  const waiting = state.connected && !state.recording && state.connection !== "watching" && !state.lab;
  notice.hidden = !waiting;
  if (waiting && !notice.firstChild) {
    notice.append(html("b", {}, "No simulator yet"), `Start one, such as ciberrato-simulator; this page goes on by itself when it answers at ${state.simulator}.`);
  }
}

function cellOf(robot, belief) {
  if (robot.x === null) return null;
  const [left, bottom, right, top] = extent(belief, state.lab);
  const column = Math.floor((robot.x - left) / (right - left) * belief.columns);
  const row = Math.floor((robot.y - bottom) / (top - bottom) * belief.rows);
  return row >= 0 && row < belief.rows && column >= 0 && column < belief.columns ? [row, column] : null;
}

// --- what people do -------------------------------------------------------------------------------

function choose(id) {
  state.chosen = id;
  state.choiceMade = true;
  if (id === null) state.follow = false;
  dirty.paint = true;
  lastPanels = 0;
}

function seek(time) {
  state.live = false;
  state.playing = false;
  state.t = Math.min(Math.max(store.last, state.frame.time), Math.max(0, time));
  dirty.paint = true;
  lastPanels = 0;
}

function goLive() {
  if (state.recording) return;
  Object.assign(state, { live: true, playing: false, past: null });
  dirty.paint = true;
  lastPanels = 0;
}

function confirmed(question, verb, action) {
  const dialog = $("ask");
  say($("ask-text"), question);
  say($("ask-yes"), verb);
  dialog.returnValue = "no";
  dialog.onclose = () => dialog.returnValue === "yes" && action();
  dialog.showModal();
}

function theme() {
  return document.documentElement.dataset.theme;
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  paint.setTheme(name);
  dirty.paint = true;
  drawLegend();
}

function showLayers() {
  const { layers } = state;
  $("layer-cones").setAttribute("aria-pressed", String(layers.cones !== "none"));
  say($("layer-cones").querySelector("span"), layers.cones === "all" ? "All cones" : "Cones");
  for (const name of ["trails", "belief", "names", "starts"]) $(`layer-${name}`).setAttribute("aria-pressed", String(layers[name]));
  const starts = document.getElementById("starts");
  if (starts) starts.style.display = layers.starts ? "" : "none";
  dirty.paint = true;
  remember("layers", JSON.stringify(layers));
}

function remember(key, value) {
  try {
    localStorage.setItem(`ciberrato-${key}`, value);
  } catch {
    // Private windows may refuse; then nothing is remembered.
  }
}

function remembered(key) {
  try {
    return localStorage.getItem(`ciberrato-${key}`);
  } catch {
    return null;
  }
}

const actions = {
  start: () => $("start").disabled || socket.send({ do: "start" }),
  stop: () => $("stop").disabled || socket.send({ do: "stop" }),
  startOrStop: () => (state.frame.phase === "running" ? actions.stop() : actions.start()),
  reset: () => $("reset").disabled || !state.control || confirmed("Reset the simulator? All robots are sent away and time begins anew.", "Reset", () => socket.send({ do: "reset" })),
  play: () => {
    if (state.playing) {
      state.playing = false;
      return;
    }
    // From the end there is nothing to replay: begin at the beginning.
    if (state.live || state.t >= store.last) seek(store.first);
    state.playing = store.times.length > 1;
    lastPanels = 0;
  },
  step: (cycles) => seek((state.live ? state.frame.time : Math.floor(state.t)) + cycles),
  live: goLive,
  choose,
  follow: () => {
    if (state.chosen === null) return;
    state.follow = !state.follow;
    if (state.follow && camera.fitted) camera.zoom(Math.max(1, 46 / camera.k));
    lastPanels = 0;
  },
  zoom: (factor, x, y) => {
    camera.zoom(factor, x, y);
    dirty.camera = true;
  },
  fit: () => {
    state.follow = false;
    camera.fit();
    dirty.camera = true;
  },
  pan: (dx, dy) => {
    state.follow = false;
    camera.pan(dx, dy);
    dirty.camera = true;
  },
  layer: (name) => {
    const order = { chosen: "all", all: "none", none: "chosen" };
    state.layers[name] = name === "cones" ? order[state.layers.cones] : !state.layers[name];
    showLayers();
  },
  theme: () => {
    setTheme(theme() === "dark" ? "light" : "dark");
    remember("theme", theme());
  },
  help: () => $("keys").showModal(),
  hover: (px, py) => {
    const tip = $("tip");
    const { lab } = state;
    const [x, y] = px === null ? [-1, -1] : camera.toWorld(px, py);
    const inside = lab && x >= 0 && y >= 0 && x < lab.width && y < lab.height;
    tip.hidden = !inside;
    if (!inside) return;
    const belief = shownBelief();
    const cell = belief && cellOf({ x, y }, belief);
    const column = cell ? cell[1] : Math.floor(x / 2);
    const row = cell ? cell[0] : Math.floor(y / 2);
    const p = cell ? probability(belief, row, column) : null;
    say(tip, `cell ${column}, ${row}${p === null ? "" : `\n${p >= 0.0005 ? `${(100 * p).toFixed(1)} %` : p > 0 ? p.toExponential(1) : "0"}`}`);
    tip.style.left = `${Math.min(camera.width - 40, Math.max(40, px))}px`;
    tip.style.top = `${py}px`;
  },
};

$("start").addEventListener("click", actions.start);
$("stop").addEventListener("click", actions.stop);
$("reset").addEventListener("click", actions.reset);
$("play").addEventListener("click", actions.play);
$("live").addEventListener("click", actions.live);
$("speed").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
$("scrubber").addEventListener("input", (event) => seek(Number(event.target.value)));
$("follow").addEventListener("click", actions.follow);
$("zoom-in").addEventListener("click", () => actions.zoom(1.3));
$("zoom-out").addEventListener("click", () => actions.zoom(1 / 1.3));
$("zoom-fit").addEventListener("click", actions.fit);
$("theme").addEventListener("click", actions.theme);
$("help").addEventListener("click", actions.help);
$("belief-source").addEventListener("change", (event) => {
  state.source = event.target.value;
  state.past = null;
  dirty.paint = true;
});
for (const name of ["cones", "trails", "belief", "names", "starts"]) $(`layer-${name}`).addEventListener("click", () => actions.layer(name));
bindKeys(actions);
bindPointer($("stage"), actions);

const dark = window.matchMedia("(prefers-color-scheme: dark)");
setTheme(remembered("theme") ?? (dark.matches ? "dark" : "light"));
dark.addEventListener("change", () => remembered("theme") ?? setTheme(dark.matches ? "dark" : "light"));
try {
  Object.assign(state.layers, JSON.parse(remembered("layers") ?? "{}"));
} catch {
  // Somebody else's value: the defaults are good.
}

new ResizeObserver(([{ contentRect: { width, height } }]) => {
  camera.resize(width, height);
  paint.resize(width, height);
  dirty.camera = true;
}).observe($("stage"));

const socket = new Socket((message) => handlers[message.type]?.(message), (connected) => {
  state.connected = connected;
  if (connected) state.epoch = -1; // it may be another process: everything anew
});
showLayers();
requestAnimationFrame(paintFrame);

// For tests and measurements; nothing in the page uses it.
window.ciberrato = { state, store, camera, counters, robotColor, socket };
