// Projection mode: the lab as large as the screen, large letters, and who leads. For class rooms.

import { fitStage } from "./picture.js";
import { $, clock, dirty, state } from "./state.js";
import { html, robotColor, say } from "./svg.js";
import { plain, sayClipped } from "./text.js";

const HASH = "#projection";
const MOST_SIGNS = 18;
// An entry's width in a strip and a line's height, in letters' heights; the column's part of the width.
const ENTRY = 15;
const LINE = 2.1;
const COLUMN = 0.25;
const MOST_LINES = 4;
// Pixels; below the page scrolls, and the scores stand under the lab.
const NARROW = 820;

/** Best score first; robots that were removed last; equal ones by their number. */
export function ranking(robots) {
  const out = (robot) => Number(robot.state === "Removed");
  return [...robots].sort((a, b) => out(a) - out(b) || b.score - a.score || a.id - b.id);
}

/** The height of a letter of the strip in pixels. */
export function letters(width) {
  return Math.min(26, Math.max(15, 0.0125 * width));
}

/** Whether the scores stand in a strip above the lab or in a column beside it: where the lab is the larger. */
export function layoutFor(count, lab, width, height) {
  if (!count) return "none";
  if (width <= NARROW) return "column";
  const letter = letters(width);
  const lines = Math.ceil(count / Math.max(1, Math.floor(width / (ENTRY * letter))));
  const scale = (across, up) => Math.min(across / lab.width, up / lab.height);
  const strip = lines > MOST_LINES ? 0 : scale(width, height - lines * LINE * letter);
  return strip >= scale(width * (1 - COLUMN), height) ? "strip" : "column";
}

export class Scoreboard {
  constructor(list) {
    this.list = list;
    this.items = new Map();
  }

  update(robots, names) {
    const order = ranking(robots);
    const { offsetWidth: width, offsetHeight: height } = $("main");
    const layout = layoutFor(order.length, state.lab ?? { width: 28, height: 14 }, width, height);
    if (document.body.dataset.scores !== layout) document.body.dataset.scores = layout;
    this.list.style.setProperty("--letter", `${letters(width)}px`);
    this.list.style.setProperty("--count", String(Math.max(4, order.length)));
    const ids = order.map(({ id }) => id);
    if (String(ids) !== this.shown) {
      this.shown = String(ids);
      this.list.replaceChildren(...ids.map((id) => this.item(id).root));
    }
    order.forEach((robot, index) => {
      const { root, rank, name, score, more } = this.item(robot.id);
      say(rank, index && robot.score === order[index - 1].score ? "" : `${index + 1}.`);
      sayClipped(name, names.get(robot.id) || `robot ${robot.id}`, MOST_SIGNS);
      say(score, String(robot.score));
      say(more, robot.state === "Running" && !robot.collisions ? "" : [
        robot.state === "Running" ? "" : plain(robot.state), robot.collisions ? `${robot.collisions} hit${robot.collisions === 1 ? "" : "s"}` : "",
      ].filter(Boolean).join(" · "));
      root.dataset.state = robot.state;
    });
  }

  item(id) {
    const known = this.items.get(id);
    if (known) return known;
    const [rank, name, score, more] = ["rank", "name", "score", "more"].map((part) => html("span", { class: part }));
    const root = html("li", {}, rank, html("span", { class: "badge" }, String(id)), name, score, more);
    root.style.setProperty("--robot", robotColor(id));
    const item = { root, rank, name, score, more };
    this.items.set(id, item);
    return item;
  }
}

export const scoreboard = new Scoreboard($("scores"));

/** Switch projection mode; the address keeps it, so that a link opens it. */
export function project(wanted, { fullscreen = false } = {}) {
  if (wanted === state.projection) return;
  state.projection = wanted;
  document.body.dataset.projection = String(wanted);
  $("project").setAttribute("aria-pressed", String(wanted));
  $("scores").hidden = !wanted;
  const address = location.pathname + location.search + (wanted ? HASH : "");
  history.replaceState(null, "", address);
  // A browser may refuse; the page is as large as its window then.
  if (wanted && fullscreen) document.documentElement.requestFullscreen?.().catch(() => {});
  if (!wanted && document.fullscreenElement) document.exitFullscreen();
  fitStage();
  clock.panels = 0;
  dirty.paint = true;
}

export function bindProjection() {
  document.addEventListener("fullscreenchange", () => document.fullscreenElement || project(false));
  window.addEventListener("hashchange", () => project(location.hash === HASH));
  project(location.hash === HASH);
}
