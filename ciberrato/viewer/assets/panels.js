// The panels beside the lab: robots, events, belief.

import { drawCurve } from "./chart.js";
import { look } from "./infrared.js";
import { cellAt, cellName } from "./paint.js";
import { html, robotColor, say, svg } from "./svg.js";
import { clip, sayClipped } from "./text.js";

const EVENT_TEXT = {
  joined: "registered", started: "Started", stopped: "Stopped", ended: "End of the run", collision: "collides",
  target: "visits a target", returning: "returns home", finished: "has finished", removed: "was removed",
};
const MOST_EVENTS = 60;
const MOST_SIGNS = 60;
const OF_CELL = "the cell's centre in units";

export class RobotList {
  constructor(list, { onChoose, onRemove }) {
    this.list = list;
    this.onChoose = onChoose;
    this.onRemove = onRemove;
    this.items = new Map();
  }

  clear() {
    this.items.clear();
    this.list.replaceChildren();
  }

  update(robots, { names, chosen, control, reflectors, angles }) {
    const present = new Set(robots.map((robot) => robot.id));
    for (const [id, item] of this.items) {
      if (!present.has(id)) {
        item.root.remove();
        this.items.delete(id);
      }
    }
    for (const robot of robots) {
      const item = this.items.get(robot.id) ?? this.add(robot.id);
      const { root } = item;
      root.dataset.state = robot.state;
      root.dataset.hit = String(robot.hit);
      root.dataset.chosen = String(robot.id === chosen);
      item.button.setAttribute("aria-pressed", String(robot.id === chosen));
      sayClipped(item.name, names.get(robot.id) || `robot ${robot.id}`, MOST_SIGNS);
      say(item.score, String(robot.score));
      // Until a target is visited the arrival time is just the time.
      const arrived = robot.mask.includes("1") && robot.arrival;
      const took = robot.returning ? `way back ${robot.returning}` : arrived ? `there at ${robot.arrival}` : "";
      say(item.state, took ? `${robot.state} · ${took}` : robot.state);
      say(item.hits, robot.collisions === 1 ? "1 hit" : `${robot.collisions} hits`);
      this.updateMask(item, robot.mask);
      item.detail.hidden = robot.id !== chosen;
      if (robot.id === chosen) this.updateDetail(item, robot, robots, { control, reflectors, angles: angles(robot.id) });
    }
  }

  add(id) {
    const name = html("span", { class: "name" });
    const score = html("span", { class: "score", title: "Score" });
    const state = html("span");
    const mask = html("span", { class: "masks" });
    const hits = html("span", { class: "hits" });
    const badge = html("span", { class: "badge" }, String(id));
    const button = html("button", { type: "button", class: "robot" }, badge, name, score, html("span", { class: "more" }, state, mask), hits);
    button.addEventListener("click", () => this.onChoose(id));
    const pose = html("dd");
    const rays = html("div", { class: "rays" });
    const cells = [0, 1, 2, 3].map(() => {
      const bar = html("i");
      const value = html("b");
      const label = html("span", {}, bar, value, "");
      rays.append(label);
      return { bar, value, text: label.lastChild };
    });
    const remove = html("button", { type: "button", class: "remove" }, "Remove robot");
    remove.addEventListener("click", () => this.onRemove(id));
    const detail = html("div", { class: "detail" }, html("dl", {}, html("dt", {}, "Pose"), pose), rays, remove);
    const root = html("li", { "data-robot": id }, button, detail);
    root.style.setProperty("--robot", robotColor(id));
    const item = { root, button, name, score, state, mask, hits, detail, pose, cells, remove, maskText: null };
    this.items.set(id, item);
    const next = [...this.list.children].find((other) => Number(other.dataset.robot) > id);
    this.list.insertBefore(root, next ?? null);
    return item;
  }

  updateMask(item, mask) {
    if (item.maskText === mask) return;
    item.maskText = mask;
    const dots = mask.length > 8 ? [] : [...mask].map((digit) => html("i", { class: digit === "1" ? "on" : "" }));
    item.mask.title = "Targets visited";
    item.mask.replaceChildren(...dots);
  }

  updateDetail(item, robot, robots, { control, reflectors, angles }) {
    if (robot.x === null || robot.y === null) {
      say(item.pose, "not a number");
      return;
    }
    say(item.pose, `x ${robot.x.toFixed(2)}  y ${robot.y.toFixed(2)}  ${(robot.dir ?? 0).toFixed(1)}°`);
    if (reflectors) {
      angles.forEach((angle, i) => {
        const { distance } = look(reflectors, robot, (robot.dir + angle) * Math.PI / 180, robots);
        const { bar, value, text } = item.cells[i];
        say(value, Number.isFinite(distance) ? distance.toFixed(2) : "–");
        if (text.data !== `${angle}°`) text.data = `${angle}°`;
        bar.style.setProperty("--part", `${Math.min(100, 100 / (1 + Math.max(0, distance)))}%`);
      });
    }
    item.remove.hidden = !control || robot.state === "Removed";
  }
}

/** The sentence for a mark. */
export function eventText(kind, robot, names) {
  const what = EVENT_TEXT[kind] ?? kind;
  return robot ? `${names.get(robot) || `Robot ${robot}`} ${what}` : what;
}

export function drawEvents(list, marks, names, onJump) {
  const shown = marks.slice(-MOST_EVENTS).reverse();
  list.replaceChildren(...shown.map(([time, kind, robot]) => {
    const dot = html("span", { class: "dot" });
    if (robot) dot.style.setProperty("--robot", robotColor(robot));
    const sentence = eventText(kind, robot, names);
    const button = html("button", { type: "button", title: `${sentence}: go there` },
      html("span", { class: "when" }, String(time)), dot, html("span", { class: "what" }, clip(sentence, MOST_SIGNS)));
    button.addEventListener("click", () => onJump(time));
    return html("li", {}, button);
  }));
}

/** Marks over the time line: collisions below, everything else above. */
export function drawTicks(picture, marks, [first, last]) {
  const width = 1000;
  picture.setAttribute("viewBox", `0 0 ${width} 40`);
  const length = Math.max(1, last - first);
  const seen = new Set();
  const ticks = [];
  for (const [time, kind, robot] of marks) {
    if (kind === "joined" || time < first || time > last) continue;
    const x = Math.round((time - first) / length * width);
    const key = `${x} ${kind === "collision"}`;
    if (seen.has(key)) continue;
    seen.add(key);
    const tick = svg("rect", { x: x - 1, width: 2, y: kind === "collision" ? 27 : 4, height: kind === "collision" ? 6 : 9 });
    tick.style.fill = robot ? robotColor(robot) : "var(--soft)";
    ticks.push(tick);
  }
  picture.replaceChildren(...ticks);
}

export class BeliefPanel {
  constructor(parts) {
    this.parts = parts;
    this.drawnFor = null;
    this.setNow = () => {};
  }

  update(belief, series, span, time, lab) {
    const { entropy, best, truth, when, modes, curve } = this.parts;
    if (belief) {
      const name = (row, column) => cellName(belief, lab, row, column);
      say(entropy, belief.entropy.toFixed(2));
      const [first] = belief.modes;
      say(best, first ? `${(100 * first[2]).toFixed(0)} %` : "–");
      best.title = first ? `${name(first[0], first[1])}, ${OF_CELL}` : "";
      // Of the cell in which the robot was when it believed so: now it may have left it.
      const share = series.find(([when]) => when === belief.time)?.[3] ?? null;
      say(truth, share === null ? "–" : `${(100 * share).toFixed(0)} %`);
      const at = belief.place && cellAt(belief, lab, ...belief.place);
      truth.title = at ? `${name(...at)}, ${OF_CELL}: where the robot was at cycle ${belief.time}` : "";
      const age = Math.max(0, time - belief.time);
      say(when, `As of cycle ${belief.time}${age ? `, ${age} ${age === 1 ? "cycle" : "cycles"} ago` : ""}${at ? `; the robot was in ${name(...at)}` : ""}.`);
      const wanted = belief.modes.map(([row, column, , mass]) => `${name(row, column)}: ${(100 * mass).toFixed(1)} %`).join("|");
      if (modes.dataset.shown !== wanted) {
        modes.dataset.shown = wanted;
        modes.replaceChildren(...belief.modes.map(([row, column, , mass]) => html("li", { title: `the hill's top, ${OF_CELL}; the hill's probability` },
          html("b", {}, name(row, column)), ` ${(100 * mass).toFixed(mass < 0.095 ? 1 : 0)} %`)));
      }
    }
    const key = `${series.length} ${series.at(-1)?.[0]} ${span}`;
    if (key !== this.drawnFor) {
      this.drawnFor = key;
      this.setNow = drawCurve(curve, series, belief ? belief.rows * belief.columns : 2, span);
    }
    this.setNow(time);
  }
}
