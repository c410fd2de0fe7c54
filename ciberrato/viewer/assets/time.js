// Which moment is looked at: now, or one that has passed.

import { asked, clock, dirty, link, state, store, tween } from "./state.js";
import { between } from "./store.js";

export function liveRobots(now) {
  // A picture's time is that of its beginning: a message that came since then has a later one.
  const part = (now - tween.start) / tween.length;
  return between(tween.from, tween.to, Math.min(1, Math.max(0, part)));
}

/** The robots to draw, and the frame whose numbers stand in the panels. */
export function shown(now) {
  if (state.live) return { frame: state.frame, robots: liveRobots(now) };
  const at = Math.max(0, store.floor(state.t));
  const frame = store.frames[at];
  if (!frame) return { frame: state.frame, robots: state.frame.robots };
  const next = store.frames[at + 1];
  if (!next) return { frame, robots: frame.robots };
  const part = (state.t - frame.time) / (next.time - frame.time);
  return { frame, robots: part > 0 ? between(frame, next, part) : frame.robots };
}

export function shownBelief() {
  if (!state.layers.belief || state.source === null) return null;
  if (state.live) return state.beliefs.get(state.source)?.belief ?? null;
  return state.past?.source === state.source ? state.past.belief : null;
}

/** Ask for the frames and the belief around the time that is looked at. */
export function fetchPast() {
  if (state.live) return;
  const time = Math.floor(state.t);
  if (store.gapAt(time) && asked.window === null) {
    asked.window = time;
    link.send({ ask: "frames", from: Math.max(0, time - 100), to: time + 300, most: 512 });
  }
  if (state.source !== null && asked.past === null && (state.past?.source !== state.source || state.past.at !== time)) {
    const series = state.beliefs.get(state.source)?.series ?? [];
    let due = -1;
    for (const [when] of series) if (when <= time) due = when;
    if (state.past?.source === state.source && (state.past.belief?.time ?? -1) === due) return;
    asked.past = time;
    link.send({ ask: "belief", source: state.source, time });
  }
}

/** What the picture depends on, apart from what is marked as dirty; the same again need not be drawn. */
export function pictureKey(now) {
  if (!state.live) return `${state.t} ${store.times.length}`;
  return now - tween.start > tween.length ? `live ${tween.start}` : null;
}

export function advance(milliseconds) {
  state.t += milliseconds / state.cycleTime * state.speed;
  if (state.t >= store.last) {
    state.t = store.last;
    state.playing = false;
    if (!state.recording) goLive();
  }
}

export function seek(time) {
  state.live = false;
  state.playing = false;
  state.t = Math.min(Math.max(store.last, state.frame.time), Math.max(0, time));
  dirty.paint = true;
  clock.panels = 0;
}

export function goLive() {
  if (state.recording) return;
  Object.assign(state, { live: true, playing: false, past: null });
  dirty.paint = true;
  clock.panels = 0;
}

export function choose(id) {
  state.chosen = id;
  state.choiceMade = true;
  if (id === null) state.follow = false;
  dirty.paint = true;
  clock.panels = 0;
}
