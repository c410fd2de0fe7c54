// What agents draw over the lab.

import { AROUND, ON } from "./labels.js";
import { robotColor, svg } from "./svg.js";
import { plain } from "./text.js";

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
    if (text) texts.push({ key: `${shape.source} ${shape.id}`, text: plain(text), color, at: anchor(shape), ...(shape.kind === "text" ? { choices: [...ON, ...AROUND] } : { world: 0.5 }) });
  }
  return texts;
}
