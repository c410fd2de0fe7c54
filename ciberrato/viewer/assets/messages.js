// What the viewer process says.

import { readBelief } from "./paint.js";
import { eventText } from "./panels.js";
import { drawLab, drawLegend, robots, setShapes } from "./picture.js";
import { robotList } from "./sidebar.js";
import { $, asked, counters, dirty, EMPTY, link, state, store, tween } from "./state.js";
import { readFrame } from "./store.js";
import { html } from "./svg.js";
import { clip, plain, sayClipped } from "./text.js";
import { liveRobots, seek } from "./time.js";

const MOST_SIGNS = 60;

export const handlers = {
  world(message) {
    if (message.epoch !== state.epoch) beginEpoch(message.epoch);
    Object.assign(state, {
      lab: message.lab, grid: message.grid, simTime: message.simTime, cycleTime: message.cycleTime,
      control: message.control, recording: message.recording,
    });
    document.body.dataset.recording = String(message.recording);
    $("controls").hidden = !message.control;
    $("live").hidden = message.recording;
    const name = message.lab ? plain(message.lab.name) : "";
    sayClipped($("lab-name"), name || (message.lab ? "Lab without a name" : "No lab yet"), MOST_SIGNS);
    document.title = name ? `${clip(name, MOST_SIGNS)} – ciberrato` : "ciberrato viewer";
    drawLab();
    if (message.span[1] > 0) {
      link.send({ ask: "frames", from: 0, to: message.span[1], most: 512 });
      if (message.recording && state.live) seek(message.span[0]);
    }
  },
  status(message) {
    state.connection = message.connection;
    state.simulator = plain(message.simulator);
  },
  roster(message) {
    state.names = new Map(message.robots.map(({ id, name }) => [id, plain(name)]));
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
    state.heard = now;
    // What is on the screen is where the movement goes on from.
    tween.from = { robots: liveRobots(now) };
    tween.length = 0.8 * tween.length + 0.2 * Math.min(250, Math.max(16, now - tween.start));
    tween.to = frame;
    tween.start = now;
    state.frame = frame;
    if (frame.robots.length) store.insert(frame);
    if (!state.choiceMade && state.chosen === null && frame.robots.length) state.chosen = frame.robots[0].id;
    if (message.marks > state.asked) {
      link.send({ ask: "marks", skip: state.marks.length });
      state.asked = message.marks;
    }
    if (state.live && state.layers.trails) dirty.paint = true;
  },
  frames(message) {
    if (message.epoch !== state.epoch) return;
    for (const frame of message.frames) store.insert(readFrame(frame));
    asked.window = null;
    dirty.paint = true;
  },
  marks(message) {
    if (message.epoch !== state.epoch || message.skip !== state.marks.length) return;
    state.marks.push(...message.marks);
    dirty.events = true;
    const last = message.marks.at(-1);
    if (last) sayClipped($("announcer"), eventText(last[1], last[2], state.names), MOST_SIGNS * 2);
  },
  belief(message) {
    if (message.epoch !== state.epoch) return;
    const known = state.beliefs.get(message.source);
    const series = known?.series ?? [];
    const entryOf = { robot: message.robot, version: message.version, belief: readBelief(message.belief), series };
    state.beliefs.set(message.source, entryOf);
    if (known && message.version === known.version + 1 && (series.at(-1)?.[0] ?? -1) < message.series[0]) series.push(message.series);
    else link.send({ ask: "series", source: message.source });
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
    asked.past = null;
    if (message.epoch !== state.epoch) return;
    state.past = { source: message.source, at: message.at, belief: message.belief ? readBelief(message.belief) : null };
    dirty.paint = true;
    dirty.panels = true;
  },
  shapes(message) {
    setShapes(message.shapes);
  },
};

function beginEpoch(epoch) {
  store.clear();
  robots.clear();
  robotList.clear();
  Object.assign(state, { epoch, marks: [], asked: 0, past: null, source: null, frame: EMPTY, live: true, playing: false, chosen: null, choiceMade: false });
  state.beliefs.clear();
  Object.assign(tween, { from: EMPTY, to: EMPTY });
  asked.window = null;
  asked.past = null;
  showSources();
  Object.assign(dirty, { paint: true, events: true, panels: true });
}

function showSources() {
  const select = $("belief-source");
  const names = [...state.beliefs.keys()];
  if (!names.includes(state.source)) state.source = names[0] ?? null;
  select.replaceChildren(...names.map((name) => html("option", { value: name, title: plain(name) }, clip(plain(name), 24))));
  select.value = state.source ?? "";
  select.title = plain(state.source ?? "");
  select.hidden = names.length < 2;
  $("belief-panel").hidden = !names.length;
  $("layer-belief").hidden = !names.length;
  drawLegend();
}
