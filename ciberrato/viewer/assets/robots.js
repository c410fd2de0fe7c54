// Drawing robots: a mouse of diameter 1, its cones, its collisions.

import { look } from "./infrared.js";
import { robotColor, say, svg } from "./svg.js";

const DEGREES = Math.PI / 180;
export const DEFAULT_ANGLES = [0, 60, -60, 180];

/** A robot looking along +x, centre at the origin. */
export function drawRobot(id) {
  const turned = svg("g", { class: "turned" },
    svg("rect", { class: "wheel", x: -0.17, y: 0.395, width: 0.34, height: 0.1, rx: 0.04 }),
    svg("rect", { class: "wheel", x: -0.17, y: -0.495, width: 0.34, height: 0.1, rx: 0.04 }),
    svg("circle", { class: "body", r: 0.455 }),
    svg("circle", { class: "ear", cx: 0.14, cy: 0.315, r: 0.125 }),
    svg("circle", { class: "ear", cx: 0.14, cy: -0.315, r: 0.125 }),
    svg("path", { class: "shine", d: "M-.4 0A.4 .4 0 0 1 .18 .36A.52 .52 0 0 0 -.3 -.27A.4 .4 0 0 0 -.4 0Z" }),
    svg("circle", { class: "eye", cx: 0.325, cy: 0.13, r: 0.07 }),
    svg("circle", { class: "eye", cx: 0.325, cy: -0.13, r: 0.07 }),
    svg("circle", { class: "pupil", cx: 0.35, cy: 0.128, r: 0.034 }),
    svg("circle", { class: "pupil", cx: 0.35, cy: -0.128, r: 0.034 }),
    svg("circle", { class: "nose", cx: 0.455, r: 0.052 }));
  const number = svg("text", { class: "robot-id", transform: "translate(-.09 0) scale(1 -1)" });
  number.textContent = String(id);
  const group = svg("g", { class: "robot-g", "data-robot": id }, svg("title"),
    svg("circle", { class: "robot-shadow", r: 0.5, cx: 0.07, cy: -0.1 }),
    svg("circle", { class: "halo", r: 0.66 }),
    turned, number,
    svg("g", { class: "flag flag-finished", transform: "translate(.42 .42)" },
      svg("circle", { r: 0.2 }), svg("path", { d: "M-.09 0L-.02 -.07L.1 .08" })),
    svg("g", { class: "flag flag-returning", transform: "translate(.42 .42)" },
      svg("circle", { r: 0.2 }), svg("path", { d: "M-.11 .01L0 .11L.11 .01M-.07 -.01V-.1H.07V-.01" })));
  group.style.setProperty("--robot", robotColor(id));
  return group;
}

/** The cone of one sensor as far as it is free, and the point that it sees. */
function conePath(seen, direction) {
  const { fromX: x, fromY: y, distance } = seen;
  const reach = Math.min(distance, 60);
  const a = direction - Math.PI / 6;
  const b = direction + Math.PI / 6;
  return `M${x} ${y}L${x + reach * Math.cos(a)} ${y + reach * Math.sin(a)}`
    + `A${reach} ${reach} 0 0 1 ${x + reach * Math.cos(b)} ${y + reach * Math.sin(b)}Z`;
}

/** Cones of one robot. */
class Cones {
  constructor(id) {
    this.area = svg("path", { class: "cone" });
    this.edge = svg("path", { class: "cone-edge" });
    this.points = [0, 1, 2, 3].map(() => svg("circle", { class: "hit-point", r: 0.085 }));
    this.element = svg("g", { class: "cones" }, this.area, this.edge, ...this.points);
    this.element.style.setProperty("--robot", robotColor(id));
  }

  update(seen, directions) {
    this.area.setAttribute("d", seen.map((one, i) => (Number.isFinite(one.distance) ? conePath(one, directions[i]) : "")).join(""));
    this.edge.setAttribute("d", seen.map((one) => (Number.isFinite(one.distance) ? `M${one.fromX} ${one.fromY}L${one.x} ${one.y}` : "")).join(""));
    seen.forEach((one, i) => {
      this.points[i].setAttribute("cx", Number.isFinite(one.distance) ? one.x : -99);
      this.points[i].setAttribute("cy", Number.isFinite(one.distance) ? one.y : -99);
    });
  }
}

/** All robots of the scene. */
export class Robots {
  constructor(onChoose) {
    this.cones = svg("g", {});
    this.bodies = svg("g", {});
    this.drawn = new Map();
    this.conesDrawn = new Map();
    this.onChoose = onChoose;
    this.bodies.addEventListener("click", (event) => {
      const group = event.target.closest(".robot-g");
      if (group) this.onChoose(Number(group.dataset.robot));
    });
  }

  clear() {
    this.drawn.clear();
    this.conesDrawn.clear();
    this.cones.replaceChildren();
    this.bodies.replaceChildren();
  }

  /** Draw robots where they are; gives what the sensors of each robot in `wanted` see. */
  update(robots, { reflectors, chosen, wanted, angles, names }) {
    const present = new Set();
    const sights = new Map();
    for (const robot of robots) {
      if (robot.x === null || robot.y === null) continue;
      present.add(robot.id);
      let entry = this.drawn.get(robot.id);
      if (!entry) {
        const group = drawRobot(robot.id);
        entry = { group, turned: group.querySelector(".turned"), hit: false, collisions: robot.collisions };
        this.drawn.set(robot.id, entry);
        this.bodies.append(group);
      }
      entry.group.setAttribute("transform", `translate(${robot.x} ${robot.y})`);
      entry.turned.setAttribute("transform", `rotate(${robot.dir ?? 0})`);
      say(entry.group.firstChild, names.get(robot.id) || `robot ${robot.id}`);
      const { dataset } = entry.group;
      if (dataset.state !== robot.state) dataset.state = robot.state;
      if (dataset.hit !== String(robot.hit)) dataset.hit = String(robot.hit);
      if (dataset.chosen !== String(robot.id === chosen)) dataset.chosen = String(robot.id === chosen);
      if (robot.collisions > entry.collisions) this.flash(entry.group);
      entry.collisions = robot.collisions;
      if (reflectors && wanted(robot)) sights.set(robot.id, this.updateCones(robot, robots, reflectors, angles(robot.id)));
    }
    for (const [id, { group }] of this.drawn) {
      if (!present.has(id)) {
        group.remove();
        this.drawn.delete(id);
      }
    }
    for (const [id, cones] of this.conesDrawn) {
      if (!sights.has(id)) {
        cones.element.remove();
        this.conesDrawn.delete(id);
      }
    }
    return sights;
  }

  updateCones(robot, robots, reflectors, angles) {
    const directions = angles.map((angle) => (robot.dir + angle) * DEGREES);
    const seen = directions.map((direction) => look(reflectors, robot, direction, robots));
    let cones = this.conesDrawn.get(robot.id);
    if (!cones) {
      cones = new Cones(robot.id);
      this.conesDrawn.set(robot.id, cones);
      this.cones.append(cones.element);
    }
    cones.update(seen, directions);
    return seen;
  }

  flash(group) {
    const ring = svg("circle", { class: "flash", r: 0.5 });
    ring.addEventListener("animationend", () => ring.remove());
    group.append(ring);
    setTimeout(() => ring.remove(), 1500);
  }
}
