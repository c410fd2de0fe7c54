// The page: the loop, and what people do.

import { bindKeys, bindPointer } from "./input.js";
import { handlers } from "./messages.js";
import { cellAt, cellName, probability } from "./paint.js";
import { drawPicture, resize, setTheme, showLayers, theme } from "./picture.js";
import { bindProjection, project } from "./scoreboard.js";
import { confirmed, permitted, updatePanels } from "./sidebar.js";
import { Socket } from "./socket.js";
import { $, camera, clock, counters, dirty, link, remember, remembered, state, store } from "./state.js";
import { say } from "./svg.js";
import { advance, choose, fetchPast, goLive, pictureKey, seek, shown, shownBelief } from "./time.js";

const PANEL_MILLISECONDS = 100;
let lastTime = 0;
let drawn = null;

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
  // A new belief is in picture and panel at once.
  if (dirty.panels || now - clock.panels > PANEL_MILLISECONDS) {
    dirty.panels = false;
    clock.panels = now;
    updatePanels(frame, performance.now());
  }
}

const actions = {
  start: () => permitted().start && link.send({ do: "start" }),
  stop: () => permitted().stop && link.send({ do: "stop" }),
  startOrStop: () => (state.frame.phase === "running" ? actions.stop() : actions.start()),
  reset: () => permitted().reset && state.control && confirmed("Reset the simulator? All robots are sent away and time begins anew.", "Reset", () => link.send({ do: "reset" })),
  play: () => {
    if (state.playing) {
      state.playing = false;
      return;
    }
    // From the end there is nothing to replay: begin at the beginning.
    if (state.live || state.t >= store.last) seek(store.first);
    state.playing = store.times.length > 1;
    clock.panels = 0;
  },
  step: (cycles) => seek((state.live ? state.frame.time : Math.floor(state.t)) + cycles),
  live: goLive,
  choose,
  follow: () => {
    if (state.chosen === null) return;
    state.follow = !state.follow;
    if (state.follow && camera.fitted) camera.zoom(Math.max(1, 46 / camera.k));
    clock.panels = 0;
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
  project: () => project(!state.projection, { fullscreen: true }),
  help: () => $("keys").showModal(),
  hover: (px, py) => {
    const tip = $("tip");
    const { lab } = state;
    const [x, y] = px === null ? [-1, -1] : camera.toWorld(px, py);
    const inside = lab && x >= 0 && y >= 0 && x < lab.width && y < lab.height;
    tip.hidden = !inside;
    if (!inside) return;
    const belief = shownBelief();
    const cell = belief && cellAt(belief, lab, x, y);
    const name = cell ? cellName(belief, lab, ...cell) : `(${2 * Math.floor(x / 2) + 1}, ${2 * Math.floor(y / 2) + 1})`;
    const p = cell ? probability(belief, ...cell) : null;
    say(tip, `cell ${name}${p === null ? "" : `\n${p >= 0.0005 ? `${(100 * p).toFixed(1)} %` : p > 0 ? p.toExponential(1) : "0"}`}`);
    tip.style.left = `${Math.min(camera.width - 40, Math.max(40, px))}px`;
    tip.style.top = `${py}px`;
    // At the upper edge it stands below the pointer.
    tip.dataset.below = String(py < 64);
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
$("project").addEventListener("click", actions.project);
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
  // Another program's value: the defaults are good.
}

new ResizeObserver(([{ contentRect: { width, height } }]) => resize(width, height)).observe($("stage"));

const socket = new Socket((message) => handlers[message.type]?.(message), (connected) => {
  state.connected = connected;
  if (connected) state.epoch = -1; // it may be another process: everything anew
});
showLayers();
bindProjection();
requestAnimationFrame(paintFrame);
link.send = (message) => socket.send(message);

// For tests and measurements; nothing in the page uses it.
window.ciberrato = { state, store, camera, counters, socket };
