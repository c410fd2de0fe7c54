// Everything around the picture: header, panels, time line.

import { BeliefPanel, drawEvents, drawTicks, RobotList } from "./panels.js";
import { DEFAULT_ANGLES } from "./robots.js";
import { $, dirty, link, state, store } from "./state.js";
import { scoreboard } from "./scoreboard.js";
import { html, say } from "./svg.js";
import { clip } from "./text.js";
import { choose, seek } from "./time.js";

const PHASES = {
  empty: "no robots", ready: "ready", running: "running", stopped: "stopped", finished: "finished",
  silent: "silent", gone: "no contact",
};
// Without a frame for so long, a simulator that runs is in doubt; one with long cycles for so many of them.
const SILENCE_MILLISECONDS = 2500;
const SILENT_CYCLES = 5;

/** What the simulator is doing, as far as it is known now: the last frame says nothing about one that is gone. */
export function phaseNow(frame, now) {
  if (state.recording || !state.live) return frame.phase;
  if (!state.connected || state.connection !== "watching") return frame.robots.length ? "gone" : "empty";
  const silence = now - state.heard;
  const doubtful = frame.phase === "running" && silence > Math.max(SILENCE_MILLISECONDS, SILENT_CYCLES * state.cycleTime);
  return doubtful ? "silent" : frame.phase;
}


/** What the simulator can be asked for now: keys obey this, as the buttons may be a tenth of a second behind. */
export function permitted() {
  const alive = state.connected && state.connection === "watching";
  return {
    start: alive && ["ready", "stopped"].includes(state.frame.phase),
    stop: alive && state.frame.phase === "running",
    reset: alive,
  };
}

export const robotList = new RobotList($("robots"), {
  onChoose: (id) => choose(state.chosen === id ? null : id),
  onRemove: (id) => confirmed(`Remove ${clip(state.names.get(id) || `robot ${id}`, 60)}? It stays out until the simulator is reset.`, "Remove", () => link.send({ do: "remove", robot: id })),
});
const beliefPanel = new BeliefPanel({
  entropy: $("entropy"), best: $("best-cell"), truth: $("true-cell"), when: $("belief-when"), modes: $("modes"), curve: $("curve"),
});
let ticksFor = "";

export function updatePanels(frame, now) {
  const shown = phaseNow(frame, now);
  const time = state.live ? frame.time : Math.floor(state.t);
  say($("time"), String(time));
  say($("sim-time"), state.simTime ? ` / ${state.simTime}` : "");
  // The rate that came with the last frame says nothing once there are no more.
  const fresh = state.live && state.connection === "watching" && shown === frame.phase;
  const pace = frame.phase === "running" ? state.rate.toFixed(state.rate < 10 ? 1 : 0) : "0";
  say($("rate"), fresh ? pace : "–");
  const phase = $("phase");
  say(phase, PHASES[shown] ?? shown);
  phase.dataset.phase = shown;
  updateStatus();
  const alive = state.connected && state.connection === "watching";
  for (const [name, may] of Object.entries(permitted())) $(name).disabled = !may;
  say($("robot-count"), frame.robots.length ? String(frame.robots.length) : "");
  $("no-robots").hidden = frame.robots.length > 0;
  robotList.update(frame.robots, {
    names: state.names, chosen: state.chosen, control: state.control && state.live && alive, reflectors: state.scene,
    angles: (id) => state.angles.get(id) ?? DEFAULT_ANGLES
  });
  updateScrubber(time);
  const known = state.beliefs.get(state.source);
  if (known) {
    const current = state.live ? known.belief : state.past?.source === state.source ? state.past.belief : null;
    beliefPanel.update(current, known.series, [store.first, Math.max(store.last, 1)], time, state.lab);
  }
  if (state.projection) scoreboard.update(frame.robots, state.names);
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
        : [state.connection, state.simulator ? `looking for a simulator at ${state.simulator}` : "connecting"];
  status.dataset.state = key;
  say(status, text);
  if (status.title !== text) status.title = text;
  const notice = $("notice");
  // The address comes a moment after the connection.
  const waiting = state.connected && state.simulator && !state.recording && state.connection !== "watching" && !state.lab;
  notice.hidden = !waiting;
  if (waiting && notice.dataset.simulator !== state.simulator) {
    notice.dataset.simulator = state.simulator;
    notice.replaceChildren(html("b", {}, "No simulator yet"), `Start one, such as ciberrato-simulator; this page goes on by itself when it answers at ${state.simulator}.`);
  }
}

/** Ask before something that cannot be taken back. */
export function confirmed(question, verb, action) {
  const dialog = $("ask");
  say($("ask-text"), question);
  say($("ask-yes"), verb);
  dialog.returnValue = "no";
  dialog.onclose = () => dialog.returnValue === "yes" && action();
  dialog.showModal();
}
