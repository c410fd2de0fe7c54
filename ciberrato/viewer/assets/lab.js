// Drawing what does not move: the floor, targets, start grid, walls, beacons.

import { svg } from "./svg.js";

const CELL = 2;

function polygonPath(flat, dx = 0, dy = 0) {
  let path = "";
  for (let i = 0; i < flat.length; i += 2) path += `${i ? "L" : "M"}${flat[i] + dx} ${flat[i + 1] + dy}`;
  return `${path}Z`;
}

/** Text that stands upright although the scene's y axis points up. */
function upright(x, y, text, className) {
  const element = svg("text", { class: className, transform: `translate(${x} ${y}) scale(1 -1)` });
  element.textContent = text;
  return element;
}

/** The floor and what lies on it. */
export function drawFloor(lab) {
  const { width, height } = lab;
  const lines = [];
  for (let x = CELL; x < width; x += CELL) lines.push(`M${x} 0V${height}`);
  for (let y = CELL; y < height; y += CELL) lines.push(`M0 ${y}H${width}`);
  return svg("g", {},
    svg("rect", { class: "board", x: -0.1, y: -0.1, width: width + 0.2, height: height + 0.2, rx: 0.16 }),
    svg("path", { class: "cells", d: lines.join("") }));
}

/** How far to the side and up a target's number stands. */
function besideMiddle(radius) {
  return Math.max(0, radius - 0.26) * Math.SQRT1_2;
}

export function drawTargets(lab) {
  return svg("g", {}, ...lab.targets.map(([x, y, radius], index) => svg("g", { transform: `translate(${x} ${y})` },
    svg("circle", { class: "target-disc", r: radius }),
    svg("circle", { class: "target-ring", r: Math.max(0.05, radius - 0.04) }),
    // The robot's centre must be inside the inner ring.
    ...(radius > 0.55 ? [svg("circle", { class: "target-inner", r: radius - 0.5 })] : []),
    // Between the rings, up to the left: in the middle often stands a beacon.
    ...(lab.targets.length > 1 ? [upright(-besideMiddle(radius), besideMiddle(radius), String(index), "floor-text target-text")] : []))));
}

export function drawStarts(grid) {
  return svg("g", { id: "starts" }, ...grid.map(([x, y, direction], index) => svg("g", { transform: `translate(${x} ${y})` },
    svg("circle", { class: "start-disc", r: 0.5 }),
    svg("path", { class: "start-mark", d: "M.56 -.14L.7 0L.56 .14", transform: `rotate(${direction})` }),
    upright(0, 0, String(index + 1), "floor-text"))));
}

/** A colour between the lowest and the highest wall's. */
export function wallColor(height, heights) {
  const low = heights[0];
  const high = heights[heights.length - 1];
  const part = high > low ? Math.round(100 * (height - low) / (high - low)) : 100;
  return `color-mix(in oklab, var(--wall-high) ${part}%, var(--wall-low))`;
}

/** The heights of the walls that stand, lowest first. */
export function wallHeights(lab) {
  return [...new Set([...lab.walls.map(([height]) => height).filter((height) => height > 0), 4])].sort((a, b) => a - b);
}

/** Walls over robots' floor: painted lines first, then low walls, then high ones, each with its shadow. */
export function drawWalls(lab) {
  const heights = wallHeights(lab);
  const group = svg("g", {});
  const tape = lab.walls.filter(([height]) => height <= 0).map(([, flat]) => polygonPath(flat)).join("");
  if (tape) group.append(svg("path", { class: "tape", d: tape }));
  const standing = heights.map((height) => [height, lab.walls.filter((wall) => wall[0] === height)]);
  const shade = standing.map(([height, walls]) => {
    const shift = 0.05 + 0.05 * Math.min(4, height);
    return walls.map(([, flat]) => polygonPath(flat, shift * 0.7, -shift)).join("");
  }).join("");
  if (shade) group.append(svg("path", { class: "shade", d: shade }));
  for (const [height, walls] of standing) {
    if (!walls.length) continue;
    const path = svg("path", { class: "wall", "data-height": height, d: walls.map(([, flat]) => polygonPath(flat)).join("") });
    path.style.fill = wallColor(height, heights);
    group.append(path);
  }
  group.append(svg("rect", { class: "border", x: -0.1, y: -0.1, width: lab.width + 0.2, height: lab.height + 0.2, rx: 0.16 }));
  return group;
}

export function drawBeacons(lab) {
  const rays = [0, 45, 90, 135, 180, 225, 270, 315].map((angle) => svg("path", { class: "beacon-ray", d: "M.3 0H.42", transform: `rotate(${angle})` }));
  return svg("g", {}, ...lab.beacons.map(([x, y, height], index) => {
    const title = svg("title");
    title.textContent = `Beacon ${index}, height ${height}`;
    return svg("g", { class: "beacon", transform: `translate(${x} ${y})` }, title,
      svg("circle", { class: "beacon-glow", r: 0.62 }), ...rays.map((ray) => ray.cloneNode()),
      svg("circle", { class: "beacon-core", r: 0.17 }), svg("circle", { class: "beacon-ring", r: 0.235 }));
  }));
}
