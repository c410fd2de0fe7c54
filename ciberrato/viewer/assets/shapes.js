// What agents draw over the lab, and the labels that keep their size whatever the zoom.

import { robotColor, svg } from "./svg.js";

const DEGREES = Math.PI / 180;

/** One shape, in the scene's units; null for what has no outline. */
function outline(shape) {
  switch (shape.kind) {
    case "circle":
      return svg("circle", { class: "shape", cx: shape.x, cy: shape.y, r: shape.radius });
    case "line":
      return svg("polyline", { class: "shape", points: shape.points.map((point) => point.join(",")).join(" ") });
    case "polygon":
      return svg("polygon", { class: "shape shape-area", points: shape.points.map((point) => point.join(",")).join(" ") });
    case "ellipse":
      return svg("ellipse", {
        class: "shape shape-area", rx: shape.radii[0], ry: shape.radii[1],
        transform: `translate(${shape.x} ${shape.y}) rotate(${shape.direction})`,
      });
    case "arrow": {
      const head = Math.min(0.35, shape.length * 0.4);
      const path = `M0 0H${shape.length}M${shape.length - head} ${head * 0.6}L${shape.length} 0L${shape.length - head} ${-head * 0.6}`;
      return svg("path", { class: "shape", d: path, transform: `translate(${shape.x} ${shape.y}) rotate(${shape.direction})` });
    }
    case "pose":
      return svg("path", {
        class: "shape ghost", d: "M.5 0A.5 .5 0 1 1 -.5 0A.5 .5 0 1 1 .5 0M0 0H.5M.34 .14L.5 0L.34 -.14",
        transform: `translate(${shape.x} ${shape.y}) rotate(${shape.direction})`,
      });
    default:
      return null;
  }
}

function anchor(shape) {
  if (shape.points) return shape.points[0];
  if (shape.kind === "arrow") {
    return [shape.x + shape.length * Math.cos(shape.direction * DEGREES), shape.y + shape.length * Math.sin(shape.direction * DEGREES)];
  }
  return [shape.x, shape.y];
}

/** Shapes in the scene; gives the texts that belong to them. */
export function drawShapes(group, shapes) {
  group.replaceChildren();
  const texts = [];
  for (const shape of shapes) {
    const color = shape.color ?? robotColor(shape.robot ?? 1);
    const element = outline(shape);
    if (element) {
      element.style.setProperty("--robot", color);
      element.dataset.shape = shape.id;
      group.append(element);
    }
    const text = shape.kind === "text" ? shape.text : shape.label;
    if (text) texts.push({ text, color, at: anchor(shape), lift: shape.kind === "text" ? 0 : 14 });
  }
  return texts;
}

/** Labels in pixels: made once, moved often. */
export class Labels {
  constructor(group) {
    this.group = group;
    this.elements = [];
  }

  /** Show labels: {text, x, y, className, color} with x, y on the screen. */
  update(labels) {
    while (this.elements.length > labels.length) this.elements.pop().remove();
    while (this.elements.length < labels.length) {
      const element = svg("text");
      this.elements.push(element);
      this.group.append(element);
    }
    labels.forEach(({ text, x, y, className, color }, index) => {
      const element = this.elements[index];
      if (element.textContent !== text) element.textContent = text;
      if (element.getAttribute("class") !== className) element.setAttribute("class", className);
      element.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
      element.style.setProperty("--robot", color ?? "currentColor");
    });
  }
}
