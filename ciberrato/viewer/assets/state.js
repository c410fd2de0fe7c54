// What the page knows, and what of it is out of date on the screen.

import { Camera } from "./camera.js";
import { Store } from "./store.js";

export const $ = (id) => document.getElementById(id);
export const EMPTY = { time: 0, phase: "empty", robots: [] };

export const state = {
  epoch: -1, lab: null, scene: null, grid: [], simTime: 0, cycleTime: 50, control: false, recording: false,
  connected: false, connection: "searching", simulator: "", rate: 0, frame: EMPTY, names: new Map(), angles: new Map(),
  marks: [], asked: 0, beliefs: new Map(), past: null, source: null, texts: [],
  live: true, t: 0, playing: false, speed: 1, chosen: null, choiceMade: false, follow: false, projection: false,
  // When the last frame came, by the page's clock.
  heard: 0,
  layers: { cones: "chosen", trails: true, belief: true, names: true, starts: true },
};
export const store = new Store();
export const camera = new Camera();
// Movement is smoothed from what is shown to what has come, in the time that a frame takes.
export const tween = { from: EMPTY, to: EMPTY, start: 0, length: 50 };
export const dirty = { paint: true, camera: true, panels: true, events: true };
export const counters = { painted: 0, frames: 0 };
// Questions under way; one of each kind at a time.
export const asked = { window: null, past: null };
// When the panels were written last; 0 has them written at once.
export const clock = { panels: 0 };
// Set when the connection is made.
export const link = { send: () => {} };

export function remember(key, value) {
  try {
    localStorage.setItem(`ciberrato-${key}`, value);
  } catch {
    // Private windows may refuse; then nothing is remembered.
  }
}

export function remembered(key) {
  try {
    return localStorage.getItem(`ciberrato-${key}`);
  } catch {
    return null;
  }
}
